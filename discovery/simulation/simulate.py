"""Simulation of many parameter sets at once on recorded input, with a stated accuracy."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from discovery.equations.program import Program
from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.foundation.errors import InputError, SimulationFailure
from discovery.foundation.workers import aside, in_threads
from discovery.mechanics import get_base
from discovery.simulation.grid import DriveLike, Grid, Pace
from discovery.simulation.kernel.compile import Kernel, compile_kernel, numpy_derivative
from discovery.simulation.runge_kutta import CLASSICAL, Method

#: Part of the time in which a state forgets: the method is stable up to 2.8, and right by some tenths of that.
_PART = 1.0


def _threads() -> int:
    """Return the number of threads that DISCOVERY_THREADS asks for; up to eight by default."""
    asked = os.environ.get("DISCOVERY_THREADS")
    if not asked:
        return min(8, os.cpu_count() or 1)
    if not asked.isdecimal() or int(asked) < 1:
        raise InputError(f"The environment variable DISCOVERY_THREADS is {asked!r}; give a whole number from 1 on.")
    return int(asked)


#: Blocks of lanes run in so many threads; the kernel releases the interpreter's lock.
THREADS = _threads()


#: Steps of a free motion go on by this share of a recording where an instrument may be early.
_BEYOND = 0.1
#: Readings beyond this many lengths (or this size) count as blown up.
_LIMIT = 1e9


@dataclass(frozen=True)
class Batch:
    """Parameter sets made ready for the kernel: in whole blocks of lanes, those with the same effects side by side."""

    #: parameters, initial (p, blocks * lanes), (states, blocks * lanes): what the kernel takes.
    parameters: FloatArray
    initial: FloatArray
    order: IntArray  # (k,), which set each column holds; idle lanes at the end repeat the last one
    lanes: int  # parameter sets in one block

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return self.parameters.shape[1] // self.lanes

    def columns(self, block: int) -> IntArray:
        """Return which sets a block holds, idle lanes left out."""
        return self.order[block * self.lanes : (block + 1) * self.lanes]

    def restored(self, values: FloatArray) -> FloatArray:
        """Return what the kernel gave (..., blocks * lanes) in the order of the sets (..., k)."""
        k = self.order.size
        if bool((self.order[1:] > self.order[:-1]).all()):
            return values[..., :k]
        return np.take(values, np.argsort(self.order), axis=-1, mode="clip")


@dataclass(frozen=True)
class Misses:
    """What readings are compared with: weight * (channel - target) at every output time."""

    channel: int  # 0: the readings themselves; 1: the angle of the tip; 2: its distance from the axis of the hub
    #: target, weight (m, c): of every output time and channel.
    target: FloatArray
    weight: FloatArray


class Simulator:
    """Simulates a base with a set of effects on one input, many parameter sets at once.

    `base`: name of the base. `effects`: effect ids; an effect whose parameters are at their defaults is absent. `time`
    (m,): output times [s], increasing, possibly irregular. `drive`: smooth input. `step`: longest step [s]. `method`:
    of the steps, where it suits the terms: `kernel.method` says. `pace`: where steps are shorter. `at_rest`: whether
    nothing moves before the first output, which a late instrument still reads then.
    """

    def __init__(
        self,
        base: str,
        effects: Sequence[str],
        time: FloatArray,
        drive: DriveLike | None,
        *,
        step: float,
        method: Method = CLASSICAL,
        pace: Pace | None = None,
        at_rest: bool = False,
    ) -> None:
        self.base = get_base(base)
        self.kernel: Kernel = compile_kernel(base, tuple(effects), method)
        self.drive = drive
        self.time = np.asarray(time, float)
        self.step, self.pace, self.at_rest = step, pace, at_rest
        self.grid = self._steps()
        self.names = self.kernel.program.parameters
        shape = self.time.size, len(self.kernel.program.reading)
        self._plain = Misses(0, np.zeros(shape), np.ones(shape))

    def refined(self, factor: float = 0.5) -> Simulator:
        """Return the same simulator with steps shortened by `factor`."""
        other = copy(self)
        other.step = self.step * factor
        other.grid = other._steps()
        return other

    def _steps(self) -> Grid:
        # How an input goes on is not known.
        beyond = _BEYOND if self.drive is None and self.kernel.program.lateness != 0 else 0.0
        return Grid.build(self.time, self.drive, self.step, self.kernel.method, self.pace, beyond)

    def until(self, count: int) -> Simulator:
        """Return the same simulator that ends with the first outputs, on the same steps."""
        other = copy(self)
        other.time = self.time[:count]
        other.grid = self.grid.until(count)
        other._plain = Misses(0, self._plain.target[:count], self._plain.weight[:count])
        return other

    def __call__(self, parameters: FloatArray, deflection: FloatArray, rate: FloatArray) -> FloatArray:
        """Simulate.

        `parameters` (p, k): rows in the order of `names`; columns are parameter sets. `deflection`, `rate` (k,):
        initial deflection [q] and its rate [q/s]. Returned (m, r, k): what the instrument reports at the output times;
        not finite where the motion blew up (`check_finite` turns that into an error with parameters and time).
        """
        return simulated([self.asked(parameters, deflection, rate)])[0][0]

    def asked(self, parameters: FloatArray, deflection: FloatArray, rate: FloatArray) -> Asked:
        """Return what `simulated` needs for the readings themselves, see `__call__`."""
        return self, self.batch(parameters, deflection, rate), self._plain, None

    def batch(self, parameters: FloatArray, deflection: FloatArray, rate: FloatArray) -> Batch:
        """Return parameter sets, see `__call__`, made ready for the kernel."""
        k = parameters.shape[1]
        lanes = self.kernel.lanes
        order = self._order(parameters)
        # Idle lanes repeat the last parameter set, so that they can neither overflow nor slow down.
        pad = order[np.minimum(np.arange(-(-k // lanes) * lanes), k - 1)]
        padded = np.ascontiguousarray(parameters[:, pad], float)
        program = self.kernel.program
        q, q_rate = self.base.initial_coordinates(
            np.asarray(deflection, float)[pad],
            np.asarray(rate, float)[pad],
            self.grid.drive[0, 0, :2],
            program.form(padded),
        )
        initial = np.zeros((len(program.states), pad.size))
        initial[: program.n_coordinates] = q
        initial[program.n_coordinates : 2 * program.n_coordinates] = q_rate
        for state, name in program.begun:
            initial[program.states.index(state)] = padded[program.parameters.index(name)]
        return Batch(padded, initial, order, lanes)

    def run(
        self,
        batch: Batch,
        misses: Misses,
        out: FloatArray,
        sums: FloatArray,
        blocks: Sequence[int],
        place: int = 0,
        *,
        motion: FloatArray | None = None,
        plays: bool = False,
    ) -> None:
        """Simulate some consecutive blocks.

        Parameters
        ----------
        batch : Batch
            Parameter sets.
        misses : Misses
            What the readings are compared with.
        out : ndarray, shape (m, c, width)
            Gets the misses, from column `place` on; of shape (0, c, width) where they are not wanted.
        sums : ndarray, shape (c + 1, blocks * lanes)
            Gets the sum of squares of every channel, and the largest magnitude.
        blocks : sequence of int
            Which blocks.
        place : int
            See `out`.
        motion : ndarray, shape (steps, 4 states), optional
            Gets the motion of the first set of the last of these blocks.
        plays : bool
            Whether `motion` is that of all sets instead, which are read only.
        """
        g = self.grid
        before = (g.times, g.steps, g.restart, g.drive, 0.0 if self.at_rest else 1.0)
        grid = (*before, g.out_step, g.out_fraction, g.out_time, g.out_drive)
        given = (misses.channel, misses.target, misses.weight, batch.parameters, batch.initial)
        motion = np.empty((0, 0)) if motion is None else motion
        where = (out, sums, blocks[0], blocks[-1] + 1, place, motion, plays)
        if self.kernel.is_compiled:
            self.kernel.run(*grid, *given, *where)
        else:
            aside(partial(self.kernel.run, *grid, *given, *where))

    def motion(self, batch: Batch) -> FloatArray:
        """Return how the first set moves: states and slopes at both ends of every step, shape (steps, 4 states)."""
        motion = np.empty((self.grid.steps.size, 4 * len(self.kernel.program.states)))
        channels, width = self._plain.target.shape[1], batch.blocks * batch.lanes
        self.run(batch, self._plain, np.empty((0, channels, 1)), np.empty((channels + 1, width)), [0], motion=motion)
        return motion

    def _order(self, parameters: FloatArray) -> IntArray:
        """Return the columns with the same effects present side by side, those with most first."""
        present = self.kernel.switches @ (parameters != 0.0) > 0
        if (present == present[:, :1]).all():
            return np.arange(parameters.shape[1])
        return np.lexsort((*present, -present.sum(axis=0)))


#: A simulator, parameter sets, what their readings are compared with, and the motion that they all share, if they do.
Asked = tuple[Simulator, Batch, Misses, FloatArray | None]


def simulated(asked: Sequence[Asked], *, stored: bool = True) -> list[tuple[FloatArray, FloatArray]]:
    """Simulate on several recordings, blocks of all of them side by side.

    `asked`: one a recording. `stored`: whether the misses are wanted, or their sums only. Returned: of each: misses,
    shape (m, c, k), with no column where they are not stored; the sum of squares of every channel and the largest
    magnitude, shape (c + 1, k).
    """
    found, jobs = [], []
    for i, (_, batch, misses, _) in enumerate(asked):
        (count, channels), width = misses.target.shape, batch.blocks * batch.lanes
        out = np.empty((count, channels, width) if stored else (0, channels, 1))
        found.append((out, np.empty((channels + 1, width))))
        # Without trajectories a call takes a few microseconds: in pieces as large as balanced threads allow.
        size = 1 if stored else max(1, batch.blocks // (4 * THREADS))
        jobs += [(i, range(first, min(first + size, batch.blocks))) for first in range(0, batch.blocks, size)]

    def work(waiting: Iterator[int]) -> None:
        for i, blocks in (jobs[j] for j in waiting):
            simulator, batch, misses, motion = asked[i]
            place = blocks[0] * batch.lanes if stored else 0
            simulator.run(batch, misses, *found[i], blocks, place, motion=motion, plays=motion is not None)

    in_threads(work, len(jobs), threads=THREADS)
    return [
        (batch.restored(out) if stored else out, batch.restored(sums))
        for (_, batch, _, _), (out, sums) in zip(asked, found, strict=True)
    ]


def check_finite(out: FloatArray, time: FloatArray, names: Sequence[str], parameters: FloatArray) -> None:
    """Raise if any trajectory blew up.

    Raises SimulationFailure with the parameters of the first set that failed and the time.
    """
    with np.errstate(invalid="ignore"):
        good: BoolArray = np.all(np.abs(out) < _LIMIT, axis=1)
    if good.all():
        return
    lane = int(np.argmax(~good.all(axis=0)))
    when = float(time[int(np.argmax(~good[:, lane]))])
    values: Mapping[str, float] = dict(zip(names, parameters[:, lane].tolist(), strict=True))
    raise SimulationFailure(values, when, "the motion is not finite any more.")


def classical_step(program: Program, grid: Grid, motion: FloatArray, parameters: FloatArray) -> float:
    """Return the longest step of the classical method on a motion on which the kernel's own may be longer [s].

    Infinite where nothing forgets faster than it moves, see `discovery.simulation.kernel.fused`.

    `program`: what moves. `grid`: the steps of the motion. `motion` (steps, 4 states): from
    `discovery.simulation.simulate.Simulator.motion`. `parameters` (p,): in the order of the program.
    """
    states = motion[:, : len(program.states)].T
    # The memory of an effect that is absent rests.
    moving = [rate for z, rate in program.relaxation if states[program.states.index(z)].any()]
    if not moving:
        return np.inf
    rates = numpy_derivative(replace(program, slopes=tuple(moving)))
    return _PART / max(float(np.max(rate)) for rate in rates(grid.times, grid.drive[:, 0].T, states, parameters))
