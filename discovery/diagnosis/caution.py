"""What a fit cannot be believed for, as records: values at the edge of what they may be, hold-outs missed.

Sentences are made from them in one place, `discovery.report.caution_sentences`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from discovery.declarations.registry import catalogue, get_effect
from discovery.estimation.fit import Fit
from discovery.results.judging import judged_rms

__all__ = ["SCATTERED", "Caution", "at_edges", "missed", "strayed"]

#: Times the noise, readings that lie farther off than a model that leaves noise would let them.
SCATTERED = 1.5
#: Part of its range within which a value lies at an edge.
_EDGE = 1e-3
#: A guess says of which size a constant is: one that ends so many times as large is of another.
_STRAYED = 10.0


@dataclass(frozen=True)
class Caution:
    """One reason not to believe an answer.

    Parameters
    ----------
    code : str
        "declared_edge", "effect_edge" (a value at the edge of its range), "strayed" (a constant far above its guess),
        "missed" (the hold-out), and those of `discovery.diagnosis.left_over`: "burst", "like_noise", "not_carried",
        "scattered".
    about : str
        The parameter, or the recording of a burst; empty where it is about the whole answer.
    effect : str
        The effect that was added with the parameter; empty otherwise.
    numbers : mapping
        Of an edge `value` and `unit`; of a strayed constant its `guess`, too; of a miss `rms`, `unit`, `ratio` (over
        the noise) and `beyond`, whether all of it moves farther than training; of a burst `start`, `stop` [s] and
        `share` of what is left; of what is like noise `ratio` and `autocorrelation`; of what is not carried by how many
        times the error falls in training (`train`) and held out (`held`); of scattered readings `rms`, `unit`, `noise`,
        their `ratio`, whether that noise is `estimated`, the `memory` of the errors (see `estimation.residual.memory`)
        and whether it counts as none (`white`).
    """

    code: str
    about: str = ""
    effect: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return asdict(self)


def at_edges(fitted: Fit, added: Iterable[str]) -> list[Caution]:
    """Return the amplitudes of a fit at an edge that is no zero: their range ends there, not physics.

    What the rig states or guesses, or a law holds by convention, is left out, and so are shapes.
    """
    problem = fitted.problem
    owner = {p.name: e for e in added if e in catalogue() for p in get_effect(e).parameters()}
    found = []
    for name, value, low, high in zip(problem.free, fitted.minimum.x, *problem.bounds, strict=False):
        parameter = problem.model.parameters[name]
        near = _EDGE * (high - low)
        # Of a range on one side of zero the end that is nearer to it is where the quantity is absent.
        at_edge = (high > 0 and value >= high - near) or (low < 0 and value <= low + near)
        left_out = name in problem.gaussian or parameter.physical or parameter.shape
        if left_out or not np.isfinite(near) or not at_edge:
            continue
        numbers = {"value": float(value), "unit": fitted.told(name)["unit"]}
        found.append(Caution("effect_edge" if name in owner else "declared_edge", name, owner.get(name, ""), numbers))
    return found


def strayed(fitted: Fit) -> list[Caution]:
    """Return the constants of a declared system that end far above their guesses; one that vanishes is an answer."""
    problem = fitted.problem
    found = []
    for name, value in zip(problem.free, fitted.minimum.x, strict=False):
        parameter = problem.model.parameters[name]
        if parameter.physical and name not in problem.gaussian and value / parameter.default > _STRAYED:
            numbers = {"value": float(value), "guess": parameter.default, "unit": fitted.told(name)["unit"]}
            found.append(Caution("strayed", name, numbers=numbers))
    return found


def missed(errors: Mapping[str, Any], *, left: float, held: float, least: float) -> Caution | None:
    """Return that a model leaves noise in training and misses what is held out; None where it does not.

    Parameters
    ----------
    errors : mapping
        Of loop.json.
    left, held, least : float
        Model error in training and held out, and that which counts as none [unit of the output].
    """
    after, floor, rms = errors["after"], errors["noise_floor"], judged_rms(errors)
    beyond = "holdout_outside" in after and "holdout_inside" not in after
    off = rms > SCATTERED * max(floor, after["train"]["rms"])
    if not (left <= least and off and (beyond or held > least)):
        return None
    return Caution("missed", numbers={"rms": rms, "unit": errors["unit"], "ratio": rms / floor, "beyond": beyond})
