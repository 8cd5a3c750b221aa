"""Where the tip of the elastica can be held: the radii that a beam without inflection reaches at a deflection."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.elastica.beam import tip_under_load
from benchmarks.paper.theory.elastica.loads import FORCE_MAX, clamp_parameter, fold, slopes
from discovery.foundation.errors import InputError
from discovery.theory.elastica.integrals import TINY, bend, increasing_root

FloatArray = npt.NDArray[np.float64]


def radius_limits(delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest radius of the tip at a deflection: the domain of the map (6) of the paper.

    The smallest is that of the beam buckled by a compression along its clamped end, ``phi = pi``: below it the beam
    has an inflection. The largest takes the force ``FORCE_MAX``; the straight beam, ``rho = l``, an infinite one.

    Parameters
    ----------
    delta : array_like
        Deflection ``theta_t - theta_m`` [rad], at most 3.1212 in magnitude: the beam buckled by ``FORCE_MAX``.

    Returns
    -------
    low, high : ndarray
        Limits of ``rho_t / l`` [-]; both 1 at ``delta = 0``.

    Raises
    ------
    InputError
        If a deflection is not finite or larger.
    """
    size, limit = np.abs(np.asarray(delta, np.float64)), float(tip_under_load(FORCE_MAX, np.pi).angle)
    if not np.all(size <= limit):
        raise InputError(
            f"The tip of an elastica without inflection deflects by at most {limit:.4f} rad; "
            f"got up to {np.max(size):.4g} rad. Check the unit of the deflection."
        )
    angle = np.maximum(size, TINY)
    return _buckled(angle), np.where(size > 0.0, _pulled(angle), 1.0)[()]


def _buckled(size: FloatArray) -> FloatArray:
    """Return the radius of the tip under compression along the clamped end, at a deflection [rad]."""
    w, c = np.sin(np.pi / 2), np.cos(np.pi / 2)

    def equation(z: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        b = bend(np.full_like(z, w), np.full_like(z, c), z)
        s, x = slopes(b), 1.0 - b.shortening
        return np.arctan2(b.y, x) - size, (x * s.y_z + b.y * s.shortening_z) / (x**2 + b.y**2)

    # pi delta / 4 is the root at the Euler load; sqrt(FORCE_MAX) bounds it at the other end.
    low, high = 0.7 * size, np.maximum(0.8 * size, np.sqrt(FORCE_MAX))
    z = increasing_root(equation, low, high, np.pi / 4 * size, (size,))
    return 1.0 - bend(np.full_like(z, w), np.full_like(z, c), z).radial_shortening


def _pulled(size: FloatArray) -> FloatArray:
    """Return the radius of the tip under the largest force, at a deflection [rad]."""

    def equation(phi: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        load = fold(FORCE_MAX, phi)
        b = bend(load.w, load.c, clamp_parameter(load))
        s, x = slopes(b), 1.0 - b.shortening
        y_phi, shortening_phi = (
            by_phi - by_z * b.t_phi / b.t_z for by_phi, by_z in ((s.y_phi, s.y_z), (s.shortening_phi, s.shortening_z))
        )
        return np.arctan2(b.y, x) - size, (x * y_phi + b.y * shortening_phi) / (x**2 + b.y**2)

    # The force is ahead of the tip by about 2 sin(delta / 2) / sqrt(F_n).
    high = np.minimum(1.02 * size, np.pi)
    phi = increasing_root(equation, size, high, np.minimum(1.01 * size, np.pi), (size,))
    return tip_under_load(FORCE_MAX, phi).radius
