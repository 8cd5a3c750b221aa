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

import numpy as np

from discovery.estimation.laplace import Belief
from discovery.estimation.linear_problem import ErrorSizes, Linearised, at_its_mode
from discovery.estimation.model_error import Channel
from discovery.foundation.arrays import FloatArray

#: Times as sure of its parameters as its intervals say, a set predicts by its estimate alone.
_SURE = 1e8
NOISIER = 2.0  #: Times what is stated that noise may be.
_FAR_OFF = 3.0  #: Times the noise that no prediction of a complete model misses by.
#: Standard deviations of the chi-square of noise by which a prediction may leave more.
_ALLOWED = 3.0


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
    def beyond(self) -> float:
        """Scatter beyond the noise that is stated, where it is of far more: no noise of this size is believed [sds]."""
        return float(np.sqrt(self.white**2 - 1)) if self.white > NOISIER else 0.0

    @property
    def off(self) -> float:
        """Model error held out; where the estimate misses that by far more than noise, all that it misses by [sds]."""
        missed = float(np.sqrt(self.chi2_ahead / max(self.count_held, 1)))
        return missed if missed > _FAR_OFF * self.white else self.error_held

    @property
    def left(self) -> float:
        """Model error in training or held out, the larger one, with what scatters beyond the noise [noise sds]."""
        return float(np.hypot(max(self.error, self.off), self.beyond))

    @property
    def misses(self) -> bool:
        """Whether the estimate leaves more of what is held out than noise of the size of training would."""
        n = self.count_held
        return bool(self.chi2_ahead > self.white**2 * (n + _ALLOWED * np.sqrt(2 * n)))

    @classmethod
    def none(cls) -> Evidence:
        """Return the evidence of a motion that blows up."""
        return cls(-np.inf, -np.inf, -np.inf, np.inf, np.inf, 1.0, 1.0, 0.0, 0.0, np.empty(0), np.empty((0, 0)))


def evidence_of(problem: Linearised) -> Evidence:
    """Return the evidence of a linearised set; its held-out score is zero where nothing is held out."""
    train = ErrorSizes(problem, problem.train, problem.prior)
    first, size, at = train.integrated, train.size, train.likeliest
    covariance = _covariance(problem, train)
    # Predictions are as uncertain as the intervals say.
    predictive = replace(at, precision=_inverse(covariance))
    sure = replace(predictive, precision=_SURE * predictive.precision)
    given = (problem.prior.after(mode, problem.belief) for mode in (predictive, sure))
    after, at_estimate = given
    held = [at_its_mode(problem, i, after) for i in range(len(problem.held))]
    ahead = [ErrorSizes(problem, part, at_estimate) for part in problem.held]
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
        chi2_held=sum(h.left for h in held),
        chi2_ahead=sum(
            own.left for own in (a if a.integrated > c else h for a, h, c in zip(ahead, held, least, strict=True))
        ),
        count_held=sum(counts),
    )


def constant_score(left: Sequence[Channel], natural_time: float, scale: float) -> float:
    """Return the log predictive score of a recording of which a constant is predicted for each channel [nats].

    `left`: what that leaves of every channel, one column each [noise sds]. `natural_time`: of the motion [s].
    `scale`: of the prior of the model error [noise sds].
    """
    none = np.empty(0)
    nothing = Linearised([], [], Belief(none, none, none, none, none, np.empty(0, bool)), 0, natural_time, scale)
    return ErrorSizes(nothing, left, nothing.prior).integrated


def _covariance(problem: Linearised, train: ErrorSizes) -> FloatArray:
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
