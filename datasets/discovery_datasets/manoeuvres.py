"""Motion of the motor: piecewise polynomials of time with stated kinks.

A manoeuvre is exact, not sampled: angle, rate and acceleration come from the same polynomial, and the times at which
the acceleration jumps are known, so that an integrator can restart there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Manoeuvre:
    r"""Angle of the motor as a polynomial on each of several stretches of time.

    Stretch `i` covers ``kinks[i - 1] <= t < kinks[i]`` (the first begins at minus, the last ends at plus infinity) and
    reads :math:`\theta_m(t) = \sum_p c_{ip} (t - o_i)^p`.

    Parameters
    ----------
    kinks : tuple of float
        Times at which a derivative of the angle jumps, strictly increasing [s].
    origins : tuple of float
        Origin :math:`o_i` of each stretch, one more than kinks [s].
    coefficients : tuple of tuple of float
        Coefficients :math:`c_{ip}` of each stretch in ascending powers [rad s^-p].
    """

    kinks: tuple[float, ...]
    origins: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def stretch(self, index: int) -> tuple[float, tuple[float, ...]]:
        """Origin [s] and coefficients [rad s^-p] of one stretch."""
        return self.origins[index], self.coefficients[index]

    def __call__(self, time: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angle [rad], rate [rad/s] and acceleration [rad/s^2] at the given times [s], each of the shape of `time`."""
        t = np.asarray(time, dtype=float)
        stretches = np.searchsorted(np.asarray(self.kinks), t, side="right")
        values = np.zeros((3, *t.shape))
        for index in np.unique(stretches):
            inside = stretches == index
            origin, coefficients = self.stretch(int(index))
            polynomial = np.polynomial.Polynomial(coefficients)
            for order in range(3):
                values[order, inside] = polynomial.deriv(order)(t[inside] - origin)
        return values[0], values[1], values[2]


def trapezoid(angle: float, rate: float, *, start: float = 0.5, initial: float = 0.0, ramp: float = 0.12) -> Manoeuvre:
    """Move with a trapezoidal speed profile: constant acceleration, constant speed, constant deceleration.

    Parameters
    ----------
    angle : float
        Signed angle of the move [rad].
    rate : float
        Speed of the plateau, positive [rad/s].
    start : float
        Beginning of the move [s].
    initial : float
        Angle before the move [rad].
    ramp : float
        Duration of each of the two ramps as a part of the whole move, in (0, 0.5].

    Returns
    -------
    Manoeuvre
        Lasts ``abs(angle) / rate / (1 - ramp)`` seconds.

    Raises
    ------
    ValueError
        If the rate is not positive or the ramp is outside (0, 0.5].
    """
    if rate <= 0 or not 0 < ramp <= 0.5:
        raise ValueError(f"a trapezoid needs rate > 0 and 0 < ramp <= 0.5, not rate = {rate}, ramp = {ramp}")
    duration = abs(angle) / rate / (1 - ramp)
    rise = ramp * duration
    speed = float(np.copysign(rate, angle))
    acceleration = speed / rise
    end, final = start + duration, initial + angle
    corner = initial + speed * rise / 2
    return Manoeuvre(
        kinks=(start, start + rise, end - rise, end),
        origins=(start, start, start + rise, end, end),
        coefficients=(
            (initial,),
            (initial, 0.0, acceleration / 2),
            (corner, speed),
            (final, 0.0, -acceleration / 2),
            (final,),
        ),
    )


def minimum_jerk(angle: float, duration: float, *, start: float = 0.5, initial: float = 0.0) -> Manoeuvre:
    """Smooth move along the quintic of least jerk (Flash, Hogan, J. Neurosci. 5, 1985), its acceleration continuous.

    Parameters
    ----------
    angle : float
        Signed angle of the move [rad]; the largest rate is ``1.875 * angle / duration``.
    duration : float
        Duration, positive [s].
    start, initial : float
        Beginning of the move [s] and angle before it [rad].

    Raises
    ------
    ValueError
        If the duration is not positive.
    """
    if duration <= 0:
        raise ValueError(f"a move needs a positive duration, not {duration} s")
    cubic, quartic, quintic = 10 * angle / duration**3, -15 * angle / duration**4, 6 * angle / duration**5
    return Manoeuvre(
        kinks=(start, start + duration),
        origins=(start, start, start + duration),
        coefficients=((initial,), (initial, 0.0, 0.0, cubic, quartic, quintic), (initial + angle,)),
    )


def rest(angle: float = 0.0) -> Manoeuvre:
    """Motor held at an angle [rad]."""
    return Manoeuvre(kinks=(), origins=(0.0,), coefficients=((angle,),))


def sequence(first: Manoeuvre, second: Manoeuvre) -> Manoeuvre:
    """One manoeuvre after another; the second's angles are counted from where the first one ends.

    Raises
    ------
    ValueError
        If the second begins before the first has ended.
    """
    if first.kinks and second.kinks and second.kinks[0] < first.kinks[-1]:
        raise ValueError(f"the second move begins at {second.kinks[0]} s, before the first ends at {first.kinks[-1]} s")
    reached = first.coefficients[-1][0]
    shifted = tuple((c[0] + reached, *c[1:]) for c in second.coefficients)
    return Manoeuvre(
        kinks=first.kinks + second.kinks,
        origins=first.origins + second.origins[1:],
        coefficients=first.coefficients + shifted[1:],
    )
