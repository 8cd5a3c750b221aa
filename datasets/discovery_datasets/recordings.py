"""The named recordings of the twin: their manoeuvres, hidden effects and seeds, fixed once.

A recording has 2501 samples at 100 Hz; the motor starts at 0.5 s. The manoeuvres are defined by the deflection that the
paper's arm must reach: the training ones 0.69 rad and 0.83 rad, one hold-out 0.70 rad, the other 0.99 rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from discovery_datasets.disturbances import CoulombFriction, Disturbance, SensorDelay, TableTilt
from discovery_datasets.manoeuvres import Manoeuvre, sequence, trapezoid
from discovery_datasets.twin import PAPER_RIG, ArmRig, FloatArray, TwinMotion, record, simulate

if TYPE_CHECKING:
    import pandas as pd

SEED = 20240
DURATION, RATE = 25.0, 100.0  # s, Hz

MANOEUVRES: dict[str, Manoeuvre] = {
    "train_paper": trapezoid(1.0, 1.0),
    "train_large": trapezoid(1.0, 1.4),
    "holdout_inside": sequence(trapezoid(-0.9, 1.1), trapezoid(0.5, 0.8, start=9.0)),
    "holdout_beyond": trapezoid(1.4, 1.45),
}
"""Motion of the motor in each recording."""

ARMS: dict[str, tuple[Disturbance, ...]] = {
    "arm": (),
    "arm_coulomb": (CoulombFriction(force=6e-4),),
    "arm_delay": (SensorDelay(delay=0.010),),
    "arm_tilt": (TableTilt(x=-1.5e-3, y=2.0e-3),),
}
"""Effects hidden in each set of recordings."""

CONTENTS: dict[str, tuple[str, ...]] = {
    name: tuple(MANOEUVRES) if not hidden else ("train_paper", "train_large", "holdout_inside")
    for name, hidden in ARMS.items()
}
"""Recordings of each set."""


def sample_times() -> FloatArray:
    """Return the times of the samples of every recording [s], shape (2501,)."""
    return np.arange(round(DURATION * RATE) + 1) / RATE


def make_motion(name: str, *, disturbances: Sequence[Disturbance] = (), rig: ArmRig = PAPER_RIG) -> TwinMotion:
    """Noise-free motion of the arm in the manoeuvre of that name.

    Raises
    ------
    KeyError
        If no manoeuvre has that name.
    """
    return simulate(rig, MANOEUVRES[name], sample_times(), disturbances=disturbances)


def make_recording(
    name: str, seed: int | Sequence[int], *, disturbances: Sequence[Disturbance] = (), rig: ArmRig = PAPER_RIG
) -> pd.DataFrame:
    """Noisy recording of the manoeuvre of that name: ``time_s, motor_angle_rad, tip_x_m, tip_y_m``.

    Raises
    ------
    KeyError
        If no manoeuvre has that name.
    """
    motion = make_motion(name, disturbances=disturbances, rig=rig)
    return record(motion, rng=np.random.default_rng(seed))


def set_seed(arm: str, name: str) -> list[int]:
    """Seed of the noise of one recording of one set."""
    return [SEED, list(ARMS).index(arm), list(MANOEUVRES).index(name)]


def make_set(arm: str) -> dict[str, pd.DataFrame]:
    """Every file of one set, by stem; hold-outs come twice, as recorded and free of noise (``*_clean``)."""
    frames = {}
    for name in CONTENTS[arm]:
        motion = make_motion(name, disturbances=ARMS[arm])
        frames[name] = record(motion, rng=np.random.default_rng(set_seed(arm, name)))
        if name.startswith("holdout"):
            silent = np.random.default_rng(0)
            frames[f"{name}_clean"] = record(motion, rng=silent, position_noise=0.0, angle_noise=0.0)
    return frames
