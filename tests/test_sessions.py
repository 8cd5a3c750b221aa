"""What may differ between recordings: parts of one file whose times go on are one of them."""

from pathlib import Path

import numpy as np
import pytest

from discovery.equations.lacking import candidates
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.estimation.predict import predict
from discovery.recordings.dataset import load_dataset
from discovery.recordings.parts import course

RIG = """name = "spring"
kind = "oscillator"

[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "x", unit = "mm" }}

[model]
effects = ["linear_stiffness", "viscous_damping"]

[records]
train = [{train}]
"""
TIME = np.arange(400) * 0.013
SWING = 20.0 * np.exp(-0.3 * TIME) * np.cos(9.0 * TIME) + 0.05 * np.random.default_rng(4).standard_normal(TIME.size)
NEAR = '{ file = "a.csv", samples = [0, 190] }, { file = "a.csv", samples = [200, 400] }'
LONG = 20.0 * np.exp(-0.05 * TIME[-1] / 400 * np.arange(800)) * np.cos(0.117 * np.arange(800))
LONG += 0.05 * np.random.default_rng(5).standard_normal(LONG.size)
AGAIN = np.where(TIME < 200 * 0.013, TIME, TIME - 150 * 0.013)  # the clock begins anew


@pytest.mark.parametrize(
    ("time", "train", "differ"),
    [
        (TIME, NEAR, False),
        (TIME, '{ file = "a.csv", samples = [200, 400] }, { file = "a.csv", samples = [0, 210] }', False),
        (TIME + 60.0 * (TIME[200] <= TIME), NEAR, True),
        (TIME, '{ file = "a.csv", where = { run = 1 } }, { file = "a.csv", where = { run = 2 } }', True),
        (TIME, '{ file = "a.csv", samples = [0, 190] }, { file = "b.csv", samples = [200, 400] }', True),
        (AGAIN, NEAR, True),
    ],
)
def test_a_zero_differs_between_recordings_and_not_between_parts_of_one(
    tmp_path: Path, time: np.ndarray, train: str, differ: bool
) -> None:
    run = 1.0 + (np.arange(TIME.size) >= 200)
    for name, more in (("a.csv", 0.0), ("b.csv", 0.1)):
        np.savetxt(
            tmp_path / name, np.column_stack([time, SWING + more, run]), "%.6f", ",", header="t,x,run", comments=""
        )
    (tmp_path / "rig.toml").write_text(RIG.format(train=train))
    parts = load_dataset(tmp_path / "rig.toml").train
    assert course(parts)["several"] is differ
    offered = candidates(declared_model(parts[0]), "m", **course(parts))
    assert ("recording_offset" in offered) is differ
    assert "angle_offset" in offered


@pytest.mark.parametrize(("later", "differ"), [("[200, 500]", False), ("[385, 500]", True)])
def test_without_times_parts_go_on_where_few_rows_lie_between(tmp_path: Path, *, later: str, differ: bool) -> None:
    np.savetxt(tmp_path / "a.csv", LONG, "%.6f", header="x", comments="")
    train = f'{{ file = "a.csv", samples = [0, 190] }}, {{ file = "a.csv", samples = {later} }}'
    text = RIG.format(train=train).replace('{ name = "t", unit = "s" }', "{ rate_hz = 77.0 }")
    (tmp_path / "rig.toml").write_text(text)
    assert course(load_dataset(tmp_path / "rig.toml").train)["several"] is differ


def test_another_recording_is_predicted_within_what_recordings_differ_by(tmp_path: Path) -> None:
    for name, more in (("a.csv", 0.0), ("b.csv", 0.8), ("c.csv", -1.2)):
        np.savetxt(tmp_path / name, np.column_stack([TIME, SWING + more]), "%.6f", ",", header="t,x", comments="")
    files = ", ".join(f'{{ file = "{name}.csv" }}' for name in "abc")
    (tmp_path / "rig.toml").write_text(RIG.format(train=files))
    train = load_dataset(tmp_path / "rig.toml").train
    declared = declared_model(train[0])
    deviations = []
    for model in (declared, declared.with_effect("recording_offset")):
        _, sd = predict(fit(model, train), train[1])
        deviations.append(sd[:, 0])
    bare, own = deviations
    apart = np.sqrt((0.8**2 + 1.2**2) / 2)  # from the first one, rms
    assert 1e3 * own == pytest.approx(apart, rel=0.05)
    assert bare.max() < 0.2 * own.min()


@pytest.mark.parametrize(("more", "dated"), [("", False), (", at_rest = true", True)])
def test_a_late_instrument_shows_where_something_says_when_a_motion_began(
    tmp_path: Path, more: str, dated: bool
) -> None:
    """What starts by itself reads like another start."""
    np.savetxt(tmp_path / "a.csv", np.column_stack([TIME, SWING]), "%.6f", ",", header="t,x", comments="")
    (tmp_path / "rig.toml").write_text(RIG.format(train=f'{{ file = "a.csv"{more} }}'))
    train = load_dataset(tmp_path / "rig.toml").train
    offered = candidates(declared_model(train[0]), "m", **course(train))
    assert ("sensor_delay" in offered) is dated
    assert "time_base_error" in offered


def test_what_recordings_differ_by_never_feeds_energy(tmp_path: Path) -> None:
    """The loss of the first recording is small, and no other is as much smaller as the second's is larger."""
    for name, loss in (("a.csv", 0.05), ("b.csv", 0.6)):
        swing = 20.0 * np.exp(-loss * TIME) * np.cos(9.0 * TIME)
        noise = 0.05 * np.random.default_rng(6).standard_normal(TIME.size)
        np.savetxt(tmp_path / name, np.column_stack([TIME, swing + noise]), "%.6f", ",", header="t,x", comments="")
    (tmp_path / "rig.toml").write_text(RIG.format(train='{ file = "a.csv" }, { file = "b.csv" }'))
    train = load_dataset(tmp_path / "rig.toml").train
    model = declared_model(train[0]).with_effect("recording_damping").without("viscous_damping")
    _, sd = predict(fit(model, train), train[0], initial=(0.02, 0.0))
    apart = np.abs(np.exp(-0.05 * TIME) - np.exp(-0.6 * TIME)) * np.abs(np.cos(9.0 * TIME)) * 0.02
    assert sd[:, 0] == pytest.approx(apart, abs=1.5e-3)
