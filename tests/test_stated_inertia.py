"""A mass or inertia that a rig file states beside a recorded force: it is used, and refuted where it is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.estimation.declared import rig_uncertainty
from discovery.recordings.dataset import load_dataset
from discovery.runs.loop import close_loop
from discovery.runs.loop_result import LoopResult

RIG = """
name = "turntable"
kind = "drive"
inertia_kg_m2 = {{ value = {inertia}, sd = {sd} }}
[columns]
time = {{ name = "t", unit = "s" }}
input = {{ name = "torque", unit = "{unit}" }}
output = {{ name = "angle", unit = "rad", noise = 2e-3 }}
[model]
effects = ["viscous_damping"]
[records]
train = [{{ file = "a.csv" }}]
holdout = [{{ file = "h.csv" }}]
"""
_INERTIA = 0.05


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write two recordings of a turntable, integrated by scipy."""
    found, rng = tmp_path_factory.mktemp("turntable"), np.random.default_rng(4)
    time = np.arange(0.0, 8.0, 0.02)
    for name, size in (("a", 0.02), ("h", 0.015)):

        def slopes(t, y, size=size):
            return [y[1], (size * np.sin(2.1 * t) - 0.01 * y[1]) / _INERTIA]

        angle = solve_ivp(slopes, (0.0, 8.0), (0.0, 0.0), t_eval=time, rtol=1e-9, atol=1e-11).y[0]
        rows = [time, size * np.sin(2.1 * time), angle + 2e-3 * rng.standard_normal(time.size)]
        np.savetxt(found / f"{name}.csv", np.column_stack(rows), delimiter=",", header="t,torque,angle", comments="")
    return found


def closed(folder: Path, unit: str = "N m", **stated: float) -> LoopResult:
    """Close the loop with an inertia that is stated."""
    rig = folder / "rig.toml"
    rig.write_text(RIG.format(unit=unit, **stated))
    return close_loop(load_dataset(rig))


def test_what_is_stated_narrows_what_is_fitted(folder: Path) -> None:
    loose, firm = (closed(folder, inertia=0.0501, sd=sd) for sd in (0.05, 3e-5))
    assert {f.verdict for f in (loose, firm)} == {"nothing_missing"}
    (sd, narrow) = (f.after.summary()["physical"]["inertia"]["sd"] for f in (loose, firm))
    assert 0.2 * sd < narrow < 0.5 * sd
    (check,) = firm.contradiction.checks
    assert check.source == "1 / inertia_kg_m2 of the rig file"
    assert check.predicted == pytest.approx(1 / 0.0501)
    assert firm.contradiction.contradictions == ()


def test_what_is_stated_wrongly_is_refuted(folder: Path) -> None:
    found = closed(folder, inertia=0.07, sd=7e-4)
    (contradiction,) = found.contradiction.contradictions
    assert contradiction.overruled
    assert contradiction.check.parameter == "g"
    assert found.after.summary()["physical"]["inertia"]["value"] == pytest.approx(_INERTIA, rel=0.02)


def test_it_says_nothing_of_a_gain_that_is_no_inertia(folder: Path) -> None:
    (folder / "rig.toml").write_text(RIG.format(unit="V", inertia=0.05, sd=1e-3))
    assert rig_uncertainty(load_dataset(folder / "rig.toml").train[0]) == {}
