"""One replication of simulation-based calibration: a truth from the prior, data from the model, ranks in the posterior.

If the posterior is right, the rank of a true value among draws from it is uniform (S. Talts et al., arXiv:1804.06788).
So is that of the true log likelihood among those of the draws, which sees errors that no single parameter shows (M.
Modrak et al., Bayesian Analysis 20 (2025) 461).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from discovery.declarations.priors import Normal, Prior
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import covariance_of
from discovery.estimation.fit import Fit
from discovery.estimation.importance import LARGEST_K, Weighted, importance_sample
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.posterior.likelihood import NOISE_PRIOR, LogPosterior, log_posterior
from discovery.posterior.noise import GAUSSIAN, noise_of
from discovery.posterior.noise.model import instruments, share_of
from discovery.recordings.experiment import Experiment

FloatArray = NDArray[np.float64]
RANKED = 99  # draws among which a truth is ranked: ranks 0 to 99
#: Of the logarithm of the noise factor, in place of one that is flat over any noise: truths are drawn from it.
NOISE = Normal(0.0, 0.3)


@dataclass(frozen=True)
class Study:
    """A model whose posterior is calibrated.

    Parameters
    ----------
    name, title : str
        For files and for people.
    model : Model
        What makes the data and is fitted to them.
    experiment : Experiment
        Times, drive and stated noise; its readings do not matter.
    gaussian : mapping of str to (mean, sd)
        Proper priors of the free parameters whose declared one is not; cut off at three standard deviations.
    units : NaturalUnits
        Those of the other priors.
    step : float
        Integration step [s].
    noise : str
        Noise model.
    """

    name: str
    title: str
    model: Model
    experiment: Experiment
    gaussian: Mapping[str, tuple[float, float]]
    units: NaturalUnits
    step: float
    noise: str = GAUSSIAN

    def problem(self, readings: FloatArray) -> Problem:
        """Return the problem for readings (n, c)."""
        recording = replace(self.experiment.recording, output=readings)
        bench = Bench(self.model.base, self.model.effects, [replace(self.experiment, recording=recording)], self.step)
        return Problem(self.model, bench, self.units, self.gaussian)


def drawn_from(prior: Prior, lower: float, upper: float, rng: Generator) -> float:
    """Draw from a prior within bounds."""
    if not prior.is_proper:
        raise TypeError(f"{prior} is no density to draw from")
    while True:
        value = float(prior.draws(rng, 1)[0])
        if lower <= value <= upper:
            return value


def drawn_truth(target: LogPosterior, rng: Generator) -> FloatArray:
    """Draw a sampled vector (d,) from the very priors of the posterior, but `NOISE` for the noise factors."""
    bounds = zip(*target.problem.bounds, strict=True)
    free = [drawn_from(p, low, high, rng) for p, (low, high) in zip(target.problem.priors, bounds, strict=True)]
    shapes = [p.prior for model in target.models for p in model.parameters]
    others = [drawn_from(p, -np.inf, np.inf, rng) for p in [NOISE] * len(target.instruments) + shapes]
    return np.array([*free, *others])


def noise_drawn(study: Study, noise: FloatArray, shape: tuple[int, int], rng: Generator) -> FloatArray:
    """Draw errors of readings (n, c), in units of the stated noise, for the parameters (1 + m,) of a noise model."""
    size = np.exp(noise[0])
    white = rng.standard_normal(shape)
    if study.noise == "student_t":
        nu = np.exp(noise[1])
        return size * white / np.sqrt(rng.chisquare(nu, shape) / nu)
    if study.noise == "correlated":
        share, tau = float(share_of(noise[1])), np.exp(noise[2])
        kept = np.exp(-np.diff(study.experiment.recording.time) / tau)
        slow = rng.standard_normal(shape)
        for i, keep in enumerate(kept, 1):
            slow[i] = keep * slow[i - 1] + np.sqrt(1 - keep**2) * slow[i]
        return size * (np.sqrt(1 - share) * white + np.sqrt(share) * slow)
    return size * white


def fitted(problem: Problem) -> Fit:
    """Fit from the prior's mean and the first readings."""
    (minimum,) = fit_problems([problem], [problem.start({})])
    return Fit(problem, minimum, *covariance_of(problem, minimum), solver_shift=0.0)


def density_of(target: LogPosterior):
    """Return the log posterior density with `NOISE` in place of the flat prior of the noise factors."""
    p, m = len(target.problem.names), len(target.instruments)

    def density(z: FloatArray) -> FloatArray:
        factors = target.vectors(z)[:, p : p + m]
        return target(z) + (NOISE.log_density(factors) - NOISE_PRIOR.log_density(factors)).sum(axis=1)

    return density


def simulated(study: Study, rng: Generator) -> tuple[FloatArray, Problem]:
    """Return a truth (d,) from the prior, and the problem of data that it makes."""
    empty = study.problem(np.zeros_like(study.experiment.recording.output))
    parts = instruments(empty.bench.experiments)
    d = len(empty.names) + len(parts)
    prior = LogPosterior(empty, parts, np.zeros(d), np.eye(d), noise_of(study.noise, empty, parts))
    truth = drawn_truth(prior, rng)
    p = len(empty.names)
    clean = empty.predict(truth[:p])[0]
    errors = noise_drawn(study, truth[p:], clean.shape, rng)
    return truth, study.problem(clean + errors * study.experiment.recording.noise)


def replication(study: Study, rng: Generator, *, draws: int = 2000) -> dict[str, object]:
    """Draw a truth and data, find the posterior, and return where the truth lies in it.

    Parameters
    ----------
    study : Study
    rng : Generator
    draws : int
        Importance draws.

    Returns
    -------
    dict
        ``pit``: posterior probability below the truth, and ``rank``: how many of `RANKED` draws are, both by name, of
        which ``log_likelihood`` is one, too. ``k``, ``effective`` and ``reliable`` are of the importance draws.
    """
    truth, problem = simulated(study, rng)
    target = log_posterior(fitted(problem), study.noise)
    drawn = importance_sample(density_of(target), target.dimension, rng, draws)
    return {**placed(target, drawn, truth, rng), "k": drawn.pareto_k, "effective": drawn.effective}


def placed(target: LogPosterior, drawn: Weighted, truth: FloatArray, rng: Generator) -> dict[str, object]:
    """Return where a truth (d,) lies among weighted draws."""
    vectors = target.vectors(drawn.points)
    chosen = vectors[rng.choice(len(vectors), RANKED, p=drawn.weights / drawn.weights.sum())]
    likelihood = target.log_likelihood(np.vstack([chosen, truth]))
    pit = drawn.weights @ (vectors < truth)
    rank = (chosen < truth).sum(axis=0)
    below = int((likelihood[:-1] < likelihood[-1]).sum())
    names = [*target.names, "log_likelihood"]
    return {
        # The log likelihood is known at the ranked draws only: anywhere between two of them.
        "pit": dict(zip(names, [*pit.tolist(), (below + rng.random()) / (RANKED + 1)], strict=True)),
        "rank": dict(zip(names, [*rank.tolist(), below], strict=True)),
        "reliable": bool(drawn.pareto_k <= LARGEST_K),
    }
