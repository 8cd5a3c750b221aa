"""The search of the loop: which effects of the catalogue join the model, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from discovery.attribution import Refit, candidates, refit, screen, similarity
from discovery.case import Case, Step
from discovery.fit import Fit, fit
from discovery.least_squares import Minimum
from discovery.model import Model
from discovery.problem import Problem

__all__ = ["Search"]


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
        self.held_chi2, self.held_count, self.first_rough = case.judge.score(case.held(self.fit))

    def run(self) -> None:
        """Search until the residual is noise or nothing passes."""
        settings = self.case.settings
        while len(self.added) < settings.most_effects:
            rough = self.case.roughness(self.fit)
            if rough <= settings.floor:
                reason = f"the training residual is noise: its systematic part is {rough:.2g} noise sds"
                self.steps.append(Step("stop", "", True, reason))
                break
            if not self._add():
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

    def _add(self) -> bool:
        """Try the best candidate; return whether it joined the model."""
        problem, minimum = self._frozen()
        names = candidates(problem.model)
        self.case.tell(f"screening the catalogue ({len(names)} effects)")
        scored = screen(problem.model, minimum, problem, names)
        self.case.tell("refitting every candidate")
        refits = refit(problem.model, minimum, problem, scored)
        tied = self._tied(refits, problem.bench.n_data)
        held = self._held_chi2(tied)
        # Among equals: fewest parameters, then the smaller held-out error.
        order = sorted(range(len(tied)), key=lambda i: (len(tied[i].problem.free), held[i]))
        chosen, chosen_held = tied[order[0]], held[order[0]]
        verdict = self._weigh(2 * minimum.cost, chosen.chi2, chosen_held, problem.bench.n_data)
        scores = {c.effect: c.score for c in scored}
        ranking = tuple(
            {
                "effect": r.effect,
                "score": scores[r.effect],
                "chi2": r.chi2,
                "parameters": len(r.problem.free) - len(problem.free),
            }
            for r in refits
        )
        self.steps.append(Step("add", chosen.effect, verdict.accepted, verdict.reason, verdict.numbers, ranking))
        if not verdict.accepted:
            return False
        others = [r.chi2 for r in refits if r.effect != chosen.effect]
        projected = {c.effect: c.sensitivity for c in scored}
        own = projected.pop(chosen.effect)
        self.evidence[chosen.effect] = {
            **verdict.evidence,
            "linear_score": scores[chosen.effect],
            "runner_up_delta_chi2": 2 * minimum.cost - min(others, default=2 * minimum.cost),
            "largest_similarity": max((similarity(own, v) for v in projected.values()), default=0.0),
        }
        self.ambiguous[chosen.effect] = tuple(r.effect for r in tied if r.effect != chosen.effect)
        self._join(chosen)
        return True

    def _weigh(self, chi2: float, new: float, new_held: float, n: int) -> _Verdict:
        """Decide whether a candidate explains enough of both the training and the held-out recordings."""
        s = self.case.settings
        excess, held_excess = max(chi2 - n, 0.0), max(self.held_chi2 - self.held_count, 0.0)
        gain, held_gain = chi2 - new, self.held_chi2 - new_held
        passes = {
            f"it removes {gain:.0f} of {excess:.0f} excess chi-square on the training recordings": gain
            > max(s.least_gain, s.least_share * excess),
            f"it removes {held_gain:.0f} of {held_excess:.0f} on the held-out ones": held_gain
            > max(0.25 * s.least_gain, 0.5 * s.least_share * held_excess),
        }
        accepted = all(passes.values())
        failed = [reason for reason, passed in passes.items() if not passed]
        return _Verdict(
            accepted,
            "; ".join(passes) if accepted else "not enough: " + "; ".join(failed),
            {
                "chi2_before": chi2,
                "chi2_after": new,
                "n_data": float(n),
                "chi2_holdout_before": self.held_chi2,
                "chi2_holdout_after": new_held,
                "n_holdout": float(self.held_count),
            },
            {
                "delta_chi2_train": gain,
                "delta_chi2_holdout": held_gain,
                "share_of_excess": gain / excess if excess else 0.0,
            },
        )

    def _join(self, chosen: Refit) -> None:
        """Refit the model with the chosen effect, with what the rig knows free again."""
        self.case.tell(f"adding {chosen.effect}")
        values = dict(zip(chosen.problem.names, chosen.minimum.x.tolist(), strict=True))
        self.fit = self._refit(self.fit.model.with_effect(chosen.effect), values)
        self.added.append(chosen.effect)
        (self.held_chi2,) = self._held_chi2([Refit(chosen.effect, self.fit.problem, self.fit.minimum)])

    def _refit(self, model: Model, values: Mapping[str, float]) -> Fit:
        bench = self.fit.problem.bench
        return fit(model, self.case.train, start=values, bench=bench, units=self.case.units, gaussian=self.gaussian)

    def _tied(self, refits: list[Refit], n: int) -> list[Refit]:
        """Return the refits that explain the training recordings as well as the best one."""
        best = refits[0].chi2
        limit = best + max(10.0, self.case.settings.tie * max(best - n, 0.0))
        return [r for r in refits if r.chi2 <= limit][:6]

    def _held_chi2(self, refits: Sequence[Refit]) -> list[float]:
        bench, judge = self.fit.problem.bench, self.case.judge
        models = []
        for r in refits:
            values = dict(zip(r.problem.names, r.minimum.x.tolist(), strict=True))
            on_train = bench.predict(*r.problem.expand(r.minimum.x[:, None])) if judge.continued else []
            models.append((r.problem.model, values, [c[:, :, 0] for c in on_train]))
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


@dataclass(frozen=True)
class _Verdict:
    """Whether a candidate joins, why, and the numbers behind it."""

    accepted: bool
    reason: str
    numbers: Mapping[str, float]
    evidence: Mapping[str, float]
