"""Coordinates that are not read begin anywhere: beats of two pendulums, a shaft of which one end is seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.estimation.declared import declared_model, first_fit
from discovery.estimation.fit import fit
from discovery.estimation.held_states import held_out
from discovery.estimation.natural_units import natural_units
from discovery.estimation.predict import predict
from discovery.export.fitted import FittedModel
from discovery.export.source import to_numpy
from discovery.mechanics import get_base
from discovery.recordings.dataset import Dataset, load_dataset

NOISE = 2e-4
PULL, COUPLING, LOSS = 15.0, 1.5, 0.02
RIG = f"""name = "two pendulums"
[system]
coordinates = {{ left = "rad", right = "rad" }}
kinetic = "inertia*dot(left)^2/2 + inertia*dot(right)^2/2"
potential = "-pull*cos(left) - pull*cos(right) + coupling*(left - right)^2/2"
dissipation = "loss*dot(left)^2/2 + loss*dot(right)^2/2"
output = "left"
places = {{ left = "left", right = "right" }}
[system.constants]
inertia = {{ value = 1.0, unit = "kg m^2" }}
pull = {{ guess = 14.0, unit = "N m" }}
coupling = {{ guess = 1.0, unit = "N m / rad" }}
loss = {{ guess = 0.01, unit = "N m s" }}
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "left", unit = "rad", noise = {NOISE} }}
"""
STARTS = {"beats": (0.0, 0.0, 0.3, 0.0), "kicked": (0.2, 0.1, -0.1, 0.8), "judge": (0.1, 0.0, -0.2, 0.5)}


def pendulums(_: float, state: np.ndarray) -> list[float]:
    left, left_rate, right, right_rate = state
    twist = COUPLING * (left - right)
    return [
        left_rate,
        -PULL * np.sin(left) - twist - LOSS * left_rate,
        right_rate,
        -PULL * np.sin(right) + twist - LOSS * right_rate,
    ]


def recorded(folder: Path, name: str, rng: np.random.Generator) -> Path:
    time = np.arange(600) * 0.025
    motion = solve_ivp(pendulums, (0, time[-1]), STARTS[name], t_eval=time, rtol=1e-10, atol=1e-12).y[0]
    path = folder / f"{name}.csv"
    np.savetxt(
        path,
        np.column_stack([time, motion + NOISE * rng.standard_normal(time.size)]),
        delimiter=",",
        header="t,left",
        comments="",
    )
    return path


@pytest.fixture(scope="module")
def beats(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder, rng = tmp_path_factory.mktemp("beats"), np.random.default_rng(4)
    (folder / "rig.toml").write_text(RIG)
    train, other, judge = (recorded(folder, name, rng) for name in STARTS)
    return load_dataset(folder / "rig.toml", [train, other], judge)


def test_both_pendulums_begin_where_they_were_let_go(beats: Dataset) -> None:
    found = fit(declared_model(beats), beats.train)
    values = found.values
    sd = dict(zip(found.problem.names, np.sqrt(np.diag(found.covariance)), strict=True))
    for name, size in (("pull", PULL), ("coupling", COUPLING), ("loss", LOSS)):
        assert abs(values[name] - size) < 4 * sd[name] < 0.2 * size
    # The right one is told beside where the spring alone would hold it.
    held = COUPLING / (PULL + COUPLING)
    for recording in ("beats", "kicked"):
        left, left_rate, right, right_rate = STARTS[recording]
        beside = values[f"right_start_0_init[{recording}]"], values[f"right_rate_start_0_init[{recording}]"]
        assert beside == pytest.approx((right - held * left, right_rate - held * left_rate), abs=0.01)
    assert found.chi2 / found.problem.bench.n_data == pytest.approx(1.0, abs=0.12)


def test_a_recording_that_judges_has_a_start_of_its_own(beats: Dataset) -> None:
    found = fit(declared_model(beats), beats.train)
    bench = found.problem.bench.of_others(beats.holdout)
    ((predicted,),) = held_out([(found.model, found.values)], bench, found.problem.units)
    error = predicted - beats.holdout[0].recording.output
    assert np.sqrt(np.mean(error**2)) < 1.1 * NOISE


def test_a_prediction_begins_where_springs_hold_what_is_not_read(beats: Dataset) -> None:
    found = fit(declared_model(beats), beats.train)
    output, sd = predict(found, beats.holdout[0], initial=(0.2, 0.0))
    time = beats.holdout[0].recording.time
    start = (0.2, 0.0, 0.2 * 1.0 / (14.0 + 1.0), 0.0)  # by the guesses of the rig file
    there = solve_ivp(pendulums, (time[0], time[-1]), start, t_eval=time, rtol=1e-10, atol=1e-12).y[0]
    assert np.abs(output[:, 0] - there).max() < 6 * sd.max() < 0.01
    np.testing.assert_allclose(predict(found, beats.holdout[0])[0], 0.0, atol=1e-12)


def test_what_is_taken_along_moves_as_the_fit(beats: Dataset, tmp_path: Path) -> None:
    found = fit(declared_model(beats), beats.train)
    taken = FittedModel.from_dict(FittedModel.from_fit(found).to_dict())
    source = to_numpy(taken)
    model: dict[str, Any] = {"__name__": "model"}
    exec(compile(source, "model.py", "exec"), model)  # written by us
    for experiment, motion in zip(beats.train, found.predict(), strict=True):
        deflection, rate, *unread = taken.initial[experiment.recording.name]
        assert f"right_start {unread[0]:.9g}" in source
        parameters = {**model["PARAMETERS"], **dict(zip(("right_start", "right_rate_start"), unread, strict=True))}
        again = model["simulate"](experiment.recording.time, 0.0, deflection, rate, parameters)
        np.testing.assert_allclose(again[0], motion[:, 0], atol=1e-6)


def test_a_start_that_nothing_tells_stays_at_rest(tmp_path: Path) -> None:
    """A wheel that nothing holds drives another through oil: where it stands is told by no reading."""
    text = RIG.replace("-pull*cos(left) - pull*cos(right) + coupling*(left - right)^2/2", "pull*left^2/2").replace(
        "loss*dot(left)^2/2 + loss*dot(right)^2/2", "loss*dot(left)^2/2 + coupling*(dot(left) - dot(right))^2/2"
    )
    (tmp_path / "rig.toml").write_text(text.replace('unit = "N m / rad"', 'unit = "N m s"'))

    def oil(_: float, state: np.ndarray) -> list[float]:
        left, left_rate, _, right_rate = state
        drag = 0.3 * (left_rate - right_rate)
        return [left_rate, -PULL * left - drag - LOSS * left_rate, right_rate, drag]

    time = np.arange(600) * 0.025
    motion = solve_ivp(oil, (0, time[-1]), (0.3, 0.0, 0.0, 2.0), t_eval=time, rtol=1e-10, atol=1e-12).y[0]
    read = motion + NOISE * np.random.default_rng(1).standard_normal(time.size)
    np.savetxt(tmp_path / "r.csv", np.column_stack([time, read]), delimiter=",", header="t,left", comments="")
    data = load_dataset(tmp_path / "rig.toml", tmp_path / "r.csv")
    found = fit(declared_model(data), data.train)
    assert found.values["right_start_0_init[r]"] == pytest.approx(0.0, abs=1e-9)
    assert found.values["right_rate_start_0_init[r]"] == pytest.approx(2.0, abs=0.1)
    assert found.chi2 < 1.15 * found.problem.bench.n_data


def test_starts_leave_alone_what_is_read(beats: Dataset) -> None:
    base = get_base(declared_model(beats).base)
    rng = np.random.default_rng(0)
    d, v, moved, moving = rng.standard_normal((4, 5))
    q, rates = base.initial_coordinates(d, v, np.zeros(2), (moved, moving))
    np.testing.assert_allclose(q[0], d)
    np.testing.assert_allclose(rates[0], v)
    still, slow = base.initial_coordinates(d, v, np.zeros(2))
    np.testing.assert_allclose(q[1] - still[1], moved)
    np.testing.assert_allclose(rates[1] - slow[1], moving)


@pytest.mark.parametrize("name", STARTS)
def test_one_recording_is_followed_from_wherever_it_begins(name: str, tmp_path: Path) -> None:
    """At rest where it is read, beats leave a fit that begins there no slope; others lead it to another spring."""
    (tmp_path / "rig.toml").write_text(RIG)
    data = load_dataset(tmp_path / "rig.toml", recorded(tmp_path, name, np.random.default_rng(4)))
    found = first_fit(data.train, natural_units(data.train))
    assert found.values["coupling"] == pytest.approx(COUPLING, rel=0.02)
    assert found.chi2 < 1.15 * found.problem.bench.n_data
