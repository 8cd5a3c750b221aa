"""Sparse discovery of the equation of motion.

SINDy proposes, trajectories decide: what is found here are names and start values; coefficients are estimated again on
trajectories before anything is reported. Terms are judged by the variance that they explain, never by the size of a
coefficient, so that a friction 200 times smaller than the stiffness counts for what it does to the motion.

References
----------
S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016) 3932 (SINDy); U. Fasel et al., Proc. R. Soc. A 478 (2022)
20210904 (inclusion probabilities).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from discovery.foundation.arrays import FloatArray
from discovery.signals.differentiate import Smoother
from discovery.signals.motion import Motion
from discovery.sindy.evidence import MISFIT, Choice, best_subsets, loudness, residual_sums
from discovery.sindy.library import Library, build_library

PASSIVE = ("viscous_damping", "structural_damping", "coulomb_friction", "quadratic_drag")
"""Friction takes energy out of the motion: its coefficients are not negative."""

FALSE_ALARM = 1e-3
"""Probability that noise alone adds a term, over the whole library."""

_MATTERS = 1e-4  # of the variance: a hundredth of the target's rms
_LISTED = 5  # rivals of an equation that a sentence lists


def _block_grams(library: Library) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gram matrix, moment and energy of every stretch."""
    data = np.column_stack([library.columns, library.target])
    grams = np.stack([data[library.blocks == b].T @ data[library.blocks == b] for b in np.unique(library.blocks)])
    return grams[:, :-1, :-1], grams[:, :-1, -1], grams[:, -1, -1]


def discover(motions: Sequence[Motion], *, rng: np.random.Generator, resamples: int = 200) -> Discovery:
    """Discover the terms of the equation of motion from smoothed recordings of one system.

    Whole stretches are resampled, with replacement.

    Raises
    ------
    InputError
        See `discovery.sindy.library.build_library`.
    """
    library = build_library(motions)
    signs = np.array([int(term.effect in PASSIVE) for term in library.terms])
    # Five terms, and the input where there is one.
    max_terms = 5 + any(term.family == "input" for term in library.terms)
    subsets = _Subsets.build(library, _best_subsets(library, max_terms, signs))
    choice, rss, noise = subsets.choice, subsets.rss, subsets.noise
    size = choice.size(subsets.energy, rss)
    preferred, included = _resampled(subsets, signs, rng, resamples)

    def equation(k: int, i: int) -> Equation:
        return subsets.equation(k, i, float(preferred[k - 1][i] / resamples))

    nothing = Equation((), (), coefficients=(), sd=(), unexplained=1.0, likelihood_ratio=1.0, probability=1.0)
    chosen = equation(size, choice.preferred(rss, size)) if size else nothing
    equal = choice.near(rss, size) if size else np.array([], int)
    rivals = tuple(equation(size, i) for i in equal if i != choice.preferred(rss, size))
    return Discovery(
        equation=chosen,
        rivals=rivals,
        inclusion={name: float(n / resamples) for name, n in zip(library.names, included, strict=True)},
        table=tuple(equation(k, i) for k, i in subsets.ranking()),
        threshold=float(choice.price * noise[size] / subsets.energy),
        noise_ratio=float(noise[size]),
        at_rest=library.at_rest,
        smoothers=tuple(motion.coordinate.smoother for motion in motions),
        stretches=choice.stretches,
        resamples=resamples,
        status=status_of(chosen, rivals, size == max_terms, float(noise[size])),
    )


_Table = Sequence[tuple[np.ndarray, FloatArray]]


def _best_subsets(library: Library, max_terms: int, signs: np.ndarray) -> _Table:
    """Return the best subsets of the terms of each size, and what each leaves."""
    scale = np.sqrt(np.mean(library.columns**2, axis=0))
    table = np.column_stack([library.columns / scale, library.target])
    triangle: FloatArray = np.asarray(np.linalg.qr(table, mode="r"))  # the same least squares in p + 1 rows
    x, y = triangle[:, :-1], triangle[:, -1]
    return best_subsets(x.T @ x, x.T @ y, float(y @ y), max_terms, signs)


@dataclass(frozen=True)
class _Subsets:
    """The best subsets of each size; `rss` is what each leaves, `noise` what the best of each leaves over the noise."""

    library: Library
    sets: tuple[np.ndarray, ...]
    rss: tuple[FloatArray, ...]
    noise: FloatArray
    choice: Choice

    @classmethod
    def build(cls, library: Library, table: _Table) -> _Subsets:
        sets, rss = tuple(s for s, _ in table), tuple(r for _, r in table)
        left = (library.target, *(_solve(library, s[0])[2] for s in sets))
        noise = np.array([loudness(r, library.target) for r in left])
        choice = Choice(
            complexity=tuple(np.array([[library.terms[j].complexity for j in s] for s in k]).sum(axis=1) for k in sets),
            noise=noise,
            stretches=np.unique(library.blocks).size,
            price=float(chi2.isf(FALSE_ALARM / len(library.terms), 1)),
        )
        return cls(library, sets, rss, noise, choice)

    @property
    def energy(self) -> float:
        """Sum of squares of the target."""
        return float(self.library.target @ self.library.target)

    def equation(self, k: int, i: int, probability: float) -> Equation:
        """Return one subset of k terms as an equation."""
        terms = self.sets[k - 1][i]
        c, sd, _ = _solve(self.library, terms)
        return Equation(
            terms=tuple(self.library.names[j] for j in terms),
            effects=tuple(self.library.terms[j].effect for j in terms),
            coefficients=tuple(float(v) for v in c),
            sd=tuple(float(v * np.sqrt(self.noise[k])) for v in sd),
            unexplained=float(self.rss[k - 1][i] / self.energy),
            likelihood_ratio=float(np.exp(min(self.choice.evidence(self.rss, k)[i], 700.0))),
            probability=probability,
        )

    def ranking(self) -> Iterator[tuple[int, int]]:
        """Return size and place of the five best subsets of each size, the preferred one first."""
        for k, found in enumerate(self.sets, 1):
            first = self.choice.preferred(self.rss, k)
            others = (i for i in range(min(6, len(found))) if i != first)
            yield from ((k, i) for i in [first, *others][:5])


def _solve(library: Library, terms: np.ndarray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return coefficients, their deviations under noise of variance one, and what is left of the target."""
    x = library.columns[:, terms]
    c: FloatArray = np.asarray(np.linalg.lstsq(x, library.target, rcond=None)[0])
    return c, np.sqrt(np.diag(np.linalg.pinv(x.T @ x))), library.target - x @ c


def _resampled(
    subsets: _Subsets, signs: np.ndarray, rng: np.random.Generator, resamples: int
) -> tuple[list[FloatArray], FloatArray]:
    """Return how often each subset is preferred of its size, and each term chosen, over resamples of stretches."""
    sets, choice, count = subsets.sets, subsets.choice, subsets.choice.stretches
    grams, moments, energies = _block_grams(subsets.library)
    preferred = [np.zeros(len(s)) for s in sets]
    included = np.zeros(len(subsets.library.terms))
    for draw in rng.multinomial(count, np.full(count, 1.0 / count), size=resamples).astype(float):
        gram, moment, e = np.tensordot(draw, grams, 1), draw @ moments, float(draw @ energies)
        again = [residual_sums(gram, moment, e, s, signs) for s in sets]
        for k in range(1, len(sets) + 1):
            preferred[k - 1][choice.preferred(again, k)] += 1.0
        if k := choice.size(e, again):
            included[sets[k - 1][choice.preferred(again, k)]] += 1.0
    return preferred, included


@dataclass(frozen=True)
class Equation:
    """One candidate equation, theta_t'' + sum of coefficient * term = 0 (an input stands on the right)."""

    #: terms, effects: names of the terms, and the ids of the effects that they stand for (None where there is none).
    terms: tuple[str, ...]
    effects: tuple[str | None, ...]
    #: coefficients, sd: start values for the fit on trajectories [s^-2 over the unit of the term], and their standard
    #: deviations.
    coefficients: tuple[float, ...]
    sd: tuple[float, ...]
    unexplained: float  # share of the target's variance that the equation leaves
    likelihood_ratio: float  # likelihood of the best equation of this size over that of this one
    probability: float  # share of the resamples in which this is the preferred equation of its size

    def __str__(self) -> str:
        return " ".join(f"{c:+.5g} {name}" for c, name in zip(self.coefficients, self.terms, strict=True)) or "0"


@dataclass(frozen=True)
class Discovery:
    """What the recordings say about the structure of the equation."""

    #: The smallest equation that leaves nothing which noise could not explain; of equal ones the simplest.
    equation: Equation
    #: Equations of the same size that fit equally (likelihood ratio under 10): "cannot tell".
    rivals: tuple[Equation, ...]
    #: Share of the resamples of whole stretches in which a term is part of the chosen equation.
    inclusion: dict[str, float]
    table: tuple[Equation, ...]  # the best equations of each size, preferred one first
    threshold: float  # share of the variance that a term must explain, at the size chosen
    noise_ratio: float  # variance of what is left over that of the instrument's noise, at the frequencies of the motion
    #: at_rest, smoothers, stretches, resamples: how the regression was made.
    at_rest: bool
    smoothers: tuple[Smoother, ...]
    stretches: int
    resamples: int
    status: str  # the result as a sentence

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
        others = "; ".join(", ".join(rival.terms) for rival in rivals[:_LISTED])
        others = f"among them {others}" if len(rivals) > _LISTED else others
        text += (
            f" Cannot tell it from {len(rivals)} of the same size that fit equally ({others}); the simplest is kept."
        )
    return text
