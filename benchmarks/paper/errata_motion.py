"""Errata of the source paper that the twin's motion shows: the time scale of (9), and the manoeuvre of section IV.B."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.twin import PAPER_RIG, ArmRig, simulate
from numpy.typing import NDArray

from benchmarks.paper.erratum import Erratum
from benchmarks.paper.stand import SPEED, scaled_rig

FloatArray = NDArray[np.float64]

#: Arms for the time scale, as factors on length, rigidity and both masses of the reference.
OTHER_ARMS = ((1.6, 2.5, 0.7), (0.6, 0.5, 2.0))
#: Largest deflection [rad] as printed.
_REACHED = 0.85


def _normalised_path(arm: ArmRig, stretch: float, grid: FloatArray) -> FloatArray:
    """Tip over length, complex (n,), of a manoeuvre and a friction that keep their form in t / stretch."""
    friction = PAPER_RIG.disc_friction / PAPER_RIG.effective_mass
    move = trapezoid(1.0, SPEED / stretch, start=0.5 * stretch)
    motion = simulate(scaled_rig(arm, friction=friction / stretch), move, grid * stretch, rtol=1e-6)
    return (motion.tip_x + 1j * motion.tip_y) / arm.length


def time_scale(others: Sequence[tuple[float, float, float]] = OTHER_ARMS, *, duration: float = 6.0) -> Erratum:
    """Erratum b: which time makes (9) one equation for all arms.

    Parameters
    ----------
    others : sequence of (float, float, float)
        Arms as factors on length, flexural rigidity and both masses of the paper's arm; the mass ratio stays.
    duration : float
        Of the comparison, in time of the paper's arm [s].
    """
    grid = np.arange(round(50 * duration) + 1) / 50
    reference = _normalised_path(PAPER_RIG, 1.0, grid)
    right: list[float] = []
    printed: list[float] = []
    for length, rigidity, mass in others:
        arm = replace(
            PAPER_RIG,
            length=length * PAPER_RIG.length,
            flexural_rigidity=rigidity * PAPER_RIG.flexural_rigidity,
            tip_mass=mass * PAPER_RIG.tip_mass,
            beam_mass=mass * PAPER_RIG.beam_mass,
        )
        for stretch, distances in ((np.sqrt(mass * length**3 / rigidity), right), (np.sqrt(mass), printed)):
            distances.append(float(np.abs(_normalised_path(arm, stretch, grid) - reference).max()))
    numbers = {"largest_distance_right_lengths": max(right), "smallest_distance_printed_lengths": min(printed)}
    sentence = (
        f"Arms of other length, rigidity and mass trace one normalised path within {max(right):.1g} lengths in "
        f"t sqrt(EI / (m l^3)), and part by {min(printed):.2f} to {max(printed):.2f} lengths in t / sqrt(m). The hub's "
        "motion, the friction and the mass ratio must keep their normalised form as well."
    )
    return Erratum("b", "(9)", "t_n = t / sqrt(m)", "t_n = t sqrt(EI / (m l^3))", numbers, sentence)


def largest_deflection(speeds: Sequence[float] = (1.0, 1.25, 1.4), *, ramp: float = 0.12) -> Erratum:
    """Erratum f: the deflection that 1 rad at the stated speed reaches.

    Parameters
    ----------
    speeds : sequence of float
        Of the motor [rad/s]; the first one also as a ramp that jumps to its speed.
    ramp : float
        Part of the move that each ramp of the trapezoid takes.
    """
    time = np.arange(301) / 100

    def reached(speed: float, part: float) -> float:
        return float(np.abs(simulate(PAPER_RIG, trapezoid(1.0, speed, ramp=part), time, rtol=1e-6).deflection).max())

    ideal = reached(speeds[0], 1e-3)
    trapezoids = {f"trapezoid_{speed:g}_rad": reached(speed, ramp) for speed in speeds}
    numbers = {"ideal_rad": ideal, **trapezoids, "printed_rad": _REACHED}
    listed = ", ".join(f"{v:.2f} rad at {s:g}" for s, v in zip(speeds, trapezoids.values(), strict=True))
    sentence = (
        f"1 rad at {speeds[0]:g} rad/s deflects the arm by {ideal:.2f} rad, not {_REACHED}; with ramps {listed} rad/s. "
        "The deflection that is reached defines the manoeuvre."
    )
    return Erratum("f", "section IV.B", "0.85 rad at 1 rad/s", "about 1.4 rad/s", numbers, sentence)
