"""Where an angle begins whose readings bend with it, as those of an accelerometer on a pendulum do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

#: Angles of a turn that are tried: nearer ones a fit finds by itself.
_TRIED = 720
#: Misfits that differ by less are the same, of the range of the readings squared: the angle nearer to rest is taken.
_SAME = 1e-4
#: Quantiles between which the range lies: a law may have a pole.
_INSIDE = (0.05, 0.95)


@dataclass(frozen=True)
class ReadByAngle:
    """What is read at angles of a turn, at rest."""

    tried: NDArray  # (n,), angles [rad]
    #: values, slopes (c, n): of every reading, and its derivative by the angle.
    values: NDArray
    slopes: NDArray

    @classmethod
    def of(cls, laws: Sequence[sp.Expr], angle: sp.Symbol) -> ReadByAngle | None:
        """Return what laws read, everything but the angle a number; None where the first is a straight line of it."""
        if sp.diff(laws[0], angle, 2) == 0:
            return None
        tried = np.linspace(-np.pi, np.pi, _TRIED, endpoint=False)
        with np.errstate(invalid="ignore", divide="ignore"):
            values, slopes = (
                np.array([np.broadcast_to(sp.lambdify(angle, law)(tried), tried.shape) for law in each])
                for each in (laws, [sp.diff(law, angle) for law in laws])
            )
        return cls(tried, values, slopes)

    def begin(self, read: NDArray) -> tuple[float, float] | None:
        """Return angle [rad] and rate [rad/s] with which readings begin; None where they do not tell it.

        `read` (c, 2): first value of every reading, and its rate; NaN of one that is first read later.
        """
        here = np.isfinite(read).all(axis=1)
        if not here[0]:
            return None
        good = np.isfinite(self.values[here]).all(axis=0) & np.isfinite(self.slopes[here]).all(axis=0)
        tried, values, slopes = self.tried[good], self.values[here][:, good], self.slopes[here][:, good]
        low, high = np.quantile(values, _INSIDE, axis=1) if tried.size else np.zeros((2, len(values)))
        told = high > low
        if not told.any():
            return None
        sizes = (high - low)[told, None]
        misfit = np.square((values[told] - read[here][told, :1]) / sizes).sum(axis=0)
        near = np.flatnonzero(misfit < misfit.min() + _SAME)
        best = near[np.argmin(np.abs(tried[near]))]
        slope = (slopes[told] / sizes)[:, best]
        rates = (read[here][told, 1:] / sizes)[:, 0]
        # At the end of its range a reading tells no rate.
        rate = float(slope @ rates / (slope @ slope)) if slope @ slope > _SAME else 0.0
        return float(tried[best]), rate
