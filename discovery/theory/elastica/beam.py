r"""The static elastica: a clamped, inextensible beam of unit length bent by a force across the radius of its tip.

The normalised equation is eq. (5) of the paper,

.. math:: \theta'' = F_n \sin(\theta - \varphi), \quad \theta(0) = 0, \quad \theta'(1) = 0, \quad F_n = F l^2 / EI,

on the branch without inflection (the stable one); `discovery.theory.elastica.integrals` solves it. Forces of any other
direction are in `benchmarks/paper/theory/elastica`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from discovery.foundation.errors import InputError
from discovery.theory.elastica.integrals import TINY, bend, increasing_root

__all__ = ["DEFLECTION_MAX", "perpendicular_law"]

FloatArray = npt.NDArray[np.float64]

DEFLECTION_MAX = np.pi / 2
"""Largest tip deflection of :func:`perpendicular_law` [rad]; there the force points back along the clamped end."""


def perpendicular_law(delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Force and radius of a tip deflected by a force perpendicular to its radius vector, from eq. (5) of the paper.

    The position of the tip has no component along such a force, so one equation in one unknown is left; to lowest
    orders ``F_n = 3 delta + (13/70) delta^3`` and ``rho / l = 1 - delta^2 / 10``.

    Parameters
    ----------
    delta : array_like
        Deflection ``theta_t - theta_m`` of the tip [rad], at most ``DEFLECTION_MAX`` in magnitude.

    Returns
    -------
    force : ndarray
        Normalised force ``F_n`` [-], with the sign of `delta`.
    rho : ndarray
        Radius ``rho_t / l`` [-].

    Raises
    ------
    InputError
        If a deflection is not finite or larger than ``DEFLECTION_MAX``.
    """
    angle = np.asarray(delta, dtype=np.float64)
    if not np.all(np.abs(angle) <= DEFLECTION_MAX):
        raise InputError(
            f"The elastica under a perpendicular tip force is defined up to a deflection of {DEFLECTION_MAX:.4f} rad; "
            f"got values from {np.min(angle):.4g} to {np.max(angle):.4g} rad. Check the unit of the deflection."
        )
    size = np.maximum(np.abs(angle), TINY)
    phi = size + np.pi / 2
    w, c = np.sin(phi / 2), np.cos(phi / 2)

    def equation(z: FloatArray, w: FloatArray, c: FloatArray, half_sine: FloatArray) -> tuple[FloatArray, FloatArray]:
        b = bend(w, c, z)
        along = (b.w * b.tau) ** 2 - b.d / b.t - half_sine
        return along, b.q2 * b.tau + b.d * b.t_z / b.t**2

    # sqrt(1.5 delta) is the root's small-deflection limit and 0.3 % off at pi / 2.
    guess = np.sqrt(1.5 * size)
    z = increasing_root(equation, 0.8 * guess, 1.25 * guess, guess, (w, c, 0.5 * np.sin(size)))
    b = bend(w, c, z)
    return np.sign(angle) * b.t**2, 2.0 * w * b.tau / b.t
