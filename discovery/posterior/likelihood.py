r"""The log posterior of a fitted problem, for many parameter sets at once, in coordinates in which it is nearly round.

The readings are Gaussian around the simulated ones. Their standard deviation is the stated noise times one factor per
instrument, which is sampled with the parameters: with chi-square :math:`\chi_g^2` over the :math:`n_g` readings of
instrument g at the stated noise,

.. math:: \log L = -\sum_g \left[ \chi_g^2 / (2 f_g^2) + n_g \log f_g \right] + \mathrm{const.}

There the errors count as independent. Where the model lacks something they are not, and f then absorbs the misfit. The
models of `discovery.posterior.noise` have a likelihood and parameters of their own for such errors, outliers and
rounding.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from discovery.declarations.priors import Normal
from discovery.estimation.fit import Fit
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import NotIdentifiable
from discovery.posterior.noise import GAUSSIAN, Noise, NoiseParameter, noise_of
from discovery.posterior.noise.model import Instrument, instruments
from discovery.posterior.whitening import cholesky, information_covariance, refined_start, residual_blocks, settled

#: Of the logarithm of the noise factor: flat over any factor that could occur, and yet a density.
NOISE_PRIOR = Normal(0.0, 5.0)
# Residuals at once, in whole blocks of the kernel's lanes.
_CACHED, _LANES = 400_000, 32


@dataclass(frozen=True)
class LogPosterior:
    """Log posterior of `problem` in whitened coordinates z; the sampled vector is ``centre + factor @ z``.

    The vector (d,) holds the free numbers of the problem, then the logarithm of the noise factor of every instrument,
    then what else describes the noise of every instrument, on scales without bounds. The centre is the minimum of the
    fit, the factor the lower Cholesky factor of the covariance there, and `models` the noise of every instrument;
    nothing for independent Gaussian errors.
    """

    problem: Problem
    instruments: tuple[Instrument, ...]
    centre: FloatArray
    factor: FloatArray
    models: tuple[Noise, ...] = ()

    @property
    def dimension(self) -> int:
        """Number of sampled quantities d."""
        return self.centre.size

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the sampled quantities."""
        return (*self.problem.names, *(part.name for part in self.instruments), *(name for name, _ in self._extra))

    @property
    def noise(self) -> str:
        """Name of the noise model."""
        return self.models[0].name if self.models else GAUSSIAN

    @cached_property
    def _extra(self) -> tuple[tuple[str, NoiseParameter], ...]:
        """Name and declaration of every parameter of a noise beside its size."""
        return tuple((model.part.named(p.name), p) for model in self.models for p in model.parameters)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Units of the sampled quantities, ``q`` written out."""
        problem = self.problem
        experiment = problem.bench.experiments[0]
        coordinate = experiment.coordinate_unit
        physical = [experiment.unit_of(problem.model.parameters[n]) for n in problem.free]
        initial = [state.unit(coordinate) for state in problem.states]
        noise = [*(part.unit for part in self.instruments), *(p.unit for _, p in self._extra)]
        return (*physical, *initial, *noise)

    @property
    def meanings(self) -> dict[str, str]:
        """What every quantity of the noise means, by name."""
        sizes = [model.size for model in self.models] or [Noise.size] * len(self.instruments)
        named = zip((part.name for part in self.instruments), sizes, strict=True)
        return {**dict(named), **{name: parameter.meaning for name, parameter in self._extra}}

    def vectors(self, z: FloatArray) -> FloatArray:
        """Return the sampled vectors (..., d) of whitened coordinates (..., d)."""
        # Not a matrix product: BLAS would wake its threads for these few numbers.
        return self.centre + np.einsum("...j,ij->...i", z, self.factor)

    def values(self, z: FloatArray) -> FloatArray:
        """Return the quantities in SI units (..., d) of whitened coordinates; the noise as a standard deviation."""
        return self._natural(self.vectors(z))

    def _natural(self, vectors: FloatArray) -> FloatArray:
        """Return sampled vectors (..., d) in SI units."""
        values = vectors.copy()
        for k, instrument in enumerate(self.instruments, start=len(self.problem.names)):
            values[..., k] = instrument.noise * np.exp(values[..., k])
        for k, (_, parameter) in enumerate(self._extra, start=self.dimension - len(self._extra)):
            values[..., k] = parameter.value(values[..., k])
        return values

    @property
    def noise_reference(self) -> dict[str, tuple[float, float]]:
        """Start value and standard deviation of every parameter of the noise, by name, in SI units."""
        sd = np.linalg.norm(self.factor, axis=1)
        ends = [self._natural(self.centre + shift) for shift in (0.0, sd, -sd)]
        first = len(self.problem.names)
        return {
            name: (float(middle), 0.5 * float(up - down))
            for name, middle, up, down in list(zip(self.names, *ends, strict=True))[first:]
        }

    def log_prior(self, vectors: FloatArray) -> FloatArray:
        """Return the log prior density of sampled vectors (k, d), minus infinity outside the bounds."""
        p = len(self.problem.names)
        total = np.zeros(len(vectors))
        noise = [NOISE_PRIOR] * len(self.instruments) + [parameter.prior for _, parameter in self._extra]
        for prior, column in zip([*self.problem.priors, *noise], vectors.T, strict=True):
            total += prior.log_density(column)
        lower, upper = self.problem.bounds
        inside = ((vectors[:, :p] >= lower) & (vectors[:, :p] <= upper)).all(axis=1)
        return np.where(inside, total, -np.inf)

    def log_likelihood(self, vectors: FloatArray) -> FloatArray:
        """Return the log likelihood of sampled vectors (k, d), minus infinity where the motion blows up."""
        if self.models:
            return self._other_log_likelihood(vectors)
        p = len(self.problem.names)
        chi2 = self._chi2(vectors[:, :p].T)
        total = np.zeros(len(vectors))
        with np.errstate(over="ignore", invalid="ignore"):
            for part, log_factor, misfit in zip(self.instruments, vectors.T[p:], chi2, strict=True):
                total += part.log_weights - 0.5 * part.n * math.log(2 * math.pi)
                total -= 0.5 * misfit * np.exp(-2 * log_factor) + part.n * log_factor
        return np.where(np.isfinite(total), total, -np.inf)

    def _chi2(self, x: FloatArray) -> FloatArray:
        """Return chi-square at the stated noise, shape (instruments, k), for free vectors (p, k)."""
        with np.errstate(all="ignore"):
            each = self.problem.bench.chi2(*self.problem.expand(x))
        return np.array([each[list(part.experiments)].sum(axis=0) for part in self.instruments])

    def _other_log_likelihood(self, vectors: FloatArray) -> FloatArray:
        """Return the log likelihood under the noise models, a few parameter sets after the other."""
        bench, p, m = self.problem.bench, len(self.problem.names), len(self.instruments)
        total = np.full(len(vectors), sum(part.log_weights for part in self.instruments))
        width = max(1, _CACHED // (bench.n_rows * _LANES)) * _LANES
        for first in range(0, len(vectors), width):
            part = slice(first, first + width)
            x, size, others = np.split(vectors[part].T, [p, p + m])
            with np.errstate(all="ignore"):
                blocks = residual_blocks(self.problem, x)
                for k, model in enumerate(self.models):
                    own, others = np.split(others, [len(model.parameters)])
                    noise = np.concatenate([size[k : k + 1], own])
                    for i in model.part.experiments:
                        total[part] += model.log_likelihood(i, blocks[i], x, noise)
        return np.where(np.isfinite(total), total, -np.inf)

    def __call__(self, z: FloatArray) -> FloatArray:
        """Return the log posterior density at whitened coordinates (k, d), up to the constant of the evidence.

        It is the density of the sampled vector: of the logarithm of the noise, not of the noise.
        """
        vectors = self.vectors(z)
        total = self.log_prior(vectors)
        inside = np.isfinite(total)
        if inside.any():
            total[inside] += self.log_likelihood(vectors[inside])
        return total


def undetermined_parameters(fit: Fit) -> tuple[Mapping[str, float], ...]:
    """Return the combinations that the data leave undetermined in which a parameter of the model takes part."""
    return tuple(d for d in fit.null_directions if any(name in fit.problem.free for name in d))


def log_posterior(fit: Fit, noise: str = GAUSSIAN) -> LogPosterior:
    """Return the log posterior around a fit on any base, under a noise model by its name.

    For Gaussian noise, the covariance is that of Gauss and Newton at the minimum, with the residuals' own size as
    noise, and with the widths of the declared priors: it is finite also where a parameter lies on a bound. For other
    noise it is that of generalised least squares, around the mode under that noise.

    NotIdentifiable if the data leave a combination of parameters undetermined, other than of starts alone, which the
    priors hold; InputError for a noise model that is not known, or does not apply to these recordings.
    """
    problem = fit.problem
    if undetermined := undetermined_parameters(fit):
        raise NotIdentifiable(
            undetermined, "A posterior would only repeat the priors along directions that the data leave open."
        )
    parts = instruments(problem.bench.experiments)
    models = noise_of(noise, problem, parts)
    widths = np.array([prior.width for prior in problem.priors])
    if models:
        centre, covariance = refined_start(fit, models, widths, NOISE_PRIOR)
        whitened = settled(lambda c, f: LogPosterior(problem, parts, c, f, models), centre, cholesky(covariance))
        return LogPosterior(problem, parts, *whitened, models)
    rows, n_rows = [own for own, _ in problem.bench.blocks()], problem.bench.n_rows
    residual, jacobian = fit.minimum.residual[:n_rows], fit.minimum.jacobian[:n_rows].copy()
    log_factors = []
    for part in parts:
        chi2 = sum(float(np.sum(residual[rows[i]] ** 2)) for i in part.experiments)
        log_factors.append(0.5 * math.log(max(chi2, np.finfo(float).tiny) / part.n))
        for i in part.experiments:
            jacobian[rows[i]] *= math.exp(-log_factors[-1])
    p, d = len(problem.names), len(problem.names) + len(parts)
    covariance = np.zeros((d, d))
    covariance[:p, :p] = information_covariance(jacobian, widths)
    covariance[range(p, d), range(p, d)] = [0.5 / part.n for part in parts]
    return LogPosterior(problem, parts, np.concatenate([fit.minimum.x, log_factors]), cholesky(covariance))
