"""Where in a recording the steps of a simulation are shorter than elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import FloatArray


@dataclass(frozen=True)
class Pace:
    """A clock that runs faster where steps must be shorter: all steps are as long by it.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Increasing [s].
    clock : ndarray, shape (n,)
        What the clock shows then [s]; never slower than time, and as fast as time before the first and after the last.
    """

    time: FloatArray
    clock: FloatArray

    @classmethod
    def of(cls, time: FloatArray, shares: FloatArray) -> Pace:
        """Return the pace at which a step is a share of the longest one.

        Parameters
        ----------
        time : ndarray, shape (n + 1,)
            Increasing [s].
        shares : ndarray, shape (n,)
            Of the longest step between one of these times and the next, above zero and at most one.
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
