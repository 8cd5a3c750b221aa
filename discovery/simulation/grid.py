"""The grid of a simulation: steps between the kinks of the drive, and where the outputs lie in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.simulation.runge_kutta import CLASSICAL, Method


class DriveLike(Protocol):
    """A smooth input: `discovery.recordings.drive.Drive` or anything that evaluates like it."""

    @property
    def kinks(self) -> FloatArray:
        """Times at which the second derivative jumps [s]."""
        ...

    def evaluate(self, time: ArrayLike, side: Literal["left", "right"] = "right") -> FloatArray:
        """Return input and two derivatives at the given times, shape (3, n); `side` chooses the limit at a kink."""
        ...


@dataclass(frozen=True)
class Grid:
    """Steps of the integration between the kinks of the drive, and where each output lies in them."""

    #: times, steps (n,): start and length of each step [s].
    times: FloatArray
    steps: FloatArray
    restart: BoolArray  # (n,), true where slopes jump (a kink of the drive, or the start)
    #: (n, nodes, 3): input and two derivatives at the nodes of each step: start, middle and end for the classical
    #: method.
    drive: FloatArray
    #: out_step, out_fraction, out_time, out_drive (m,), (m,), (m,), (m, 3): step that contains each output, where in
    #: it, when, and the drive there.
    out_step: IntArray
    out_fraction: FloatArray
    out_time: FloatArray
    out_drive: FloatArray

    @classmethod
    def build(
        cls,
        time: FloatArray,
        drive: DriveLike | None,
        step: float,
        method: Method = CLASSICAL,
        pace: Pace | None = None,
        beyond: float = 0.0,
    ) -> Grid:
        """Return a grid with steps of at most `step` [s] from the first to the last of `time`, shorter at a pace.

        It ends later by the share `beyond` of that: there an instrument that is early reads its last outputs.
        """
        start, end = float(time[0]), float(time[-1])
        after = [end + beyond * (end - start)] if beyond > 0.0 else []
        kinks = np.empty(0) if drive is None else _breaks(drive, time.size)
        # Two kinks nearer than a millionth of the step are one.
        inner = kinks[(kinks > start) & (kinks < end)]
        knots = np.concatenate([[start], inner[np.diff(inner, prepend=start) > 1e-6 * step], [end], after])
        shown = knots if pace is None else pace.shown(knots)
        counts = np.maximum(1, np.ceil(np.diff(shown) / step - 1e-9)).astype(int)
        first = np.cumsum(counts) - counts
        within = np.arange(counts.sum()) - np.repeat(first, counts)
        edges = np.append(
            within * np.repeat(np.diff(shown) / counts, counts) + np.repeat(shown[:-1], counts), shown[-1]
        )
        if pace is not None:
            edges = pace.when(edges)
            edges[np.cumsum(counts)] = knots[1:]
            edges[0] = start
        times, steps = edges[:-1], np.diff(edges)
        restart = np.zeros(times.size, bool)
        restart[first] = True
        values = np.zeros((times.size, len(method.times), 3))
        out_drive = np.zeros((time.size, 3))
        if drive is not None:
            for k, node in enumerate(method.times[:-1]):
                values[:, k] = drive.evaluate(times + node * steps, side="right").T
            values[:, -1] = drive.evaluate(edges[1:], side="left").T
            out_drive[:] = drive.evaluate(time, side="right").T
        within = int(counts[: counts.size - len(after)].sum())
        out_step = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, within - 1)
        fraction = np.clip((time - times[out_step]) / steps[out_step], 0.0, 1.0)
        return cls(times, steps, restart, values, out_step, fraction, np.ascontiguousarray(time, float), out_drive)

    def until(self, count: int) -> Grid:
        """Return the same steps with the first outputs only: the integration ends with the last of them."""
        return replace(
            self,
            out_step=self.out_step[:count],
            out_fraction=self.out_fraction[:count],
            out_time=self.out_time[:count],
            out_drive=self.out_drive[:count],
        )


def _breaks(drive: DriveLike, samples: int) -> FloatArray:
    """Return where steps must end: kinks, and where a smooth motor profile changes its polynomial.

    A band-limited input has several pieces a sample, each join far below the solver's error; those are passed over.
    """
    joins = getattr(drive, "breakpoints", np.empty(0))
    if joins.size > samples / 2:
        joins = np.empty(0)
    return np.unique(np.concatenate([np.asarray(drive.kinks, float), joins]))


@dataclass(frozen=True)
class Pace:
    """A clock that runs faster where steps must be shorter: all steps are as long by it."""

    time: FloatArray  # (n,), increasing [s]
    #: (n,): what the clock shows then [s]; never slower than time, and as fast as time before the first and after the
    #: last.
    clock: FloatArray

    @classmethod
    def of(cls, time: FloatArray, shares: FloatArray) -> Pace:
        """Return the pace at which a step is a share of the longest one.

        `time` (n + 1,): increasing [s]. `shares` (n,): of the longest step between one of these times and the next,
        above zero and at most one.
        """
        return cls(time, time[0] + np.concatenate([[0.0], np.cumsum(np.diff(time) / shares)]))

    @property
    def least(self) -> float:
        """The smallest share of the longest step."""
        return float(np.min(np.diff(self.time) / np.diff(self.clock), initial=1.0))

    def shown(self, time: FloatArray) -> FloatArray:
        """Return what the clock shows at given times."""
        return _read(time, self.time, self.clock)

    def when(self, shown: FloatArray) -> FloatArray:
        """Return when the clock shows this."""
        return _read(shown, self.clock, self.time)


def _read(x: FloatArray, known: FloatArray, values: FloatArray) -> FloatArray:
    """Return values between known ones on straight lines, and with slope one beyond them."""
    inside = np.clip(x, known[0], known[-1])
    return np.asarray(np.interp(inside, known, values) + (x - inside), np.float64)
