"""What importance sampling draws from: a Student t, bent or straight, with a wider one mixed in as a defence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from discovery.estimation.bent import Bend
from discovery.foundation.arrays import FloatArray

_DOF = 8.0
# Part of the draws that the defence makes, and how much wider it is.
_DEFENCE, _WIDER = 0.1, 2.5
#: Draws a dimension that must count before anything is bent.
_ENOUGH = 10


@dataclass(frozen=True)
class Proposal:
    """A Student t around a centre, with a wider one mixed in (T. Hesterberg, Technometrics 37 (1995) 185).

    Parameters
    ----------
    centre : ndarray, shape (d,)
        Its centre.
    factor : ndarray, shape (d, d)
        Lower Cholesky factor of its scale matrix.
    frame : ndarray, shape (d, d), optional
        Matrix from the coordinates of the density to those in which valleys may bend; None: nothing bends.
    bend : Bend, optional
        The map from straight coordinates, in which it is a Student t, to those of the frame.
    """

    centre: FloatArray
    factor: FloatArray
    frame: FloatArray | None = None
    bend: Bend | None = None

    @classmethod
    def standard(cls, dimension: int, frame: FloatArray | None = None) -> Proposal:
        """Return the proposal for a density that is roughly a standard normal one."""
        return cls(np.zeros(dimension), np.eye(dimension), frame)

    def draw(self, rng: Generator, count: int) -> tuple[FloatArray, FloatArray]:
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
        d, effective = self.centre.size, 1.0 / float(np.sum(weights**2))
        if self.frame is not None and effective >= _ENOUGH * d:
            inside = weights > 0
            points, weights = points[inside], weights[inside]
            framed = points @ self.frame.T
            bend = Bend.of(framed, weights)
            if bend.shifts:
                mean, covariance = _moments(bend.straight(framed), weights)
                return Proposal(mean, np.asarray(np.linalg.cholesky(covariance), np.float64), self.frame, bend)
        mean, covariance = _moments(points, weights)
        if self.bend is None:
            trust = effective / (effective + 2 * d)
            covariance = trust * covariance + (1 - trust) * self.factor @ self.factor.T
        return Proposal(mean, np.asarray(np.linalg.cholesky(covariance), np.float64), self.frame)


def _moments(points: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of weighted draws."""
    mean = np.einsum("n,nd->d", weights, points)
    off = points - mean
    return mean, np.einsum("n,ni,nj->ij", weights, off, off)
