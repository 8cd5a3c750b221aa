"""Random arms, manoeuvres and hidden effects: the cases of the blind benchmark, before their strength is settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from discovery_datasets.arm import ROD_SHARE, ArmRig, TwinError
from discovery_datasets.hidden import FAMILIES, Hidden, Scene, clash, draw_hidden, log_uniform, random_sign
from discovery_datasets.manoeuvres import Manoeuvre, minimum_jerk, sequence, trapezoid
from discovery_datasets.quick import readings

FloatArray = NDArray[np.float64]
Generator = np.random.Generator
#: Shares of the kinds of case; what is left has one effect of the catalogue.
CLEAN, PAIRS, OUTSIDERS = 0.18, 0.17, 0.13
#: Share of the cases with the camera of the paper, 0.3 mm; the others are spread from 0.1 to 3 mm.
PAPER_CAMERA = 0.7
SAMPLE_RATES = (50.0, 60.0, 80.0, 100.0, 125.0, 160.0, 200.0)


@dataclass(frozen=True)
class CaseDraw:
    """A case but for the strengths of its effects.

    Attributes
    ----------
    kind : str
        "none", "single", "pair" or "outside".
    scene : Scene
        The arm and its sizes.
    train, holdout : tuple of Manoeuvre, Manoeuvre
        Motions of the motor.
    time : (n,) array
        Times of the samples [s].
    noise : float
        Of the camera, per axis [m].
    hidden : tuple of Hidden
        Effects.
    targets : tuple of float
        Size wanted of each, see the benchmark, in units of the noise.
    """

    kind: str
    scene: Scene
    train: tuple[Manoeuvre, ...]
    holdout: Manoeuvre
    time: FloatArray
    noise: float
    hidden: tuple[Hidden, ...]
    targets: tuple[float, ...]


def draw_rig(rng: Generator) -> ArmRig:
    """Draw an arm: 0.5 to 1.5 m, disc of 20 to 80 g, rod of 0.03 to 0.35 times that, swinging at 0.35 to 1.4 Hz.

    Its material damps itself a little, as every one does: without that the ringing of a light rod grows chaotic.
    """
    length, tip_mass = float(rng.uniform(0.5, 1.5)), log_uniform(rng, 0.02, 0.08)
    beam_mass = tip_mass * log_uniform(rng, 0.03, 0.35)
    mass = tip_mass + ROD_SHARE * beam_mass
    frequency = 2 * pi * log_uniform(rng, 0.35, 1.4)
    return ArmRig(
        length=length,
        tip_mass=tip_mass,
        beam_mass=beam_mass,
        flexural_rigidity=frequency**2 * mass * length**3 / 3,
        disc_friction=mass * log_uniform(rng, 0.02, 0.15),
        retardation=log_uniform(rng, 5e-5, 2e-4),
    )


def _moves(rng: Generator, duration: float, count: int) -> list[tuple[bool, float, float, float]]:
    """Draw (smooth, angle, quickness, start) of moves in the first 60 % of a recording."""
    starts = np.sort(rng.uniform(0.05, 0.6, count) * duration)
    starts[0] = rng.uniform(0.2, 1.0)
    moves = []
    for start in starts:
        moves.append(
            (bool(rng.random() < 0.4), random_sign(rng) * rng.uniform(0.4, 1.5), rng.uniform(0.7, 1.3), float(start))
        )
    return moves


def _manoeuvre(moves: Sequence[tuple[bool, float, float, float]], rate: float) -> Manoeuvre:
    """Put moves in sequence, each at about `rate` [rad/s]; one that would begin too early waits for the one before."""
    found: Manoeuvre | None = None
    for smooth, angle, quickness, start in moves:
        begin = start if found is None else max(start, found.kinks[-1] + 0.1)
        speed = rate * quickness
        if smooth:
            move = minimum_jerk(angle, 1.5 * abs(angle) / speed, start=begin)
        else:
            move = trapezoid(angle, speed, start=begin, ramp=0.12 + 0.2 * (quickness - 0.7))
        found = move if found is None else sequence(found, move)
    assert found is not None
    return found


def _reaching(
    rng: Generator, rig: ArmRig, frequency: float, time: FloatArray, deflection: float
) -> tuple[Manoeuvre, FloatArray, NDArray[np.complex128], float]:
    """Draw a manoeuvre that deflects the arm about as wanted; with its hub angles, tip path and largest deflection."""
    while True:
        moves = _moves(rng, time[-1], int(rng.integers(1, 4)))
        rate = deflection * frequency / 2.2
        for _ in range(4):
            manoeuvre = _manoeuvre(moves, rate)
            if manoeuvre.kinks[-1] > 0.75 * time[-1]:
                break
            # The largest deflection comes in a move or soon after it.
            busy = time[time < manoeuvre.kinks[-1] + 2 * pi / frequency]
            try:
                reached = float(np.abs(readings(rig, manoeuvre, busy, modes=3, nodes=8).deflection).max())
            except TwinError:
                break
            if abs(reached / deflection - 1) < 0.05:
                motion = readings(rig, manoeuvre, time, modes=3, nodes=8)
                return manoeuvre, motion.motor_angle, motion.tip, reached
            rate *= np.clip(deflection / reached, 0.5, 1.6)


def draw_case(seed: Sequence[int]) -> CaseDraw:
    """Draw a case from a seed of its own; the same seed gives the same case."""
    rng = np.random.default_rng(seed)
    kind = str(
        rng.choice(["none", "pair", "outside", "single"], p=[CLEAN, PAIRS, OUTSIDERS, 1 - CLEAN - PAIRS - OUTSIDERS])
    )
    rig = draw_rig(rng)
    frequency = float(np.sqrt(3 * rig.flexural_rigidity / (rig.effective_mass * rig.length**3)))
    rate = float(rng.choice(SAMPLE_RATES))
    duration = float(np.clip(round(rng.uniform(max(8.0, 5 * 2 * pi / frequency), 30.0), 1), 8.0, 30.0))
    time = np.arange(round(duration * rate) + 1) / rate
    deflection = float(rng.uniform(0.3, 1.1))
    noise = 3e-4 if rng.random() < PAPER_CAMERA else round(log_uniform(rng, 1e-4, 3e-3), 6)
    first, hub, path, reached = _reaching(rng, rig, frequency, time, deflection)
    train = [first]
    if rng.random() < 0.15:
        train.append(_reaching(rng, rig, frequency, time, deflection * rng.uniform(0.6, 1.0))[0])
    wider = rng.uniform(1.0, 1.25) if rng.random() < 0.25 else rng.uniform(0.7, 1.0)
    holdout = _reaching(rng, rig, frequency, time, min(1.2, deflection * wider))[0]
    scene = Scene(
        rig=rig,
        deflection=reached,
        frequency=frequency,
        force=3 * rig.flexural_rigidity / rig.length**2 * reached,
        speed=rig.length * reached * frequency,
        duration=duration,
        time=time,
        path=path,
        hub=hub,
    )
    inside = [name for family, names in FAMILIES.items() if family != "outside" for name in names]
    count = {"none": 0, "single": 1, "outside": 1, "pair": 2}[kind]
    names = rng.permutation(FAMILIES["outside"] if kind == "outside" else inside)
    chosen: list[Hidden] = []
    for name in names:
        found = draw_hidden(str(name), scene, rng)
        if len(chosen) < count and not any(clash(found, other) for other in chosen):
            chosen.append(found)
    targets = tuple(log_uniform(rng, 1.0, 30.0) for _ in chosen)
    return CaseDraw(kind, scene, tuple(train), holdout, time, noise, tuple(chosen), targets)
