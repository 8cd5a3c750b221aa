"""What every stage of a run shares: its seed."""

from __future__ import annotations

from numpy.random import SeedSequence

_ORDER = ("discover", "posterior", "predictive", "elastica", "loop", "evidence")


def stage_seed(seed: int, stage: str) -> int:
    """Return the seed of one stage, independent of the others."""
    return int(SeedSequence(seed).spawn(len(_ORDER))[_ORDER.index(stage)].generate_state(1)[0])
