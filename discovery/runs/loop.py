"""The closed loop: refit the declared model, find the effects that it lacks, add them, and say what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.declared import first_fit, rig_uncertainty
from discovery.estimation.fit import Fit
from discovery.estimation.generalised import fitted_to_all, without_bent
from discovery.estimation.holdout import HoldOut
from discovery.estimation.input_choice import choose_interpolation
from discovery.estimation.natural_units import natural_units
from discovery.estimation.residual import examine, variance_left
from discovery.estimation.step import error_unit
from discovery.foundation.arguments import check_seed, expect
from discovery.foundation.errors import ComputationError
from discovery.foundation.progress import Course, Tell, teller
from discovery.foundation.workers import at_once, single_algebra
from discovery.mechanics.upgrades import UPGRADES
from discovery.recordings.chosen import Recordings, held_out_of, training_of
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment
from discovery.recordings.flags import impossible
from discovery.recordings.parts import searched_part
from discovery.recordings.rounding import resolution
from discovery.runs.around_search import contradiction_of, in_its_units, separations, sought
from discovery.runs.lead import leads
from discovery.runs.loop_errors import loop_errors
from discovery.runs.loop_result import LoopResult, ModelErrorReport
from discovery.screening.refits import Refit
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context
from discovery.selection.decision import Decision
from discovery.selection.final import finished, settled
from discovery.selection.search import Search
from discovery.selection.settings import LoopSettings
from discovery.selection.verdict import Named, is_complete, named, verdict_of
from discovery.simulation.simulate import THREADS

#: The exact arm on which effects are searched.
_EXACT = [*UPGRADES.values()][-1].base
#: A trajectory error below so many noise sds at every sample is none to the search.
_HIDDEN = 0.06
#: Part of the readings' variance beyond which the declared model leaves most of the motion.
_MOST = 0.5


def close_loop(
    train: Recordings,
    holdout: Recordings | None = None,
    *,
    settings: LoopSettings | None = None,
    seed: int | None = None,
    progress: Tell | None = None,
) -> LoopResult:
    """Find what the declared model lacks.

    Parameters
    ----------
    train : Dataset or sequence of Experiment
        A data set with its hold-outs, or recordings to fit; where nothing is held out, a last part of them should be
        excluded by `fitted_samples`, as `load_dataset` does.
    holdout : Dataset or sequence of Experiment, optional
        Recordings that are never fitted, but for their initial states; the data set's own otherwise.
    settings : LoopSettings, optional
        The numbers that decide.
    seed : int, optional
        Seed of everything random, in the place of the one of `settings`, which is 1.
    progress : callable, optional
        Receives one sentence before every longer piece of work.

    Raises
    ------
    InputError
        For anything else than recordings of one system, or a declared model that cannot be theirs.
    ComputationError
        If the declared model blows up wherever its fit begins.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> found = close_loop(data)
    >>> found.verdict, found.added
    ('explained', ('coulomb_friction',))
    """
    everything = _given(train, holdout)
    train, holdout = (searched_part(part) for part in everything)
    units = natural_units(train)
    settings = LoopSettings() if settings is None else settings
    expect(settings, LoopSettings, "settings", "Make some with LoopSettings(name=value).")
    check_seed(settings.seed if seed is None else seed)
    course = Course(teller(progress))
    settings = settings if seed is None else replace(settings, seed=seed)
    noises = [float(e.recording.noise[e.recording.judged].min()) for e in (*train, *holdout)]
    least = min(noises) / error_unit(train, units)
    rounding = _rounding(train, holdout)
    settings = replace(
        settings,
        tolerance=max(settings.tolerance, _HIDDEN * least),
        # The error of rounding follows the motion: it is none of the model's.
        error_scale=float(np.hypot(settings.error_scale, rounding)),
    )
    context, whole = (
        Context(fitted, HoldOut(fitted, held, units, settings.tolerance), settings, units, course)
        for fitted, held in ((train, holdout), everything)
    )
    part, all_of_it = (*train, *holdout), (*everything[0], *everything[1])
    # Matrices are tall and narrow: a second thread of theirs would only wait in the way of the simulations.
    with single_algebra():
        in_part = any(a is not b for a, b in zip(part, all_of_it, strict=True))
        return _closed(context, whole if in_part else context, course)


def _given(train: Recordings, holdout: Recordings | None) -> tuple[tuple[Experiment, ...], tuple[Experiment, ...]]:
    """Return what is fitted and what judges, the inputs of a data set made smooth as it says or as suits them."""
    fitted = training_of(train)
    if not isinstance(train, Dataset):
        return fitted, held_out_of(fitted, holdout)
    held_out_of(train, holdout)
    train = choose_interpolation(train)
    return train.train, held_out_of(train, holdout)


def _rounding(train: Sequence[Experiment], holdout: Sequence[Experiment]) -> float:
    """Return the largest error of rounding of any channel [noise sds of training]."""
    rounding = [[resolution(column, e.recording.time) for column in e.recording.output.T] for e in (*train, *holdout)]
    return float(np.max(np.max(rounding, axis=0) / np.min([e.recording.noise for e in train], axis=0)))


def _closed(context: Context, whole: Context, course: Course) -> LoopResult:
    """Return what the loop finds on the recordings of a context, its two models fitted to the whole of them."""
    context.progress("refitting the declared model")
    before, context, whole = in_its_units(first_fit(context.train, context.units), context, whole)
    before = sought(before, context)
    doubted = impossible(flag for e in (*context.train, *context.judge.separate) for flag in e.recording.flags)
    before, search = _searching(before, context, led=not doubted)
    if (left := variance_left(before.problem, before.chi2)) > _MOST:
        search.decisions.append(Decision("declare", (), False, "astray", {"left": left}))
    if doubted:
        # What explains readings in another unit is none of the system's effects.
        search.decisions.append(Decision("stop", (), True, "impossible"))
    else:
        with course.searching(lambda: len(search.offers), context.settings.budget.offers):
            search.run()
    best, geometry, steps = _on_best_mechanics(before, search, context)
    # On steps that shift no estimate a set may predict otherwise than it did in the search.
    after, last = finished(settled(best, context), context)
    first = last if _is_one_model(best.model, before.model) else _declared(before, context)
    if best is search.best and (confirmed := search.confirmed(last, first)) is not last:
        after, last = finished(settled(confirmed, context), context)
    found = {n.effect: n for n in named(search)}
    after = without_bent(after, found)
    complete = not doubted and is_complete(last, search.root, context)
    if _is_one_model(after.model, before.model):
        before, first = after, last  # one model has one estimate
    elif first.chi2 < before.chi2:
        before, first = finished(settled(first, context), context)
    contradiction = contradiction_of(after, search, context, complete=complete)
    manoeuvres = separations(search, found, context)
    if whole is not context:
        context.progress("fitting the whole of the recordings")
        before, after = (
            fitted_to_all(f, c.evidence.error, f.problem.bench.of_others(whole.train))
            for f, c in ((before, first), (after, last))
        )
    result = _result(whole, search, found, (before, first), (after, last), (geometry, steps), complete=complete)
    return replace(result, contradiction=contradiction, separations=manoeuvres)


def _start(before: Fit, context: Context) -> Fit:
    """Return the fit to which effects are added: an arm's on its exact mechanics."""
    first = context.train[0]
    if first.system.has_rod:
        context.progress("refitting on the exact mechanics of the arm")
        known = {n: v for n, v in before.values.items() if n in ("alpha", "xi")}
        return context.fit(before.model.on_base(_EXACT), known, rig_uncertainty(first))
    if before.problem.bench.effects == context.kernel_effects(before.model):
        return before
    return context.fit(before.model, before.values, before.problem.gaussian)


def _searching(before: Fit, context: Context, *, led: bool) -> tuple[Fit, Search]:
    """Return the declared model's fit and the search from it, once `led` to where the likeliest candidate leads it.

    What lowers its minimum is not lacking. An arm is not led: its exact mechanics begin at its estimate.
    """
    search = Search(_start(before, context), context)
    if not led or context.train[0].system.has_rod or (lower := search.neighbours.lower()) is search.root:
        return before, search
    try:
        before = context.fit(before.model, lower.refit.values, before.problem.gaussian)
    except ComputationError:  # on steps of its own it may blow up there
        return before, search
    return before, Search(before, context)


def _is_one_model(one: Model, other: Model) -> bool:
    """Return whether two models have the same mechanics and effects."""
    return (one.base, one.effects) == (other.base, other.effects)


def _declared(before: Fit, context: Context) -> Contender:
    """Return the declared model as a contender."""
    return contenders(context, [((), Refit("", before.problem, before.minimum))])[0]


def _on_best_mechanics(
    before: Fit, search: Search, context: Context
) -> tuple[Contender, tuple[str, ...], list[Decision]]:
    """Return the set found on the mechanics with the highest evidence, the steps to it, and why."""
    if not context.train[0].system.has_rod:
        return search.best, (), []
    context.progress("comparing mechanics")
    bases = ["constant_radius", *(step.base for step in UPGRADES.values())]
    answers = at_once([partial(_with_base, base, before, search, context) for base in bases], threads=THREADS)
    best, geometry, steps = answers[0], [], []
    for name, other in zip(UPGRADES, answers[1:], strict=True):
        gain = -np.inf if other is None else other.joint - (-np.inf if best is None else best.joint)
        accepted = bool(gain >= context.settings.nats)
        numbers = {"odds": float(gain)} if np.isfinite(gain) else {}
        steps.append(Decision("mechanics", (name,), accepted, "accepted" if accepted else "training", numbers))
        if accepted and other is not None:
            best = other
            geometry.append(name)
    return best or search.best, tuple(geometry), steps


def _with_base(base: str, before: Fit, search: Search, context: Context) -> Contender | None:
    """Return the set that was found on other mechanics; None where it blows up there."""
    if base == _EXACT:
        return search.neighbours.unapproximated(search.best)
    added = search.best.added
    declared = before.model.without([e for e in before.model.effects if e in search.offers.given_up])
    model = declared.with_effect(*[e for e in added if e not in declared.effects]).on_base(base)
    values = {n: v for n, v in search.best.refit.values.items() if "[" not in n and n in model.parameters}
    fitted = context.fit(model, values, {}) if added or base != before.model.base else before
    return contenders(context, [(added, Refit("", fitted.problem, fitted.minimum))])[0]


def _result(
    context: Context, search: Search, found: Mapping[str, Named], before: tuple[Fit, Contender],
    after: tuple[Fit, Contender], mechanics: tuple[tuple[str, ...], list[Decision]], *, complete: bool,
) -> LoopResult:  # fmt: skip
    train, judge = context.train, context.judge
    geometry, steps = mechanics
    fits = {"before": before[0], "after": after[0]}
    on_train = {when: f.predict() for when, f in fits.items()}
    held = {when: judge.held(f, on_train[when]) for when, f in fits.items()}
    reports = {when: examine(train, p, context.period) for when, p in on_train.items()}
    verdict = verdict_of(search.best.added, geometry, complete=complete)
    lead, law = (None, None) if complete else leads(search, found)
    return LoopResult(
        verdict=verdict,
        declared=before[0].model.effects,
        added=(*geometry, *search.best.added),
        named=found,
        before=before[0],
        after=after[0],
        steps=(*steps, *search.decisions),
        errors=loop_errors(context, on_train, held),
        model_error=ModelErrorReport.of(context, search.root, before[1], after[1], reports["after"]),
        lead=lead,
        residual_before=reports["before"],
        residual_after=reports["after"],
        predictions={w: on_train[w] if judge.continued else [*on_train[w], *held[w]] for w in fits},
        complete=complete,
        recordings=tuple(e.recording for e in (*train, *judge.separate)),
        lead_law=law,
    )
