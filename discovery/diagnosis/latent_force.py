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

from discovery.diagnosis.multiple_shooting import Chain, Linearised
from discovery.diagnosis.slow_model import Law
from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError

#: Knots in one period of the motion.
KNOTS = 12
#: Times in one spacing of the knots at which the force is reported.
FINE = 3
#: Only so many periods are reconstructed, from the first: enough to see what a force depends on.
LONGEST = 50
#: Times over which the force remembers itself that are tried [periods].
_MEMORY = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0)
#: Rounds of Newton's method.
ROUNDS = 12
#: Derivatives beyond this are those of a motion that nothing holds.
_LARGE = 1e9


@dataclass(frozen=True)
class LatentForce:
    """The missing force in one recording."""

    name: str  # of the recording
    time: FloatArray  # (n,), times [s], `FINE` in every spacing of the knots
    #: mean, sd (n,): the force and its standard deviation, per unit inertia [s^-2 q].
    mean: FloatArray
    sd: FloatArray
    #: each (n,): what it may depend on, along the motion that follows the recording; see `SlowModel.variables`.
    variables: Mapping[str, FloatArray]
    #: each (n,): for every fitted parameter, the force that imitates a change of it by one unit.
    equivalent: Mapping[str, FloatArray]
    memory: float  # correlation time of the process, by maximum likelihood [s]
    gain: float  # twice the logarithm of the likelihood ratio of this force against none
    rms: tuple[float, float]  # residual of the free run in noise sds, without and with the force

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

        def likeliest(memory: float) -> tuple[float, float, float, FloatArray]:
            """Return the gain of the best size for a memory, that size, the memory [s], and a covariance's root."""
            scaled = np.sqrt(3.0) * np.abs(lag / (memory * period))
            matern = (1 + scaled) * np.exp(-scaled) + 1e-9 * np.eye(k)
            root = np.asarray(np.linalg.cholesky(matern), np.float64)
            values, axes = np.linalg.eigh(root.T @ gram @ root)
            values, along = np.maximum(values, 0.0), (axes.T @ (root.T @ moment)) ** 2

            def gain(log_size: float) -> float:
                shrunk = np.exp(2 * log_size)
                return float(np.sum(shrunk * along / (1 + shrunk * values) - np.log1p(shrunk * values)))

            centre = -0.5 * np.log(values[-1] + 1e-300)
            found = minimize_scalar(lambda x: -gain(x), bounds=(centre - 3, centre + 12), method="bounded")
            return -float(found.fun), float(np.exp(found.x)), memory * period, root

        best, size, memory, root = max(map(likeliest, _MEMORY), key=lambda each: each[0])
        root = size * root
        inner = np.linalg.inv(np.eye(k) + root.T @ gram @ root)
        return cls(memory, best, root @ inner @ root.T)


def _parameters(fit: Fit, index: int) -> FloatArray:
    """Return how the fitted channels of one recording change with each free parameter of the model, shape (n, c, p)."""
    problem, x, n = fit.problem, fit.minimum.x, len(fit.problem.free)
    sizes = 1e-4 * problem.scale[:n]
    sizes = np.where(x[:n] + sizes > problem.bounds[1][:n], -sizes, sizes)
    vectors = np.repeat(x[:, None], n + 1, axis=1)
    vectors[np.arange(n), np.arange(1, n + 1)] += sizes
    parameters, initial = problem.expand(vectors)
    bench = problem.bench
    experiment = bench.experiments[index]
    reading = bench.simulators[index](*bench.started(parameters, experiment, initial[index]))
    channels = experiment.fitted_part.channels(reading)
    return (channels[:, :, 1:] - channels[:, :, :1]) / sizes


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

    Raises ComputationError if no motion beside the fitted run is found.
    """
    problem = fit.problem
    period = 2 * np.pi * problem.units.time
    whole = problem.bench.experiments[index]
    times = whole.recording.time
    end = int(np.searchsorted(times, times[0] + LONGEST * period))
    experiment = whole.first(min(len(times[whole.fitted]), end))
    _, starts = problem.expand(fit.minimum.x[:, None])
    chain = Chain(problem, fit.own_values, experiment, starts[index, :, 0])
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


def _propagate(chain: Chain, lin: Linearised, first: FloatArray, basis: FloatArray, gap: FloatArray) -> FloatArray:
    """Return how every cut changes with initial state, coefficients and defects, shape (m + 1, 2, 2 + k + 1).

    `first` (2, 2) and `gap` (2,) belong to the first cut, `basis` (m + 1, k) gives the force at the cuts.
    """
    k = basis.shape[1]
    found = np.zeros((chain.time.size, 2, 3 + k))
    found[0, :, :2], found[0, :, -1] = first, gap
    for i in range(chain.time.size - 1):
        following = lin.transition[i] @ found[i]
        following[:, 2:-1] += np.outer(lin.force[0, i], basis[i]) + np.outer(lin.force[1, i], basis[i + 1])
        following[:, -1] += lin.defect[i]
        found[i + 1] = following
    return found


class Newton:
    """Newton's method on the states of a chain, its initial state, and the coefficients of a force."""

    def __init__(self, chain: Chain, basis: FloatArray, law: Law | None = None) -> None:
        self.chain, self.basis, self.law = chain, basis, law
        self.start, self.coefficients = np.zeros(2), np.zeros(basis.shape[1])
        self.states = chain.run.copy()
        self.weights = chain.experiment.weights()
        self.used = self.weights > 0
        self._scale = chain.slow.units.coordinate / np.array([1.0, chain.slow.units.time])

    def linearise(self) -> None:
        """Compute the whitened residual (n,) and its derivatives by initial state (n, 2) and coefficients (n, k)."""
        chain = self.chain
        here = chain.initial(self.start)
        moves = 1e-6 * np.diag(self._scale)
        first = np.stack([(chain.initial(self.start + d) - here) / d.sum() for d in moves], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            lin = chain.linearise(self.states, self.basis @ self.coefficients, self.law, pushed=self.basis.size > 0)
            self.change = _propagate(chain, lin, first, self.basis, here - self.states[:, 0])
            seen = np.einsum("ncs,nsk->nck", chain.sensitivity(self.states), self.change[chain.at])
        if not np.abs(seen).max() < _LARGE:
            raise ComputationError("The motion beside the fitted run grows beyond all bounds.")
        missing = (chain.experiment.recording.output - chain.channels(self.states) - seen[:, :, -1]) * self.weights
        columns = (seen[:, :, :-1] * self.weights[:, :, None])[self.used]
        self.residual, self.by_start, self.by_force = missing[self.used], columns[:, :2], columns[:, 2:]

    def move(self, coefficients: FloatArray) -> float:
        """Take these coefficients with the initial state that suits them; return the largest change of the motion."""
        step = coefficients - self.coefficients
        start = np.linalg.lstsq(self.by_start, self.residual - self.by_force @ step, rcond=None)[0]
        moved = self.change @ np.concatenate([start, step, [1.0]])
        self.states = self.states + moved.T
        self.start, self.coefficients = self.start + start, coefficients
        return float(np.abs(moved / self._scale).max())

    def settle(self) -> bool:
        """Close the chain with the coefficients held; return whether that succeeds."""
        try:
            for _ in range(ROUNDS):
                self.linearise()
                if self.move(self.coefficients) < 1e-6:
                    return True
        except ComputationError:
            pass
        return False


def close(chain: Chain, law: Law | None) -> FloatArray:
    """Return what the instrument reports of a free run under a law (n, c), the initial state fitted.

    Raises ComputationError if Newton's method does not close the chain, even where the law grows by quarters.
    """
    newton = Newton(chain, np.zeros((chain.time.size, 0)), law)
    if newton.settle():
        return chain.channels(newton.states)
    newton = Newton(chain, newton.basis)
    for share in (0.25, 0.5, 0.75, 1.0):
        newton.law = law and law.scaled(share)
        if not newton.settle():
            raise ComputationError("No motion of the model with this law was found beside the fitted run.")
    return chain.channels(newton.states)
