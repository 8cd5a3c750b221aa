"""The machines that lack one effect: their motions, and what counts as an answer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.systems import laws, machines
from benchmarks.systems.__main__ import table
from benchmarks.systems.cases import CASES, Case
from benchmarks.systems.record import record
from benchmarks.systems.run import judged, run
from discovery.rigs.rig_file import read_rig


def test_a_recording_is_that_of_its_machine(tmp_path: Path) -> None:
    """A motor under a torque in steps comes to the speed at which its loss takes the torque."""
    machine = machines.motor()
    record(machine, "shaft", laws.NOTHING, tmp_path / "a.csv", 1)
    record(machine, "shaft", laws.dry(8e-3, 0.01), tmp_path / "b.csv", 1)
    free, rubbed = (np.loadtxt(tmp_path / name, delimiter=",", skiprows=1) for name in ("a.csv", "b.csv"))
    # Five time constants after a step of the torque.
    _, torque, speed = free[1299]
    assert speed == pytest.approx(torque / 6e-3, abs=0.2)
    _, torque, speed = rubbed[1299]
    assert speed == pytest.approx((torque - np.sign(torque) * 8e-3) / 6e-3, abs=0.2)


def test_every_rig_file_can_be_read(tmp_path: Path) -> None:
    for case in CASES.values():
        path = tmp_path / "rig.toml"
        path.write_text(case.machine.rig, encoding="utf-8")
        read_rig(path)


def answer(effect: str, value: float, held: float, **more: Any) -> dict[str, Any]:
    errors = {w: {"holdout": {"rms": rms}} for w, rms in (("before", 9.0), ("after", held))}
    parameters = {"f_c_load": {"value": value, "sd": 0.1, "unit": "N m", **more}}
    return {
        "verdict": "explained",
        "effects": [{"id": effect, "parameters": parameters}],
        "errors": {"noise_floor": 1.0, **errors},
    }


def test_an_answer_needs_place_size_and_prediction() -> None:
    case = Case(machines.two_masses(), "load", laws.dry(0.012, 2e-3))
    right = judged(case, answer("coulomb_friction_at_load", 0.0121, 1.02), 1.0, 2.0)
    assert right.right
    assert right.errors == {"f_c": pytest.approx(0.0121 / 0.012 - 1)}
    assert not judged(case, answer("coulomb_friction_at_motor", 0.0121, 1.02), 1.0, 2.0).right
    assert not judged(case, answer("coulomb_friction_at_load", 0.015, 1.02), 1.0, 2.0).right
    assert not judged(case, answer("coulomb_friction_at_load", 0.0121, 1.5), 1.0, 2.0).right
    assert "| yes | explained `coulomb_friction_at_load` | f_c +0.8 % | 9.00 → 1.020 |" in table({"case": right})


@pytest.mark.slow
def test_friction_is_found_although_without_it_the_system_fits_at_absurd_values(tmp_path: Path) -> None:
    """A loss on the track that the model lacks: it fits with a pendulum of no length, and a dead zone explains more."""
    outcome = run(CASES["cart pendulum: dry friction on the track"], tmp_path, 1)
    assert outcome.right, outcome
