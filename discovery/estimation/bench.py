"""Simulators of several recordings that many problems share, and the residuals that they leave."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, partial

import numpy as np

from discovery.estimation.start_values import own_parameters
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.experiment import Experiment
from discovery.simulation import simulate
from discovery.simulation.kernel.compile import leaps
from discovery.simulation.runge_kutta import CLASSICAL, dormand_prince
from discovery.simulation.simulate import Batch, Misses, Simulator, classical_step

#: Residuals are simulated in pieces of about this many numbers, so that memory stays bounded.
_PIECE = 4e7
#: Residuals at once that stay in the cache.
_CACHED = 4e5
#: What the kernel makes of the tip position, see `discovery.simulation.simulate.Misses`.
_CHANNELS: dict[tuple[str, ...], int] = {("tip_angle",): 1, ("tip_deflection",): 2}


class Bench:
    """Simulators of one base with a common set of effects on all experiments: many problems share them.

    `base`: name of the base. `effects`: every effect that any problem on this bench may use. `step`: longest
    integration step of the classical method [s]; the pace of an experiment makes some shorter. `leap`: longest step of
    the method of order eight [s]. It replaces the classical one where the terms suit it.
    """

    def __init__(
        self,
        base: str,
        effects: Sequence[str],
        experiments: Sequence[Experiment],
        step: float,
        leap: float | None = None,
    ) -> None:
        self.base, self.effects, self.experiments, self.step = base, tuple(effects), tuple(experiments), step
        self.leap = leap if leap is not None and leaps(base, self.effects) else None
        self._whole = [self._simulator(e) for e in experiments]
        self._parts = [e.fitted_part for e in self.experiments]
        #: To the last fitted samples.
        self.simulators = [
            whole.until(part.recording.time.size) for part, whole in zip(self._parts, self._whole, strict=True)
        ]
        self.names = self.simulators[0].names
        #: Parameters of which every experiment has its own value, in the rows of its start after deflection and rate.
        self.own = own_parameters(self.base, self.effects, self.names)
        self._own_rows = [self.names.index(n) for n in self.own]
        self._weights = [np.ascontiguousarray(e.weights()) for e in self._parts]
        self._targets = [
            np.ascontiguousarray(np.where(w > 0, e.recording.output, 0.0))
            for e, w in zip(self._parts, self._weights, strict=True)
        ]
        #: What the kernel compares readings with: a view passes a filter first.
        self._compared = [
            Misses(_CHANNELS.get(e.recording.channels, 0), target, weight)
            if e.rig.view is None
            else Misses(0, np.zeros_like(target), np.ones_like(weight))
            for e, target, weight in zip(self._parts, self._targets, self._weights, strict=True)
        ]

    def _simulator(self, e: Experiment) -> Simulator:
        longest, method = (self.step, CLASSICAL) if self.leap is None else (self.leap, dormand_prince())
        steps = partial(Simulator, step=longest, method=method, pace=e.pace, at_rest=e.recording.at_rest)
        return steps(self.base, self.effects, e.recording.time, e.drive)

    @classmethod
    def like(cls, other: Bench, step: float) -> Bench:
        """Return the same bench with another step; leaps change in proportion."""
        leap = None if other.leap is None else other.leap * step / other.step
        return cls(other.base, other.effects, other.experiments, step, leap)

    def finer(self, times: float) -> Bench:
        """Return the same bench on steps so many times shorter."""
        return Bench.like(self, self.step / times)

    def of_others(self, experiments: Sequence[Experiment]) -> Bench:
        """Return the bench of other recordings, whose motions are not known: on the shortest steps of these."""
        return Bench(self.base, self.effects, experiments, self.shortest)

    def predict(self, parameters: FloatArray, initial: FloatArray, some: slice = slice(None)) -> list[FloatArray]:
        """Return simulated channels of every experiment, or of `some`, to the end of its recording, each (n, c, k).

        `parameters` (p, k): in the order of `names`. `initial` (experiments, 2 + own, k): initial deflection and rate
        in every experiment, and the values of `own`.
        """
        runs = zip(self._whole[some], self.experiments[some], initial[some], strict=True)
        asked = [s.asked(*self.started(parameters, e, own)) for s, e, own in runs]
        read = simulate.simulated(asked)
        return [e.channels(out) for e, (out, _) in zip(self.experiments[some], read, strict=True)]

    def residuals(
        self, parameters: FloatArray, initial: FloatArray, motions: Sequence[FloatArray] | None = None
    ) -> FloatArray:
        """Return (prediction - measurement) / noise to the last fitted samples, zero in gaps, shape (n, k).

        A trial that blows up is infinite throughout. Where all trials share the `motions`, they are read only.
        """
        pieces = [
            self._residuals(parameters[:, part], initial[:, :, part], motions)
            for part in self.pieces(parameters.shape[1])
        ]
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=1)

    def motions(self, parameters: FloatArray, initial: FloatArray) -> list[FloatArray]:
        """Return how a first parameter set moves in every experiment, for `residuals`."""
        batches = self._batches(parameters[:, :1], initial[:, :, :1])
        return [simulator.motion(batch) for simulator, batch in zip(self.simulators, batches, strict=True)]

    def classical_step(self, parameters: FloatArray, initial: FloatArray) -> float:
        """Return the shortest step that the classical method needs where the simulators' may be longer [s]."""
        if not self.simulators[0].kernel.program.relaxation:
            return self.shortest
        moved = zip(self.simulators, self.motions(parameters, initial), strict=True)
        return min(self.shortest, *(classical_step(s.kernel.program, s.grid, m, parameters[:, 0]) for s, m in moved))

    def moves_alike(self, parameters: FloatArray) -> BoolArray:
        """Return which parameter sets (p, k) move as the first one does: they differ in what is read at most."""
        moving = np.isin(self.names, list(self.simulators[0].kernel.program.moving))
        return (parameters[moving] == parameters[moving, :1]).all(axis=0)

    def chi2(self, parameters: FloatArray, initial: FloatArray) -> FloatArray:
        """Return the sum of squared residuals of every experiment, shape (experiments, k), infinite for a blow-up.

        Nothing is stored on the way, but for a view, whose filter needs the residuals: of a few sets at a time.
        """
        viewed = any(e.rig.view is not None for e in self.experiments)
        parts = self.pieces(parameters.shape[1], _CACHED) if viewed else (slice(None),)
        each = [self._chi2(parameters[:, part], initial[:, :, part], viewed=viewed) for part in parts]
        return each[0] if len(each) == 1 else np.concatenate(each, axis=1)

    def _chi2(self, parameters: FloatArray, initial: FloatArray, *, viewed: bool) -> FloatArray:
        answers = simulate.simulated(self._asked(parameters, initial, None), stored=viewed)
        if viewed:
            for i, each in enumerate(answers):
                self._filtered(i, *each)
        sums = [own for _, own in answers]
        found = np.array([own[:-1].sum(axis=0) for own in sums])
        found[:, self._blown(sums)] = np.inf
        return found

    def _batches(self, parameters: FloatArray, initial: FloatArray) -> list[Batch]:
        runs = zip(self.simulators, self.experiments, initial, strict=True)
        return [s.batch(*self.started(parameters, e, own)) for s, e, own in runs]

    def started(
        self, parameters: FloatArray, experiment: Experiment, start: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the parameters (p, k) of one experiment, its deflection and its rate for its start (2 + own, k)."""
        constants = experiment.recording.constants
        if constants or start[2:].any():
            parameters = parameters.copy()
            parameters[self._own_rows] = start[2:]
            for name, value in constants:
                parameters[self.names.index(name)] = value
        return parameters, start[0], start[1]

    def _asked(
        self, parameters: FloatArray, initial: FloatArray, motions: Sequence[FloatArray] | None
    ) -> list[simulate.Asked]:
        shared = [None] * len(self.simulators) if motions is None else motions
        batches = self._batches(parameters, initial)
        return list(zip(self.simulators, batches, self._compared, shared, strict=True))

    def _residuals(
        self, parameters: FloatArray, initial: FloatArray, motions: Sequence[FloatArray] | None
    ) -> FloatArray:
        answers = simulate.simulated(self._asked(parameters, initial, motions))
        sums = [own for _, own in answers]
        found = [self._filtered(i, *each).reshape(-1, parameters.shape[1]) for i, each in enumerate(answers)]
        residuals = found[0] if len(found) == 1 else np.concatenate(found)
        residuals[:, self._blown(sums)] = np.inf
        return residuals

    def _filtered(self, i: int, out: FloatArray, sums: FloatArray) -> FloatArray:
        """Return the residuals of what the kernel gave: the same, but for a view with its low-pass; renew its sums."""
        experiment = self._parts[i]
        if experiment.rig.view is None:
            return out
        with np.errstate(over="ignore", invalid="ignore"):
            residual = (experiment.channels(out) - self._targets[i][:, :, None]) * self._weights[i][:, :, None]
            sums[:-1], sums[-1] = np.einsum("nck,nck->ck", residual, residual), np.abs(residual).max(axis=(0, 1))
        return residual

    def _blown(self, sums: Sequence[FloatArray]) -> BoolArray:
        """Return which trials blew up in any experiment, even where they stay finite to the end, from their sums."""
        good = [np.isfinite(each[:-1]).all(axis=0) & (each[-1] < self._absurd) for each in sums]
        return ~np.logical_and.reduce(good)

    def pieces(self, columns: int, numbers: float | None = None) -> Iterator[slice]:
        """Yield parts of so many columns whose residuals together are about so many numbers, or fit into memory."""
        width = max(64, int((numbers or _PIECE) / max(1, self.n_rows)))
        for first in range(0, columns, width):
            yield slice(first, first + width)

    def blocks(self) -> Iterator[tuple[slice, BoolArray]]:
        """Yield the rows of every recording in a residual, and where its samples (n, c) are fitted and finite.

        They end with the last fitted one.
        """
        first = 0
        for weight in self._weights:
            yield slice(first, first + weight.size), weight > 0
            first += weight.size

    @cached_property
    def _absurd(self) -> float:
        """A hundred times the largest measured value, in noise sds."""
        largest = [float((np.abs(t) * w).max()) for t, w in zip(self._targets, self._weights, strict=True) if w.size]
        return 100 * max([1.0, *largest])

    @property
    def shortest(self) -> float:
        """Shortest step at the pace of these experiments, that of a motion of which no pace is known [s]."""
        return self.step * min((e.pace.least for e in self.experiments if e.pace is not None), default=1.0)

    @property
    def has_rod(self) -> bool:
        """Whether it is of an arm, whose rod rings everywhere; of other systems steps follow the motion."""
        return self.experiments[0].system.has_rod

    @property
    def charge(self) -> int:
        """Steps that count against a limit of work: of an arm those that are taken.

        Of other systems those of a recording whose motion is not known, as if all were as short as the shortest.
        """
        if self.has_rod:
            return self.cost
        return round(max(float(s.grid.steps.sum()) for s in self.simulators) / self.shortest)

    @cached_property
    def seen(self) -> tuple[float, float]:
        """Duration of the longest recording, and the shortest step between readings [s]."""
        times = [e.recording.time for e in self.experiments]
        return max(float(np.ptp(time)) for time in times), min(map(median_step, times))

    @property
    def cost(self) -> int:
        """Steps that the longest fitted recording takes: what a simulation costs."""
        return max(s.grid.steps.size for s in self.simulators)

    @cached_property
    def n_rows(self) -> int:
        """Length of the residual vector, gaps included."""
        return int(sum(w.size for w in self._weights))

    @cached_property
    def n_data(self) -> int:
        """Number of finite fitted samples over all channels."""
        return int(sum((w > 0).sum() for w in self._weights))
