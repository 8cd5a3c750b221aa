"""How far the steps of a simulation lead from the exact motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.foundation.sampling import median_step
from discovery.foundation.workers import at_once
from discovery.recordings.experiment import Experiment
from discovery.simulation.simulate import THREADS

__all__ = ["Probe", "error_unit"]

FloatArray = NDArray[np.float64]


def error_unit(experiments: Sequence[Experiment], units: NaturalUnits) -> float:
    """Return what a reading off by one unit of the trajectory error is off: see `Probe.apart`."""
    return units.length if experiments[0].system.has_rod else units.read


@dataclass(frozen=True)
class Probe:
    """One motion of a model, at which the error of steps is measured.

    Parameters
    ----------
    model : Model
        The model, parameters that are not free known.
    effects : tuple of str
        Effects of the kernel.
    units : NaturalUnits
        Natural units.
    values : mapping of str to float
        Parameter values, such that the motion has a converged solution.
    """

    model: Model
    effects: tuple[str, ...]
    units: NaturalUnits
    values: Mapping[str, float]

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
            distances = [float(np.linalg.norm(a - b, axis=1).max()) for a, b in zip(one, other, strict=True)]
        worst = max(distances) / error_unit(experiments, self.units)
        return worst if np.isfinite(worst) else np.inf

    def error(self, bench: Bench) -> float:
        """Return the trajectory error on the steps of a bench, measured against half of them; unit as for `apart`."""
        both = [partial(self.predict, each) for each in (bench.finer(2), bench)]
        fine, coarse = at_once(both, threads=THREADS)
        # A sixteenth of it the finer solve still has.
        return 16 / 15 * self.apart(coarse, fine, bench.experiments)
