"""One parameter over several specimens: its mean, its spread, and each specimen's value with the others' help."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError

#: Points at which the spread is integrated over, and how far beyond the smallest and the largest scale of the data.
_POINTS, _BEYOND = 600, 1e4
#: Probabilities of the ends and the middle of an interval.
_PROBABILITIES = np.array([0.025, 0.5, 0.975])
#: Halvings by which a quantile is found.
_HALVINGS = 60


@dataclass(frozen=True)
class Quantity:
    """A posterior in three numbers: an interval of 95 % probability, equal tails, and its middle."""

    low: float
    median: float
    high: float


@dataclass(frozen=True)
class Pooled:
    """A parameter over specimens: the population's mean, the sd between specimens, and the value of the next specimen.

    Each specimen has its value, shrunk towards the mean, and its `shrinkage`: by which part of its distance from the
    mean its estimate is moved, on average over the spread, 0 for one that stands for itself, 1 for one that tells
    nothing.
    """

    mean: Quantity
    spread: Quantity
    following: Quantity
    specimens: tuple[Quantity, ...]
    shrinkage: tuple[float, ...]


def pool(values: ArrayLike, sds: ArrayLike) -> Pooled:
    r"""Return the posterior of the normal hierarchical model of some estimates of one parameter.

    Specimen :math:`j` has the value :math:`\theta_j \sim N(\mu, \tau^2)`, and its estimate is
    :math:`y_j \sim N(\theta_j, \sigma_j^2)`, with :math:`\sigma_j^2` the parameter's entry in the covariance of that
    specimen's fit; parameters are pooled one by one. With a flat prior of :math:`\mu` (Gelman and others, Bayesian
    Data Analysis, 3rd edition, equations 5.17 to 5.21)

    .. math::

        p(\tau \mid y) \propto p(\tau)\, V^{1/2}
            \prod_j (\sigma_j^2 + \tau^2)^{-1/2} \exp\left(-\frac{(y_j - \hat\mu)^2}{2 (\sigma_j^2 + \tau^2)}\right),
        \quad V^{-1} = \sum_j \frac{1}{\sigma_j^2 + \tau^2},
        \quad \hat\mu = V \sum_j \frac{y_j}{\sigma_j^2 + \tau^2},

    and given :math:`\tau` everything else is normal, so that all that is left is one sum over :math:`\tau`. The prior
    is that of DuMouchel, :math:`p(\tau) = \sigma_0 / (\sigma_0 + \tau)^2` with :math:`\sigma_0^2` the harmonic mean of
    the :math:`\sigma_j^2` (DuMouchel and Normand 2000; Röver, Journal of Statistical Software 93(6), 2020): it knows
    no unit, leaves specimens without any spread possible, and is proper from two specimens on.

    `values` and `sds` (n,) are the estimates and their standard deviations, in the parameter's unit. InputError if
    there are fewer than two, or a standard deviation is not positive.
    """
    y, sigma = np.asarray(values, np.float64), np.asarray(sds, np.float64)
    if y.ndim != 1 or y.shape != sigma.shape or y.size < 2:
        raise InputError("Estimates of at least two specimens are needed, each with its standard deviation.")
    if not (np.isfinite(y).all() and np.isfinite(sigma).all() and (sigma > 0).all()):
        raise InputError("Every estimate needs a positive standard deviation.")
    # Numbers around one, whatever the unit.
    origin, unit = float(np.mean(y)), float(sigma.min())
    y, sigma = (y - origin) / unit, sigma / unit
    tau, weight = _spread(y, sigma)
    precision = 1.0 / (sigma**2 + tau[:, None] ** 2)
    variance = 1.0 / precision.sum(axis=1)
    centre = variance * (precision @ y)
    # Given the spread, a specimen is its estimate and the mean, weighted by their precisions (BDA 5.17, the mean's own
    # uncertainty added).
    share = sigma**2 * precision
    means = share * centre[:, None] + (1.0 - share) * y
    variances = (1.0 - share) * sigma**2 + share**2 * variance[:, None]

    def told(mean: FloatArray, sd: FloatArray) -> Quantity:
        return Quantity(*(origin + unit * _quantiles(mean, sd, weight)).tolist())

    spread = np.interp(_PROBABILITIES, np.cumsum(weight) - weight / 2, tau)
    return Pooled(
        told(centre, np.sqrt(variance)),
        Quantity(*(unit * spread).tolist()),
        told(centre, np.sqrt(variance + tau**2)),
        tuple(told(means[:, j], np.sqrt(variances[:, j])) for j in range(y.size)),
        tuple((weight @ share).tolist()),
    )


def _spread(y: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values of the spread and the posterior probability of each."""
    largest = max(float(np.ptp(y)), float(sigma.max()))
    log_tau = np.linspace(np.log(sigma.min() / _BEYOND), np.log(largest * _BEYOND), _POINTS)
    tau = np.exp(log_tau)
    total = sigma**2 + tau[:, None] ** 2
    variance = 1.0 / (1.0 / total).sum(axis=1)
    centre = variance * (y / total).sum(axis=1)
    scale = np.sqrt(1.0 / np.mean(1.0 / sigma**2))
    # The last term: equal steps of the logarithm are unequal ones of the spread.
    log_density = (
        0.5 * np.log(variance)
        - 0.5 * (np.log(total) + (y - centre[:, None]) ** 2 / total).sum(axis=1)
        - 2.0 * np.log(scale + tau)
        + log_tau
    )
    weight = np.exp(log_density - log_density.max())
    return tau, weight / weight.sum()


def _quantiles(mean: FloatArray, sd: FloatArray, weight: FloatArray) -> FloatArray:
    """Return quantiles of a mixture of normal distributions, by halving."""
    kept = weight > 1e-12 * weight.max()
    mean, sd, weight = mean[kept], sd[kept], weight[kept] / weight[kept].sum()
    low = np.full(_PROBABILITIES.size, (mean - 10.0 * sd).min())
    high = np.full(_PROBABILITIES.size, (mean + 10.0 * sd).max())
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = ndtr((middle[:, None] - mean) / sd) @ weight < _PROBABILITIES
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)
