"""A mixture of multivariate Student t distributions: a proposal that covers posteriors of any shape."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import RandomState

from discovery.foundation.arrays import FloatArray
from discovery.foundation.workers import single_algebra

#: Degrees of freedom; tails heavier than those of the posterior keep walkers from sticking there.
_DOF = 30.0
#: One component is so many times as wide as all others together, with this weight: it finds what they miss.
_WIDE, _WIDE_WEIGHT = 4.0, 0.03
# Components, each of so many different points a dimension; no more points than are of use.
_COMPONENTS, _POINTS_A_DIMENSION, _POINTS = (2, 8), 30, 3000
_LEAST_WEIGHT = 0.005


@dataclass(frozen=True)
class StudentMixture:
    """A mixture of multivariate Student t distributions.

    Its m components have `weights` (m,), `centres` (m, d), and scale matrices with lower Cholesky `factors` (m, d, d).
    """

    weights: FloatArray
    centres: FloatArray
    factors: FloatArray

    @classmethod
    def standard(cls, dimension: int, scale: float = 1.0) -> StudentMixture:
        """Return a round distribution around the origin, for coordinates that a fit has whitened."""
        return cls._with_wide(np.ones(1), np.zeros((1, dimension)), scale * np.eye(dimension)[None])

    @classmethod
    def of_points(cls, points: FloatArray, seed: int) -> StudentMixture:
        """Return the mixture that points (k, d) look drawn from; a Bayesian fit chooses the number of components."""
        # Only hardly accepted proposals need it, and its import takes long.
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.mixture import BayesianGaussianMixture

        points = points[:: -(-len(points) // _POINTS)]
        d = points.shape[1]
        covariance = np.cov(points, rowvar=False).reshape(d, d)
        centre, factor = np.mean(points, axis=0), np.linalg.cholesky(covariance)
        # Walkers that rejected a proposal are the same point once more, and tell nothing new.
        different = len(np.unique(points[:, 0]))
        most = int(np.clip(different // (_POINTS_A_DIMENSION * d), *_COMPONENTS))
        fit = BayesianGaussianMixture(n_components=most, max_iter=100, random_state=seed)
        with warnings.catch_warnings(), single_algebra():
            # An unfinished fit is a good proposal all the same.
            warnings.simplefilter("ignore", ConvergenceWarning)
            fit.fit(np.linalg.solve(factor, (points - centre).T).T)
        kept = fit.weights_ > _LEAST_WEIGHT
        return cls._with_wide(
            fit.weights_[kept] / fit.weights_[kept].sum(),
            centre + fit.means_[kept] @ factor.T,
            np.asarray(factor @ np.linalg.cholesky(fit.covariances_[kept]), np.float64),
        )

    @classmethod
    def _with_wide(cls, weights: FloatArray, centres: FloatArray, factors: FloatArray) -> StudentMixture:
        centre = weights @ centres
        away = centres - centre
        covariance = np.einsum("m,mij,mkj->ik", weights, factors, factors) + (weights[:, None] * away).T @ away
        return cls(
            np.append((1 - _WIDE_WEIGHT) * weights, _WIDE_WEIGHT),
            np.concatenate([centres, centre[None]]),
            np.concatenate([factors, _WIDE * np.linalg.cholesky(covariance)[None]]),
        )

    @cached_property
    def _inverses(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.factors), np.float64)

    @cached_property
    def _log_scales(self) -> FloatArray:
        return np.log(self.weights) - np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)

    def draw(self, random: RandomState, count: int) -> FloatArray:
        """Return independent draws, shape (count, d)."""
        z = random.standard_normal((count, self.centres.shape[1]))
        z /= np.sqrt(random.chisquare(_DOF, count) / _DOF)[:, None]
        ends = np.cumsum(random.multinomial(count, self.weights))
        points = np.empty_like(z)
        starts = np.append(0, ends[:-1])
        for first, last, centre, factor in zip(starts, ends, self.centres, self.factors, strict=True):
            points[first:last] = centre + np.einsum("kj,ij->ki", z[first:last], factor)
        # Which walker gets a draw of which component is left to chance.
        return points[random.permutation(count)]

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the log density (k,) at points (k, d), up to a constant."""
        d = points.shape[1]
        parts = np.empty((len(self.weights), len(points)))
        # Not by BLAS here and above: its threads would spin for these few numbers.
        for part, centre, inverse, log_scale in zip(parts, self.centres, self._inverses, self._log_scales, strict=True):
            z = np.einsum("kj,ij->ki", points - centre, inverse)
            part[:] = log_scale - 0.5 * (_DOF + d) * np.log1p(np.einsum("kd,kd->k", z, z) / _DOF)
        return np.logaddexp.reduce(parts)
