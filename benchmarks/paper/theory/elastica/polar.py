"""Derivatives of the elastica's tip and of its force in polar components, which turn with the tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.elastica.loads import blockwise, clamp_parameter, fold, slopes
from discovery.theory.elastica.integrals import Bend, bend

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PolarSlopes:
    """Derivatives of the map (6) by a bend's parameter z and by the direction phi: of 1 - rho, delta, F_r and F_t."""

    shortening_z: FloatArray
    shortening_phi: FloatArray
    delta_z: FloatArray
    delta_phi: FloatArray
    radial_z: FloatArray
    radial_phi: FloatArray
    tangential_z: FloatArray
    tangential_phi: FloatArray


def polar_force(b: Bend) -> tuple[FloatArray, FloatArray]:
    """Return the components of the force of eq. (6) along and across the tip's radius."""
    rho = 1.0 - b.radial_shortening
    # The latter is the clamp's moment over rho; the angle between force and radius would lose its digits.
    return b.t * (b.t - 2.0 * (b.q2 * b.t + b.d)) / rho, 2.0 * b.t * b.w * b.tau / rho


def polar_slopes(b: Bend) -> PolarSlopes:
    """Differentiate the tip's polar coordinates and of the force along and across its radius."""
    s, x, rho = slopes(b), 1.0 - b.shortening, 1.0 - b.radial_shortening
    delta_z = (x * s.y_z + b.y * s.shortening_z) / rho**2
    delta_phi = (x * s.y_phi + b.y * s.shortening_phi) / rho**2
    radial, tangential = polar_force(b)
    force = b.t**2
    sin, cos = tangential / force, radial / force
    return PolarSlopes(
        (x * s.shortening_z - b.y * s.y_z) / rho,
        (x * s.shortening_phi - b.y * s.y_phi) / rho,
        delta_z=delta_z,
        delta_phi=delta_phi,
        radial_z=2.0 * b.t * b.t_z * cos + tangential * delta_z,
        radial_phi=2.0 * b.t * b.t_phi * cos + tangential * (delta_phi - 1.0),
        tangential_z=2.0 * b.t * b.t_z * sin - radial * delta_z,
        tangential_phi=2.0 * b.t * b.t_phi * sin - radial * (delta_phi - 1.0),
    )


def polar_compliance(force: npt.ArrayLike, direction: npt.ArrayLike) -> FloatArray:
    """Differentiate the tip's position by the force along and across its radius: the inverse map (6) of the paper.

    Parameters
    ----------
    force, direction : array_like
        As in `beam.tip_under_load`, but neither absent nor along the undeflected beam.

    Returns
    -------
    ndarray, shape (..., 2, 2)
        Rows ``rho`` [lengths] and ``delta`` [rad], columns ``F_r`` and ``F_t``, which turn with the tip.

    Raises
    ------
    InputError
        As :func:`benchmarks.paper.theory.elastica.beam.tip_under_load`.
    """

    def entries(force: FloatArray, direction: FloatArray) -> tuple[FloatArray, ...]:
        load = fold(force, direction)
        s = polar_slopes(bend(load.w, load.c, clamp_parameter(load)))
        scale = 1.0 / (s.radial_z * s.tangential_phi - s.radial_phi * s.tangential_z)
        return (
            scale * (s.shortening_phi * s.tangential_z - s.shortening_z * s.tangential_phi),
            scale * (s.shortening_z * s.radial_phi - s.shortening_phi * s.radial_z) * load.sign,
            scale * (s.delta_z * s.tangential_phi - s.delta_phi * s.tangential_z) * load.sign,
            scale * (s.delta_phi * s.radial_z - s.delta_z * s.radial_phi),
        )

    found = blockwise(entries, np.asarray(force, np.float64), np.asarray(direction, np.float64))
    return np.stack(found, axis=-1).reshape(*np.shape(found[0]), 2, 2)
