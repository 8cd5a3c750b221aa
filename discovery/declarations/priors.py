"""Prior densities of one parameter: each law says all that is asked of a prior."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from discovery.foundation.arrays import FloatArray

#: How many widths the nodes of a quadrature reach, and how many scales of a heavy tail.
_REACH, _FAR = 10.0, 1e6


@dataclass(frozen=True)
class Prior:
    """A one-dimensional prior density, in the unit of its parameter; a law says what differs from here."""

    law: ClassVar[str]
    #: Whether its mass is finite.
    is_proper: ClassVar[bool] = True
    #: Its numbers in the unit of the parameter, and those that are its width.
    sizes: ClassVar[tuple[str, ...]] = ()
    spread: ClassVar[str] = ""

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the logarithm of the density at `x`; minus infinity outside the support."""
        raise NotImplementedError

    @property
    def width(self) -> float:
        """Typical size of the parameter; steps and starts scale with it."""
        raise NotImplementedError

    def width_at(self, x: float) -> float:
        """Return the width at a value: that of a prior of scales, or with a heavy tail, grows with it."""
        return self.width

    @property
    def centre(self) -> float:
        """Mean of a Gaussian prior; NaN of any other."""
        return math.nan

    def scaled(self, unit: float) -> Self:
        """Return the prior of the parameter in another unit, of which one of its own makes so many."""
        return replace(self, **{name: unit * getattr(self, name) for name in self.sizes})

    def widened(self, factor: float) -> Self:
        """Return the prior so many times as wide around the same centre; one that prefers nothing stays what it is."""
        return replace(self, **{self.spread: factor * getattr(self, self.spread)}) if self.spread else self

    def nodes(self, low: float, high: float, count: int) -> FloatArray:
        """Return so many points between bounds, for a quadrature over the density."""
        return np.linspace(low, high, count)

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws of a prior that is proper."""
        raise NotImplementedError

    def summary(self) -> dict[str, Any]:
        """Return the law with its numbers, JSON-ready."""
        return {"law": self.law, **vars(self)}


@dataclass(frozen=True)
class Flat(Prior):
    """No preference (an improper constant density); `size` is only the typical magnitude."""

    law, is_proper, sizes = "flat", False, ("size",)
    size: float = 1.0

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return zero everywhere."""
        return np.zeros(np.shape(x))

    @property
    def width(self) -> float:
        """Typical magnitude."""
        return self.size

    def summary(self) -> dict[str, Any]:
        """Return the law: its size is no number of the density."""
        return {"law": self.law}


@dataclass(frozen=True)
class Normal(Prior):
    """Gaussian prior with mean `mean` and standard deviation `sd`."""

    law, sizes, spread = "normal", ("mean", "sd"), "sd"
    mean: float
    sd: float

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the Gaussian log density."""
        z = (np.asarray(x, float) - self.mean) / self.sd
        return -0.5 * z * z - math.log(self.sd * math.sqrt(2 * math.pi))

    @property
    def width(self) -> float:
        """The standard deviation."""
        return self.sd

    @property
    def centre(self) -> float:
        """The mean."""
        return self.mean

    def nodes(self, low: float, high: float, count: int) -> FloatArray:
        """Return points as far as the density counts."""
        reach = _REACH * self.sd
        return np.linspace(max(low, self.mean - reach), min(high, self.mean + reach), count)

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws."""
        return rng.normal(self.mean, self.sd, count)


@dataclass(frozen=True)
class Student(Prior):
    """Student's t of three degrees of freedom: an amplitude of either sign, mostly small; see `HalfStudent`."""

    law, sizes, spread = "t", ("scale",), "scale"
    scale: float

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the log density."""
        z = np.asarray(x, float) / self.scale
        return -2 * np.log1p(z * z / 3) + math.log(2 / (math.pi * math.sqrt(3) * self.scale))

    @property
    def width(self) -> float:
        """The scale."""
        return self.scale

    def width_at(self, x: float) -> float:
        """Return that of the Gaussian as steep as the tail there."""
        return math.sqrt((3 * self.scale**2 + x**2) / 4)

    def nodes(self, low: float, high: float, count: int) -> FloatArray:
        """Return points densely where the density is large, and far into its tail."""
        first, last = np.arcsinh(np.clip([low / self.scale, high / self.scale], -_FAR, _FAR))
        return self.scale * np.sinh(np.linspace(first, last, count))

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws."""
        return self.scale * rng.standard_t(3, count)


@dataclass(frozen=True)
class HalfStudent(Student):
    """Student's t of three degrees of freedom folded onto the non-negative half line: an amplitude, mostly small.

    It believes in the size `scale` as a folded Gaussian does, but forbids nothing: an amplitude of ten scales costs
    seven nats, not fifty, as what is natural for one system may be far from it for another. Source: Gelman, Bayesian
    Analysis 1 (2006) 515.
    """

    law = "half-t"

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the log density; minus infinity below zero."""
        return np.where(np.asarray(x, float) >= 0, super().log_density(x) + math.log(2.0), -np.inf)

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws."""
        return np.abs(super().draws(rng, count))


@dataclass(frozen=True)
class LogNormal(Prior):
    """Prior of a positive scale parameter: log x is Gaussian around log `median` with standard deviation `log_sd`."""

    law, sizes, spread = "log-normal", ("median",), "log_sd"
    median: float
    log_sd: float

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the log density; minus infinity at and below zero."""
        x = np.asarray(x, float)
        positive = np.where(x > 0, x, 1.0)
        z = (np.log(positive) - math.log(self.median)) / self.log_sd
        inside = -0.5 * z * z - np.log(positive * self.log_sd * math.sqrt(2 * math.pi))
        return np.where(x > 0, inside, -np.inf)

    @property
    def width(self) -> float:
        """The median."""
        return self.median

    def width_at(self, x: float) -> float:
        """Return a standard deviation of the logarithm at that value."""
        return max(abs(x), 1e-3 * self.median) * self.log_sd

    def nodes(self, low: float, high: float, count: int) -> FloatArray:
        """Return points evenly in the logarithm: such a prior spans decades."""
        far = math.exp(_REACH * self.log_sd)
        return np.geomspace(max(low, self.median / far), min(high, self.median * far), count)

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws."""
        return self.median * np.exp(rng.normal(0.0, self.log_sd, count))


@dataclass(frozen=True)
class LogUniform(Prior):
    """Prior of a scale whose order of magnitude is unknown: log abs(x) is uniform; bounds keep the sign.

    Parameters
    ----------
    size : float
        Middle of the magnitudes.
    factor : float
        The farthest magnitudes are so many times larger or smaller.
    """

    law, sizes = "log-uniform", ("size",)
    size: float
    factor: float

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the log density; minus infinity outside the magnitudes."""
        y: FloatArray = np.abs(np.asarray(x, float))
        inside = (y >= self.size / self.factor) & (y <= self.size * self.factor)
        return np.where(inside, -np.log(np.where(inside, y, 1.0)) - math.log(2 * math.log(self.factor)), -np.inf)

    @property
    def width(self) -> float:
        """The middle."""
        return self.size

    @property
    def log_sd(self) -> float:
        """Standard deviation of log abs(x)."""
        return math.log(self.factor) / math.sqrt(3)

    def width_at(self, x: float) -> float:
        """Return a standard deviation of the logarithm at that value."""
        return abs(x) * self.log_sd

    def nodes(self, low: float, high: float, count: int) -> FloatArray:
        """Return points evenly in the logarithm."""
        ends = self.size * np.geomspace(1.0 / self.factor, self.factor, count)
        return np.clip(ends if high > 0.0 else -ends[::-1], low, high)

    def draws(self, rng: Generator, count: int) -> FloatArray:
        """Return independent draws, of either sign."""
        return rng.choice((-1.0, 1.0), count) * self.size * self.factor ** rng.uniform(-1.0, 1.0, count)
