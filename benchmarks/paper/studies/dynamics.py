"""The general model (7), both components of the force, against the twin and the exact arm as the rod gets lighter."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from discovery_datasets.manoeuvres import Manoeuvre, minimum_jerk
from discovery_datasets.twin import PAPER_RIG, ArmRig, simulate
from numpy.typing import NDArray

from benchmarks.paper.stand import manoeuvre
from benchmarks.paper.theory.massless_arm.massless_limit import distance_to_rod, tip_distance
from benchmarks.paper.theory.massless_arm.model import GeneralModel
from benchmarks.paper.theory.massless_arm.simulation import simulate_general
from discovery.recordings.drive import Drive

FloatArray = NDArray[np.float64]

RODS = (0.01245, 0.006, 0.003, 0.0012)
"""Masses of the twin's rod [kg]."""
MASS_RATIOS = (0.2845, 0.1, 0.05, 0.02, 0.01, 0.005)
"""Rod over tip mass of the exact arm; below 0.005 its second mode is too fast to be worth simulating."""
MOVES = {"trapezoid": manoeuvre(), "minimum jerk": minimum_jerk(1.0, 1.1)}
"""Two motions of the hub: the paper's, whose acceleration jumps, and a smooth one that deflects the arm alike."""
TIME = np.arange(601) / 100.0


def true_drive(move: Manoeuvre, end: float) -> Drive:
    """Return the exact motion of the hub as an input, up to `end` [s]."""
    edges = np.unique(np.clip([0.0, *move.kinks, end], 0.0, end))
    columns = []
    for begin, stop in pairwise(edges):
        origin, powers = move.stretch(int(np.searchsorted(move.kinks, (begin + stop) / 2)))
        shifted = np.polynomial.Polynomial(powers)(np.polynomial.Polynomial([begin - origin, 1.0]))
        columns.append(np.pad(shifted.coef, (0, 6 - shifted.coef.size))[::-1])
    return Drive(edges, np.array(columns, float).T.copy(), np.asarray(move.kinks, float))


def general_arm(arm: ArmRig, *, rod: bool) -> GeneralModel:
    """Return the massless arm of a rig, its tip carrying 33/140 of the rod's mass or nothing of it."""
    mass = arm.effective_mass if rod else arm.tip_mass
    return GeneralModel(arm.flexural_rigidity, mass, arm.length, arm.disc_friction / mass)


def _against_twin(name: str) -> list[dict[str, float | str]]:
    move, rows = MOVES[name], []
    for rod_mass in RODS:
        arm = replace(PAPER_RIG, beam_mass=rod_mass)
        truth = simulate(arm, move, TIME, rtol=1e-6)
        row: dict[str, float | str] = {"move": name, "rod_mass": rod_mass, "mass_ratio": rod_mass / arm.tip_mass}
        for label, rod in (("massless", False), ("rod counted", True)):
            motion = simulate_general(general_arm(arm, rod=rod), true_drive(move, TIME[-1]), TIME)
            row[label] = tip_distance(motion, truth.tip_x, truth.tip_y).mean
        rows.append(row)
    return rows


def _against_exact_arm(name: str) -> list[dict[str, float | str]]:
    drive, model = true_drive(MOVES[name], TIME[-1]), general_arm(PAPER_RIG, rod=False)
    return [
        {
            "move": name,
            "mass_ratio": ratio,
            **{
                label: distance_to_rod(model, drive, TIME, ratio, effective=rod).mean
                for label, rod in (("massless", False), ("rod counted", True))
            },
        }
        for ratio in MASS_RATIOS
    ]


def dynamics() -> tuple[dict[str, Any], dict[str, dict[str, FloatArray]]]:
    """Return the distance of the general model from arms with a rod, and one motion with its two force components."""
    arm, move = PAPER_RIG, MOVES["trapezoid"]
    drive, model = true_drive(move, TIME[-1]), general_arm(arm, rod=True)
    truth = simulate(arm, move, TIME, rtol=1e-6)
    motion = simulate_general(model, drive, TIME)
    finer = simulate_general(model, drive, TIME, step=0.005)
    calmed = simulate_general(model, drive, TIME, retardation=0.02)
    numbers = {
        "twin": [row for name in MOVES for row in _against_twin(name)],
        "exact": [row for name in MOVES for row in _against_exact_arm(name)],
        "paper_rig": vars(tip_distance(motion, truth.tip_x, truth.tip_y)),
        "step_halved": tip_distance(motion, *finer.position).peak,
        "retardation_doubled": tip_distance(motion, *calmed.position).peak,
        "largest_tangential": float(np.abs(motion.tangential).max()),
    }
    curves = {
        "motion": {
            "time": TIME,
            "tip": motion.position.T,
            "truth": np.column_stack([truth.tip_x, truth.tip_y]),
            "deflection": motion.theta_t - motion.theta_m,
            "rho": motion.rho,
            "tangential": motion.tangential,
            "radial": motion.radial,
            "coupling_torque": motion.coupling_torque,
        }
    }
    return numbers, curves
