"""The force that a model lacks, in time: what makes its free run follow a recording, with intervals.

The force per unit inertia f(t) [s^-2 q] turns the tip (it pushes on the coordinate of an oscillator). It is a Gaussian
process with a Matern-3/2 covariance, smooth once, on cubic B-splines with twelve knots a period; its size and memory
are those of the highest marginal likelihood (Rasmussen and Williams, Gaussian Processes for Machine Learning (2006),
sections 2.3 and 5.4.1; Alvarez, Luengo and Lawrence, IEEE Transactions on Pattern Analysis 35 (2013) 2693). The initial
state is free, the fitted parameters are held: what they absorbed is not in the force. What is shorter than a knot is
spread over one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar

from discovery.diagnosis.chain_newton import ROUNDS, Newton
from discovery.diagnosis.multiple_shooting import Chain
from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment

#: Knots in one period of the motion.
KNOTS = 12
#: Times in one spacing of the knots at which the force is reported.
FINE = 3
#: Only so many periods are reconstructed, from the first: enough to see what a force depends on.
LONGEST = 50
#: Times over which the force remembers itself that are tried [periods].
_MEMORY = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0)


@dataclass(frozen=True)
class LatentForce:
    """The missing force in one recording.

    Parameters
    ----------
    name : str
        Of the recording.
    time : ndarray, shape (n,)
        Times [s], `FINE` in every spacing of the knots.
    mean, sd : ndarray, shape (n,)
        The force and its standard deviation, per unit inertia [s^-2 q].
    variables : mapping of str to ndarray, shape (n,)
        What it may depend on, along the motion that follows the recording; see `SlowModel.variables`.
    equivalent : mapping of str to ndarray, shape (n,)
        For every fitted parameter, the force that imitates a change of it by one unit.
    memory : float
        Correlation time of the process, by maximum likelihood [s].
    gain : float
        Twice the logarithm of the likelihood ratio of this force against none.
    rms : tuple of float
        Residual of the free run in noise sds, without and with the force.
    """

    name: str
    time: FloatArray
    mean: FloatArray
    sd: FloatArray
    variables: Mapping[str, FloatArray]
    equivalent: Mapping[str, FloatArray]
    memory: float
    gain: float
    rms: tuple[float, float]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description, without the arrays."""
        return {
            "recording": self.name,
            "force_rms": float(np.sqrt(np.mean(self.mean**2))),
            "force_sd": float(np.sqrt(np.mean(self.sd**2))),
            "memory_s": self.memory,
            "gain": self.gain,
            "residual_rms_without": self.rms[0],
            "residual_rms_with": self.rms[1],
        }


def _matern(lag: FloatArray) -> FloatArray:
    scaled = np.sqrt(3.0) * np.abs(lag)
    return (1 + scaled) * np.exp(-scaled)


@dataclass(frozen=True)
class _Prior:
    """Memory of the process with the highest marginal likelihood, and the posterior that follows."""

    memory: float
    gain: float
    covariance: FloatArray

    @classmethod
    def likeliest(cls, columns: FloatArray, residual: FloatArray, spacing: float, period: float) -> _Prior:
        """Choose for whitened columns (n, k) and what they shall explain (n,), without the initial state's part."""
        k = columns.shape[1]
        gram, moment = columns.T @ columns, columns.T @ residual
        lag = np.subtract.outer(np.arange(k), np.arange(k)) * spacing
        best: tuple[float, float, float, FloatArray] | None = None
        for memory in _MEMORY:
            root = np.asarray(np.linalg.cholesky(_matern(lag / (memory * period)) + 1e-9 * np.eye(k)), np.float64)
            values, axes = np.linalg.eigh(root.T @ gram @ root)
            values, along = np.maximum(values, 0.0), (axes.T @ (root.T @ moment)) ** 2

            def gain(log_size: float, values=values, along=along) -> float:
                shrunk = np.exp(2 * log_size)
                return float(np.sum(shrunk * along / (1 + shrunk * values) - np.log1p(shrunk * values)))

            centre = -0.5 * np.log(values[-1] + 1e-300)
            found = minimize_scalar(lambda x, g=gain: -g(x), bounds=(centre - 3, centre + 12), method="bounded")
            if best is None or -found.fun > best[0]:
                best = -float(found.fun), float(np.exp(found.x)), memory * period, root
        assert best is not None
        root = best[1] * best[3]
        inner = np.linalg.inv(np.eye(k) + root.T @ gram @ root)
        return cls(best[2], best[0], root @ inner @ root.T)


def _parameters(fit: Fit, index: int) -> FloatArray:
    """Return how the fitted channels of one recording change with each free parameter of the model, shape (n, c, p)."""
    problem, x, n = fit.problem, fit.minimum.x, len(fit.problem.free)
    sizes = 1e-4 * problem.scale[:n]
    sizes = np.where(x[:n] + sizes > problem.bounds[1][:n], -sizes, sizes)
    vectors = np.repeat(x[:, None], n + 1, axis=1)
    vectors[np.arange(n), np.arange(1, n + 1)] += sizes
    parameters, initial = problem.expand(vectors)
    bench = problem.bench
    reading = bench.simulators[index](*bench.started(parameters, initial[index]))
    channels = bench.experiments[index].fitted_part.channels(reading)
    return (channels[:, :, 1:] - channels[:, :, :1]) / sizes


def _shortened(experiment: Experiment, period: float) -> Experiment:
    """Return the fitted part of a recording, of its first periods."""
    r = experiment.recording
    stop = len(r.time[experiment.fitted])
    stop = min(stop, int(np.searchsorted(r.time, r.time[0] + LONGEST * period)))
    return experiment.first(stop)


def _likeliest(newton: Newton, spacing: float, period: float, name: str) -> tuple[_Prior, FloatArray]:
    """Move to the likeliest force; return its prior, and how the residual answers to it beside the initial state."""
    prior: _Prior | None = None
    for i in range(ROUNDS):
        newton.linearise()
        away = np.linalg.qr(newton.by_start)[0]
        columns = newton.by_force - away @ (away.T @ newton.by_force)
        target = newton.residual - away @ (away.T @ newton.residual) + columns @ newton.coefficients
        if prior is None or i < 3:
            prior = _Prior.likeliest(columns, target, spacing, period)
        if newton.move(prior.covariance @ (columns.T @ target)) < 1e-5:
            return prior, columns
    raise ComputationError(f"No force was found that makes the model follow {name}.")


def reconstruct(fit: Fit, index: int = 0) -> LatentForce:
    """Return the force that makes a fitted model, its parameters held, follow one of its recordings.

    Raises
    ------
    ComputationError
        If no motion beside the fitted run is found.
    """
    problem = fit.problem
    period = 2 * np.pi * problem.units.time
    whole = problem.bench.experiments[index]
    experiment = _shortened(whole, period)
    values = {n: v for n, v in fit.values.items() if "[" not in n}
    _, starts = problem.expand(fit.minimum.x[:, None])
    chain = Chain(problem, values, experiment, starts[index, :, 0])
    span = chain.time[-1] - chain.time[0]
    pieces = max(4, int(np.ceil(KNOTS * span / period)))
    spacing = span / pieces
    knots = chain.time[0] + spacing * np.arange(-3, pieces + 4)
    basis = cubic_splines(chain.time, knots)
    newton = Newton(chain, basis)
    prior, columns = _likeliest(newton, spacing, period, whole.recording.name)
    changes = (_parameters(fit, index)[: len(experiment.recording.time)] * newton.weights[:, :, None])[newton.used]
    imitating = prior.covariance @ (columns.T @ changes)
    time = np.linspace(chain.time[0], chain.time[-1], FINE * pieces + 1)
    shown = cubic_splines(time, knots)
    along = chain.along(newton.states)
    left = (chain.channels(newton.states) - experiment.recording.output) * newton.weights
    before = (chain.reading - experiment.recording.output) * newton.weights
    return LatentForce(
        name=whole.recording.name,
        time=time,
        mean=shown @ newton.coefficients,
        sd=np.sqrt(np.einsum("ij,jk,ik->i", shown, prior.covariance, shown)),
        variables={n: np.interp(time, chain.time, v) for n, v in along.items()},
        equivalent=dict(zip(problem.free, (shown @ imitating).T, strict=True)),
        memory=prior.memory,
        gain=prior.gain,
        rms=tuple(float(np.sqrt(np.mean(r[newton.used] ** 2))) for r in (before, left)),  # type: ignore[arg-type]
    )


def cubic_splines(time: FloatArray, knots: FloatArray) -> FloatArray:
    """Return the cubic B-splines (n, k) of uniform knots that reach three beyond the times on both sides."""
    inside = np.clip(time, knots[3], knots[-4])
    return np.asarray(BSpline.design_matrix(inside, knots, 3).toarray())
