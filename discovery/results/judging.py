"""Which of the errors of loop.json judge an answer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def held_group(errors: Mapping[str, Any]) -> str:
    """Return the recordings that judge: held out inside the trained deflection, else all held out, else training.

    Beyond the trained range a model may err, and after its motion a body only rests: of free motions that come to rest
    it is what moves.
    """
    for group in ("holdout_moving", "holdout_inside", "holdout", "train"):
        if (errors["after"].get(group) or {}).get("rms") is not None:
            return group
    return "train"


def judged_rms(errors: Mapping[str, Any], when: str = "after") -> float:
    """Return the error that judges the final model, or `when` "before" the declared one [unit of the output]."""
    return float(errors[when][held_group(errors)]["rms"])
