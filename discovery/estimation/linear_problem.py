"""A set of effects made linear around its estimate, and the size of the model error beside it."""

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


@dataclass
class ErrorSizes:
    """The size of the model error over the noise, integrated under its prior."""

    problem: Linearised
    channels: Sequence[Channel]
    prior: Prior

    def __post_init__(self) -> None:
        self.modes: dict[float, Mode] = {}
        #: Logarithm of the likeliest size. Not a cached property: until Python 3.12 one lock of all would hold up
        #: what other threads weigh.
        self.best = self._likeliest_size()

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

    def _likeliest_size(self) -> float:
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
        count = sum(c.time.size for c in self.channels)
        size = min(float(np.exp(self.best)) * self.likeliest.white, float(np.sqrt(self.left / count)))
        return size if self.nil > 0 else min(size, self.problem.scale)

    @property
    def left(self) -> float:
        """The sum of squares that is left at the likeliest size [noise variances]."""
        return sum(float(np.sum(c.left(self.likeliest.step) ** 2)) for c in self.channels)

    def costs(self, steps: FloatArray, residuals: Sequence[FloatArray]) -> FloatArray:
        """Return twice what steps (k, p) cost at the likeliest size [nats], by residuals (n, k) of each channel."""
        error, off = ModelError.of(float(np.exp(self.best)), self.problem.natural_time), steps - self.prior.mean
        pulled = np.einsum("ip,pq,iq->i", off, self.prior.pull, off)
        with np.errstate(over="ignore", invalid="ignore"):
            grams = [Channel(c.time, r).gram(error)[0] for c, r in zip(self.channels, residuals, strict=True)]
            return np.asarray(pulled + sum(np.diag(g) for g in grams) / self.likeliest.white**2, np.float64)

    @property
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


def at_its_mode(problem: Linearised, number: int, prior: Prior) -> ErrorSizes:
    """Return the sizes of the model error in a held-out recording, around the mode that its motion has.

    A law that misses asks for a long step, whose end only a linear model reaches. It is gone in parts, each as long as
    the motion gains from it, and made linear again (Gauss-Newton with a line search).
    """
    motion, channels, at = problem.motion, problem.held[number], np.zeros(len(prior.mean))
    for _ in range(_STEPS):
        sizes = ErrorSizes(problem, channels, prior)
        if motion is None:
            return sizes
        steps = _SHARES[:, None] * sizes.likeliest.step
        costs = sizes.costs(steps, motion.residuals(number, (at + steps).T))
        promised = sizes.costs(steps[:1], [c.left(steps[0])[:, None] for c in channels])
        if not 0.5 * abs(costs[0] - promised[0]) > _AGREES:
            return sizes
        step = steps[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
        there = motion.channels(number, at + step)
        if not step.any() or not all(np.isfinite(c.columns).all() for c in there):
            break
        channels, at = there, at + step
        prior = replace(prior, mean=prior.mean - step, low=prior.low - step, high=prior.high - step)
    # Nowhere on the way does a linear model hold: what the motion leaves where it came to is what counts.
    stays, everywhere = np.ones(at.size, bool), np.full(at.size, np.inf)
    return ErrorSizes(problem, channels, replace(prior, low=-everywhere, high=everywhere, frozen=stays))
