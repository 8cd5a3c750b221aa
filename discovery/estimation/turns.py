"""Whether recorded motions turn back: what a law of memory remembers shows only after a reversal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.mechanics.systems import system_base
from discovery.recordings.experiment import Experiment

#: Reversals behind which the motion passes the same places in the same direction again.
_TWICE = 2
#: A reversal goes back by this part of the way between the ends of the motion, and by so many times the noise.
_BACK, _BEYOND = 0.05, 10.0
#: Samples of a path that are looked at.
_SAMPLES = 4_000


def turns_back(experiments: Sequence[Experiment]) -> bool:
    """Return whether the motion of some recording reverses twice, so that it passes the same places once more.

    Where it does not, a memory of the way cannot be told from a law of the place. It is taken to do so where the
    readings do not show the motion of what effects act on: several coordinates, a moved base, an acceleration.

    `experiments`: recordings of one system.
    """
    first = experiments[0]
    base = None if first.rig.system is None else system_base(first.rig.system)
    hidden = base is not None and (base.n_coordinates > 1 or base.input_moves or base.order > 1)
    if first.reads_acceleration or hidden:
        return True
    rate = base is not None and base.order == 1
    return any(_reversals(*_way(e, rate=rate)) >= _TWICE for e in experiments)


def _way(experiment: Experiment, *, rate: bool) -> tuple[FloatArray, float]:
    """Return the fitted positions without gaps, and their noise; those of a body whose rate is read begin at zero."""
    time, read = experiment.recording.time[experiment.fitted], experiment.deflection[experiment.fitted]
    good = np.isfinite(read)
    time, read = time[good], read[good]
    lever = experiment.rig.length.value if experiment.system.has_rod and experiment.rig.length else 1.0
    # What a force is computed from is recorded as an input.
    noise = 0.0 if experiment.rig.view is not None else float(experiment.recording.noise.max()) / lever
    if rate:
        steps = np.diff(time)
        read = np.concatenate([[0.0], np.cumsum(0.5 * (read[1:] + read[:-1]) * steps)])
        noise *= float(np.linalg.norm(steps))
    return read[:: max(1, read.size // _SAMPLES)], noise


def _reversals(way: FloatArray, noise: float) -> int:
    """Return how often a path turns back by more than noise and a small part of it."""
    if way.size == 0:
        return 0
    least = max(_BACK * float(np.ptp(way)), _BEYOND * noise)
    count, heading, low, high = 0, 0, way[0], way[0]
    for x in way.tolist():
        low, high = min(low, x), max(high, x)
        turned = 1 if x > low + least else -1 if x < high - least else 0
        if turned in (0, heading):
            continue
        count += heading != 0
        heading, low, high = turned, x, x
    return count
