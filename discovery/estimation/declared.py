"""What a rig file declares to be fitted, and its first fit: where guesses lead nowhere, it is led there by parts.

They lead nowhere where the model blows up, and perhaps where it leaves much of the motion or ends at a bound: a free
run over many swings has minima that explain nothing, and what is added to such a fit explains its mistakes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.guess import pushed, restoring
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.physical import stated_inertia
from discovery.estimation.problem import LIGHT_ROD, conventions, known_values
from discovery.estimation.residual import explains
from discovery.foundation.errors import ComputationError, InputError
from discovery.mechanics.systems import declared_base
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment

#: What is known within an uncertainty: mean and standard deviation, by parameter.
Known = Mapping[str, tuple[float, float]]
#: Retardation time of an ordinary rod's material, with its standard deviation [s]: fibre composites lose 0.5 to 1 % of
#: their elastic energy per radian of a vibration at some 50 rad/s, where such a rod rings.
RETARDATION, RETARDATION_SD = 1.5e-4, 1e-4
#: Parts of the recordings that are followed one after the other, and how many readings the first one has at least.
_PARTS, _FEWEST = tuple(2.0**-k for k in range(8, -1, -1)), 64
#: A swing that is lost among n leaves about 2/n of the variance: a fit that leaves less than this has lost none of 20.
_LEFT = 0.1
#: A model that lacks an effect has minima about equally low: only one that leaves less than this part is better.
_BETTER = 0.5
#: Times the standard deviation that is stated, or part of the value, within which the recordings may overrule it.
_WIDE, _PART = 30.0, 1 / 3
#: What leaves less than so many noise variances a reading has no need of another start;
_NOISE = 2.0
#: effects with more declared starts than this are scanned elsewhere; each is followed for so many steps.
_MOST_STARTS, _FOLLOWED = 12, 15
#: A guess says of which size a constant is: one that ends so many times as large, or as small, is of another.
_STRAYED = 10.0


def rig_uncertainty(experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Return mean and sd of what may move: stated constants or inertia, or mass and slight damping of an exact arm.

    It is fitted with this prior and bounded at three standard deviations, so that it cannot swallow an effect.
    """
    rig = experiment.rig
    if rig.system is not None:
        return {n: (c.value, c.sd) for n, c in rig.system.constants.items() if c.sd is not None}
    if not experiment.system.has_rod:
        return {found[0]: found[1:3]} if (found := stated_inertia(experiment)) else {}
    known = {"tau_r": (RETARDATION, RETARDATION_SD), "mu": (LIGHT_ROD, LIGHT_ROD)}
    if rig.beam_mass is not None and rig.tip_mass is not None and rig.beam_mass.value:
        mu = rig.beam_mass.value / rig.tip_mass.value
        spread = np.hypot(rig.beam_mass.sd / rig.beam_mass.value, rig.tip_mass.sd / rig.tip_mass.value)
        known["mu"] = (mu, mu * float(spread))
    return known


def declared_model(experiment: Experiment | Dataset) -> Model:
    """Return the model that the rig file declares, on the base of its kind.

    Parameters
    ----------
    experiment : Experiment or Dataset
        A recording of the rig, or a data set.

    Raises
    ------
    InputError
        For anything else than an experiment, such as the rig alone: a recording says whether there is an input. If a
        law of an angle is declared for an output in another unit.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> declared_model(data).effects
    ('viscous_damping', 'linear_stiffness')
    """
    if isinstance(experiment, Dataset):
        experiment = experiment.train[0]
    if not isinstance(experiment, Experiment):
        raise InputError(
            f"The declared model is that of an Experiment, not of a {type(experiment).__name__}; make one with "
            "`make_experiment(recording, rig)`, or take one of `load_dataset(rig_path, recordings).train`."
        )
    unit = experiment.coordinate_unit
    for law in map(get_effect, experiment.rig.declared):
        # Whether a place is an angle its declaration says, whatever is read.
        if law.angular and not (law.place or experiment.system.has_rod) and unit != "rad":
            raise InputError(f"Effect {law.id()} needs an angle in rad, but the coordinate is in {unit}.")
    return Model(experiment.rig.base, tuple(experiment.rig.declared), known_values(experiment))


def first_fit(experiments: Sequence[Experiment], units: NaturalUnits) -> Fit:
    """Fit the model that the rig file declares, wherever its guesses lead.

    A fit that leaves much of the motion, or that a bound stops, is tried again along growing parts of the recordings,
    and the other one is returned if it leaves less than half. So is one that is free of a constant that is stated.

    `experiments`: recordings to fit. Raises ComputationError if the model blows up from its guesses, and cannot be led
    to the end of the recordings either.
    """
    model = declared_model(experiments[0])
    gaussian = {} if experiments[0].system.has_rod else rig_uncertainty(experiments[0])
    try:
        found = fit(model, experiments, units=units, gaussian=gaussian)
    except ComputationError:
        again = _led_fit(model, experiments, units, gaussian)
        if again is None:
            raise
        return _freed(again, experiments)
    if _is_doubtful(found) and (told := pushed(model, experiments, units)):
        found = _better(found, _fit_from(told, model, experiments, units, gaussian))
    if _is_doubtful(found):
        found = _better(found, _led_fit(model, experiments, units, gaussian))
    found = _better(found, _begun_elsewhere(found, experiments), part=1.0)
    found = _better(found, _from_elsewhere(found, experiments))
    return _freed(_overruled(found, experiments), experiments)


def _overruled(found: Fit, experiments: Sequence[Experiment]) -> Fit:
    """Return a fit without what is stated of constants where it leaves less than half; the one found where none does.

    They are those that end at their bounds, three standard deviations from what is stated. The one without which least
    is left is then known within as much as it moved by, and others are tried beside it.
    """
    model, units, known = found.model, found.problem.units, dict(found.problem.gaussian)
    for _ in known:
        held = [n for n in found.minimum.bound(found.problem.names) if n in known]
        wide = {n: (mean, max(_WIDE * sd, _PART * abs(mean))) for n, (mean, sd) in known.items()}
        freed = {n: _fit_from(found.values, model, experiments, units, {**known, n: wide[n]}) for n in held}
        best = {n: again for n, again in freed.items() if _better(found, again) is again}
        if not best:
            break
        name = min(best, key=lambda n: best[n].chi2)
        known[name] = known[name][0], abs(best[name].values[name] - known[name][0])
        found = _better(found, _fit_from(best[name].values, model, experiments, units, known))
    return found


def _better(found: Fit, again: Fit | None, part: float = _BETTER) -> Fit:
    """Return another fit if it leaves less than a part of what the one found leaves."""
    return again if again is not None and again.chi2 < part * found.chi2 else found


def _from_elsewhere(found: Fit, experiments: Sequence[Experiment]) -> Fit | None:
    """Return the fit from another declared start of one of its effects; None where none promises less than half.

    An amplitude of which nothing is known, as the width of a play, may be off by any factor, and the constants with it:
    they begin at their guesses, and where the first fit ended.
    """
    problem, units = found.problem, found.problem.units
    if found.chi2 < _NOISE * problem.bench.n_data:
        return None
    laws = {p.name: p for p in problem.model.parameters.values() if p.name in problem.free and not p.physical}
    scanned = {*problem.gaussian, restoring(problem.model)}
    starts = [
        {**known, name: value * units.scale(p)}
        for known in ({}, {n: v for n, v in found.values.items() if n not in laws})
        for name, p in laws.items()
        for value in (p.starts if name not in scanned and 1 < len(p.starts) <= _MOST_STARTS else ())
    ]
    return _fit_from_best(starts, found, experiments, _BETTER)


def _begun_elsewhere(found: Fit, experiments: Sequence[Experiment]) -> Fit | None:
    """Return the fit in which a coordinate that is not read begins elsewhere; None where none leaves less."""
    unread = [state for state in found.problem.states if state.believed and not state.still]
    known = {n: v for n, v in found.values.items() if n not in {state.name for state in unread}}
    starts = [{**k, state.name: way * state.width} for k in ({}, known) for state in unread for way in (-1.0, 1.0)]
    return _fit_from_best(starts, found, experiments, 1.0)


def _fit_from_best(
    starts: Sequence[Mapping[str, float]], found: Fit, experiments: Sequence[Experiment], part: float
) -> Fit | None:
    """Return the fit from that start from which least is left; None where that is more than a part of a fit found."""
    problem, first = found.problem, [found.problem.start(values) for values in starts]
    minima = fit_problems([problem] * len(first), first, iterations=_FOLLOWED, tolerance=1e-3, rough=True)
    best = min(minima, key=lambda m: m.cost, default=None)
    if best is None or not 2 * best.cost < part * found.chi2:
        return None
    return _fit_from(problem.named(best.x), found.model, experiments, problem.units, problem.gaussian)


def _freed(found: Fit, experiments: Sequence[Experiment]) -> Fit:
    """Return a fit with what its laws hold by convention free: held, another law would seem to be missing."""
    problem, model = found.problem, found.model
    laws = conventions(model.effects, problem.units)
    held = {n: known for n, known in laws.items() if n not in problem.free and n not in model.known}
    if not held:
        return found
    again = _fit_from(found.values, model, experiments, problem.units, {**problem.gaussian, **held})
    return _better(found, again, part=1.0)


def strayed(found: Fit) -> dict[str, float]:
    """Return the constants of a declared system that end far from their guesses, and by which factor.

    One that vanishes is an answer, but a mass or a length is not.
    """
    problem, model = found.problem, found.problem.model
    base = declared_base(model.base)
    inertial = set() if base is None else {x.name for x in base.equations.kinetic.free_symbols}
    guessed = {n: model.parameters[n] for n in problem.free if n not in problem.gaussian}
    far = {n: found.values[n] / p.default for n, p in guessed.items() if p.physical}
    return {n: x for n, x in far.items() if x > _STRAYED or (n in inertial and x * _STRAYED < 1.0)}


def _is_doubtful(found: Fit) -> bool:
    """Return whether a fit may have ended in a minimum that is not the lowest."""
    problem = found.problem
    if problem.model.mechanics.prescribed:
        # Without a simulated motion there are no swings to lose.
        return False
    held = {*found.minimum.bound(problem.names)}.intersection(problem.free).difference(problem.gaussian)
    stopped = [problem.model.parameters[name] for name in held]
    # A bound at which an effect is absent is an answer like others.
    beside = any(found.values[p.name] != p.default * problem.units.scale(p) for p in stopped)
    return beside or bool(strayed(found)) or not explains(problem, found.chi2, _LEFT)


def _led_fit(model: Model, experiments: Sequence[Experiment], units: NaturalUnits, gaussian: Known) -> Fit | None:
    """Return the fit that is led to the end of the recordings; None where it does not get there."""
    values, part = led(model, experiments, units, gaussian)
    return None if part < 1.0 else _fit_from(values, model, experiments, units, gaussian)


def _fit_from(
    values: Mapping[str, float], model: Model, experiments: Sequence[Experiment], units: NaturalUnits, gaussian: Known
) -> Fit | None:
    """Return the fit from a start; None where there is none from there."""
    try:
        return fit(model, experiments, units=units, gaussian=gaussian, start=values)
    except ComputationError:
        return None


def led(
    model: Model, experiments: Sequence[Experiment], units: NaturalUnits, gaussian: Known
) -> tuple[dict[str, float], float]:
    """Return the values that follow the longest first part of recordings, and which part that is.

    Over a short part no start blows up, and there its values become good enough for a part of twice that length.
    """
    values: dict[str, float] = {}
    followed, step = 0.0, float("inf")
    for part in _PARTS:
        first = [e.beginning(round(part * e.recording.time[e.fitted].size), _FEWEST) for e in experiments]
        try:
            bench = Bench(model.base, model.effects, first, step) if values else None
            found = fit(model, first, units=units, gaussian=gaussian, start=values, bench=bench)
        except ComputationError:
            if values:
                break
            continue
        values, followed, step = found.values, part, found.problem.bench.step
    return values, followed
