"""A map that bends straight distributions into bananas: the mean of some coordinates is a cubic of others.

Under dry friction, initial displacement and initial rate lie on a curve. A triangular map (Y. Marzouk et al., Handbook
of Uncertainty Quantification (2016), ch. 23) follows such a valley: a polynomial of the other coordinates shifts each
bent one. Volumes stay, and with them densities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import FloatArray

#: Polynomials go on as they are there, in standard deviations.
_REACH = 4.0
#: A polynomial is taken where the logarithm by which it lowers the variance, times the draws that count, exceeds so
#: many times its terms; and no polynomial has more terms than a third of these draws.
_EARNED = 3.0
#: What pulls its terms to zero, as so many draws would.
_RIDGE = 10.0


@dataclass(frozen=True)
class Bend:
    """A triangular map.

    Parameters
    ----------
    centre, scale : ndarray, shape (d,)
        Of the coordinates in which it is defined.
    shifts : tuple of (int, tuple of int, ndarray)
        Coordinate, the coordinates that shift it, and the coefficients of their terms; in the order in which they are
        added.
    """

    centre: FloatArray
    scale: FloatArray
    shifts: tuple[tuple[int, tuple[int, ...], FloatArray], ...] = ()

    @classmethod
    def of(cls, points: FloatArray, weights: FloatArray) -> Bend:
        """Return the map whose bent coordinates are those of weighted draws (n, d).

        The coordinate whose mean a cubic of all others tells best comes last, then the one of those left, and so on.
        """
        centre = weights @ points
        scale = np.sqrt(weights @ (points - centre) ** 2)
        y, effective = (points - centre) / scale, 1.0 / float(np.sum(weights**2))
        left, found = list(range(points.shape[1])), []
        while len(left) > 1:
            tried = [(i, tuple(j for j in left if j != i)) for i in left]
            fits = [_regressed(y[:, i], y[:, others], weights, effective) for i, others in tried]
            best = max(range(len(fits)), key=lambda k: fits[k][0])
            if not fits[best][0] > 0:
                break
            found.append((*tried[best], fits[best][1]))
            left.remove(tried[best][0])
        return cls(centre, scale, tuple(reversed(found)))

    def bent(self, straight: FloatArray) -> FloatArray:
        """Return bent points (n, d) of straight ones."""
        y = straight.copy()
        for i, others, coefficients in self.shifts:
            y[:, i] += _terms(y[:, others], coefficients.size) @ coefficients
        return self.centre + self.scale * y

    def straight(self, points: FloatArray) -> FloatArray:
        """Return straight points (n, d) of bent ones."""
        y = (points - self.centre) / self.scale
        found = y.copy()
        for i, others, coefficients in self.shifts:
            found[:, i] -= _terms(y[:, others], coefficients.size) @ coefficients
        return found


def _terms(y: FloatArray, count: int) -> FloatArray:
    """Return the first so many of: one, the coordinates (n, m), their squares and cubes, their products in pairs."""
    n, m = y.shape
    y = np.clip(y, -_REACH, _REACH)
    plain = np.hstack([np.ones((n, 1)), y, y**2, y**3])
    if count == plain.shape[1]:
        return plain
    first, second = np.triu_indices(m, 1)
    return np.hstack([plain, y[:, first] * y[:, second]])


def _regressed(
    target: FloatArray, given: FloatArray, weights: FloatArray, effective: float
) -> tuple[float, FloatArray]:
    """Return what a cubic gains over a line beyond what it must, and its coefficients; below zero where not enough."""
    m = given.shape[1]
    most = int(effective / _EARNED)
    count = next((c for c in (1 + 3 * m + m * (m - 1) // 2, 1 + 3 * m) if c <= most), 0)
    if count <= m + 1:
        return -1.0, np.zeros(0)
    terms = _terms(given, count)
    normal = terms.T @ (weights[:, None] * terms)
    # The ridge holds what is not linear.
    pulled = normal + np.diag(np.r_[np.full(m + 1, 1e-9), np.full(count - m - 1, _RIDGE / effective)])
    right = terms.T @ (weights * target)
    coefficients = np.linalg.solve(pulled, right)
    line = terms[:, : m + 1] @ np.linalg.solve(pulled[: m + 1, : m + 1], right[: m + 1])
    straight, curved = (_variance(target - fit, weights) for fit in (line, terms @ coefficients))
    return effective * float(np.log(straight / curved)) - _EARNED * count, coefficients


def _variance(values: FloatArray, weights: FloatArray) -> float:
    return float(weights @ (values - weights @ values) ** 2)
