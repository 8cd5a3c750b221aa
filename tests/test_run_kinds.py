"""Whole runs of systems other than the arm: an inverse view, and a falling body."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from discovery.estimation.holdout import HoldOut
from discovery.estimation.residual import errors
from discovery.foundation.errors import InputError
from discovery.posterior.draws import Posterior
from discovery.recordings.dataset import load_dataset
from discovery.report import build_report
from discovery.runs import regression_stage, stages
from discovery.runs.pipeline import run

#: The words and files of pages are what is tested here.
pytestmark = pytest.mark.usefixtures("few_draws", "sketched")

MASS, DAMPING, NOISE = 3.0, 0.8, 1.0

DRIVE = """
name = "carriage"
kind = "drive"
[columns]
time = { name = "t", unit = "s" }
input = { name = "q", unit = "m" }
output = { name = "F", unit = "N" }
[view]
output = "force"
motion_cutoff_hz = 20.0
cutoff_hz = 10.0
[model]
effects = ["viscous_damping"]
[records]
train = [{ file = "drive.csv", samples = [0, 800] }]
holdout = [{ file = "drive.csv", samples = [800, 1600] }]
"""

STONE = """
name = "stone"
kind = "falling_body"
gravity_m_s2 = 9.8
[columns]
time = { name = "t", unit = "s" }
output = { name = "h", unit = "m", noise = 0.02 }
[model]
effects = []
[records]
train = [{ file = "fall.csv", where = { drop = 1 } }]
holdout = [{ file = "fall.csv", where = { drop = 2 } }]
test = [{ file = "fall.csv", where = { drop = 3 }, name = "far" }]
"""


SWING = """
name = "swing"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "q", unit = "m", noise = 1e-4 }
[model]
effects = ["viscous_damping", "linear_stiffness"]
[records]
train = [{ file = "swing.csv", samples = [0, 1200], name = "first" }]
holdout = [{ file = "swing.csv", samples = [1200, 2400], name = "second" }]
"""


def silent(message: str) -> None:
    """Hear progress and say nothing."""


def results_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "results.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def drive(sketch: Callable[[Path], Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the inverse view of a carriage with viscous friction, nothing hidden."""
    folder = tmp_path_factory.mktemp("drive")
    t = np.arange(1600) / 100.0
    w = np.array([0.9, 2.3, 4.1])[:, None]
    q, rate, acceleration = (np.sum(f, axis=0) for f in (np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)))
    force = MASS * (acceleration + DAMPING * rate) + NOISE * np.random.default_rng(1).standard_normal(t.size)
    pd.DataFrame({"t": t, "q": q, "F": force}).to_csv(folder / "drive.csv", index=False)
    (folder / "rig.toml").write_text(DRIVE)
    run(load_dataset(folder / "rig.toml"), folder / "run", seed=1, progress=silent, with_posterior=False)
    sketch(folder / "run")
    return folder / "run"


@pytest.mark.slow
def test_an_inverse_view_is_run_whole(drive: Path, tmp_path: Path) -> None:
    run(load_dataset(drive.parent / "rig.toml"), tmp_path, seed=1, progress=silent)
    results = results_of(tmp_path)
    assert results["loop"]["verdict"] == "nothing_missing"
    assert results["discovery"] is None
    assert set(results["fits"]) == {"declared"}
    assert (results["rig"]["coordinate_unit"], results["rig"]["input_unit"]) == ("m", "m")
    assert results["recordings"][0]["signal"]["rms"] > 10 * NOISE
    rows = {r["name"]: r for r in results["posterior"]["rows"]}
    assert set(rows) == {"m", "xi", "sigma"}
    assert abs(rows["m"]["mean"] - MASS) < 5 * rows["m"]["sd"] + 1e-3 * MASS
    # Damping per reference inertia, a power of ten.
    viscous = MASS * DAMPING / results["models"]["after"]["model"]["known"]["m_0"]
    assert abs(rows["xi"]["mean"] - viscous) < 5 * rows["xi"]["sd"] + 1e-3 * viscous
    assert Posterior.from_netcdf(tmp_path / "posterior.nc").units["m"] == "s^2 m^-1"


def test_its_page_speaks_of_force_and_position(drive: Path) -> None:
    page = (drive / "report.html").read_text(encoding="utf-8")
    assert "Measured: force and position of" in page
    assert "Phase portrait" not in page
    assert "The equation found in the motion" not in page


def test_what_the_library_does_not_describe_is_not_searched(drive: Path) -> None:
    with pytest.raises(InputError, match="carriage: sparse regression needs readings of the coordinate"):
        regression_stage.discover(load_dataset(drive.parent / "rig.toml"), seed=1, progress=silent)


def test_a_falling_body_is_scored_on_what_nobody_has_seen(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    t = np.arange(60) / 30.0
    # The third stone falls under another gravity, so that its score is known: half of the difference times t^2.
    drops = [
        pd.DataFrame({"drop": n, "t": t, "h": 30 + v * t - g * t**2 / 2 + 0.02 * rng.standard_normal(t.size)})
        for n, v, g in ((1, 0.0, 9.8), (2, 1.0, 9.8), (3, 0.0, 11.8))
    ]
    pd.concat(drops).to_csv(tmp_path / "fall.csv", index=False)
    (tmp_path / "rig.toml").write_text(STONE)
    run(load_dataset(tmp_path / "rig.toml"), tmp_path / "run", seed=1, progress=silent, with_posterior=False)
    results = results_of(tmp_path / "run")
    assert results["loop"]["verdict"] == "nothing_missing"
    assert results["posterior"] is None
    assert not (tmp_path / "run" / "posterior.nc").exists()
    # What a straight line, the initial state, leaves of t^2 over [0, T]: T^2 / (6 sqrt 5) rms.
    left = t[-1] ** 2 / (6 * np.sqrt(5.0))
    assert results["test"]["far"]["after"]["rms"] == pytest.approx(np.hypot(left, 0.02), rel=0.05)
    assert [r["role"] for r in results["recordings"]] == ["train", "holdout", "test"]
    page = build_report(tmp_path / "run").read_text(encoding="utf-8")
    assert "only scored" in page
    assert "This run sampled no posterior." in page
    assert "height" in page


def test_a_run_that_goes_on_keeps_the_phase_that_it_lost(tmp_path: Path) -> None:
    """A pendulum that grows slower: with a new initial state the second half fits far better than run on."""
    t = np.arange(2400) / 50.0
    rng = np.random.default_rng(3)
    phase = 3.0 * t - 0.004 * t**2
    q = 0.1 * np.exp(-0.01 * t) * np.cos(phase) + 1e-4 * rng.standard_normal(t.size)
    pd.DataFrame({"t": t, "q": q}).to_csv(tmp_path / "swing.csv", index=False)
    (tmp_path / "rig.toml").write_text(SWING)
    dataset = load_dataset(tmp_path / "rig.toml")
    before = stages.estimate(dataset, progress=silent).models["declared"]
    result: Any = SimpleNamespace(before=before, after=before)
    found = stages.continued(result, dataset, progress=silent)
    assert found is not None
    (held,) = HoldOut(dataset.train, dataset.holdout, before.problem.units, 1e-6).predictions(
        before.problem.bench, [(before.model, before.values, before.predict())]
    )
    anew = errors(held[0], dataset.holdout[0].recording.output)["rms"]
    assert found["after"]["rms"] > 1.5 * anew
    # The same by an integrator of its own, from the fitted values.
    v = before.values
    solved = solve_ivp(
        lambda _, y: [y[1], -v["xi"] * y[1] - v["alpha"] * y[0]],
        (t[0], t[-1]),
        [v["delta_0_init[first]"], v["rate_0_init[first]"]],
        t_eval=t,
        rtol=1e-10,
        atol=1e-12,
    )
    expected = np.sqrt(np.mean((solved.y[0][1200:] - q[1200:]) ** 2))
    assert found["after"]["rms"] == pytest.approx(expected, rel=1e-3)
    apart = replace(dataset, holdout=dataset.train)
    assert stages.continued(result, apart, progress=silent) is None
