"""Steps of unequal length, where only some moments of a motion ask for short ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.optimize import brentq

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.step import Probe, choose_step
from discovery.foundation.arrays import FloatArray
from discovery.foundation.workers import at_once
from discovery.recordings.experiment import Experiment
from discovery.simulation.pace import Pace
from discovery.simulation.simulate import THREADS

#: Equal steps that are longer than this part of the longest ones are kept,
_ENOUGH = 0.7
#: and so they are if unequal ones are more than this part of them.
_FEWER = 0.8
#: Parts of a recording whose steps have one length, a neighbour's if that is shorter: other sets move otherwise.
_PARTS, _NEIGHBOURS = 48, 1
#: What a part adds is measured on steps so many times longer: quicker, and of the order that follows.
_COARSE = 4.0
#: The error of one step is of this order, that of all of them of one less.
_ORDER = 5
#: Of the parts' errors some cancel, and coarse steps foretell them roughly: lengths are tried so often at most, until
#: the error is between this part of the tolerance and all of it; each time it shall become this part,
_ROUNDS, _FAR_BELOW, _AIM = 3, 0.5, 0.7
#: and change by this factor at most.
_MOST = 16.0


def unequal_bench(
    model: Model,
    effects: Sequence[str],
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    tolerance: float,
) -> Bench:
    """Return a bench whose trajectory error is at most a tolerance, on unequal steps where these are far fewer.

    A violent moment of an arm asks for short steps where it is, the rest of a recording for steps that are stable. The
    steps of other systems cost little, and their input asks for short ones everywhere.

    Parameters
    ----------
    model, effects, experiments, units, values, tolerance
        As for `discovery.estimation.step.choose_step`.

    Raises
    ------
    ComputationError
        If no step reaches the tolerance.
    """
    step = choose_step(model, experiments, units, values, tolerance, effects)
    probe = Probe.of(model, effects, units, values)
    longest = probe.longest(experiments)
    best = equal = probe.bench(experiments, step)
    if step > _ENOUGH * longest or not experiments[0].system.has_rod:
        return equal
    parts = _measured(probe, experiments, min(_COARSE * step, longest))
    if not 0 < parts.errors.max() < np.inf:
        # Half of what was to be tried blows up already.
        return equal
    shares = parts.shares(step / longest)
    for _ in range(_ROUNDS):
        unequal = probe.bench(parts.paced(shares), longest)
        error = probe.error(unequal)
        if error <= tolerance:
            best = unequal
        if _FAR_BELOW * tolerance < error <= tolerance or (error > tolerance and best is not equal):
            break
        change = float(np.clip(_AIM * tolerance / max(error, np.finfo(float).tiny), 1 / _MOST, _MOST))
        shares = np.minimum(1.0, shares * change ** (1 / (_ORDER - 1)))
    return best if best.cost < _FEWER * equal.cost else equal


@dataclass(frozen=True)
class _Parts:
    """What each part of some recordings adds to the error of their readings.

    Parameters
    ----------
    experiments : sequence of Experiment
        The recordings.
    edges : list of ndarray, shape (parts + 1,)
        Where the parts of each begin and end [s].
    errors : ndarray, shape (parts of all,)
        Error of a part on steps of some length, per second.
    """

    experiments: Sequence[Experiment]
    edges: list[FloatArray]
    errors: FloatArray

    def shares(self, equal: float) -> FloatArray:
        """Return the lengths of steps in every part, as shares of the longest, that err as much as equal ones.

        With errors e h^4 a second on steps of length h, the fewest steps of a given sum of errors have lengths in
        proportion to e^(-1/5), here none of them above one.
        """
        lasting = np.concatenate([np.diff(edges) for edges in self.edges])
        e = np.maximum(self.errors / self.errors.max(), np.finfo(float).eps)
        goal = np.sum(lasting * e) * equal ** (_ORDER - 1)

        def shares(scale: float) -> FloatArray:
            return np.minimum(1.0, np.exp(scale) * e ** (-1 / _ORDER))

        def excess(scale: float) -> float:
            return float(np.log(np.sum(lasting * e * shares(scale) ** (_ORDER - 1)) / goal))

        # Lengths that may be above one err as much with the first of these, and with the second all are one.
        lowest = np.log(goal / np.sum(lasting * e ** (1 / _ORDER))) / (_ORDER - 1)
        return shares(brentq(excess, lowest - 1e-9, 0.0))

    def paced(self, shares: FloatArray) -> list[Experiment]:
        """Return the recordings with steps of these shares of the longest."""
        each = zip(self.experiments, self.edges, np.split(shares, len(self.edges)), strict=True)
        return [replace(experiment, pace=Pace.of(edges, own)) for experiment, edges, own in each]


def _measured(probe: Probe, experiments: Sequence[Experiment], step: float) -> _Parts:
    """Return what each part adds to the error of a motion on steps of a length there, half of it elsewhere."""
    found = []
    edges = [np.linspace(e.recording.time[0], e.recording.time[-1], _PARTS + 1) for e in experiments]
    for experiment, own in zip(experiments, edges, strict=True):
        fine = probe.predict(probe.bench([experiment], step / 2))

        def error(part: int, experiment: Experiment, own: FloatArray, fine: list[FloatArray]) -> float:
            shares = np.full(_PARTS, 0.5)
            shares[part] = 1.0
            coarse = probe.bench([replace(experiment, pace=Pace.of(own, shares))], step)
            return probe.apart(probe.predict(coarse), fine, [experiment])

        each = at_once([partial(error, part, experiment, own, fine) for part in range(_PARTS)], threads=THREADS)
        # Where steps of this length blow up in a part alone, they err there by as much as there is.
        errors = np.minimum(each, 1.0 if np.isfinite(fine[0]).all() else np.inf) / np.diff(own)
        found.append(maximum_filter1d(errors, 2 * _NEIGHBOURS + 1))
    return _Parts(experiments, edges, np.concatenate(found))
