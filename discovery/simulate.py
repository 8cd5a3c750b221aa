"""Simulation of many parameter sets at once on recorded input, with a stated accuracy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from discovery.compile import Kernel, compile_kernel
from discovery.errors import SimulationFailure
from discovery.mechanics import get_base

__all__ = ["THREADS", "DriveLike", "Grid", "Simulator", "check_finite"]

#: Blocks of lanes run in this many threads; the kernel releases the interpreter's lock.
THREADS = 2
#: Readings beyond this many lengths (or this size) count as blown up.
_LIMIT = 1e9


class DriveLike(Protocol):
    """A smooth input: `discovery.drive.Drive` or anything that evaluates like it."""

    @property
    def kinks(self) -> NDArray[np.float64]:
        """Times at which the second derivative jumps [s]."""
        ...

    def evaluate(self, time: ArrayLike, side: Literal["left", "right"] = "right") -> NDArray[np.float64]:
        """Return input and two derivatives at the given times, shape (3, n); `side` chooses the limit at a kink."""
        ...


@dataclass(frozen=True)
class Grid:
    """Steps of the integration between the kinks of the drive, and where each output lies in them.

    Parameters
    ----------
    times, steps : ndarray, shape (n,)
        Start and length of each step [s].
    restart : ndarray of bool, shape (n,)
        True where slopes jump (a kink of the drive, or the start).
    drive : ndarray, shape (n, 3, 3)
        Input and two derivatives at start, middle and end of each step.
    out_step, out_fraction, out_time, out_drive : ndarray, shapes (m,), (m,), (m,), (m, 3)
        Step that contains each output, where in it, when, and the drive there.
    """

    times: NDArray[np.float64]
    steps: NDArray[np.float64]
    restart: NDArray[np.bool_]
    drive: NDArray[np.float64]
    out_step: NDArray[np.int64]
    out_fraction: NDArray[np.float64]
    out_time: NDArray[np.float64]
    out_drive: NDArray[np.float64]

    @classmethod
    def build(cls, time: NDArray[np.float64], drive: DriveLike | None, step: float) -> Grid:
        """Return a grid with steps of at most `step` [s] from the first to the last of `time`."""
        start, end = float(time[0]), float(time[-1])
        kinks = np.empty(0) if drive is None else _breaks(drive, time.size)
        # Two kinks nearer than a millionth of the step are one.
        inner = kinks[(kinks > start) & (kinks < end)]
        knots = np.concatenate([[start], inner[np.diff(inner, prepend=start) > 1e-6 * step], [end]])
        counts = np.maximum(1, np.ceil(np.diff(knots) / step - 1e-9)).astype(int)
        edges = np.concatenate(
            [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(knots[:-1], knots[1:], counts, strict=True)]
            + [[end]]
        )
        times, steps = edges[:-1], np.diff(edges)
        restart = np.zeros(times.size, bool)
        restart[np.concatenate([[0], np.cumsum(counts)[:-1]])] = True
        values = np.zeros((times.size, 3, 3))
        out_drive = np.zeros((time.size, 3))
        if drive is not None:
            values[:, 0] = drive.evaluate(times, side="right").T
            values[:, 1] = drive.evaluate(times + 0.5 * steps, side="right").T
            values[:, 2] = drive.evaluate(edges[1:], side="left").T
            out_drive[:] = drive.evaluate(time, side="right").T
        out_step = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, times.size - 1)
        fraction = np.clip((time - times[out_step]) / steps[out_step], 0.0, 1.0)
        return cls(times, steps, restart, values, out_step, fraction, np.ascontiguousarray(time, float), out_drive)


def _breaks(drive: DriveLike, samples: int) -> NDArray[np.float64]:
    """Return where steps must end: kinks, and where a smooth motor profile changes its polynomial.

    A band-limited input has several pieces a sample, each join far below the solver's error; those are passed over.
    """
    joins = getattr(drive, "breakpoints", np.empty(0))
    if joins.size > samples / 2:
        joins = np.empty(0)
    return np.unique(np.concatenate([np.asarray(drive.kinks, float), joins]))


class Simulator:
    """Simulates a base with a set of effects on one input, many parameter sets at once.

    Parameters
    ----------
    base : str
        Name of the base.
    effects : sequence of str
        Effect ids; an effect whose parameters are at their defaults is absent.
    time : ndarray, shape (m,)
        Output times [s], increasing, possibly irregular.
    drive : DriveLike or None
        Smooth input.
    step : float
        Longest step [s].
    """

    def __init__(
        self, base: str, effects: Sequence[str], time: NDArray[np.float64], drive: DriveLike | None, *, step: float
    ) -> None:
        self.base = get_base(base)
        self.kernel: Kernel = compile_kernel(base, tuple(effects))
        self.drive = drive
        self.time = np.asarray(time, float)
        self.step = step
        self.grid = Grid.build(self.time, drive, step)
        self.names = self.kernel.program.parameters

    def refined(self, factor: float = 0.5) -> Simulator:
        """Return the same simulator with steps shortened by `factor`."""
        other = object.__new__(Simulator)
        other.__dict__.update(self.__dict__)
        other.step = self.step * factor
        other.grid = Grid.build(self.time, self.drive, other.step)
        return other

    def __call__(
        self, parameters: NDArray[np.float64], deflection: NDArray[np.float64], rate: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Simulate.

        Parameters
        ----------
        parameters : ndarray, shape (p, k)
            Rows in the order of `names`; columns are parameter sets.
        deflection, rate : ndarray, shape (k,)
            Initial deflection [q] and its rate [q/s].

        Returns
        -------
        ndarray, shape (m, r, k)
            What the instrument reports at the output times; not finite where the motion blew up
            (`check_finite` turns that into an error with parameters and time).
        """
        k = parameters.shape[1]
        lanes = self.kernel.lanes
        blocks = -(-k // lanes)
        order = self._order(parameters)
        # Idle lanes repeat the last parameter set, so that they can neither overflow nor slow down.
        pad = order[np.minimum(np.arange(blocks * lanes), k - 1)]
        padded = np.ascontiguousarray(parameters[:, pad], float)
        program = self.kernel.program
        q, q_rate = self.base.initial_coordinates(
            np.asarray(deflection, float)[pad],
            np.asarray(rate, float)[pad],
            self.grid.drive[0, 0, :2],
            program.form(padded),
        )
        initial = np.zeros((len(program.states), blocks * lanes))
        initial[: program.n_coordinates] = q
        initial[program.n_coordinates : 2 * program.n_coordinates] = q_rate
        out = np.empty((self.time.size, len(program.reading), blocks * lanes))
        g = self.grid
        arguments = (g.times, g.steps, g.restart, g.drive, g.out_step, g.out_fraction, g.out_time, g.out_drive)
        # Threads take the next block as they finish one: blocks differ in what they cost.
        waiting = iter(range(blocks))

        def work(_: int) -> None:
            for block in waiting:
                self.kernel.run(*arguments, padded, initial, out, block, block + 1)

        if blocks == 1:
            work(0)
        else:
            with ThreadPoolExecutor(THREADS) as pool:
                list(pool.map(work, range(THREADS)))
        sorted_already = bool((order[1:] > order[:-1]).all())
        return out[:, :, :k] if sorted_already else np.take(out, np.argsort(order), axis=2, mode="clip")

    def _order(self, parameters: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the columns with the same effects present side by side, those with most first."""
        present = self.kernel.switches @ (parameters != 0.0) > 0
        return np.lexsort((*present, -present.sum(axis=0)))


def check_finite(
    out: NDArray[np.float64], time: NDArray[np.float64], names: Sequence[str], parameters: NDArray[np.float64]
) -> None:
    """Raise if any trajectory blew up.

    Raises
    ------
    SimulationFailure
        With the parameters of the first set that failed and the time.
    """
    with np.errstate(invalid="ignore"):
        good: NDArray[np.bool_] = np.all(np.abs(out) < _LIMIT, axis=1)
    if good.all():
        return
    lane = int(np.argmax(~good.all(axis=0)))
    when = float(time[int(np.argmax(~good[:, lane]))])
    values: Mapping[str, float] = dict(zip(names, parameters[:, lane].tolist(), strict=True))
    raise SimulationFailure(values, when, "the motion is not finite any more.")
