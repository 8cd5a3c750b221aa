"""What importance sampling draws from: a Student t, bent or straight, with a wider one mixed in as a defence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, RandomState

from discovery.foundation.arrays import FloatArray

_DOF = 8.0
# Part of the draws that the defence makes, and how much wider it is.
_DEFENCE, _WIDER = 0.1, 2.5
#: Draws a dimension that must count before they alone tell it, and before anything is bent.
_ENOUGH = 12
# Of it, what is as good: weights are flattened to that number but for round-off.
_TRUSTED = 0.999
#: Polynomials go on as they are there, in standard deviations.
_REACH = 4.0
#: A polynomial is taken where the logarithm by which it lowers the variance, times the draws that count, exceeds so
#: many times its terms; and no polynomial has more terms than a third of these draws.
_EARNED = 3.0
#: What pulls its terms to zero, as so many draws would.
_RIDGE = 10.0
# It is held by what is left, and so told anew.
_PASSES = 3


@dataclass(frozen=True)
class Proposal:
    """A Student t around a centre, with a wider one mixed in (T. Hesterberg, Technometrics 37 (1995) 185)."""

    centre: FloatArray  # (d,), its centre
    factor: FloatArray  # (d, d), lower Cholesky factor of its scale matrix
    #: (d, d): matrix from the coordinates of the density to those in which valleys may bend; None: nothing bends.
    frame: FloatArray | None = None
    bend: Bend | None = None  # the map from straight coordinates, in which it is a Student t, to those of the frame

    @classmethod
    def standard(cls, dimension: int, frame: FloatArray | None = None) -> Proposal:
        """Return the proposal for a density that is roughly a standard normal one."""
        return cls(np.zeros(dimension), np.eye(dimension), frame)

    def draw(self, rng: Generator | RandomState, count: int) -> tuple[FloatArray, FloatArray]:
        """Return independent draws, shape (count, d), and their log densities, shape (count,)."""
        t = rng.standard_normal((count, self.centre.size)) / np.sqrt(rng.chisquare(_DOF, count) / _DOF)[:, None]
        t *= np.where(rng.random(count) < _DEFENCE, _WIDER, 1.0)[:, None]
        points = self.centre + np.einsum("nj,ij->ni", t, self.factor)
        if self.bend is not None and self.frame is not None:
            points = np.asarray(np.linalg.solve(self.frame, self.bend.bent(points).T).T, np.float64)
        return points, self._log_density(t)

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the log density at points (n, d), shape (n,)."""
        if self.bend is not None and self.frame is not None:
            points = self.bend.straight(points @ self.frame.T)
        return self._log_density(np.asarray(np.linalg.solve(self.factor, (points - self.centre).T).T, np.float64))

    def _log_density(self, t: FloatArray) -> FloatArray:
        """Return the log density where the coordinates of the standard Student t are these."""
        from scipy.special import gammaln

        d = self.centre.size
        square = np.einsum("nd,nd->n", t, t)
        constant = gammaln(0.5 * (_DOF + d)) - gammaln(0.5 * _DOF) - 0.5 * d * math.log(_DOF * math.pi)
        narrow = math.log(1 - _DEFENCE) - 0.5 * (_DOF + d) * np.log1p(square / _DOF)
        broad = math.log(_DEFENCE) - d * math.log(_WIDER) - 0.5 * (_DOF + d) * np.log1p(square / (_DOF * _WIDER**2))
        volume = float(np.log(np.diag(self.factor)).sum())
        if self.bend is not None and self.frame is not None:
            volume += float(np.log(self.bend.scale).sum() - np.linalg.slogdet(self.frame)[1])
        return np.asarray(constant + np.logaddexp(narrow, broad) - volume, np.float64)

    def adapted(self, points: FloatArray, weights: FloatArray) -> Proposal:
        """Return the proposal of the moments of weighted draws, which keeps to this one where few of them count."""
        trust = min(1.0, 1.0 / float(np.sum(weights**2)) / enough(self.centre.size))
        if self.frame is not None and trust > _TRUSTED:
            inside = weights > 0
            points, weights = points[inside], weights[inside]
            framed = points @ self.frame.T
            bend = Bend.of(framed, weights)
            if bend.shifts:
                mean, covariance = _moments(bend.straight(framed), weights)
                return Proposal(mean, np.asarray(np.linalg.cholesky(covariance), np.float64), self.frame, bend)
        mean, covariance = _moments(points, weights)
        if self.bend is None:
            covariance = trust * covariance + (1 - trust) * self.factor @ self.factor.T
        return Proposal(mean, np.asarray(np.linalg.cholesky(covariance), np.float64), self.frame)


def enough(dimension: int) -> float:
    """Return how many draws must count before a proposal is told by them alone, and may bend."""
    return float(_ENOUGH * dimension)


def _moments(points: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of weighted draws."""
    mean = np.einsum("n,nd->d", weights, points)
    off = points - mean
    return mean, np.einsum("n,ni,nj->ij", weights, off, off)


@dataclass(frozen=True)
class Bend:
    """A map that bends straight distributions into bananas: the mean of some coordinates is a curve of others.

    Under dry friction, initial displacement and initial rate lie on a curve: the way to a stop is the signed square of
    the rate. A triangular map (Y. Marzouk et al., Handbook of Uncertainty Quantification (2016), ch. 23) follows such a
    valley: a polynomial of the other coordinates shifts each bent one. Volumes stay, and with them densities.
    """

    #: centre, scale (d,): of the coordinates in which it is defined.
    centre: FloatArray
    scale: FloatArray
    #: Coordinate, the coordinates that shift it, and the coefficients of their terms; in the order in which they are
    #: added.
    shifts: tuple[tuple[int, tuple[int, ...], FloatArray], ...] = ()

    @classmethod
    def of(cls, points: FloatArray, weights: FloatArray) -> Bend:
        """Return the map whose bent coordinates are those of weighted draws (n, d).

        The coordinate whose mean a curve of all others tells best comes last, then the one of those left, and so on.
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
    """Return the first so many of: one, coordinates (n, m), their squares, signed squares, cubes, products in pairs."""
    n, m = y.shape
    y = np.clip(y, -_REACH, _REACH)
    plain = np.hstack([np.ones((n, 1)), y, y**2, y * np.abs(y), y**3])
    if count == plain.shape[1]:
        return plain
    first, second = np.triu_indices(m, 1)
    return np.hstack([plain, y[:, first] * y[:, second]])


def _regressed(
    target: FloatArray, given: FloatArray, weights: FloatArray, effective: float
) -> tuple[float, FloatArray]:
    """Return what a curve gains over a line beyond what it must, and its coefficients; below zero where not enough."""
    m = given.shape[1]
    most = int(effective / _EARNED)
    count = next((c for c in (1 + 4 * m + m * (m - 1) // 2, 1 + 4 * m) if c <= most), 0)
    if count <= m + 1:
        return -1.0, np.zeros(0)
    terms = _terms(given, count)
    normal, right = terms.T @ (weights[:, None] * terms), terms.T @ (weights * target)
    line = terms[:, : m + 1] @ np.linalg.solve(normal[: m + 1, : m + 1] + 1e-9 * np.eye(m + 1), right[: m + 1])
    straight = curved = _variance(target - line, weights)
    for _ in range(_PASSES):
        # The ridge holds what is not linear, as firmly as what is left asks for.
        ridge = _RIDGE / effective * curved
        pulled = normal + np.diag(np.r_[np.full(m + 1, 1e-9), np.full(count - m - 1, ridge)])
        coefficients = np.linalg.solve(pulled, right)
        curved = _variance(target - terms @ coefficients, weights)
    return effective * float(np.log(straight / curved)) - _EARNED * count, coefficients


def _variance(values: FloatArray, weights: FloatArray) -> float:
    return float(weights @ (values - weights @ values) ** 2)
