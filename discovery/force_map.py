"""The inverse of the elastica's map: the force that holds the tip at a given position."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from discovery.elastica import DEFLECTION_MAX, perpendicular_law, tip_under_load
from discovery.elastica_integrals import FORCE_MAX
from discovery.errors import ComputationError, InputError

__all__ = ["load_at_tip"]

FloatArray = npt.NDArray[np.float64]

_ITERATIONS = 80
# Of central differences: balances the curvature of the map from load to tip and its rounding.
_STEP = 1e-5


def load_at_tip(rho: npt.ArrayLike, delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Force that holds the tip at a position: both components of eq. (6) of the paper.

    In small deflection the radial component alone fixes ``(1 - rho) / delta^2`` and the tangential one the angle, so
    Newton's method in these components converges from the perpendicular force in a few steps.

    Parameters
    ----------
    rho : array_like
        Radius ``rho_t / l`` of the tip [-], below 1.
    delta : array_like
        Its polar angle ``theta_t - theta_m`` [rad], not 0, at most ``DEFLECTION_MAX`` in magnitude.

    Returns
    -------
    force : ndarray
        Normalised magnitude ``F_n`` [-].
    direction : ndarray
        Orientation ``phi`` from the undeflected beam [rad]. Rounding of `rho` counts ``1 / delta^2`` times.

    Raises
    ------
    InputError
        If a position is straight, out of reach or beyond the domain.
    ComputationError
        If the force is not found: the position needs one beyond ``FORCE_MAX``, or a shape with an inflection.
    """
    radius, angle = np.broadcast_arrays(np.asarray(rho, np.float64), np.asarray(delta, np.float64))
    size = np.abs(angle)
    if not np.all((radius > 0.0) & (radius < 1.0) & (size > 0.0) & (size <= DEFLECTION_MAX)):
        raise InputError(
            "The force at the tip of an elastica is defined for radii between 0 and 1 lengths and deflections of at "
            f"most {DEFLECTION_MAX:.4f} rad that are not 0; check the units, and leave out the straight positions."
        )
    target = np.log((1.0 - radius) / size**2), np.log(size)

    def components(radial: FloatArray, tangential: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.hypot(radial, tangential * size), size + np.arctan2(tangential * size, radial)

    def error(radial: FloatArray, tangential: FloatArray) -> FloatArray:
        tip = tip_under_load(*components(radial, tangential))
        return np.stack([np.log((1.0 - tip.radius) / tip.angle**2) - target[0], np.log(tip.angle) - target[1]])

    radial, tangential = np.zeros_like(size), perpendicular_law(size)[0] / size
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(_ITERATIONS):
            e = error(radial, tangential)
            if np.all(np.abs(e) < 1e-9 + 1e-15 / size**2):
                force, direction = components(radial, tangential)
                return force, np.sign(angle) * direction
            a, c = (error(radial + _STEP, tangential) - error(radial - _STEP, tangential)) / (2.0 * _STEP)
            b, d = (error(radial, tangential + _STEP) - error(radial, tangential - _STEP)) / (2.0 * _STEP)
            determinant = a * d - b * c
            radial = radial - (d * e[0] - b * e[1]) / determinant
            tangential = tangential - (a * e[1] - c * e[0]) / determinant
            if not np.all(np.hypot(radial, tangential) < FORCE_MAX / 2.0):
                break
    raise ComputationError("No tip force without inflection of the beam was found for at least one of the positions.")
