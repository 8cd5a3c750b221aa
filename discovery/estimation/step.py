"""The integration step of a fit, from the trajectory error that it causes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.solver_error import Probe
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment

__all__ = ["TOLERANCE", "choose_step"]

#: Trajectory error by default: rad for an arm, of the largest amplitude for an oscillator.
TOLERANCE = 1e-6
#: After so many attempts that gained less than a decade there is no convergence;
_PATIENCE = 4
#: the best step will do if its error is below this.
_USABLE = 1e-2
#: A step whose error is below this part of the tolerance, where a longer one was above it, is made longer to reach this
#: part of it, so often at most.
_FAR_BELOW, _AIM, _LONGER = 0.25, 0.7, 3
#: A step that is so many times longer must not err by more than so many times the tolerance: order four, twice over.
_SPARE, _SPARE_ERROR = 1.25, 5.0


def choose_step(
    model: Model,
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    tolerance: float = TOLERANCE,
    effects: Sequence[str] | None = None,
    shortest: float = 0.0,
) -> float:
    """Return the integration step whose trajectory error is at most `tolerance`, measured against half the step.

    Parameters
    ----------
    model : Model
        The model.
    experiments : sequence of Experiment
        Recordings.
    units : NaturalUnits
        Natural units.
    values : mapping of str to float
        Parameter values at which the error is measured.
    tolerance : float
        Largest error over all samples, unit as for `discovery.estimation.solver_error.Probe.apart`.
    effects : sequence of str, optional
        Effects of the kernel; the model's own by default.
    shortest : float
        Shortest step that is tried, against half of it [s].

    Raises
    ------
    ComputationError
        If no step reaches the tolerance.
    """
    probe = Probe.of(model, effects or model.effects, units, values)
    step = max(probe.longest(experiments), shortest)
    tried: dict[float, float] = {}

    def error(step: float) -> float:
        tried[step] = probe.error(probe.bench(experiments, step))
        return tried[step]

    for _ in range(12):
        if error(step) <= tolerance:
            return _longest(error, step, tried, tolerance)
        finite = [e for e in tried.values() if np.isfinite(e)]
        if len(finite) > _PATIENCE and min(finite) > 0.1 * max(finite):
            break
        # Order four: one adjustment is usually enough; never more than a factor eight at once.
        too_much = tried[step]
        change = float(np.clip(0.9 * (tolerance / too_much) ** 0.25, 0.125, 0.9)) if np.isfinite(too_much) else 0.5
        if step <= shortest:
            break
        step = max(step * change, shortest)
    best = min(tried, key=lambda h: tried[h])
    if tried[best] < _USABLE:
        # Dry friction at a turn, or ringing that is all but chaotic: finer steps do not help, or are not to be tried.
        return best
    raise ComputationError(f"No step gives a trajectory error below {tolerance:g}, not even {min(tried):.3g} s.")


def _longest(error: Callable[[float], float], step: float, tried: Mapping[float, float], tolerance: float) -> float:
    """Return a longer step than one that reaches the tolerance by far, if it reaches it too.

    Parameters
    ----------
    error : callable
        Error of a step, which it adds to `tried`.
    step : float
        The step.
    tried : mapping of float to float
        Errors of the steps so far, from which those between them are foretold.
    tolerance : float
        The tolerance.
    """
    for _ in range(_LONGER):
        known = [h for h, e in tried.items() if h > step and tolerance < e < np.inf]
        if not known or not 0 < tried[step] < _FAR_BELOW * tolerance:
            break
        # Where what rings is not resolved, the error falls in no order of the step.
        order = np.log(tried[min(known)] / tried[step]) / np.log(min(known) / step)
        longer = float(step * (_AIM * tolerance / tried[step]) ** (1 / order))
        if error(longer) > tolerance:
            break
        # Next to a blow-up the error falls in no time: candidates need some of what is left.
        if error(_SPARE * longer) > _SPARE_ERROR * tolerance:
            return max(step, longer / _SPARE)
        step = longer
    return step
