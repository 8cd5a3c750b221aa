"""The search of the loop: which effects of the catalogue join the model, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from discovery.attribution import Candidate, Refit, candidates, refit, screen, similarity
from discovery.case import Case, Step
from discovery.fit import Fit, fit
from discovery.least_squares import Minimum
from discovery.model import Model
from discovery.problem import Problem
from discovery.registry import catalogue
from discovery.residual import correlation_length

__all__ = ["Search"]

#: So many candidates of equal merit are weighed by a full refit,
_TRIED = 4
#: and so many of the best are paired with so many partners.
_PAIRED = 2


class Search:
    """Adds effects one at a time while each explains enough of training and held-out data, then removes idle ones.

    Parameters
    ----------
    start : Fit
        The model to which effects are added.
    case : Case
        Recordings, thresholds, progress.

    Attributes
    ----------
    fit : Fit
        The model so far.
    added : list of str
        Effects in the order in which they were added.
    steps : list of Step
        The story.
    evidence, ambiguous : dict
        By added effect.
    held_chi2, held_count, first_rough : float, int, float
        Chi-square and number of the deciding held-out samples, and their systematic residual before anything is added.
    """

    def __init__(self, start: Fit, case: Case) -> None:
        self.case = case
        self.gaussian = start.problem.gaussian
        whole = start.problem.bench.effects == case.kernel_effects(start.model)
        self.fit = start if whole else case.fit(start.model, start.values, self.gaussian)
        self.steps: list[Step] = []
        self.added: list[str] = []
        self.evidence: dict[str, dict[str, float]] = {}
        self.ambiguous: dict[str, tuple[str, ...]] = {}
        self._scored: dict[str, Candidate] = {}
        self.held_chi2, self.held_count, self.first_rough = case.judge.score(case.held(self.fit))
        self.held_rough = self.first_rough

    def run(self) -> None:
        """Search until both the training and the held-out residual are noise, or nothing passes."""
        settings = self.case.settings
        while len(self.added) < settings.most_effects:
            rough = self.case.roughness(self.fit)
            if rough <= settings.floor and self.held_rough <= settings.limit(self.first_rough):
                reason = f"the training residual is noise: its systematic part is {rough:.2g} noise sds"
                self.steps.append(Step("stop", "", True, reason))
                break
            if not self._add(alone=rough <= settings.floor):
                break
        if len(self.added) > 1:
            self._remove()

    def _frozen(self) -> tuple[Problem, Minimum]:
        """Return the fit with what the rig knows held at its fitted value: the rod's ringing would trap the search."""
        problem, minimum = self.fit.problem, self.fit.minimum
        nuisance = [n for n in problem.gaussian if n in problem.free]
        known = {**self.fit.model.known, **{n: self.fit.values[n] for n in nuisance}}
        model = Model(self.fit.model.base, self.fit.model.effects, known)
        keep = [i for i, n in enumerate(problem.names) if n not in nuisance]
        rows = problem.bench.n_rows
        residual = minimum.residual[:rows]
        return Problem(model, problem.bench, self.case.units, {}), Minimum(
            minimum.x[keep],
            0.5 * float(residual @ residual),
            residual,
            minimum.jacobian[:rows, keep],
            minimum.at_bound[keep],
            minimum.converged,
            minimum.iterations,
        )

    def _add(self, *, alone: bool) -> bool:
        """Try candidates, best first, and pairs where none passes alone; return whether any joined the model.

        Parameters
        ----------
        alone : bool
            Do not try pairs: the training residual is noise already.
        """
        start = self.fit
        singles = self._refits()
        for single in self._order(singles):
            if self._try(start, (single,), singles):
                return True
        if alone or len(self.added) + 2 > self.case.settings.most_effects:
            return False
        # Effects hide each other: one may help the held-out data only once the other is there.
        excess = max(start.chi2 - start.problem.bench.n_data, 0.0)
        first = [r for r in singles if start.chi2 - r.chi2 > self.case.settings.least_share * excess]
        for single in first[:_PAIRED]:
            self.fit = self._refit(start.model.with_effect(single.effect), _values(single))
            seconds = self._refits()
            self.fit, partners = start, self._order(seconds)[:_PAIRED]
            for second in partners:
                if start.chi2 - second.chi2 < self.case.settings.pair_share * excess:
                    break
                if self._try(start, (single, second), singles):
                    return True
        return False

    def _refits(self) -> list[Refit]:
        """Screen the catalogue and refit every candidate beside the model so far."""
        problem, minimum = self._frozen()
        names = candidates(problem.model, self.case.train[0].recording.units[0])
        self.case.tell(f"screening the catalogue ({len(names)} effects)")
        scored = screen(problem.model, minimum, problem, names)
        self._scored = {c.effect: c for c in scored}
        self.case.tell("refitting every candidate")
        return refit(problem.model, minimum, problem, scored)

    def _order(self, refits: list[Refit]) -> list[Refit]:
        """Return the refits that are as good as the best one, simplest first, then by the held-out error."""
        n = self.fit.problem.bench.n_data
        settings, best = self.case.settings, refits[0]
        limit = self._tie_limit(best, settings.tie_pliable if _pliable(best) else settings.tie)
        tied = [r for r in refits if r.chi2 <= limit][:_TRIED]
        held = dict(zip((r.effect for r in tied), self._held_chi2(tied), strict=True))
        # A thousandth of the held-out error is no difference; then a force is simpler than a faulty instrument.
        least = 1.001 * min(held.values(), default=0.0)
        tied.sort(key=lambda r: (_pliable(r), len(r.problem.free), max(held[r.effect], least), _is_sensor(r)))
        if all(_pliable(r) for r in tied):
            # What a pliable law imitates deserves a try of its own, if it explains nearly all.
            enough = self.fit.chi2 - settings.pair_share * max(self.fit.chi2 - n, 0.0)
            tied += [r for r in refits if not _pliable(r) and r.chi2 < enough][:1]
        return tied

    def _try(self, start: Fit, chosen: tuple[Refit, ...], ranked: list[Refit]) -> bool:
        """Refit with one or two effects, what the rig knows free again, and keep them if they explain enough."""
        names = tuple(r.effect for r in chosen)
        self.case.tell(f"trying {' with '.join(names)}")
        trial = self._refit(start.model.with_effect(*names), _values(chosen[-1]))
        held, _, held_rough = self.case.judge.score(self.case.held(trial))
        verdict = self._weigh(start, trial, held, names)
        ranking = tuple(
            {
                "effect": r.effect,
                "score": self._scored[r.effect].score,
                "chi2": r.chi2,
                "parameters": len(catalogue()[r.effect].fitted(start.model.mechanics.system)),
            }
            for r in ranked
            if r.effect in self._scored
        )
        for name in names:
            self.steps.append(Step("add", name, verdict.accepted, verdict.reason, verdict.numbers, ranking))
        if not verdict.accepted:
            return False
        tied = self._equals(ranked, chosen[0])
        others = [r.chi2 for r in ranked if r.effect not in names]
        runner_up = {"runner_up_delta_chi2": start.chi2 - min(others, default=start.chi2)}
        for name in names:
            self.evidence[name] = {**verdict.evidence, **runner_up, **self._standing(name)}
            self.ambiguous[name] = tied if name == names[0] else ()
            self.added.append(name)
        self.fit, self.held_chi2, self.held_rough = trial, held, held_rough
        return True

    def _tie_limit(self, best: Refit, share: float) -> float:
        """Return the chi-square up to which a refit is as good as `best`: a share more of what that one leaves."""
        return best.chi2 + max(10.0, share * max(best.chi2 - self.fit.problem.bench.n_data, 0.0))

    def _equals(self, ranked: list[Refit], chosen: Refit) -> tuple[str, ...]:
        """Return the effects that explain the training recordings as well as the chosen one."""
        limit = self._tie_limit(chosen, self.case.settings.tie)
        return tuple(r.effect for r in ranked if r.effect != chosen.effect and r.chi2 <= limit)

    def _standing(self, name: str) -> dict[str, float]:
        """Return an effect's linear score, and its likeness to its nearest rival, from the latest screening."""
        if name not in self._scored:
            return {}
        own = self._scored[name]
        rivals = [c.sensitivity for n, c in self._scored.items() if n != name]
        likeness = max((similarity(own.sensitivity, v) for v in rivals), default=0.0)
        return {"linear_score": own.score, "largest_similarity": likeness}

    def _weigh(self, start: Fit, trial: Fit, held: float, names: tuple[str, ...]) -> _Verdict:
        """Decide whether effects explain enough of both the training and the held-out recordings."""
        s = self.case.settings
        n = start.problem.bench.n_data
        excess, held_excess = max(start.chi2 - n, 0.0), max(self.held_chi2 - self.held_count, 0.0)
        gain, held_gain = start.chi2 - trial.chi2, self.held_chi2 - held
        # Where the residual stays correlated, chance gains are larger by its correlation length.
        least = s.least_gain * correlation_length(self.case.train, trial.predict())
        passes = {
            f"it removes {gain:.0f} of {excess:.0f} excess chi-square on the training recordings": gain
            > max(least, s.least_share * excess),
            f"it removes {held_gain:.0f} of {held_excess:.0f} on the held-out ones": held_gain
            > max(0.25 * s.least_gain, 0.5 * s.least_share * held_excess),
        }
        vague = [name for name in names if not _determined(trial, name)]
        if vague:
            passes[f"no parameter of {' and '.join(vague)} is determined"] = False
        accepted = all(passes.values())
        failed = [reason for reason, passed in passes.items() if not passed]
        return _Verdict(
            accepted,
            "; ".join(passes) if accepted else "not enough: " + "; ".join(failed),
            {
                "chi2_before": start.chi2,
                "chi2_after": trial.chi2,
                "n_data": float(n),
                "chi2_holdout_before": self.held_chi2,
                "chi2_holdout_after": held,
                "n_holdout": float(self.held_count),
            },
            {
                "delta_chi2_train": gain,
                "delta_chi2_holdout": held_gain,
                "share_of_excess": gain / excess if excess else 0.0,
            },
        )

    def _refit(self, model: Model, values: Mapping[str, float]) -> Fit:
        bench = self.fit.problem.bench
        return fit(model, self.case.train, start=values, bench=bench, units=self.case.units, gaussian=self.gaussian)

    def _held_chi2(self, refits: Sequence[Refit]) -> list[float]:
        bench, judge = self.fit.problem.bench, self.case.judge
        models = []
        for r in refits:
            on_train = bench.predict(*r.problem.expand(r.minimum.x[:, None])) if judge.continued else []
            models.append((r.problem.model, _values(r), [c[:, :, 0] for c in on_train]))
        return [judge.score(p)[0] for p in judge.predictions(bench, models)]

    def _remove(self) -> None:
        """Drop an effect that the later ones have made superfluous."""
        for effect in tuple(self.added[:-1]):
            trial = self._refit(self.fit.model.without([effect]), self.fit.values)
            loss = trial.chi2 - self.fit.chi2
            superfluous = loss < self.case.settings.least_gain
            numbers = {"chi2_before": self.fit.chi2, "chi2_after": trial.chi2}
            reason = f"without it chi-square rises by {loss:.0f}"
            self.steps.append(Step("remove", effect, superfluous, reason, numbers))
            if superfluous:
                self.fit = trial
                self.added.remove(effect)
                self.evidence.pop(effect)
                self.ambiguous.pop(effect)


def _values(refitted: Refit) -> dict[str, float]:
    """Return the values of a refit by name."""
    return dict(zip(refitted.problem.names, refitted.minimum.x.tolist(), strict=True))


def _pliable(refitted: Refit) -> bool:
    return catalogue()[refitted.effect].pliable


def _is_sensor(refitted: Refit) -> bool:
    return catalogue()[refitted.effect].kind == "sensor"


def _determined(trial: Fit, name: str) -> bool:
    """Return whether at least one amplitude of an effect is three standard deviations from zero."""
    amplitudes = [p.name for p in catalogue()[name].parameters() if not p.shape]
    sd, values = trial.sd, trial.values
    return any(abs(values[n]) > 3 * sd[n] for n in amplitudes if n in values)


@dataclass(frozen=True)
class _Verdict:
    """Whether a candidate joins, why, and the numbers behind it."""

    accepted: bool
    reason: str
    numbers: Mapping[str, float]
    evidence: Mapping[str, float]
