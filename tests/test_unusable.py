"""Recordings from which nothing can be learned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.foundation.errors import InputError
from discovery.recordings.dataset import load_dataset

RIG = Path(__file__).parents[1] / "datasets" / "arm" / "rig.toml"
TIME = np.arange(0.0, 12.0, 0.01)


def recorded(path: Path, bent: float, seed: int) -> Path:
    """Write a move of an arm whose tip swings by so much about the motor's line [rad]."""
    rng = np.random.default_rng(seed)
    motor = 0.6 * np.sin(0.9 * TIME + seed)
    tip = motor + bent * np.sin(5.0 * TIME)
    columns = np.column_stack([TIME, motor + 7e-5 * rng.standard_normal(TIME.size), np.cos(tip), np.sin(tip)])
    columns[:, 2:] += 3e-4 * rng.standard_normal((TIME.size, 2))
    names = "time_s,motor_angle_rad,tip_x_m,tip_y_m"
    np.savetxt(path, columns, delimiter=",", header=names, comments="", fmt="%.7g")
    return path


def test_an_arm_that_nowhere_bends_is_refused(tmp_path: Path) -> None:
    still = [recorded(tmp_path / f"{name}.csv", 0.0, seed) for name, seed in (("a", 1), ("b", 2))]
    with pytest.raises(InputError, match=r"a\.csv, .*b\.csv: the tip never leaves the motor's line.*Record faster"):
        load_dataset(RIG, still)


@pytest.mark.parametrize("bent", [1e-3, 0.1])
def test_one_recording_that_bends_a_little_is_enough(tmp_path: Path, bent: float) -> None:
    files = [recorded(tmp_path / "a.csv", 0.0, 1), recorded(tmp_path / "b.csv", bent, 2)]
    assert len(load_dataset(RIG, files).train) == 2
