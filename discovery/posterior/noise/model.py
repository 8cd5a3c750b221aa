"""What a noise model is: a likelihood of residuals with parameters of its own, and how it weighs a Jacobian."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from discovery.declarations.parameters import Prior
from discovery.foundation.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from discovery.estimation.problem import Problem
    from discovery.posterior.instrument import Instrument
    from discovery.recordings.experiment import Experiment

LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True)
class Logistic:
    """Prior of log(s/(1 - s)) for a share s that is uniform between zero and one."""

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the standard logistic log density."""
        size = np.abs(np.asarray(x, float))
        return -size - 2 * np.log1p(np.exp(-size))

    @property
    def width(self) -> float:
        """The standard deviation."""
        return float(np.pi / np.sqrt(3))


@dataclass(frozen=True)
class NoiseParameter:
    """A parameter of a noise model beside its size, sampled on a scale without bounds.

    `prior` is that of the sampled coordinate, `starts` are coordinates from which an estimate starts, and `value` makes
    values of coordinates; name, unit and meaning are of the value.
    """

    name: str
    unit: str
    meaning: str
    prior: Prior
    starts: tuple[float, ...]
    value: Callable[[FloatArray], FloatArray]


def share_of(log_odds: ArrayLike) -> FloatArray:
    """Return the share s of log odds log(s/(1 - s)), never zero or one."""
    return 1.0 / (1.0 + np.exp(-np.clip(np.asarray(log_odds, float), -30.0, 30.0)))


@dataclass(frozen=True)
class Noise(ABC):
    """The noise of one instrument, `part`.

    Its parameters are the logarithm of the size over the stated noise, then `parameters`, all on scales without bounds.
    """

    #: What it is called, what it takes errors as in words, and what its size is.
    name: ClassVar[str]
    words: ClassVar[str]
    size: ClassVar[str] = "noise, sd"
    #: Whether errors of different readings are independent, and whether there are some that least squares cannot bear.
    independent: ClassVar[bool] = True
    outliers: ClassVar[bool] = False

    part: Instrument
    parameters: tuple[NoiseParameter, ...]

    @classmethod
    @abstractmethod
    def of(cls, problem: Problem, part: Instrument) -> Noise | None:
        """Return the noise of an instrument, None where this model does not apply to it."""

    @abstractmethod
    def log_likelihood(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log density (k,) of the readings of experiment i, in units of the stated noise.

        The residual (n, c, k) is (prediction - measurement) / stated noise, zero in gaps; x (p, k) are the free numbers
        of the problem, and noise (1 + m, k) the parameters of the noise.
        """

    @abstractmethod
    def whitened(self, i: int, columns: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return columns (n, c, k) of a Jacobian such that the information is their product; x (p,), noise (1 + m,)."""

    def scaled(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return residuals (n, c, k) of which half the sum of squares is minus the log likelihood but for a constant.

        Of rounded readings it is so where the cells are no wider than the noise.
        """
        return self.whitened(i, residual, x, noise)


def seen_by(experiment: Experiment) -> BoolArray:
    """Return which readings count, up to the last of them, shape (n, c)."""
    seen = experiment.weights() > 0
    stop = int(np.flatnonzero(seen.any(axis=1))[-1]) + 1 if seen.any() else 0
    return seen[:stop]
