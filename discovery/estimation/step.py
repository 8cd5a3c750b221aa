"""The integration step of a fit, from the trajectory error that it causes, and the measure of that error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.foundation.sampling import median_step
from discovery.foundation.workers import at_once
from discovery.recordings.experiment import Experiment
from discovery.simulation.simulate import THREADS

#: Trajectory error by default: rad for an arm, of the largest amplitude for an oscillator.
TOLERANCE = 1e-6
#: After so many attempts that gained less than a decade there is no convergence;
_PATIENCE = 4
#: the best step will do if its error is below this.
_USABLE = 1e-2
#: What errs by more than so much runs away: shorter steps than so many of all recordings, or of a reading, do not help.
_RUNS_AWAY, _MOST_STEPS, _A_READING = 1e6, 2_000_000, 8
#: No step is tried that is shorter than this part of those, whatever errs: memory would not hold the motion.
_LEAST = 0.25
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

    `values`: parameter values at which the error is measured. `tolerance`: largest error over all samples, unit as for
    `Probe.apart`. `effects`: effects of the kernel; the model's own by default. `shortest`: shortest step that is
    tried, against half of it [s]. Raises ComputationError if no step reaches the tolerance.
    """
    probe = Probe.of(model, effects or model.effects, units, values)
    readings = sum(e.recording.time.size for e in experiments)
    duration = sum(float(np.ptp(e.recording.time)) for e in experiments)
    hopeless = duration / max(_MOST_STEPS, _A_READING * readings)
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
        if step <= shortest or step * change < hopeless * (_LEAST if too_much < _RUNS_AWAY else 1.0):
            break
        step = max(step * change, shortest)
    best = min(tried, key=lambda h: tried[h])
    if tried[best] < _USABLE:
        # Dry friction at a turn, or ringing that is all but chaotic: finer steps do not help, or are not to be tried.
        return best
    raise ComputationError(f"No step gives a trajectory error below {tolerance:g}, not even {min(tried):.3g} s.")


def _longest(error: Callable[[float], float], step: float, tried: Mapping[float, float], tolerance: float) -> float:
    """Return a longer step than one that reaches the tolerance by far, if it reaches it too.

    `error`: error of a step, which it adds to `tried`. `tried`: errors of the steps so far, from which those between
    them are foretold.
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


def error_unit(experiments: Sequence[Experiment], units: NaturalUnits) -> float:
    """Return what a reading off by one unit of the trajectory error is off: see `Probe.apart`."""
    return units.length if experiments[0].system.has_rod else units.read


@dataclass(frozen=True)
class Probe:
    """One motion of a model, at which the error of steps is measured."""

    model: Model  # the model, parameters that are not free known
    effects: tuple[str, ...]  # effects of the kernel
    units: NaturalUnits
    values: Mapping[str, float]  # parameter values, such that the motion has a converged solution

    @classmethod
    def of(cls, model: Model, effects: Sequence[str], units: NaturalUnits, values: Mapping[str, float]) -> Probe:
        """Return the motion at some values, calmed where the mechanics ask for it."""
        values = model.mechanics.calmed(values)
        held = {n: v for n, v in values.items() if n in model.parameters and n not in model.free}
        return cls(Model(model.base, model.effects, {**model.known, **held}), tuple(effects), units, values)

    def longest(self, experiments: Sequence[Experiment]) -> float:
        """Return the longest step that the method stands where the motion is small [s]."""
        alpha = self.values.get("alpha", self.units.time**-2)
        fastest = np.sqrt(abs(alpha)) * self.model.mechanics.highest_frequency({**self.model.known, **self.values})
        gap = median_step(experiments[0].recording.time)
        # An input with content up to half the sampling rate must be resolved too.
        rough = experiments[0].drive is not None and not experiments[0].system.has_rod
        # The method is stable up to 2.8 / fastest; damping and candidates need some of that.
        return float(min(2.0 / fastest, 0.1 * self.units.time, gap if rough else np.inf))

    def bench(self, experiments: Sequence[Experiment], step: float) -> Bench:
        """Return a bench of some recordings with steps of a length [s]."""
        return Bench(self.model.base, self.effects, experiments, step)

    def predict(self, bench: Bench) -> list[FloatArray]:
        """Return simulated channels of every recording of a bench, each (n, c)."""
        problem = Problem(self.model, bench, self.units, {})
        return problem.predict(problem.start(self.values))

    def apart(self, one: Sequence[FloatArray], other: Sequence[FloatArray], experiments: Sequence[Experiment]) -> float:
        """Return the largest distance of two predictions over all samples, infinite where one blows up.

        In rad for an arm (its readings divided by the length), in the natural coordinate for an oscillator.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            distances = [
                float(np.linalg.norm((a - b) * e.recording.worth, axis=1).max())
                for a, b, e in zip(one, other, experiments, strict=True)
            ]
        worst = max(distances) / error_unit(experiments, self.units)
        return worst if np.isfinite(worst) else np.inf

    def error(self, bench: Bench) -> float:
        """Return the trajectory error on the steps of a bench, measured against half of them; unit as for `apart`."""
        both = [partial(self.predict, each) for each in (bench.finer(2), bench)]
        fine, coarse = at_once(both, threads=THREADS)
        # A sixteenth of it the finer solve still has.
        return 16 / 15 * self.apart(coarse, fine, bench.experiments)
