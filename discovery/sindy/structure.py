"""What sparse regression says about the structure of the equation of motion: equations, rivals, probabilities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from discovery.signals.differentiate import Smoother
from discovery.sindy.evidence import MISFIT

_MATTERS = 1e-4  # of the variance: a hundredth of the target's rms


@dataclass(frozen=True)
class Equation:
    """One candidate equation, theta_t'' + sum of coefficient * term = 0 (an input stands on the right).

    Attributes
    ----------
    terms, effects : tuple
        Names of the terms, and the ids of the effects that they stand for (None where there is none).
    coefficients, sd : tuple of float
        Start values for the fit on trajectories [s^-2 over the unit of the term], and their standard deviations.
    unexplained : float
        Share of the target's variance that the equation leaves.
    likelihood_ratio : float
        Likelihood of the best equation of this size over that of this one.
    probability : float
        Share of the resamples in which this is the preferred equation of its size.
    """

    terms: tuple[str, ...]
    effects: tuple[str | None, ...]
    coefficients: tuple[float, ...]
    sd: tuple[float, ...]
    unexplained: float
    likelihood_ratio: float
    probability: float

    def __str__(self) -> str:
        return " ".join(f"{c:+.5g} {name}" for c, name in zip(self.coefficients, self.terms, strict=True)) or "0"


@dataclass(frozen=True)
class Discovery:
    """What the recordings say about the structure of the equation.

    Attributes
    ----------
    equation : Equation
        The smallest equation that leaves nothing which noise could not explain; of equal ones the simplest.
    rivals : tuple of Equation
        Equations of the same size that fit equally (likelihood ratio under 10): "cannot tell".
    inclusion : dict of str to float
        Share of the resamples of whole stretches in which a term is part of the chosen equation.
    table : tuple of Equation
        The best equations of each size, preferred one first.
    threshold : float
        Share of the variance that a term must explain, at the size chosen.
    noise_ratio : float
        Variance of what is left over that of the instrument's noise, at the frequencies of the motion.
    at_rest, smoothers, stretches, resamples
        How the regression was made.
    status : str
        The result as a sentence.
    """

    equation: Equation
    rivals: tuple[Equation, ...]
    inclusion: dict[str, float]
    table: tuple[Equation, ...]
    threshold: float
    noise_ratio: float
    at_rest: bool
    smoothers: tuple[Smoother, ...]
    stretches: int
    resamples: int
    status: str

    def best(self, terms: int) -> Equation:
        """Return the preferred equation of so many terms."""
        return next(equation for equation in self.table if len(equation.terms) == terms)

    def summary(self) -> list[dict[str, float | str | None]]:
        """One row for each term of the equation, for a table of the report."""
        e = self.equation
        return [
            {"term": t, "effect": f, "coefficient": c, "sd": s, "inclusion_probability": self.inclusion[t]}
            for t, f, c, s in zip(e.terms, e.effects, e.coefficients, e.sd, strict=True)
        ]


def status_of(equation: Equation, rivals: Sequence[Equation], full: bool, noise: float) -> str:
    """Say what was found, what is left and what cannot be told apart; `full` if no larger equation was looked at."""
    left = f"{equation.unexplained:.2g}" if equation.unexplained < _MATTERS else f"{equation.unexplained:.2%}"
    text = f"{len(equation.terms)} terms ({', '.join(equation.terms)}) explain all but {left} of the variance."
    if full and equation.unexplained > _MATTERS:
        text += " More terms than were allowed would explain more."
    if noise > MISFIT:
        text += (
            f" What is left is {math.sqrt(noise):.2g} times the instrument's noise, at the frequencies of the motion."
        )
    if rivals:
        others = "; ".join(", ".join(rival.terms) for rival in rivals[:5])
        text += (
            f" Cannot tell it from {len(rivals)} of the same size that fit equally ({others}); the simplest is kept."
        )
    return text
