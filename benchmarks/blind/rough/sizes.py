"""Sizes in noise sds: what a refit of the declared model leaves of an effect, or of all errors of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.blind.rough.ingredient import Action, Ingredient, log_uniform
from benchmarks.blind.rough.instruments import INSTRUMENT_ERRORS
from benchmarks.blind.rough.refit import leftover
from benchmarks.blind.rough.subject import Subject

Generator = np.random.Generator
#: Size of all errors of the model together [noise sds], and that of an effect over it.
JOINT, RATIO = (0.5, 3.0), (3.0, 16.0)
#: What a strength is changed by at most in one correction.
_CHANGE = (0.02, 50.0)
_CORRECTIONS = 4
#: Relative distance from the wanted size that will do.
_NEAR = 0.15


@dataclass(frozen=True)
class Errors:
    """Errors of the model with their strengths, sizes each alone, and the size of all together."""

    ingredients: tuple[Ingredient, ...]
    strengths: tuple[float, ...]
    sizes: tuple[float, ...]
    joint: float

    @property
    def actions(self) -> dict[str, Action]:
        """What they do, by name."""
        return {_label(i): i.act(s) for i, s in zip(self.ingredients, self.strengths, strict=True)}


class Sizer:
    """Measure sizes on the noise-free training recordings of one subject."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject

    def _left(self, actions: Mapping[str, Action]) -> float:
        with TemporaryDirectory() as scratch:
            folder = Path(scratch)
            paths = self.subject.write(folder, "probe", actions, noise=False)
            return leftover(folder / "rig.toml", paths, self.subject.starts(), self.subject.known())

    @cached_property
    def geometry(self) -> float:
        """What the refit leaves of the bare system: the error of the declared mechanics and of its solver."""
        return self._left({})

    def size(self, actions: Mapping[str, Action]) -> float:
        """What the refit leaves of some actions, less in quadrature what it leaves without them."""
        return float(np.sqrt(max(self._left(actions) ** 2 - self.geometry**2, 0.0)))

    def settle(self, label: str, ingredient: Ingredient, target: float) -> tuple[float, float]:
        """Return the strength at which an ingredient has about the wanted size, and the size it has."""
        strength, best = 1.0, (1.0, 0.0)
        for _ in range(_CORRECTIONS):
            try:
                own = self.size({label: ingredient.act(strength)})
            except ArithmeticError:
                strength = rounded(strength / 3)
                continue
            if abs(own - target) <= abs(best[1] - target):
                best = strength, own
            if abs(own / target - 1) < _NEAR:
                break
            # Where nothing is left at all, the size says nothing of the strength.
            change = np.clip(target / max(own, 0.02 * target), *_CHANGE)
            new = rounded(float(np.clip(strength * change, 1e-4, ingredient.most)))
            if new == strength:
                break
            strength = new
        return best


def draw_errors(subject: Subject, sizer: Sizer, rng: Generator) -> Errors:
    """Draw errors of the motion and of the instrument, and settle their joint size between the bounds of `JOINT`.

    Raises
    ------
    ArithmeticError
        If their size stays out of bounds.
    """
    target = log_uniform(rng, 0.65, 2.6)
    motion, instrument = _halves(subject.errors())
    chosen = [*rng.permutation(motion)[: rng.integers(1, 3)], *rng.permutation(instrument)[: rng.integers(1, 3)]]
    shares = np.maximum(np.sqrt(rng.dirichlet(np.full(len(chosen), 1.5))), 0.15)
    ingredients = tuple(subject.error(str(n), rng) for n in chosen)
    settled = [sizer.settle(_label(i), i, float(s * target)) for i, s in zip(ingredients, shares, strict=True)]
    strengths, joint = _together(sizer, ingredients, tuple(s for s, _ in settled), target)
    if not JOINT[0] <= joint <= JOINT[1]:
        raise ArithmeticError(f"the errors of the model have a size of {joint:.3g} noise sds, which is out of bounds")
    alone = tuple(sizer.size({_label(i): i.act(s)}) for i, s in zip(ingredients, strengths, strict=True))
    return Errors(ingredients, strengths, alone, joint)


def _together(
    sizer: Sizer, ingredients: Sequence[Ingredient], strengths: tuple[float, ...], target: float
) -> tuple[tuple[float, ...], float]:
    """Return strengths at which all have about the wanted size together, and the size that they have."""
    for left in reversed(range(_CORRECTIONS + 1)):
        try:
            joint = sizer.size({_label(i): i.act(s) for i, s in zip(ingredients, strengths, strict=True)})
            factor = float(np.clip(target / max(joint, 1e-3), 0.3, 3.0))
        except ArithmeticError:
            joint, factor = np.inf, 0.3
        if left == 0 or abs(joint / target - 1) < _NEAR:
            break
        strengths = tuple(rounded(min(s * factor, i.most)) for s, i in zip(strengths, ingredients, strict=True))
    return strengths, joint


def rounded(strength: float) -> float:
    """Two digits of a strength, so that the last digits of a fit decide nothing."""
    return float(f"{strength:.2g}")


def _label(ingredient: Ingredient) -> str:
    return f"error {ingredient.id}"


def _halves(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split errors into those of the motion and those of the instrument."""
    return [n for n in names if n not in INSTRUMENT_ERRORS], [n for n in names if n in INSTRUMENT_ERRORS]
