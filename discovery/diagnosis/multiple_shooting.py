"""The motion beside a fitted run, as a chain of short steps that are computed side by side: multiple shooting.

The steps of the slow model are corrected so that without a force they lead along the fitted run itself, ringing and
all; what counts is how they answer to a force. The state at every cut is unknown and Newton's method closes the chain,
so a whole recording costs as much as a few steps (Bock, Numerical Treatment of Inverse Problems in Differential and
Integral Equations (1983) 95).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline

from discovery.declarations.effect import Mode, Sensor
from discovery.diagnosis.slow_model import Law, SlowModel
from discovery.estimation.problem import Problem, values_of
from discovery.foundation.arrays import FloatArray
from discovery.recordings.experiment import Experiment
from discovery.simulation.simulate import Simulator, check_finite

#: Relative size of the differences that give derivatives.
_SMALL = 1e-6
#: Cuts are at most this many median sampling intervals apart: gaps are bridged by more of them.
_LONGEST = 1.5
#: Longest step [natural times].
_STEP = 0.12


@dataclass(frozen=True)
class Linearised:
    """How the end of every step changes: with the state at its start, shape (m, 2, 2), and with the force.

    The force (2, m, 2) is that at the start and at the end of the step, linear between them. The defect (m, 2) is by
    how much the end of the step misses the next cut.
    """

    transition: FloatArray
    force: FloatArray
    defect: FloatArray


class Chain:
    """The motion beside a fitted run of one recording, cut at its samples and at the kinks of its input.

    `problem`: model, natural units, and the effects of its kernel. `values`: parameters of the model. `start`
    (2 + own,): initial deflection and rate of the fitted run, and what the recording has of its own, see `Bench`.
    Raises SimulationFailure if the fitted run blows up.

    It has the cuts `time` (m + 1,) [s], which of them is seen in each sample, `at` (n,), the fitted run at the cuts,
    `run` (2, m + 1), and what the instrument reports of it, `reading` (n, c).
    """

    def __init__(
        self, problem: Problem, values: Mapping[str, float], experiment: Experiment, start: FloatArray
    ) -> None:
        own = {**dict(zip(problem.bench.own, start[2:].tolist(), strict=True)), **dict(experiment.recording.constants)}
        known = {**problem.model.known, **values, **own}
        start = start[:2]
        self.slow, self.experiment = SlowModel(problem.model, problem.units, known), experiment
        recorded = experiment.recording.time
        seen = np.round(recorded - self.slow.lateness(recorded), 9)
        self.time = self._cuts(seen)
        self.at = np.searchsorted(self.time, seen)
        self._lengths = np.diff(self.time)
        self._steps = max(1, int(np.ceil(self._lengths.max() / (_STEP * problem.units.time) - 1e-9)))
        self._stage_drive = self._evaluate_stages()
        self._drive = self._evaluate(self.time)
        self._correction: FloatArray | float = 0.0
        self._offset: FloatArray | float = 0.0
        self.reading, self._motion = self._fitted(problem, known, start)
        self.run = self.slow.coordinates(self._motion, self._drive)
        if self.slow.reduced and "alpha" in self.slow.program.parameters:
            self._calibrate()
        self._correction = self._misses()
        self._offset = self.reading - self.channels(self.run)

    def _cuts(self, seen: FloatArray) -> FloatArray:
        kinks = np.empty(0) if self.experiment.drive is None else np.asarray(self.experiment.drive.kinks, float)
        cuts = np.unique(np.round(np.concatenate([seen, kinks[(kinks > seen[0]) & (kinks < seen[-1])]]), 9))
        gaps = np.diff(cuts)
        pieces = np.ceil(gaps / (_LONGEST * np.median(gaps))).astype(int)
        inner = [np.linspace(a, a + g, n, endpoint=False) for a, g, n in zip(cuts[:-1], gaps, pieces, strict=True)]
        return np.round(np.concatenate([*inner, cuts[-1:]]), 9)

    def _evaluate(self, time: FloatArray, side: str = "right") -> FloatArray:
        drive = self.experiment.drive
        return np.zeros((3, time.size)) if drive is None else drive.evaluate(time, side=side)  # type: ignore[arg-type]

    def _evaluate_stages(self) -> FloatArray:
        """Return the input at begin, middle and end of every inner step, shape (2 steps + 1, 3, m)."""
        fractions = np.arange(2 * self._steps + 1) / (2 * self._steps)
        found = [self._evaluate(self.time[:-1] + f * self._lengths) for f in fractions[:-1]]
        return np.array([*found, self._evaluate(self.time[1:], "left")])

    def _fitted(self, problem: Problem, known: Mapping[str, float], start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the reading (n, c) of the fitted run, and the true angle, or output, with its rate (2, m + 1)."""
        bench, recording = problem.bench, self.experiment.recording
        sensors = [p.name for e in problem.model.terms if isinstance(e, Sensor | Mode) for p in e.parameters()]
        blind = {n: v for n, v in known.items() if n not in sensors}
        at = np.unique(np.concatenate([[recording.time[0]], self.time[self.time > recording.time[0]]]))
        found = []
        for time, values in ((recording.time, known), (at, blind)):
            drive, pace = self.experiment.drive, self.experiment.pace
            steps = partial(Simulator, step=bench.step, pace=pace, at_rest=recording.at_rest)
            simulate = steps(bench.base, bench.effects, time, drive)
            column = values_of(simulate.names, bench.base, bench.effects, problem.units, values)[:, None]
            reading = simulate(column, start[:1], start[1:])
            check_finite(reading, time, simulate.names, column)
            found.append(reading)
        true = found[1][:, :, 0]
        position = true[:, 0]
        if self.experiment.system.has_rod:
            motor = self._evaluate(at)[0]
            position = motor + np.angle((true[:, 0] + 1j * true[:, 1]) * np.exp(-1j * motor))
        curve = CubicSpline(at, position)
        return self.experiment.channels(found[0])[:, :, 0], np.stack([curve(self.time), curve(self.time, 1)])

    def _misses(self) -> FloatArray:
        """Return by how much the steps along the fitted run miss it, shape (2, m)."""
        return self.run[:, 1:] - self.advance(self.run[:, :-1], np.zeros((2, self._lengths.size)))

    def _calibrate(self) -> None:
        """Adjust the stiffness so that the slow base misses the fitted run least: it then swings as fast."""
        k = self.slow.program.parameters.index("alpha")
        before, alpha = self._misses()[1], self.slow.parameters[k]
        self.slow.parameters[k] *= 1 + _SMALL
        change = (self._misses()[1] - before) / _SMALL
        self.slow.parameters[k] = alpha * (1 - float(change @ before) / float(change @ change))

    def advance(self, states: FloatArray, force: FloatArray, law: Law | None = None) -> FloatArray:
        """Return the end of every step (2, m).

        States (2, m) are those at the start of every step, forces (2, m) those at its start and its end [s^-2 q]; a law
        is a force that depends on the motion, added to them.
        """
        own, lengths = list(self.slow.parameters), self._lengths
        step = lengths / self._steps

        def slopes(stage: int, at: FloatArray) -> FloatArray:
            fraction = stage / (2 * self._steps)
            time, recorded = self.time[:-1] + fraction * lengths, self._stage_drive[stage]
            push = (1 - fraction) * force[0] + fraction * force[1]
            if law is not None:
                push = push + law.force(self.slow.variables(time, recorded, at, law.names))
            found = self.slow.slopes(time, recorded, at, [*own[:-1], push])
            return np.array([np.broadcast_to(f, time.shape) for f in found])

        for k in range(self._steps):
            first = slopes(2 * k, states)
            second = slopes(2 * k + 1, states + 0.5 * step * first)
            third = slopes(2 * k + 1, states + 0.5 * step * second)
            fourth = slopes(2 * k + 2, states + step * third)
            states = states + step / 6 * (first + 2 * second + 2 * third + fourth)
        return states + self._correction

    def linearise(
        self, states: FloatArray, force: FloatArray, law: Law | None = None, *, pushed: bool = True
    ) -> Linearised:
        """Return the derivatives of every step at the states (2, m + 1) and forces (m + 1,) of the cuts.

        Without `pushed`, those by the force are zero.
        """
        start, ends = states[:, :-1], np.array([force[:-1], force[1:]])
        end = self.advance(start, ends, law)
        transition, pushes = [], np.zeros((2, *start.shape))
        for k, size in enumerate(self._changes(states)):
            moved = start.copy()
            moved[k] += size
            transition.append((self.advance(moved, ends, law) - end) / size)
        unit = _SMALL * self.slow.units.coordinate / self.slow.units.time**2
        for k in range(2 if pushed else 0):
            changed = ends.copy()
            changed[k] += unit
            pushes[k] = (self.advance(start, changed, law) - end) / unit
        return Linearised(np.array(transition).transpose(2, 1, 0), pushes.transpose(0, 2, 1), (end - states[:, 1:]).T)

    def _changes(self, states: FloatArray) -> FloatArray:
        """Return changes of the states that give their derivatives."""
        least = 1e-2 * self.slow.units.coordinate / np.array([1.0, self.slow.units.time])
        return _SMALL * np.maximum(np.abs(states).max(axis=1), least)

    def initial(self, start: FloatArray) -> FloatArray:
        """Return the state (2,) at the first cut that differs from the fitted run by a deflection and a rate (2,)."""
        return self.slow.coordinates(self._motion[:, :1] + start[:, None], self._drive[:, :1])[:, 0]

    def channels(self, states: FloatArray) -> FloatArray:
        """Return what the instrument reports in every sample (n, c), for states (2, m + 1)."""
        return self._channels(states[:, self.at])

    def _channels(self, seen: FloatArray) -> FloatArray:
        reading = self.slow.reading(self.experiment.recording.time, self._drive[:, self.at], seen)
        return self.experiment.channels(reading[:, :, None])[:, :, 0] + self._offset

    def sensitivity(self, states: FloatArray) -> FloatArray:
        """Return how the channels change with the state, shape (n, c, 2)."""
        seen = states[:, self.at]
        centre = self._channels(seen)
        found = []
        for k, size in enumerate(self._changes(states)):
            moved = seen.copy()
            moved[k] += size
            found.append((self._channels(moved) - centre) / size)
        return np.stack(found, axis=2)

    def along(self, states: FloatArray) -> dict[str, FloatArray]:
        """Return the variables of `SlowModel.variables` at every cut, for states (2, m + 1)."""
        return self.slow.variables(self.time, self._drive, states)
