"""The closed loop: refit the declared model, find the effect that it lacks, add it, and say what is left."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.attribution import Refit, candidates, refit, screen, similarity
from discovery.experiment import Experiment, largest_deflection
from discovery.fit import Fit, choose_step, declared_model, fit, rig_uncertainty
from discovery.least_squares import Minimum
from discovery.model import Model
from discovery.predict import held_out
from discovery.problem import Bench, NaturalUnits, Problem, natural_units
from discovery.registry import catalogue
from discovery.residual import ResidualReport, errors, examine, systematic_share

__all__ = ["LoopResult", "LoopSettings", "Step", "close_loop"]

FloatArray = NDArray[np.float64]
#: What a base upgrade is called when the loop finds it.
UPGRADES = (("reduced", "radius_inertia"), ("elastica", "elastica_geometry"))


@dataclass(frozen=True)
class LoopSettings:
    """Thresholds of the loop, each a plain number with a reason.

    Parameters
    ----------
    tolerance : float
        Trajectory error of the search [rad or natural coordinate]; the solver's shift of the answer is reported.
    floor : float
        Systematic residual, in noise sds, below which a residual counts as noise. The exact arm itself leaves 0.05 to
        0.3 when the encoder's profile is rough.
    relative_floor : float
        Or below this share of what the geometric model left.
    least_gain : float
        Chi-square that an effect must remove: far beyond the largest of 20 chance gains.
    least_share : float
        Share of the excess chi-square that an effect must remove on the training recordings.
    tie : float
        Candidates whose excess chi-square is within this share of the best one count as equally good: the one with
        fewer parameters is taken and the others are reported as ambiguous.
    most_effects : int
        Largest number of effects added.
    """

    tolerance: float = 2e-5
    floor: float = 0.35
    relative_floor: float = 0.1
    least_gain: float = 40.0
    least_share: float = 0.2
    tie: float = 0.05
    most_effects: int = 4


@dataclass(frozen=True)
class Step:
    """One decision of the loop, for its story.

    Parameters
    ----------
    action : str
        "upgrade", "add", "remove" or "stop".
    effect : str
        What was added or tried.
    accepted : bool
        Whether it stayed.
    reason : str
        A sentence.
    numbers : mapping of str to float
        Chi-square before and after, on training and hold-out.
    ranking : tuple of mapping
        For "add": every candidate with its linear score and its refitted chi-square.
    """

    action: str
    effect: str
    accepted: bool
    reason: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    ranking: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True)
class LoopResult:
    """What the loop found.

    Parameters
    ----------
    verdict : str
        "explained", "nothing_missing" or "unexplained".
    declared : tuple of str
        The declared model.
    added : tuple of str
        Effects in the order in which they were added, base upgrades first.
    before, after : Fit
        The declared model refitted, and the final one.
    steps : tuple of Step
        The story.
    evidence, ambiguous : mapping
        By added effect.
    errors : mapping
        As in loop.json.
    residual_before, residual_after : ResidualReport
        On the training recordings.
    predictions : mapping
        "before" and "after": prediction of every recording, training first.
    test : str
        The test by which the held-out residual counts as noise, with its numbers.
    """

    verdict: str
    declared: tuple[str, ...]
    added: tuple[str, ...]
    before: Fit
    after: Fit
    steps: tuple[Step, ...]
    evidence: Mapping[str, Mapping[str, float]]
    ambiguous: Mapping[str, tuple[str, ...]]
    errors: Mapping[str, Any]
    residual_before: ResidualReport
    residual_after: ResidualReport
    predictions: Mapping[str, list[FloatArray]]
    test: str

    def summary(self) -> dict[str, Any]:
        """Return the content of loop.json."""
        sd, values = self.after.sd, self.after.values
        effects = []
        for effect in self.added:
            names = [p.name for p in catalogue()[effect].parameters()] if effect in catalogue() else []
            effects.append(
                {
                    "id": effect,
                    "parameters": {
                        n: {
                            "value": values[n],
                            "sd": None if n in self.after.reasons else sd[n],
                            "unit": self.after.model.parameters[n].unit,
                        }
                        for n in names
                        if n in values
                    },
                    "evidence": dict(self.evidence.get(effect, {})),
                    "ambiguous_with": list(self.ambiguous.get(effect, ())),
                }
            )
        return {
            "verdict": self.verdict,
            "declared": list(self.declared),
            "effects": effects,
            "errors": dict(self.errors),
            "test": self.test,
            "model": {"before": self.before.summary(), "after": self.after.summary()},
            "residual": {"before": self.residual_before.summary(), "after": self.residual_after.summary()},
            "steps": [
                {
                    "action": s.action,
                    "effect": s.effect,
                    "accepted": s.accepted,
                    "reason": s.reason,
                    "numbers": dict(s.numbers),
                    "ranking": [dict(r) for r in s.ranking],
                }
                for s in self.steps
            ],
        }


class _HoldOut:
    """Recordings, or parts of them, that decide and judge but are never fitted."""

    def __init__(self, train: Sequence[Experiment], separate: Sequence[Experiment], units: NaturalUnits) -> None:
        self.train, self.separate, self.units = train, separate, units
        self.continued = not separate
        reach = largest_deflection(train)
        self.inside = [largest_deflection([e]) <= 1.05 * reach for e in separate]
        self._benches: dict[tuple[str, tuple[str, ...], float], Bench] = {}

    @property
    def kind(self) -> str:
        """How the held-out data relate to the fitted ones."""
        return "last third of each training recording, continued" if self.continued else "separate recordings"

    def predictions(
        self, bench: Bench, models: Sequence[tuple[Model, Mapping[str, float], list[FloatArray]]]
    ) -> list[list[FloatArray]]:
        """Return the predictions of the held-out recordings by each model (model, values, training predictions)."""
        if self.continued:
            return [on_train for _, _, on_train in models]
        key = (bench.base, bench.effects, bench.step)
        if key not in self._benches:
            self._benches[key] = Bench(bench.base, bench.effects, self.separate, bench.step)
        return held_out([(m, v) for m, v, _ in models], self.separate, self._benches[key], self.units)

    @property
    def experiments(self) -> Sequence[Experiment]:
        """Recordings that `predictions` refers to."""
        return self.train if self.continued else self.separate

    def outputs(self) -> list[FloatArray]:
        """Return measured outputs, NaN where a sample was fitted."""
        found = []
        for e in self.experiments:
            out = e.recording.output.copy()
            if self.continued:
                out[e.fitted] = np.nan
            found.append(out)
        return found

    def deciding(self) -> list[int]:
        """Return which recordings decide: those inside the trained deflection, or all where none is."""
        inside = [i for i, flag in enumerate(self.inside) if flag]
        return inside or list(range(len(self.experiments)))

    def score(self, predictions: Sequence[FloatArray]) -> tuple[float, int, float]:
        """Return chi-square, number of samples and systematic residual of the deciding recordings."""
        chi2, count, parts = 0.0, 0, []
        outputs = self.outputs()
        for i in self.deciding():
            e = self.experiments[i]
            normal = (predictions[i] - outputs[i]) / e.recording.noise
            good = np.isfinite(normal)
            chi2 += float(np.sum(normal[good] ** 2))
            count += int(good.sum())
            parts.append(systematic_share(normal, e.recording.time, 2 * np.pi * self.units.time))
        return chi2, count, float(np.sqrt(np.mean(np.square(parts))))

    def errors(self, predictions: Sequence[FloatArray]) -> dict[str, dict[str, float]]:
        """Return errors over all held-out recordings, and apart inside and outside the trained deflection."""
        outputs = self.outputs()

        def pooled(which: list[int]) -> dict[str, float]:
            return errors(np.concatenate([predictions[i] for i in which]), np.concatenate([outputs[i] for i in which]))

        everything = list(range(len(self.experiments)))
        result = {"holdout": pooled(everything)}
        if not self.continued:
            inside = [i for i in everything if self.inside[i]]
            outside = [i for i in everything if not self.inside[i]]
            if inside:
                result["holdout_inside"] = pooled(inside)
            if outside:
                result["holdout_outside"] = pooled(outside)
        return result


def _noise_floor(train: Sequence[Experiment]) -> float:
    return float(np.sqrt(np.sum(np.square(train[0].recording.noise))))


def _train_errors(train: Sequence[Experiment], predictions: Sequence[FloatArray]) -> dict[str, float]:
    return errors(
        np.concatenate([p[e.fitted] for e, p in zip(train, predictions, strict=True)]),
        np.concatenate([e.recording.output[e.fitted] for e in train]),
    )


def close_loop(
    train: Sequence[Experiment],
    holdout: Sequence[Experiment] = (),
    *,
    settings: LoopSettings | None = None,
    progress: Callable[[str], None] | None = None,
) -> LoopResult:
    """Find what the declared model lacks.

    Parameters
    ----------
    train : sequence of Experiment
        Recordings to fit; where `holdout` is empty, their last third should be excluded by `fitted_samples`.
    holdout : sequence of Experiment
        Recordings that are never fitted, but for their initial states.
    settings : LoopSettings, optional
        Thresholds.
    progress : callable, optional
        Receives one sentence before every longer piece of work.

    Returns
    -------
    LoopResult
    """
    settings = settings or LoopSettings()
    tell = progress or (lambda _: None)
    units = natural_units(train)
    judge = _HoldOut(train, holdout, units)
    declared = declared_model(train[0])

    tell("refitting the declared model")
    before = fit(declared, train, units=units)
    before_train = before.predict()
    (before_held,) = judge.predictions(before.problem.bench, [(declared, before.values, before_train)])
    steps: list[Step] = []
    start = _exact_arm(before, train, settings, units, tell) if train[0].is_arm else before
    search = _Search(start, train, judge, settings, units, tell)
    search.run()
    geometry: list[str] = []
    if train[0].is_arm:
        geometry, steps = _judge_geometry(before, search, train, judge, settings, units, tell)
        if "elastica_geometry" not in geometry:
            # Rare: the exact mechanics predicts no better than the declared one; then the declared one is searched.
            plain = _Search(before, train, judge, settings, units, tell)
            plain.run()
            if plain.held_chi2 < search.held_chi2:
                search, geometry = plain, []
    steps = [*steps, *search.steps]

    after_train = search.fit.predict()
    (after_held,) = judge.predictions(search.fit.problem.bench, [(search.fit.model, search.fit.values, after_train)])
    _, _, rough = judge.score(after_held)
    limit = max(settings.floor, settings.relative_floor * search.first_rough)
    noise = rough <= limit
    added = (*geometry, *search.added)
    verdict = "unexplained" if not noise else "explained" if added else "nothing_missing"
    test = (
        "systematic part of the held-out residual (averages over a 24th of a period, noise removed): "
        f"{rough:.3g} noise sds, {'at most' if noise else 'above'} {limit:.3g} = "
        f"max({settings.floor:g}, {settings.relative_floor:g} x {search.first_rough:.3g})"
    )
    first = train[0].recording
    result_errors: dict[str, Any] = {
        "unit": first.units[0],
        "noise_floor": _noise_floor(train),
        "holdout_kind": judge.kind,
        "before": {"train": _train_errors(train, before_train), **judge.errors(before_held)},
        "after": {"train": _train_errors(train, after_train), **judge.errors(after_held)},
    }
    period = 2 * np.pi * units.time
    extra = judge.continued
    return LoopResult(
        verdict=verdict,
        declared=declared.effects,
        added=added,
        before=before,
        after=search.fit,
        steps=tuple(steps),
        evidence={**search.evidence},
        ambiguous=search.ambiguous,
        errors=result_errors,
        residual_before=examine(train, before_train, period),
        residual_after=examine(train, after_train, period),
        predictions={
            "before": before_train if extra else [*before_train, *before_held],
            "after": after_train if extra else [*after_train, *after_held],
        },
        test=test,
    )


def _kernel_effects(model: Model) -> tuple[str, ...]:
    """Return every effect that may come into question on the base, so that one kernel serves the whole search."""
    return tuple(sorted({*model.effects, *candidates(model)}))


def _fit_on(model: Model, train, settings, units, values, gaussian) -> Fit:
    """Fit a model with the kernel that holds the whole catalogue of its base."""
    effects = _kernel_effects(model)
    step = choose_step(model, train, units, values, settings.tolerance, effects)
    bench = Bench(model.base, effects, train, step)
    return fit(model, train, start=values, bench=bench, units=units, gaussian=gaussian)


def _exact_arm(before: Fit, train, settings, units, tell) -> Fit:
    """Refit on the exact mechanics: what geometry explains must not be explained by effects."""
    tell("refitting on the exact mechanics of the arm")
    start = {n: before.values[n] for n in ("alpha", "xi") if n in before.values}
    return _fit_on(before.model.on_base("elastica"), train, settings, units, start, rig_uncertainty(train[0]))


def _judge_geometry(before: Fit, search: _Search, train, judge, settings, units, tell) -> tuple[list[str], list[Step]]:
    """Ask, with the other effects in the model, which steps of the mechanics lower the held-out error."""
    geometry, steps = [], []
    previous = None
    for base, name in (("constant_radius", ""), *UPGRADES):
        if base == search.fit.model.base:
            found = search.fit
        elif base == "constant_radius" and not search.added:
            found = before
        else:
            tell(f"comparing mechanics: {base}")
            model = before.model.with_effect(*[e for e in search.added if e not in before.model.effects]).on_base(base)
            values = {n: v for n, v in search.fit.values.items() if "[" not in n and n in model.parameters}
            found = _fit_on(model, train, settings, units, values, {})
        (held,) = judge.predictions(found.problem.bench, [(found.model, found.values, found.predict())])
        chi2, count, _ = judge.score(held)
        if previous is not None:
            # Fewer free parameters and a better fit of everything, or a smaller held-out error alone.
            better = chi2 < 0.98 * previous[0] or chi2 + found.chi2 < 0.98 * sum(previous)
            reason = "no free parameter, and a smaller error" if better else "the error is not smaller"
            numbers = {
                "chi2_train": found.chi2,
                "mean_chi2_holdout_before": previous[0] / count,
                "mean_chi2_holdout_after": chi2 / count,
            }
            steps.append(Step("upgrade", name, better, reason, numbers))
            if not better:
                continue
            geometry.append(name)
        previous = chi2, found.chi2
    return geometry, steps


class _Search:
    """Adds effects one at a time while each explains enough of training and held-out data, then removes idle ones."""

    def __init__(self, start: Fit, train, judge: _HoldOut, settings: LoopSettings, units: NaturalUnits, tell) -> None:
        self.fit = start
        self.train, self.judge, self.settings, self.units, self.tell = train, judge, settings, units, tell
        self.steps: list[Step] = []
        self.added: list[str] = []
        self.evidence: dict[str, dict[str, float]] = {}
        self.ambiguous: dict[str, tuple[str, ...]] = {}
        self.gaussian = start.problem.gaussian
        effects = _kernel_effects(start.model)
        if start.problem.bench.effects != effects:
            self.fit = _fit_on(start.model, train, settings, units, start.values, self.gaussian)
        (held,) = judge.predictions(self.fit.problem.bench, [(self.fit.model, self.fit.values, self.fit.predict())])
        self.held_chi2, self.held_count, self.first_rough = judge.score(held)

    def run(self) -> None:
        """Search until the residual is noise or nothing passes."""
        while len(self.added) < self.settings.most_effects:
            rough = examine(self.train, self.fit.predict(), 2 * np.pi * self.units.time).systematic
            if rough <= self.settings.floor:
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
        frozen = Problem(Model(self.fit.model.base, self.fit.model.effects, known), problem.bench, self.units, {})
        keep = [i for i, n in enumerate(problem.names) if n not in nuisance]
        rows = problem.bench.n_rows
        residual = minimum.residual[:rows]
        return frozen, Minimum(
            minimum.x[keep],
            0.5 * float(residual @ residual),
            residual,
            minimum.jacobian[:rows, keep],
            minimum.at_bound[keep],
            minimum.converged,
            minimum.iterations,
        )

    def _add(self) -> bool:
        s = self.settings
        problem, minimum = self._frozen()
        names = candidates(problem.model)
        self.tell(f"screening the catalogue ({len(names)} effects)")
        scored = screen(problem.model, minimum, problem, names)
        self.tell("refitting every candidate")
        refits = refit(problem.model, minimum, problem, scored)
        n, chi2 = problem.bench.n_data, 2 * minimum.cost
        excess = max(chi2 - n, 0.0)
        tied = self._tied(refits, n)
        held = self._held(tied)
        # Among equals: fewest parameters, then the smaller held-out error.
        order = sorted(range(len(tied)), key=lambda i: (len(tied[i].problem.free), held[i]))
        chosen, chosen_held = tied[order[0]], held[order[0]]
        gain, held_gain = chi2 - chosen.chi2, self.held_chi2 - chosen_held
        held_excess = max(self.held_chi2 - self.held_count, 0.0)
        passes = {
            f"it removes {gain:.0f} of {excess:.0f} excess chi-square on the training recordings": gain
            > max(s.least_gain, s.least_share * excess),
            f"it removes {held_gain:.0f} of {held_excess:.0f} on the held-out ones": held_gain
            > max(0.25 * s.least_gain, 0.5 * s.least_share * held_excess),
        }
        accepted = all(passes.values())
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
        numbers = {
            "chi2_before": chi2,
            "chi2_after": chosen.chi2,
            "n_data": float(n),
            "chi2_holdout_before": self.held_chi2,
            "chi2_holdout_after": chosen_held,
            "n_holdout": float(self.held_count),
        }
        failed = [k for k, ok in passes.items() if not ok]
        reason = "; ".join(passes) if accepted else "not enough: " + "; ".join(failed)
        self.steps.append(Step("add", chosen.effect, accepted, reason, numbers, ranking))
        if not accepted:
            return False
        self.tell(f"adding {chosen.effect}")
        values = dict(zip(chosen.problem.names, chosen.minimum.x.tolist(), strict=True))
        model = self.fit.model.with_effect(chosen.effect)
        self.fit = fit(model, self.train, start=values, bench=problem.bench, units=self.units, gaussian=self.gaussian)
        self.added.append(chosen.effect)
        projected = {c.effect: c.sensitivity for c in scored}
        others = [r.chi2 for r in refits if r.effect != chosen.effect]
        self.ambiguous[chosen.effect] = tuple(r.effect for r in tied if r.effect != chosen.effect)
        self.evidence[chosen.effect] = {
            "delta_chi2_train": gain,
            "delta_chi2_holdout": held_gain,
            "share_of_excess": gain / excess if excess else 0.0,
            "linear_score": scores[chosen.effect],
            "runner_up_delta_chi2": chi2 - min(others, default=chi2),
            "largest_similarity": max(
                (similarity(projected[chosen.effect], v) for k, v in projected.items() if k != chosen.effect),
                default=0.0,
            ),
        }
        self.held_chi2 = self._held([Refit(chosen.effect, self.fit.problem, self.fit.minimum)])[0]
        return True

    def _tied(self, refits: list[Refit], n: int) -> list[Refit]:
        """Return the refits that explain the training recordings as well as the best one."""
        best = refits[0].chi2
        limit = best + max(10.0, self.settings.tie * max(best - n, 0.0))
        return [r for r in refits if r.chi2 <= limit][:6]

    def _held(self, refits: Sequence[Refit]) -> list[float]:
        bench = self.fit.problem.bench
        triples = []
        for r in refits:
            values = dict(zip(r.problem.names, r.minimum.x.tolist(), strict=True))
            on_train = (
                [c[:, :, 0] for c in bench.predict(*r.problem.expand(r.minimum.x[:, None]))]
                if self.judge.continued
                else []
            )
            triples.append((r.problem.model, values, on_train))
        return [self.judge.score(p)[0] for p in self.judge.predictions(bench, triples)]

    def _remove(self) -> None:
        """Drop an effect that the later ones have made superfluous."""
        for effect in tuple(self.added[:-1]):
            model = self.fit.model.without([effect])
            trial = fit(
                model,
                self.train,
                start=self.fit.values,
                bench=self.fit.problem.bench,
                units=self.units,
                gaussian=self.gaussian,
            )
            loss = trial.chi2 - self.fit.chi2
            superfluous = loss < self.settings.least_gain
            self.steps.append(
                Step(
                    "remove",
                    effect,
                    superfluous,
                    f"without it chi-square rises by {loss:.0f}",
                    {"chi2_before": self.fit.chi2, "chi2_after": trial.chi2},
                )
            )
            if superfluous:
                self.fit = trial
                self.added.remove(effect)
                self.evidence.pop(effect, None)
