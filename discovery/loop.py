"""The closed loop: refit the declared model, find the effect that it lacks, add it, and say what is left."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.bench import Bench
from discovery.case import Case, LoopSettings, Step
from discovery.contradiction import ContradictionReport, check_contradictions, grossly_unlike
from discovery.experiment import Experiment
from discovery.fit import Fit, declared_model, fit, prolonged, rig_uncertainty, widened
from discovery.holdout import HoldOut
from discovery.mechanics import upgrades
from discovery.problem import NaturalUnits, natural_units
from discovery.quantisation import resolution
from discovery.recording import Recording
from discovery.refits import Refit, quickened
from discovery.registry import catalogue
from discovery.residual import ResidualReport, errors, examine
from discovery.search import Search
from discovery.separation import Separation, separate
from discovery.simulate import THREADS
from discovery.solver_error import error_unit
from discovery.stand_in import StandIn, stand_in
from discovery.workers import at_once, single_algebra

__all__ = ["UPGRADES", "LoopResult", "close_loop"]

FloatArray = NDArray[np.float64]
#: Better bases, and what the step to each is called when the loop finds it.
UPGRADES = tuple((step.base, name) for name, step in upgrades.UPGRADES.items())
#: The exact arm on which effects are searched.
_EXACT = UPGRADES[-1][0]
#: Without the exact mechanics a search must leave so much less of the held-out chi-square to be believed.
_MUCH_LESS = 0.9
#: A trajectory error below so many noise sds at every sample is none to the search.
_HIDDEN = 0.06
#: Manoeuvres tried for each group of rivals; fewer, but so many at least, where a motion takes more steps than this.
_DESIGNS, _LONG, _FEWEST = 100, 6_000, 20


@dataclass(frozen=True, repr=False)
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
    contradiction : ContradictionReport, optional
        Fitted values against what the rig and the elastica predict.
    separations : tuple of Separation
        The manoeuvres that would tell apart what these recordings cannot.
    recordings : tuple of Recording
        Training first.
    noise : bool
        Whether what the final model leaves counts as noise: if so, an "unexplained" motion contradicts the rig.
    unlike : float
        How far the laws of the added effects may be from nature's, see `discovery.covariance.covariance_of`.
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
    contradiction: ContradictionReport | None = None
    separations: tuple[Separation, ...] = ()
    recordings: tuple[Recording, ...] = ()
    noise: bool = False
    unlike: float = 0.0

    def __repr__(self) -> str:
        """Return the answer; all that led to it would fill pages."""
        before, after = (self.errors[k]["holdout"]["rms"] for k in ("before", "after"))
        change = f"holdout rms {before:.4g} -> {after:.4g} {self.errors['unit']}"
        return f"<LoopResult {self.verdict}, added {', '.join(self.added) or 'nothing'}, {change}>"

    @property
    def stand_ins(self) -> dict[str, StandIn]:
        """What added effects may stand for, by effect: an error of the rig file would do the same."""
        found = {effect: stand_in(self.after, effect) for effect in self.added}
        return {effect: other for effect, other in found.items() if other is not None}

    def foresight(self) -> Fit:
        """Return the final model fitted to the training recordings to their end: once judged, it predicts others."""
        return widened(prolonged(self.after), self.unlike)

    def summary(self) -> dict[str, Any]:
        """Return the content of loop.json."""
        sd, values, others = dict(self.after.sd), self.after.values, self.stand_ins
        effects = []
        for effect in self.added:
            if other := others.get(effect):
                # No reading is surer than the ruler.
                sd[other.parameter] = float(np.hypot(sd[other.parameter], other.relative_sd))
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
                    **({"stands_for": other.summary()} if other else {}),
                }
            )
        return {
            "verdict": self.verdict,
            "declared": list(self.declared),
            "recordings": [{"name": r.name, "notes": list(r.notes)} for r in self.recordings],
            "effects": effects,
            "errors": dict(self.errors),
            "test": self.test,
            "noise": self.noise,
            **({"contradiction": self.contradiction.summary()} if self.contradiction else {}),
            **({"separation": [s.summary() for s in self.separations]} if self.separations else {}),
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
    units = natural_units(train)
    settings = settings or LoopSettings()
    settings = replace(settings, tolerance=max(settings.tolerance, _HIDDEN * _least_noise([*train, *holdout], units)))
    judge = HoldOut(train, holdout, units, settings.tolerance)
    case = Case(train, judge, _attainable(settings, train, judge), units, progress or (lambda _: None))
    # Matrices are tall and narrow: a second thread of theirs would only wait in the way of the simulations.
    with single_algebra():
        return _closed(case)


def _closed(case: Case) -> LoopResult:
    """Return what the loop finds."""
    train, holdout, units = case.train, case.judge.separate, case.units
    declared = declared_model(train[0])
    case.tell("refitting the declared model")
    before = fit(declared, train, units=units)
    if train[0].is_arm:
        search, geometry, steps = _search_arm(before, case)
    else:
        search, geometry, steps = Search(before, case), [], []
        search.run()

    # Laws that differ by no more than this share of what they remove could not have been told apart.
    moved = sum(e["effect_rms"] ** 2 for e in search.evidence.values())
    unlike = float(np.sqrt(case.form(search.best.refit.problem.model) * moved))
    # Both leave threads idle most of the time: the answer is one fit.
    last: list[Callable[[], Any]] = [partial(_final, search, case), partial(_separations, search, case)]
    (after, after_held), separations = at_once(last, threads=THREADS)
    after = widened(after, unlike)
    before_train, after_train = before.predict(), after.predict()
    before_held = case.held(before)
    noise, test = case.is_noise(after, after_held, (search.root.rough, search.root.held_rough))
    added = (*geometry, *search.added)
    contradiction = _contradiction(after, search, case, noise=noise)
    excluded = contradiction.gross if noise and contradiction else ()
    if excluded:
        # Whatever else the motion was explained with, it is not the motion of the arm that the rig file describes.
        test = f"what is left is noise, but {excluded[0].sentence}"
    verdict = "unexplained" if excluded or not noise else "explained" if added else "nothing_missing"
    period = 2 * np.pi * units.time
    only_train = case.judge.continued
    return LoopResult(
        verdict=verdict,
        declared=declared.effects,
        added=added,
        before=before,
        after=after,
        steps=(*steps, *search.steps),
        evidence={**{s.effect: s.numbers for s in steps if s.accepted}, **search.evidence},
        ambiguous=search.ambiguous,
        errors={
            "unit": train[0].recording.units[0],
            "noise_floor": float(np.sqrt(np.sum(np.square(train[0].recording.noise)))),
            "holdout_kind": case.judge.kind,
            "before": {"train": _train_errors(train, before_train), **case.judge.errors(before_held)},
            "after": {"train": _train_errors(train, after_train), **case.judge.errors(after_held)},
        },
        residual_before=examine(train, before_train, period),
        residual_after=examine(train, after_train, period),
        predictions={
            "before": before_train if only_train else [*before_train, *before_held],
            "after": after_train if only_train else [*after_train, *after_held],
        },
        test=test,
        contradiction=contradiction,
        separations=separations,
        recordings=tuple(e.recording for e in (*train, *holdout)),
        noise=noise,
        unlike=unlike,
    )


def _least_noise(experiments: Sequence[Experiment], units: NaturalUnits) -> float:
    """Return the smallest noise of any channel, in the unit of the error that `discovery.step.choose_step` bounds."""
    return min(float(e.recording.noise.min()) for e in experiments) / error_unit(experiments, units)


def _attainable(settings: LoopSettings, train: Sequence[Experiment], judge: HoldOut) -> LoopSettings:
    """Return settings that ask no more than chance and rounding, whose error follows the motion, allow."""
    rounding = [
        resolution(column) / noise
        for e in train
        for column, noise in zip(e.recording.output.T, e.recording.noise, strict=True)
    ]
    return replace(settings, floor=max(settings.floor, judge.chance(), *rounding))


def _contradiction(after: Fit, search: Search, case: Case, *, noise: bool) -> ContradictionReport | None:
    """Test the final values against what the rig and the elastica predict; None where nothing asks for it.

    Where more than noise is left and the search names nothing, nothing is named that would reconcile them either.
    """
    follow_up, seed = case.settings.follow_up, [case.settings.seed, 1]
    arm = case.train[0].is_arm
    if arm and not (noise and follow_up):
        gross = grossly_unlike(after, np.random.default_rng(seed))
        if not noise or not gross.contradictions:
            return gross if follow_up else None
    elif not follow_up:
        return None
    case.tell("comparing with the rig")
    names = None if noise or search.added else ()
    bench = search.best.refit.problem.bench
    rng = np.random.default_rng(seed)
    return check_contradictions(after, rng, candidates=names, bench=bench, progress=case.tell)


def _separations(search: Search, case: Case) -> tuple[Separation, ...]:
    """Design a manoeuvre, within the limits of the motor, for every added effect that others explain as well."""
    if not (case.settings.follow_up and case.train[0].is_arm):
        return ()
    found = []
    for effect, rivals in search.rivals().items():
        case.tell(f"designing a manoeuvre that tells {effect} from {' and '.join(rivals)}")
        # All on the mechanics on which the search began, where they do: what tells them apart must be the effects.
        refits = {effect: search.best.refit, **rivals}
        fitting = [partial(_quickly, r, search.bench, case) for r in refits.values()]
        fits = dict(zip(refits, at_once(fitting, threads=THREADS), strict=True))
        steps = max(f.problem.bench.duration / f.problem.bench.shortest for f in fits.values())
        rng = np.random.default_rng([case.settings.seed, 2])
        found.append(separate(fits, rng, evaluations=_designs(steps)))
    return tuple(found)


def _quickly(found: Refit, bench: Bench, case: Case) -> Fit:
    """Return a refit with its intervals, on the mechanics of a bench where these do."""
    return case.finished(quickened(found, bench))


def _designs(steps: float) -> int:
    """Return how many manoeuvres are tried where the motion takes so many steps: play takes a hundred thousand."""
    return int(np.clip(_DESIGNS * _LONG / steps, _FEWEST, _DESIGNS))


def _train_errors(train: Sequence[Experiment], predictions: Sequence[FloatArray]) -> dict[str, float]:
    return errors(
        np.concatenate([p[e.fitted] for e, p in zip(train, predictions, strict=True)]),
        np.concatenate([e.recording.output[e.fitted] for e in train]),
    )


def _final(search: Search, case: Case) -> tuple[Fit, list[FloatArray]]:
    """Return the final fit of what was found, and its predictions of the held-out recordings."""
    found, _ = search.finest()
    if search.added and not search.settled:
        found = case.reshaped(found, search.added)
    # On steps that are finer than a search needs any fit takes several times as long: only the answer is worth it.
    found = case.polish(found)
    return found, case.held(found)


def _search_arm(before: Fit, case: Case) -> tuple[Search, list[str], list[Step]]:
    """Search on the exact mechanics first: what geometry explains must not be explained by effects."""
    case.tell("refitting on the exact mechanics of the arm")
    start = {n: v for n, v in before.values.items() if n in ("alpha", "xi")}
    exact = case.fit(before.model.on_base(_EXACT), start, rig_uncertainty(case.train[0]))
    search = Search(exact, case)
    search.run()
    geometry, steps = _judge_geometry(before, search, case)
    if "elastica_geometry" not in geometry:
        # Rare: the exact mechanics predicts no better than a simpler one. It is given up only where it fails and the
        # declared one, searched alike, leaves nothing but noise, or predicts as well where the exact one names nothing.
        if not search.settled:
            # Both searches begin at the same fit, on the kernel of the whole catalogue.
            declared = case.fit(before.model, before.values, before.problem.gaussian)
            plain = Search(declared, case)
            plain.run(search.least)
            if plain.settled and plain.best.held < _MUCH_LESS * search.best.held:
                return plain, [], steps
            if not search.added and not search.best.held < plain.root.held:
                idle = "the error is smaller, but the exact arm's is not, and no effect is named upon that"
                refused = [replace(s, accepted=False, reason=idle) if s.accepted else s for s in steps]
                return Search(declared, case), [], [*refused, *search.steps]
        geometry.append("elastica_geometry")
    return search, geometry, steps


def _judge_geometry(before: Fit, search: Search, case: Case) -> tuple[list[str], list[Step]]:
    """Ask, with the other effects in the model, which steps of the mechanics lower the error."""
    geometry: list[str] = []
    steps: list[Step] = []
    held_before, train_before = float("inf"), float("inf")
    bases = [("constant_radius", ""), *UPGRADES]
    case.tell(f"comparing mechanics: {', '.join(base for base, _ in bases)}")

    def fitted(base: str) -> tuple[Fit, list[FloatArray]]:
        if base == _EXACT:
            return search.finest()
        if base == "constant_radius" and not search.added:
            return before, case.held(before)
        model = before.model.with_effect(*[e for e in search.added if e not in before.model.effects]).on_base(base)
        values = {n: v for n, v in search.best.refit.values.items() if "[" not in n and n in model.parameters}
        found = case.fit(model, values, case.conventions(model))
        return found, case.held(found)

    answers = at_once([partial(fitted, base) for base, _ in bases], threads=THREADS)
    for (_, name), (found, predicted) in zip(bases, answers, strict=True):
        held, count, _ = case.judge.score(predicted)
        if name:
            # Fewer free parameters and a better fit of everything, or a smaller held-out error alone.
            better = held < 0.98 * held_before or held + found.chi2 < 0.98 * (held_before + train_before)
            reason = "no effect is added for it, and the error is smaller" if better else "the error is not smaller"
            numbers = {
                "chi2_train_before": train_before,
                "chi2_train_after": found.chi2,
                "chi2_holdout_before": held_before,
                "chi2_holdout_after": held,
                "n_holdout": float(count),
            }
            steps.append(Step("upgrade", name, better, reason, numbers))
            if not better:
                continue
            geometry.append(name)
        held_before, train_before = held, found.chi2
    return geometry, steps
