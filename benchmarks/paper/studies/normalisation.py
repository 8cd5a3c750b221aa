"""The paper's last claim: a model found on one arm predicts other arms through the normalised equation (9).

The model is discovered once, on the paper's rig. Its dimensionless parameters are alpha, beta times T^2 and xi times T,
T^2 = m l^3 / EI; gamma and delta have none. For another arm they are multiplied out again, and its motion is predicted
without any fit. The friction of the other arms is scaled with them, so that xi T stays the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.twin import PAPER_RIG, ArmRig

from benchmarks.paper.measures import distance
from benchmarks.paper.paper_fit import CUBIC, LINEAR
from benchmarks.paper.parallel import in_parallel
from benchmarks.paper.rest_fit import ROD_SHARE, RestFit, fit_from_rest
from benchmarks.paper.stand import SPEED, Stand, manoeuvre, scaled_rig, stand
from discovery.declarations.units import dimension
from discovery.equations.model import Model
from discovery.estimation.problem import known_values

_SEED = 105


@dataclass(frozen=True)
class Trial:
    """Another arm, and the part of the paper's manoeuvre that it makes."""

    changed: str
    value: float
    arm: ArmRig
    angle: float = 1.0


def time_scale(arm: ArmRig, *, rod: bool) -> float:
    """Return T = sqrt(m l^3 / EI) [s] of (9), the rod counted at the tip with 33/140 of its mass or not at all."""
    mass = arm.tip_mass + (ROD_SHARE * arm.beam_mass if rod else 0.0)
    return float(np.sqrt(mass * arm.length**3 / arm.flexural_rigidity))


def transfer(found: RestFit, here: ArmRig, there: Stand, *, rod: bool) -> RestFit:
    """Return the model found on one arm as (9) carries it to another, nothing fitted."""
    faster = time_scale(here, rod=rod) / time_scale(there.arm, rod=rod)
    declared = found.model.parameters
    values = {n: v / faster ** float(dimension(declared[n].unit).get("s", 0)) for n, v in found.values.items()}
    known = {n: v for n, v in known_values(there.experiment).items() if n in declared}
    return RestFit(Model(found.model.base, found.model.effects, known), values, {}, found.step / faster)


def trials() -> list[Trial]:
    """Return the other arms: one quantity changed at a time, and the paper's arm at other amplitudes."""
    rig = PAPER_RIG
    rods = (0.05, 0.1, 0.2845, 0.5, 0.8)
    return [
        *(Trial("length", v, scaled_rig(length=v)) for v in (0.5, 2.0)),
        *(Trial("stiffness", v, scaled_rig(flexural_rigidity=v * rig.flexural_rigidity)) for v in (0.3, 3.0)),
        *(
            Trial("both masses", v, scaled_rig(tip_mass=v * rig.tip_mass, beam_mass=v * rig.beam_mass))
            for v in (0.4, 2.5)
        ),
        *(Trial("mass ratio", v, scaled_rig(beam_mass=v * rig.tip_mass)) for v in rods),
        *(Trial("amplitude", v, rig, angle=v) for v in (0.25, 0.5, 1.0, 1.25)),
    ]


def _recorded(trial: Trial) -> Stand:
    # The same manoeuvre in normalised time, the rod counted: alike arms then make alike motions.
    scale = time_scale(trial.arm, rod=True) / time_scale(PAPER_RIG, rod=True)
    xi = PAPER_RIG.disc_friction / PAPER_RIG.effective_mass
    arm = scaled_rig(trial.arm, friction=xi / scale)
    return stand(
        arm,
        trapezoid(trial.angle, SPEED * trial.angle / scale, start=0.5 * scale),
        name=f"{trial.changed} {trial.value:g}",
        seed=[_SEED, round(1000 * trial.value)],
        duration=round(20.0 * scale, 2),
        rate=100.0 / scale,
    )


def normalisation() -> dict[str, Any]:
    """Return the mean error of the tip, over the length, of carried models on every other arm."""
    home = stand(PAPER_RIG, manoeuvre(), name="home", seed=[_SEED]).shortened(20.0)
    found = {
        "linear": fit_from_rest("constant_radius", LINEAR, home, angle=True),
        "paper": fit_from_rest("constant_radius", (*CUBIC, "radius_law"), home),
        "exact": fit_from_rest("elastica", LINEAR, home),
    }
    listed = trials()
    rows = []
    for trial, there in zip(listed, in_parallel(_recorded, listed), strict=True):
        errors = {
            name: float(distance(carried.tip(there), there.tip).mean()) / there.arm.length
            for name, model, rod in (
                ("linear", "linear", True),
                ("paper, massless rod", "paper", False),
                ("paper, rod counted", "paper", True),
                ("exact arm", "exact", True),
            )
            for carried in (transfer(found[model], home.arm, there, rod=rod),)
        }
        rows.append(
            {
                "changed": trial.changed,
                "value": trial.value,
                "mass_ratio": there.arm.beam_mass / there.arm.tip_mass,
                "deflection": there.reached,
                "errors": errors,
            }
        )
    return {"home": {n: m.values for n, m in found.items()}, "trials": rows}
