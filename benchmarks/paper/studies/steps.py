"""The three steps of the arm's mechanics: what error each leaves, from the rig file alone and fitted.

Every model is fitted and judged from rest, by its mean distance to the tip without noise: on the manoeuvre that
was fitted, on a slower one inside the trained deflection, and on one beyond it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.twin import PAPER_RIG

from benchmarks.paper.measures import distance, mean_and_peak
from benchmarks.paper.paper_fit import CUBIC, LINEAR
from benchmarks.paper.rest_fit import RestFit, fit_from_rest, rig_values
from benchmarks.paper.stand import Stand, manoeuvre, stand
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION

_SEED = 103
_TERMS = ("centrifugal_stiffening", "coriolis_coupling", "radial_inertia", "distributed_mass")


@dataclass(frozen=True)
class Rung:
    """One model of the ladder: its words, base and effects, and whether the angle alone is fitted."""

    words: str
    base: str
    effects: tuple[str, ...]
    angle_only: bool = False


LADDER = (
    Rung("linear", "constant_radius", LINEAR, angle_only=True),
    Rung("cubic spring", "constant_radius", CUBIC, angle_only=True),
    Rung("with radius law", "constant_radius", (*CUBIC, "radius_law")),
    Rung("reduced", "reduced", LINEAR),
    Rung("exact, 1 mode", "elastica_1", LINEAR),
    Rung("exact, 2 modes", "elastica_2", LINEAR),
    Rung("exact, 3 modes", "elastica", LINEAR),
)
"""From the linear model to the exact arm."""


def judge(fitted: RestFit, stands: Mapping[str, Stand]) -> dict[str, dict[str, float]]:
    """Return mean and peak distance [m] to the noise-free tip, and the rms error of the angle [rad], by manoeuvre."""
    found = {}
    for name, at in stands.items():
        tip = fitted.tip(at)
        angle = np.unwrap(np.arctan2(*tip.T[::-1])) - at.motion.tip_angle
        found[name] = {**mean_and_peak(distance(tip, at.tip)), "angle_rms": float(np.sqrt(np.mean(angle**2)))}
    return found


def _row(words: str, fitted: RestFit, stands: Mapping[str, Stand]) -> dict[str, Any]:
    values = {**fitted.model.known, **fitted.values}
    return {"model": words, "values": values, "sd": fitted.sd, "errors": judge(fitted, stands)}


def ladder(stands: Mapping[str, Stand]) -> list[dict[str, Any]]:
    """Return the errors of every rung, from the rig file with only xi fitted ("rig") and with all its parameters."""
    trained = stands["trained"]
    rows = []
    for rung in LADDER:
        for how, known in (("rig", rig_values(trained)), ("fitted", None)):
            found = fit_from_rest(rung.base, rung.effects, trained, known, angle=rung.angle_only)
            rows.append({"how": how, **_row(rung.words, found, stands)})
    return rows


def freed(stands: Mapping[str, Stand]) -> list[dict[str, Any]]:
    """Return the third-order terms one at a time, held at their values, and all free (finding h)."""
    c = DYNAMIC_REDUCTION
    arm = stands["trained"].arm
    rod = 11 * arm.beam_mass / (2 * (140 * arm.tip_mass + 33 * arm.beam_mass))
    first = {"c_cen": float(c.c1), "c_cor": float(c.c2), "c_rad": float(c.c3), "A": rod}
    plans: dict[str, tuple[tuple[str, ...], dict[str, float] | None]] = {
        "none of the terms": ((), None),
        "centrifugal alone": (_TERMS[:1], None),
        "Coriolis alone": (_TERMS[1:2], None),
        "radial alone": (_TERMS[2:3], None),
        "all held at first principles": (_TERMS, first),
        "held, and β too": (_TERMS, {**first, "beta": float(c.beta) * rig_values(stands["trained"])["alpha"]}),
        "all free": (_TERMS, None),
    }
    effects = (*CUBIC, "radius_law")
    return [
        _row(words, fit_from_rest("constant_radius", (*effects, *terms), stands["trained"], held), stands)
        for words, (terms, held) in plans.items()
    ]


def steps() -> dict[str, Any]:
    """Return the ladder of models and what freed inertial coefficients do."""
    moves = {"trained": manoeuvre(), "inside": manoeuvre(1.0), "beyond": trapezoid(1.4, 1.45)}
    stands = {n: stand(PAPER_RIG, m, name=n, seed=[_SEED, i]) for i, (n, m) in enumerate(moves.items())}
    return {
        "deflection": {n: s.reached for n, s in stands.items()},
        "ladder": ladder(stands),
        "freed": freed(stands),
    }
