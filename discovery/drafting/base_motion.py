"""Whether the motion above a moved base was read against the base or against the floor, as a recording tells it."""

from __future__ import annotations

import numpy as np

from discovery.declarations.units import si_symbol
from discovery.drafting.law_of_motion import FloatArray, integral_over, least_squares, telling_part

#: Factor between the squared errors of the two readings, and share of the motion's square that the better one may
#: leave: a recording beyond these does not tell them apart.
_CLEAR, _LEFT = 3.0, 0.03
#: Ratio of the frequencies between which nine tenths of the base's motion lie: at one frequency, both readings fit.
_BROAD = 1.5
#: Share of the base's acceleration that a body may feel; it is 1 for a point mass.
_SHARE = (0.5, 2.0)
#: What a recording says, for people.
LOOKS = {
    True: "The recording looks relative, too.",
    False: "But the recording looks like a motion against the floor.",
    None: "The recording does not tell which it is.",
}


def is_one_line(base: str, output: str) -> bool:
    """Whether a base and what is above it move along one line or about one axis, as their units tell."""
    return si_symbol(base) == si_symbol(output) in ("m", "rad")


def is_relative(time: FloatArray, output: FloatArray, base: FloatArray) -> bool | None:
    """Return whether an output is relative to the base, None where the recording does not tell.

    On a spring and a damper, the way z of a mass from its base obeys z'' = -d z' - k z - p u''. Integrated twice, this
    is fitted with z as the output itself and with z as the output less the base. Far below the own frequency the one
    says that the output stays near 0, the other that it follows the base.

    Parameters
    ----------
    time, output, base : array, shape (n,)
        Times [s] and both motions in one unit; NaN marks gaps.

    Examples
    --------
    >>> t = np.linspace(0, 20, 2001)
    >>> slow, fast = np.sin(t), np.sin(3 * t)  # below the own frequency of 4 rad/s
    >>> base, above = slow + fast, slow / 15 + fast * 9 / 7
    >>> is_relative(t, base + above, base), is_relative(t, above, base)
    (False, True)
    """
    good = telling_part(output)
    if good.size < 50 or not _is_broad(base[good]):
        return None
    t, y, u = time[good] - time[good[0]], output[good], base[good]
    relative, absolute = _error(t, y, u), _error(t, y - u, u)
    better, worse = sorted((relative, absolute))
    if worse < _CLEAR * better or better > _LEFT * float(np.sum((y - y.mean()) ** 2)):
        return None
    return relative < absolute


def _error(t: FloatArray, z: FloatArray, u: FloatArray) -> float:
    """Return the squared error of the law; infinite where its spring would push."""
    integral, scale = integral_over(t), float(t[-1])
    once = integral(z)
    twice = integral(once)
    columns = [np.ones_like(t), t / scale, (t / scale) ** 2, once, twice]
    squares, weights = least_squares(np.column_stack([*columns, u]), z)
    share = float(np.clip(-weights[-1], *_SHARE))
    if share != -weights[-1]:
        squares, weights = least_squares(np.column_stack(columns), z + share * u)
    return squares if weights[4] < 0.0 else np.inf


def _is_broad(u: FloatArray) -> bool:
    power = np.cumsum(np.abs(np.fft.rfft(u - u.mean())) ** 2)
    low, high = np.searchsorted(power, [0.05 * power[-1], 0.95 * power[-1]])
    return bool(power[-1] > 0.0 and high > _BROAD * low + 2)  # a sine leaks into its neighbours
