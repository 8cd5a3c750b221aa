"""Motor and gear (P6): the coupling torque of several models against the twin, and when the encoder angle is given."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from discovery_datasets.twin import PAPER_RIG, simulate
from numpy.typing import NDArray

from benchmarks.paper.paper_fit import LINEAR, paper_models
from benchmarks.paper.stand import manoeuvre, stand
from benchmarks.paper.studies.dynamics import general_arm, true_drive
from benchmarks.paper.theory.arm_motion import move_arm
from benchmarks.paper.theory.coupling import Arm
from benchmarks.paper.theory.drivetrain.driven_arm import drive_arm
from benchmarks.paper.theory.drivetrain.motor import ASSUMED_MOTOR, PositionController
from benchmarks.paper.theory.drivetrain.study import encoder_as_input
from benchmarks.paper.theory.massless_arm.simulation import simulate_general
from discovery.equations.model import Model
from discovery.rigs.kinds import PAPER_MODEL

FloatArray = NDArray[np.float64]

_SEED = 109
_TIME = np.arange(601) / 100.0
_CONTROLLER = PositionController(2 * np.pi * 10)
_BANDWIDTHS = (3.0, 10.0, 30.0)  # Hz


def exact_arm() -> Arm:
    """Return the exact arm of the paper's rig."""
    rig = PAPER_RIG
    inertia = rig.effective_mass * rig.length**2
    values = {
        "xi": rig.disc_friction / rig.effective_mass,
        "alpha": 3 * rig.flexural_rigidity / (inertia * rig.length),
        "mu": rig.beam_mass / rig.tip_mass,
        "length": rig.length,
        "tau_r": 0.0,
    }
    return Arm(Model("elastica", LINEAR), values, inertia)


def fitted_arm() -> Arm:
    """Return the paper's model with the numbers that it has when it is fitted to the twin."""
    found = paper_models(stand(PAPER_RIG, manoeuvre(), name="motor", seed=[_SEED]))
    values = {**found.cubic.values, "gamma": found.gamma, "length": PAPER_RIG.length}
    inertia = PAPER_RIG.effective_mass * PAPER_RIG.length**2
    return Arm(Model("constant_radius", PAPER_MODEL), values, inertia)


def motor() -> tuple[dict[str, Any], dict[str, dict[str, FloatArray]]]:
    """Return torque errors against the twin, the study by gear ratio, and one manoeuvre of motor and arm together."""
    move = manoeuvre()
    drive = true_drive(move, _TIME[-1])
    truth = simulate(PAPER_RIG, move, _TIME, rtol=1e-6)
    arm = exact_arm()
    torques = {
        "exact arm": move_arm(arm, drive, _TIME).coupling_torque,
        "paper’s model": move_arm(fitted_arm(), drive, _TIME).coupling_torque,
        "general model, rod counted": simulate_general(general_arm(PAPER_RIG, rod=True), drive, _TIME).coupling_torque,
    }
    # At a kink the twin's torque has two values, as the acceleration has.
    away = np.abs(_TIME[:, None] - np.array(move.kinks)).min(axis=1) > 1e-6
    rms = {n: float(np.sqrt(np.mean((t - truth.base_torque)[away] ** 2))) for n, t in torques.items()}
    driven = drive_arm(arm, ASSUMED_MOTOR, _CONTROLLER, drive, _TIME)
    long = true_drive(move, 10.0)
    studies = {
        f"{f:g}": asdict(
            encoder_as_input(np.random.default_rng(_SEED), controller=PositionController(2 * np.pi * f), command=long)
        )
        for f in _BANDWIDTHS
    }
    m = ASSUMED_MOTOR
    numbers = {
        "assumed": {"J": m.inertia, "nu": m.viscous_friction, "k_t": m.torque_constant, "n": m.gear_ratio},
        "bandwidth_Hz": _CONTROLLER.bandwidth / (2 * np.pi),
        "largest_torque": float(np.abs(truth.base_torque).max()),
        "torque_rms": float(np.sqrt(np.mean(truth.base_torque[away] ** 2))),
        "torque_error_rms": rms,
        "largest_current": float(np.abs(driven.current).max()),
        "tracking_peak": float(np.abs(driven.theta_m - driven.command).max()),
        "study": studies[f"{_CONTROLLER.bandwidth / (2 * np.pi):g}"],
        "by_bandwidth": studies,
    }
    curves = {
        "torque": {"time": _TIME, "twin": truth.base_torque, **torques},
        "driven": {
            "time": _TIME,
            "command": driven.command,
            "theta_m": driven.theta_m,
            "current": driven.current,
            "coupling_torque": driven.coupling_torque,
        },
    }
    return numbers, curves
