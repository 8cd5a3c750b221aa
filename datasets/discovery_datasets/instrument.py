"""A motion of the twin, and what encoder and camera write down of it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class TwinMotion:
    """A simulated motion, free of noise, at n times.

    Attributes
    ----------
    time : (n,) array
        Times [s].
    motor_angle, base_angle : (n,) array
        Angle that a perfect encoder reports, and the angle of the rod's root [rad].
    tip_x, tip_y : (n,) array
        Position of the tip [m].
    reading_x, reading_y : (n,) array
        What a perfect camera reports: late, shifted or scaled where a disturbance says so [m].
    tip_angle : (n,) array
        Polar angle of the tip [rad], continuous in time.
    coordinates, rates : (n, K) array
        Curvature coordinates q_k [rad] and their rates [rad/s].
    kinetic_energy, elastic_energy : (n,) array
        Energy of all mass, and bending energy at the nominal rigidity [J].
    base_torque : (n,) array
        Torque of the motor on the rod's root [N m].
    """

    time: FloatArray
    motor_angle: FloatArray
    base_angle: FloatArray
    tip_x: FloatArray
    tip_y: FloatArray
    reading_x: FloatArray
    reading_y: FloatArray
    tip_angle: FloatArray
    coordinates: FloatArray
    rates: FloatArray
    kinetic_energy: FloatArray
    elastic_energy: FloatArray
    base_torque: FloatArray

    @property
    def deflection(self) -> FloatArray:
        """Angle of the tip against the base, delta = theta_t - theta_m [rad], shape (n,)."""
        return self.tip_angle - self.base_angle


def record(
    motion: TwinMotion, *, rng: np.random.Generator, position_noise: float = 3e-4, angle_noise: float = 7e-5
) -> pd.DataFrame:
    """Write down what encoder and camera report.

    Parameters
    ----------
    motion : TwinMotion
        The motion.
    rng : numpy.random.Generator
        Source of the noise.
    position_noise : float
        Standard deviation of the camera's normal noise, per axis [m].
    angle_noise : float
        Half width of the encoder's uniform error [rad].

    Returns
    -------
    pandas.DataFrame
        Columns ``time_s, motor_angle_rad, tip_x_m, tip_y_m``.
    """
    import pandas as pd

    n = motion.time.size
    angle_error = rng.uniform(-angle_noise, angle_noise, n)
    position_error = position_noise * rng.standard_normal((n, 2))
    return pd.DataFrame(
        {
            "time_s": motion.time,
            "motor_angle_rad": motion.motor_angle + angle_error,
            "tip_x_m": motion.reading_x + position_error[:, 0],
            "tip_y_m": motion.reading_y + position_error[:, 1],
        }
    )


def write_csv(frame: pd.DataFrame, path: str | Path) -> None:
    """Write a recording with six decimals; the file appears whole or not at all."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = target.with_name(target.name + ".part")
    try:
        frame.to_csv(draft, index=False, float_format="%.6f", lineterminator="\n")
        os.replace(draft, target)
    finally:
        draft.unlink(missing_ok=True)
