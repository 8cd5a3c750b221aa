"""The log evidence of a set of effects: likelihood with noise and model error, priors, and Occam's factor.

The parameters are integrated by Laplace's method around the generalised least squares estimate, the size of the model
error under a half-Cauchy prior that shrinks it to zero (MacKay, Information Theory, Inference and Learning Algorithms
(2003), chapters 27 and 28; Brynjarsdottir and O'Hagan, Inverse Problems 30 (2014) 114007). Two limits: a model error of
zero leaves the white chi-square with Occam's factor; one that is far above the noise leaves the number of independent
pieces of the recording times the logarithm by which it falls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from discovery.estimation.held_motion import HeldMotion
from discovery.estimation.laplace import Belief, Mode, Prior, mode_of
from discovery.estimation.model_error import Channel, ModelError
from discovery.foundation.arrays import FloatArray

_LOG_2PI = float(np.log(2 * np.pi))
#: Times as sure of its parameters as its intervals say, a set predicts by its estimate alone.
_SURE = 1e8
#: Standard deviations of the chi-square of noise by which a prediction may leave more.
_ALLOWED = 3.0
#: Shares of a step to a held-out mode at which the motion is asked; steps; nats within which the linear model holds.
_SHARES, _STEPS, _AGREES = np.array([1.0, 0.5, 0.25, 0.1, 0.03, 0.0]), 4, 1.0
#: Smallest size of a model error that is told from none [noise sds]; factor between the first sizes that are tried.
_LEAST, _FACTOR = 0.02, 4.0


@dataclass(frozen=True)
class Linearised:
    """Residuals and their derivatives: one channel for each channel of each recording."""

    #: Columns: derivatives by every parameter, then the residual. Held-out initial states come last.
    train: Sequence[Channel]
    #: The same of what is held out, recording by recording: a model errs more in one manoeuvre than in another.
    held: Sequence[Sequence[Channel]]
    belief: Belief  # of every parameter; those of the held-out initial states last
    fitted: int  # number of parameters of the training recordings
    natural_time: float  # of the motion [s]
    scale: float  # of the prior of its size [noise sds]
    #: Error that the mechanics states of itself [noise sds]: intervals are never narrower than it asks.
    stated: float = 0.0
    #: Share of the model error that is expected in the direction of any one parameter: intervals hold it.
    form: float = 0.0
    #: Score of a constant for each held-out recording [nats], see `constant_score`: no model is worse than that.
    constants: Sequence[float] = ()
    motion: HeldMotion | None = None  # what is held out, beyond where the linear model holds

    @cached_property
    def prior(self) -> Prior:
        """What is believed before the training recordings."""
        return Prior.of(self.belief, self.fitted)

    def mode(self, size: float, blocks: Sequence[Channel] | None = None, prior: Prior | None = None) -> Mode:
        """Return the posterior for a size of the model error over the noise.

        From the training recordings, or from a held-out one, given what is believed after these.
        """
        blocks, prior = self.train if blocks is None else blocks, self.prior if prior is None else prior
        gram, logarithms = np.zeros(()), 0.0
        for block in blocks:
            own, log = block.gram(ModelError.of(size, self.natural_time))
            gram, logarithms = gram + own, logarithms + log
        use = np.append(np.arange(len(prior.mean)), len(self.belief.width))
        count = sum(block.time.size for block in blocks)
        return mode_of(gram[np.ix_(use, use)], logarithms, count, prior)


@dataclass(frozen=True)
class Evidence:
    """How well a set of effects explains the recordings."""

    train: float  # log evidence of the training recordings [nats]
    #: Log predictive score of the held-out ones, given the training ones; zero where nothing is held out [nats].
    #: Where a model predicts a recording less well than a constant does, that counts, so that one that runs away there
    #: is no merit of others.
    held: float
    #: The same of the one prediction that the estimate makes. Where parameters are uncertain, the score is also high
    #: for a law that misses what is held out but could be fitted to it.
    ahead: float
    #: error, error_held: size of the model error in training and held out, at its mode, over all recordings [noise
    #: sds].
    error: float
    error_held: float
    white: float  # size of the noise at the mode of the training recordings [stated noise sds]
    alone: float  # the same where there is no model error
    nil: float  # by how much a model error of free size explains the recordings better than none [nats]
    gained: float  # what the step to the generalised least squares estimate gained, to first order [nats]
    step: FloatArray  # (p,), that step
    covariance: FloatArray  # (p, p), of the parameters, from the training recordings
    #: chi2_held, chi2_ahead: what is left of the held-out recordings at their mode, and with the estimate's parameters
    #: unless these run away there [noise variances].
    chi2_held: float = 0.0
    chi2_ahead: float = 0.0
    count_held: int = 0  # number of their readings

    @property
    def joint(self) -> float:
        """Log evidence of all recordings [nats]."""
        return self.train + self.held

    @property
    def misses(self) -> bool:
        """Whether the estimate leaves more of what is held out than noise of the size of training would."""
        n = self.count_held
        return bool(self.chi2_ahead > self.white**2 * (n + _ALLOWED * np.sqrt(2 * n)))

    @classmethod
    def none(cls) -> Evidence:
        """Return the evidence of a motion that blows up."""
        return cls(-np.inf, -np.inf, -np.inf, np.inf, np.inf, 1.0, 1.0, 0.0, 0.0, np.empty(0), np.empty((0, 0)))


@dataclass
class _Sizes:
    """The size of the model error over the noise, integrated under its prior."""

    problem: Linearised
    channels: Sequence[Channel]
    prior: Prior

    def __post_init__(self) -> None:
        self.modes: dict[float, Mode] = {}

    def mode(self, size: float) -> Mode:
        """Return the posterior of the parameters for a size."""
        if size not in self.modes:
            self.modes[size] = self.problem.mode(size, self.channels, self.prior)
        return self.modes[size]

    def density(self, log_size: float) -> float:
        """Return log evidence and prior for the logarithm of a size."""
        size, scale = float(np.exp(log_size)), self.problem.scale
        prior = np.log(2 / np.pi) + np.log(scale * size / (scale**2 + size**2))
        found = self.mode(size).log_evidence + float(prior)
        return found if np.isfinite(found) else -1e300

    @cached_property
    def best(self) -> float:
        """Logarithm of the likeliest size."""
        rms = np.sqrt([np.mean(c.columns[:, -1] ** 2) for c in self.channels])
        highest = np.log(10 * max(1.0, *rms.tolist())) + np.log(_FACTOR)
        grid = np.arange(np.log(_LEAST), highest, np.log(_FACTOR))
        values = [self.density(u) for u in grid]
        i = int(np.argmax(values))
        bracket = (grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
        found = minimize_scalar(lambda u: -self.density(u), bounds=bracket, method="bounded", options={"xatol": 0.02})
        return float(found.x) if -found.fun >= values[i] else float(grid[i])

    @property
    def likeliest(self) -> Mode:
        """The posterior of the parameters for the likeliest size."""
        return self.mode(float(np.exp(self.best)))

    @property
    def size(self) -> float:
        """Likeliest size of the model error [noise sds], no more than its scale where none explains as much.

        Nor more than the rms of what is left: a remainder that forgets faster than the process has a larger one.
        """
        left = _left(self.channels, self.likeliest.step) / sum(c.time.size for c in self.channels)
        size = min(float(np.exp(self.best)) * self.likeliest.white, float(np.sqrt(left)))
        return size if self.nil > 0 else min(size, self.problem.scale)

    @cached_property
    def integrated(self) -> float:
        """The log evidence, the size integrated: none, or around the likeliest."""
        u, h = self.best, 0.1
        curvature = (2 * self.density(u) - self.density(u - h) - self.density(u + h)) / h**2
        width = 1.0 / np.sqrt(max(curvature, 0.25))
        below = 2 / np.pi * np.arctan(_LEAST / self.problem.scale)
        none = self.mode(0.0).log_evidence + np.log(below)
        return float(np.logaddexp(none, self.density(u) + 0.5 * _LOG_2PI + np.log(width)))

    @property
    def nil(self) -> float:
        """By how much a free size explains more than none [nats]."""
        return self.integrated - self.mode(0.0).log_evidence


def evidence_of(problem: Linearised) -> Evidence:
    """Return the evidence of a linearised set; its held-out score is zero where nothing is held out."""
    train = _Sizes(problem, problem.train, problem.prior)
    first, size, at = train.integrated, train.size, train.likeliest
    covariance = _covariance(problem, train)
    # Predictions are as uncertain as the intervals say.
    predictive = replace(at, precision=_inverse(covariance))
    sure = replace(predictive, precision=_SURE * predictive.precision)
    given = (problem.prior.after(mode, problem.belief) for mode in (predictive, sure))
    after, at_estimate = given
    held = [_at_its_mode(problem, i, after) for i in range(len(problem.held))]
    ahead = [_Sizes(problem, part, at_estimate) for part in problem.held]
    counts = [sum(c.time.size for c in part) for part in problem.held]
    least = problem.constants or [-np.inf] * len(held)
    return Evidence(
        train=first,
        held=sum(max(h.integrated, c) for h, c in zip(held, least, strict=True)),
        ahead=sum(max(a.integrated, c) for a, c in zip(ahead, least, strict=True)),
        error=size,
        error_held=float(np.sqrt(np.average([h.size**2 for h in held], weights=counts))) if held else 0.0,
        white=at.white,
        alone=train.mode(0.0).white,
        nil=train.nil + sum(h.nil for h in held),
        gained=at.gained,
        step=at.step,
        covariance=covariance,
        chi2_held=sum(_left(h.channels, h.likeliest.step) for h in held),
        chi2_ahead=sum(
            _left(own.channels, own.likeliest.step)
            for own in (a if a.integrated > c else h for a, h, c in zip(ahead, held, least, strict=True))
        ),
        count_held=sum(counts),
    )


def _at_its_mode(problem: Linearised, number: int, prior: Prior) -> _Sizes:
    """Return the sizes of the model error in a held-out recording, around the mode that its motion has.

    A law that misses asks for a long step, whose end only a linear model reaches: it is gone in steps, each as long as
    the motion gains from it.
    """
    motion, channels, at = problem.motion, problem.held[number], np.zeros(len(prior.mean))
    for _ in range(_STEPS):
        sizes = _Sizes(problem, channels, prior)
        if motion is None:
            return sizes
        mode, error = sizes.likeliest, ModelError.of(float(np.exp(sizes.best)), problem.natural_time)
        steps = _SHARES[:, None] * mode.step
        left = motion.residuals(number, (at + steps).T)
        pulled = np.einsum("ip,pq,iq->i", steps - prior.mean, prior.pull, steps - prior.mean)
        with np.errstate(over="ignore", invalid="ignore"):
            costs = pulled + _quadratic(channels, left, error) / mode.white**2
        promised = pulled[0] + _quadratic(channels, [c.left(mode.step)[:, None] for c in channels], error) / mode.white**2
        if not 0.5 * abs(costs[0] - promised[0]) > _AGREES:
            return sizes
        best = int(np.argmin(np.nan_to_num(costs, nan=np.inf)))
        step, at = steps[best], at + steps[best]
        prior = replace(prior, mean=prior.mean - step, low=prior.low - step, high=prior.high - step)
        there = motion.channels(number, at)
        if not step.any() or not all(np.isfinite(c.columns).all() for c in there):
            break
        channels = there
    everywhere = np.full(at.size, np.inf)
    return _Sizes(problem, channels, replace(prior, low=-everywhere, high=everywhere, frozen=np.ones(at.size, bool)))


def _quadratic(channels: Sequence[Channel], residuals: Sequence[FloatArray], error: ModelError) -> FloatArray:
    """Return the quadratic forms of residuals (n, k) of each channel under a model error, (k,)."""
    grams = (Channel(c.time, r).gram(error)[0] for c, r in zip(channels, residuals, strict=True))
    return np.asarray(sum(np.diag(gram) for gram in grams), np.float64)


def constant_score(left: Sequence[Channel], natural_time: float, scale: float) -> float:
    """Return the log predictive score of a recording of which nothing is predicted but the mean of each channel [nats].

    `left`: what the mean leaves of every channel, one column each [noise sds]. `natural_time`: of the motion [s].
    `scale`: of the prior of the model error [noise sds].
    """
    none = np.empty(0)
    nothing = Linearised([], [], Belief(none, none, none, none, none, np.empty(0, bool)), 0, natural_time, scale)
    return _Sizes(nothing, left, nothing.prior).integrated


def _covariance(problem: Linearised, train: _Sizes) -> FloatArray:
    """Return the covariance of the parameters under the noise and the model error.

    A model error that is told from none is no chance: in the direction of a parameter it moves the readings by a share
    of its size, all of them alike, and the parameter takes it for its own.
    """
    size, at = train.size, train.likeliest
    covariance = _inverse(train.mode(float(np.hypot(size, problem.stated)) / at.white).precision)
    if train.nil > 0:
        none, count = train.mode(0.0), sum(c.time.size for c in problem.train)
        moved = _moved(none.precision, problem.prior.precision) / none.white**2
        covariance = covariance + (problem.form * size) ** 2 * count * moved
    return covariance


def _moved(precision: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the covariance that an error in any one direction of the readings gives, of size one.

    A parameter of which the readings know little is moved by little: its prior holds it.
    """
    scale = 1.0 / np.sqrt(np.diag(precision))
    told, axes = np.linalg.eigh((precision - prior) * np.outer(scale, scale))
    # What the readings tell is nowhere negative but for round-off.
    root = _inverse(precision) @ (axes * np.sqrt(np.maximum(told, 0.0)) / scale[:, None])
    return np.asarray(root @ root.T, np.float64)


def _inverse(precision: FloatArray) -> FloatArray:
    """Return the inverse of a precision whose parameters are of very different sizes."""
    scale = 1.0 / np.sqrt(np.diag(precision))
    return np.linalg.pinv(precision * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale)


def _left(channels: Sequence[Channel], step: FloatArray) -> float:
    """Return the sum of squares that is left of channels after a step of the first parameters [noise variances]."""
    return sum(float(np.sum(c.left(step) ** 2)) for c in channels)
