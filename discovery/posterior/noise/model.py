"""What a noise model is: a likelihood of the residuals of an instrument, and how it weighs a Jacobian."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike
from scipy import stats

from discovery.declarations.priors import Prior
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.recordings.experiment import Experiment

LOG_2PI = float(np.log(2 * np.pi))
#: Draws of the parameters of a noise beside its size, each (k,), by the name that its model gives them.
Own = Mapping[str, FloatArray]


@dataclass(frozen=True)
class Instrument:
    """Readings that share one noise factor: those of recordings with the same channels.

    `name` is that of the noise parameter, ``"sigma"``, or ``"sigma[tip_angle]"`` where there are several instruments.
    It made the `n` readings of `experiments`. `noise` is the stated standard deviation of a reading in `unit`; 1 where
    the channels or recordings differ, and the parameter is a factor. `log_weights` sums log(1/noise) over all readings.
    """

    name: str
    experiments: tuple[int, ...]
    n: int
    noise: float
    unit: str
    log_weights: float

    def named(self, quantity: str) -> str:
        """Return the name of another quantity of this instrument's noise: as `name`, with another symbol."""
        return quantity + self.name.removeprefix("sigma")


def noise_names(channels: Sequence[str]) -> tuple[str, str]:
    """Return the names that the noise of these channels may have: one of several instruments, or the only one."""
    return f"sigma[{'+'.join(channels)}]", "sigma"


def instruments(experiments: Sequence[Experiment]) -> tuple[Instrument, ...]:
    """Return the instruments of experiments, in order of appearance."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for i, experiment in enumerate(experiments):
        groups.setdefault(experiment.recording.channels, []).append(i)
    found = []
    for channels, members in groups.items():
        weights = np.concatenate([experiments[i].weights().ravel() for i in members])
        weights = weights[weights > 0]
        noise = np.concatenate([experiments[i].recording.noise for i in members])
        units = {unit for i in members for unit in experiments[i].recording.units}
        common = len(units) == 1 and bool(np.allclose(noise, noise[0], rtol=1e-9, atol=0.0))
        found.append(
            Instrument(
                name=noise_names(channels)[len(groups) == 1],
                experiments=tuple(members),
                n=weights.size,
                noise=float(noise[0]) if common else 1.0,
                unit=units.pop() if common else "1",
                log_weights=float(np.log(weights).sum()),
            )
        )
    return tuple(found)


@dataclass(frozen=True)
class Logistic(Prior):
    """Prior of log(s/(1 - s)) for a share s that is uniform between zero and one."""

    law = "logistic"

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the standard logistic log density."""
        size = np.abs(np.asarray(x, float))
        return -size - 2 * np.log1p(np.exp(-size))

    @property
    def width(self) -> float:
        """The standard deviation."""
        return float(np.pi / np.sqrt(3))

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws."""
        return rng.logistic(size=count)


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


def share_parameter(meaning: str, starts: tuple[float, ...]) -> NoiseParameter:
    """Return the parameter of a share of the variance, estimated from some log odds on."""
    return NoiseParameter("share", unit="1", meaning=meaning, prior=Logistic(), starts=starts, value=share_of)


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

    #: What recordings need, in words, where it does not apply to all.
    needs: ClassVar[str] = ""

    part: Instrument
    parameters: tuple[NoiseParameter, ...]

    @classmethod
    @abstractmethod
    def drawn(cls, rng: Generator, shape: tuple[int, ...], own: Own) -> FloatArray:
        """Return errors of readings of size one, shape (n, c, k); `own`: draws of its parameters."""

    @classmethod
    @abstractmethod
    def density(cls, error: FloatArray, size: FloatArray, own: Own, step: FloatArray) -> FloatArray:
        """Return the log density of the error of each reading alone, shape (n, c, k).

        `error`, `size` (n, c, k): of readings, and of the noise, in their unit. `own`: draws of its parameters.
        `step`: of readings that come in steps, in their unit.
        """

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


class GaussianErrors:
    """The error of one reading that is Gaussian, of a standard deviation: a mixin of noise models, and without one."""

    @classmethod
    def drawn(cls, rng: Generator, shape: tuple[int, ...], own: Own) -> FloatArray:
        """Return errors of unit standard deviation."""
        return rng.standard_normal(shape)

    @classmethod
    def density(cls, error: FloatArray, size: FloatArray, own: Own, step: FloatArray) -> FloatArray:
        """Return the Gaussian log density."""
        return np.asarray(stats.norm.logpdf(error, scale=size))


def own_of(channels: Sequence[str], draws: Mapping[str, FloatArray]) -> Own:
    """Return the parameters of the noise of channels among all draws, by the names that its model gives them."""
    several, _ = noise_names(channels)
    if several not in draws:
        return draws
    label = several.removeprefix("sigma")
    return {name.removesuffix(label): values for name, values in draws.items() if name.endswith(label)}


def seen_by(experiment: Experiment) -> BoolArray:
    """Return which readings count, up to the last of them, shape (n, c)."""
    seen = experiment.weights() > 0
    stop = int(np.flatnonzero(seen.any(axis=1))[-1]) + 1 if seen.any() else 0
    return seen[:stop]
