"""What every stage of a run shares: its seed, and how it tells what it does."""

from __future__ import annotations

from collections.abc import Callable

from numpy.random import SeedSequence

__all__ = ["Tell", "silent", "stage_seed"]


Tell = Callable[[str], None]
_ORDER = ("discover", "posterior", "predictive", "elastica", "loop", "evidence")


def silent(_: str) -> None:
    """Tell nobody."""


def stage_seed(seed: int, stage: str) -> int:
    """Return the seed of one stage, independent of the others."""
    return int(SeedSequence(seed).spawn(len(_ORDER))[_ORDER.index(stage)].generate_state(1)[0])
