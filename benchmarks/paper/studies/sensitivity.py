"""How the paper's numbers depend on what the paper does not state: speed, length of the record, mass of the rod."""

from __future__ import annotations

from typing import Any

from discovery_datasets.twin import PAPER_RIG

from benchmarks.paper.measures import mean_and_peak, model_errors, radius_error
from benchmarks.paper.paper_fit import paper_models
from benchmarks.paper.parallel import in_parallel
from benchmarks.paper.rest_fit import rig_alpha
from benchmarks.paper.stand import SPEED, Stand, manoeuvre, scaled_rig, stand

SPEEDS = (0.6, 0.8, 1.0, 1.2, 1.4, 1.6)
"""Speeds of the 1 rad manoeuvre [rad/s]."""
DURATIONS = (6.0, 10.0, 15.0, 20.0, 25.0, 30.0)
"""Lengths of the record [s]."""
ROD_MASSES = (0.003, 0.006, 0.01245, 0.02, 0.03)
"""Masses of the rod [kg]; the paper's weighs 12.45 g by its density."""
_SEED = 102


def paper_numbers(recorded: Stand) -> dict[str, float]:
    """Return the numbers of P11 to P15 on one recording, in SI units."""
    models = paper_models(recorded)
    errors = model_errors(recorded, models.tips)
    law = mean_and_peak(radius_error(recorded, recorded.arm.length))
    return {
        "deflection": recorded.reached,
        "xi_linear": models.linear.values["xi"],
        "omega2": models.linear.values["alpha"],
        "xi": models.cubic.values["xi"],
        "alpha": models.cubic.values["alpha"],
        "beta": models.cubic.values["beta"],
        "gamma": models.gamma,
        "rig_alpha": rig_alpha(recorded.experiment.rig),
        "angle_linear": errors["linear"]["angle"]["mean"],
        "angle_cubic": errors["cubic"]["angle"]["mean"],
        "radius_constant_mean": law["mean"],
        "radius_constant_peak": law["peak"],
        "position_linear": errors["linear"]["position"]["mean"],
        "position_cubic": errors["cubic"]["position"]["mean"],
        "position_with_radius": errors["with_radius"]["position"]["mean"],
        "peak_linear": errors["linear"]["position"]["peak"],
        "peak_with_radius": errors["with_radius"]["position"]["peak"],
    }


def _at_speed(speed: float) -> Stand:
    return stand(PAPER_RIG, manoeuvre(speed), name=f"speed {speed:g} rad/s", seed=[_SEED, round(1000 * speed)])


def _with_rod(mass: float) -> Stand:
    arm = scaled_rig(PAPER_RIG, beam_mass=mass)
    return stand(arm, manoeuvre(), name=f"rod {1e3 * mass:g} g", seed=[_SEED, round(1e6 * mass)])


def sensitivity() -> dict[str, Any]:
    """Return `paper_numbers` by speed, by length of the record and by mass of the rod."""
    fast = in_parallel(_at_speed, SPEEDS)
    whole = fast[SPEEDS.index(SPEED)]
    return {
        "speed": [{"speed": v, **paper_numbers(s)} for v, s in zip(SPEEDS, fast, strict=True)],
        "duration": [{"duration": v, **paper_numbers(whole.shortened(v))} for v in DURATIONS],
        "rod_mass": [
            {"rod_mass": m, **paper_numbers(s)}
            for m, s in zip(ROD_MASSES, in_parallel(_with_rod, ROD_MASSES), strict=True)
        ],
    }
