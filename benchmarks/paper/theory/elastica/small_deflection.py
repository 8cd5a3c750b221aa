r"""The small-deflection limit of the elastica: the linear beam of eq. (2) of the paper.

With :math:`s = x` and the moment of a force across the undeflected beam, :math:`EI\, y'' = M = F (l - x)`, so

.. math:: y = \frac{F x^2 (3 l - x)}{6 EI}, \quad y(l) = \frac{F l^3}{3 EI}, \quad y'(l) = \frac{F l^2}{2 EI}.

The elastica's tip differs from it by terms of third order in the force across, of second order along the beam.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.elastica.beam import BeamShape
from discovery.foundation.errors import InputError

FloatArray = npt.NDArray[np.float64]


def small_deflection_tip(force: npt.ArrayLike) -> FloatArray:
    """Deflection of the tip of the linear beam, eq. (2) of the paper.

    Parameters
    ----------
    force : array_like
        Normalised force across the undeflected beam, ``F l^2 / EI`` [-].

    Returns
    -------
    ndarray
        Deflection of the tip, ``F_n / 3`` [lengths].
    """
    return np.asarray(force, np.float64) / 3.0


def small_deflection_shape(force: npt.ArrayLike, arc: npt.ArrayLike | None = None) -> BeamShape:
    """Shape of the linear beam, eq. (2) of the paper.

    Parameters
    ----------
    force : array_like
        As in :func:`small_deflection_tip`.
    arc : array_like, shape (k,), optional
        Distances from the clamp in [0, 1] at which the shape is wanted [lengths]; 101 equal steps by default.

    Returns
    -------
    BeamShape
        Fields of the shape of the forces, followed by ``k``; the slope is ``dy / dx`` and ``x`` the distance itself.

    Raises
    ------
    InputError
        If `arc` is not a vector within [0, 1].
    """
    s = np.linspace(0.0, 1.0, 101) if arc is None else np.asarray(arc, dtype=np.float64)
    if s.ndim != 1 or not np.all((s >= 0.0) & (s <= 1.0)):
        raise InputError("The distances along a linear beam must be a vector of numbers from 0 (clamp) to 1 (tip).")
    load = np.asarray(force, np.float64)[..., None]
    y = load * s**2 * (3.0 - s) / 6.0
    return BeamShape(s, load * s * (2.0 - s) / 2.0, np.broadcast_to(s, y.shape), y)
