r"""First guess of the force that holds the tip of the elastica at a given position.

With :math:`h = (1 - \rho) / 4 \sin^2(\delta / 4)` the strong limit of the radial force is :math:`F_r = 1 / h^2`;
:math:`R = \sqrt{F_r + 8}` less :math:`1 / h`, and :math:`F_t / \delta R`, are so smooth in :math:`h` and
:math:`\delta^2` over the whole domain that polynomials of degree four hold the force to 1 %. They are drawn by least
squares through the map from force to tip; what they leave costs Newton's method a step, not its accuracy.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numpy.polynomial.polynomial import polyval2d, polyvander2d

from benchmarks.paper.theory.elastica.loads import FORCE_MAX, clamp_parameter, fold
from discovery.theory.elastica.integrals import bend

FloatArray = npt.NDArray[np.float64]

# Keeps the root real: on the domain the radial force is above -pi^2 / 4.
_OFFSET = 8.0
# Above its largest value, 0.468 at the Euler load of the straight beam.
_H_MAX = 0.48
_DEGREE = 4


def _arguments(shortening: FloatArray, delta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the arguments of the polynomials, h and the square of delta, both scaled to [0, 1]."""
    h = shortening / (4.0 * np.sin(0.25 * delta) ** 2)
    return np.minimum(h / _H_MAX, 1.0), (delta / np.pi) ** 2


@lru_cache(maxsize=1)
def _coefficients() -> FloatArray:
    """Return the polynomials of R - 1 / h and of F_t / (delta R), shape (5, 5, 2), through forces of any direction."""
    n = 48
    directions = 0.5 * np.pi * (1.0 - np.cos(np.pi * (np.arange(n) + 0.5) / n))
    roots = np.concatenate([np.linspace(0.05, 6.0, n), np.geomspace(6.5, np.sqrt(FORCE_MAX), 20)])
    force, phi = (a.ravel() for a in np.meshgrid(roots**2, directions))
    load = fold(force, phi)
    b = bend(load.w, load.c, clamp_parameter(load))
    delta = np.arctan2(b.y, 1.0 - b.shortening)
    h, square = _arguments(b.radial_shortening, delta)
    root = np.sqrt(force * np.cos(phi - delta) + _OFFSET)
    targets = np.stack([root - 1.0 / (_H_MAX * h), force * np.sin(phi - delta) / (delta * root)], axis=1)
    found = np.linalg.lstsq(polyvander2d(h, square, [_DEGREE, _DEGREE]), targets, rcond=None)[0]
    return found.reshape(_DEGREE + 1, _DEGREE + 1, 2)


def first_guess(shortening: FloatArray, delta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the radial force and the tangential one over delta, to 1 %.

    Parameters
    ----------
    shortening, delta : ndarray
        ``1 - rho / l`` [-] and deflection [rad] of the tip, both positive.

    Returns
    -------
    radial, stiffness : ndarray
        ``F_r`` and ``F_t / delta`` [-].
    """
    h, square = _arguments(shortening, delta)
    excess, ratio = polyval2d(h, square, _coefficients())
    root = 1.0 / (_H_MAX * h) + excess
    return root**2 - _OFFSET, root * ratio
