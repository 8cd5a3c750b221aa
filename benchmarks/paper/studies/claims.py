"""The paper's claims (P17) put to the test: small error, linear friction, static radius law."""

from __future__ import annotations

from typing import Any

import numpy as np
from discovery_datasets.disturbances import CoulombFriction
from discovery_datasets.manoeuvres import minimum_jerk
from discovery_datasets.twin import PAPER_RIG
from numpy.typing import NDArray

from benchmarks.paper.measures import mean_and_peak, model_errors
from benchmarks.paper.paper_fit import CUBIC, LINEAR, paper_models
from benchmarks.paper.rest_fit import fit_from_rest
from benchmarks.paper.stand import Stand, manoeuvre, stand

FloatArray = NDArray[np.float64]

SMOOTH = minimum_jerk(1.0, 1.0)
"""A motion of the hub without jumps of its acceleration, which hardly rings the rod's second mode."""
FRICTIONS = ("coulomb_friction", "quadratic_drag", "amplitude_dependent_damping")
"""Laws of friction other than the paper's, each tried beside it."""
_COULOMB = 6e-4  # N
_DEGREE = 5
_SEED = 104


def error_ratios(recorded: Stand) -> dict[str, float]:
    """Return the nonlinear model's error over the linear one's: the paper claims less than 0.2 for all."""
    errors = model_errors(recorded, paper_models(recorded).tips)
    return {
        f"{what}_{size}": errors["with_radius"][what][size] / errors["linear"][what][size]
        for what in ("position", "angle", "radius")
        for size in ("mean", "peak")
    }


def friction(recorded: Stand, base: str, effects: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return each law of friction fitted beside the linear one, and what it removes from the residual.

    On a model that lacks mechanics a false friction can remove a lot; on the exact arm only a real one can.
    """
    plain = fit_from_rest(base, effects, recorded)
    measured, noise = recorded.experiment.recording.output, recorded.experiment.recording.noise

    def misfit(tip: FloatArray) -> float:
        return float(np.sqrt(np.mean(((tip - measured) / noise) ** 2)))

    before = misfit(plain.tip(recorded))
    rows = []
    for law in FRICTIONS:
        found = fit_from_rest(base, (*effects, law), recorded)
        (name,) = [n for n in found.values if n not in plain.values]
        rows.append(
            {
                "law": law,
                "parameter": name,
                "value": found.values[name],
                "sd": found.sd[name],
                "unit": found.model.parameters[name].unit,
                "xi": found.values["xi"],
                "misfit_before": before,
                "misfit_after": misfit(found.tip(recorded)),
            }
        )
    return rows


def static_radius(recorded: Stand) -> dict[str, Any]:
    """Return how much of the noise-free radius no law rho(delta) can hold, and what tension adds to it.

    The best static law is a polynomial of degree 10 in delta; beside it stands the same with a term in
    ``delta^2 theta_t'^2``, the centrifugal tension of a tip on a circle.
    """
    motion, arm = recorded.motion, recorded.arm
    delta = motion.deflection
    rho = np.hypot(*recorded.tip.T) / arm.length
    rate = np.gradient(motion.tip_angle, motion.time)
    powers = delta[:, None] ** (2 * np.arange(1, _DEGREE + 1))
    tension = (delta * rate)[:, None] ** 2

    def residual(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        found, *_ = np.linalg.lstsq(columns, rho - 1.0)
        return arm.length * (rho - 1.0 - columns @ found), found

    static, _ = residual(powers)
    moving, found = residual(np.column_stack([powers, tension]))
    gamma = paper_models(recorded).gamma
    law = arm.length * (rho - np.cos(gamma * delta))
    driven = np.abs(np.gradient(motion.motor_angle)) > 0
    return {
        "deflection": recorded.reached,
        "law_16": _sizes(law),
        "best_static": _sizes(static),
        "best_static_driven": _sizes(static[driven]),
        "best_static_free": _sizes(static[~driven]),
        "with_tension": _sizes(moving),
        "tension_coefficient": float(found[-1]),
    }


def _sizes(error: FloatArray) -> dict[str, float]:
    return {**mean_and_peak(error), "rms": float(np.sqrt(np.mean(error**2)))}


def claims() -> dict[str, Any]:
    """Return every test but that of the normalisation."""
    plain = stand(PAPER_RIG, manoeuvre(), name="linear friction", seed=[_SEED, 0])
    smooth = stand(PAPER_RIG, SMOOTH, name="no jumps of acceleration", seed=[_SEED, 2])
    dry = stand(
        PAPER_RIG, manoeuvre(), name="dry friction", seed=[_SEED, 1], disturbances=[CoulombFriction(force=_COULOMB)]
    )
    return {
        "error_ratios": error_ratios(plain),
        "friction": {
            "paper_model": friction(plain, "constant_radius", (*CUBIC, "radius_law")),
            "exact_arm": friction(plain, "elastica", LINEAR),
            "exact_arm_dry": friction(dry, "elastica", LINEAR),
            "dry_force": _COULOMB,
            "dry_truth": _COULOMB / (PAPER_RIG.effective_mass * PAPER_RIG.length),
        },
        "static_radius": {"trapezoid": static_radius(plain), "minimum jerk": static_radius(smooth)},
    }
