"""What a fit cannot be believed for, as records: values at the edge of what they may be, hold-outs missed.

Sentences are made from them in one place, `discovery.report.caution_sentences`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.estimation.fit import Fit
from discovery.results.judging import judged_rms

__all__ = ["SCATTERED", "Caution", "at_edges", "missed", "strayed"]

#: Times the noise, readings that lie farther off than a model that leaves noise would let them.
SCATTERED = 1.5
#: Times the training error, a hold-out that is missed by a model which leaves an error there, too.
_ELSEWHERE = 5.0
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
        Of an edge `value` and `unit`; of a strayed constant its `guess`, too, and `others` that stray; of a miss `rms`,
        `unit`, `ratio` (over the noise) and `beyond`, whether all of it moves farther than training; of a burst
        `start`, `stop` [s] and `share` of what is left; of what is like noise `ratio` and `autocorrelation`; of what is
        not carried by how many times the error falls in training (`train`) and held out (`held`); of scattered readings
        `rms`, `unit`, `noise`, their `ratio`, whether that noise is `estimated`, the `memory` of the errors (see
        `estimation.residual.memory`) and whether it counts as none (`white`).
    """

    code: str
    about: str = ""
    effect: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return asdict(self)


def at_edges(fitted: Fit, added: Iterable[str]) -> list[Caution]:
    """Return the parameters of a fit at an edge that is no zero: their range ends there, not physics.

    What the rig states or guesses, or a law holds by convention, is left out.
    """
    problem = fitted.problem
    owner = {p.name: e for e in {*added}.intersection(problem.model.effects) for p in get_effect(e).parameters()}
    found = []
    for name, value, low, high in zip(problem.free, fitted.minimum.x, *problem.bounds, strict=False):
        parameter = problem.model.parameters[name]
        near = _EDGE * (high - low)
        # Of a range on one side of zero the end that is nearer to it is where the quantity is absent. A shape, as a
        # width, is not absent at an end that is no zero, and its range spans decades.
        lowest = low + (min(near, _EDGE * abs(low)) if parameter.shape else near)
        ends = low < 0 or (parameter.shape and low > 0)
        at_edge = (high > 0 and value >= high - near) or (ends and value <= lowest)
        left_out = name in problem.gaussian or parameter.physical
        if left_out or not np.isfinite(near) or not at_edge:
            continue
        numbers = {"value": float(value), "unit": fitted.told(name)["unit"]}
        found.append(Caution("effect_edge" if name in owner else "declared_edge", name, owner.get(name, ""), numbers))
    return found


def strayed(fitted: Fit) -> Caution | None:
    """Return the constant of a declared system that ends farthest above its guess; one that vanishes is an answer."""
    problem, model = fitted.problem, fitted.problem.model
    guesses = {n: model.parameters[n].default for n in problem.free if model.parameters[n].physical}
    values = dict(zip(problem.free, fitted.minimum.x.tolist(), strict=False))
    far = {n: values[n] / guess for n, guess in guesses.items() if n not in problem.gaussian}
    name, *others = sorted((n for n, times in far.items() if times > _STRAYED), key=lambda n: -far[n]) or [""]
    if not name:
        return None
    numbers = {"value": values[name], "guess": guesses[name], "unit": fitted.told(name)["unit"], "others": others}
    return Caution("strayed", name, numbers=numbers)


def missed(errors: Mapping[str, Any], *, left: float, held: float, least: float) -> Caution | None:
    """Return that a model misses what is held out far more than training; None where it does not.

    Parameters
    ----------
    errors : mapping
        Of loop.json.
    left, held, least : float
        Model error in training and held out, and that which counts as none [unit of the output].
    """
    after, floor, rms = errors["after"], errors["noise_floor"], judged_rms(errors)
    beyond, explains = "holdout_outside" in after and "holdout_inside" not in after, left <= least
    usual = max(floor, after["train"]["rms"])
    if not (rms > (SCATTERED if explains else _ELSEWHERE) * usual and (beyond or held > least)):
        return None
    numbers = {"rms": rms, "unit": errors["unit"], "ratio": rms / (floor if explains else usual), "beyond": beyond}
    return Caution("missed", numbers={**numbers, "explains": explains})
