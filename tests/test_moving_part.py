"""Free motions that come to rest: where they end, and what that changes for what is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.foundation.errors import InputError
from discovery.recordings.dataset import load_dataset
from discovery.recordings.parts import moving_count, moving_part
from discovery.recordings.recording import Recording
from discovery.runs.loop import close_loop

TIME = np.linspace(0.0, 60.0, 3000)
RIG = """
name = "rig"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "x", unit = "mm" }
"""


def recorded(values: np.ndarray, noise: float = 1e-3, drive: np.ndarray | None = None) -> Recording:
    read = values + noise * np.random.default_rng(0).standard_normal(values.size)
    return Recording("r", TIME, drive, read[:, None], ("output",), ("m",), np.array([noise]), sha256="", source="")


def swing(rate: float) -> np.ndarray:
    return np.exp(-rate * TIME) * np.sin(6 * TIME)


@given(rate=st.floats(0.3, 2.0), place=st.floats(-5.0, 5.0))
def test_a_decay_is_kept_until_it_is_below_its_noise(rate: float, place: float) -> None:
    kept = moving_count(recorded(place + swing(rate)))
    assert kept is not None
    below = np.log(1 / 1e-3) / rate
    # Of a decay at its noise not a whole length is left; what is cut off lies below two noise sds.
    assert np.log(1 / 2e-3) / rate < TIME[kept - 1] < 1.1 * below + 3.0


def test_the_part_that_moves_is_the_same_readings_and_says_so() -> None:
    whole = recorded(swing(0.8))
    part = moving_part(whole)
    kept = part.time.size
    assert np.array_equal(part.output, whole.output[:kept])
    (flag,) = part.flags
    assert (flag.code, flag.severity, flag.numbers["kept"], flag.numbers["count"]) == ("at_rest", "note", kept, 3000)
    assert f"its first {kept} of 3000 readings" in flag.sentence


@pytest.mark.parametrize(
    "values",
    [swing(0.01), np.zeros(3000), swing(0.8) + swing(0.8)[::-1], swing(0.8) + 1e-3 * TIME],
    ids=["lasting", "rest alone", "moves again", "drifts"],
)
def test_what_does_not_come_to_rest_is_kept_whole(values: np.ndarray) -> None:
    whole = recorded(values)
    assert moving_count(whole) is None
    assert moving_part(whole) is whole


def test_a_body_at_its_final_speed_does_not_rest() -> None:
    speed = recorded(2.0 * np.tanh(TIME))
    assert moving_count(speed) is not None
    assert moving_count(replace(speed, units=("m/s",))) is None


def test_what_an_input_may_push_is_kept_whole() -> None:
    assert moving_count(recorded(swing(0.8), drive=np.zeros(3000))) is None


def held(start: float, force: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a swing at 20 rad/s with dry friction, piece by piece in closed form, that sticks at its end."""
    time = np.arange(0.0, 9.0, 0.005)
    rest, x = force / 400.0, start
    out, half = np.empty(time.size), np.pi / 20.0
    for i, t in enumerate(time):
        k = int(t // half)
        place = start
        for _ in range(k):
            if abs(place) <= rest:
                break
            place = -(place - np.sign(place) * 2 * rest)
        if abs(place) <= rest:
            out[i] = place
            continue
        centre = np.sign(place) * rest
        x = centre + (place - centre) * np.cos(20.0 * (t - k * half))
        out[i] = x
    return time, out


@pytest.mark.slow
def test_friction_that_holds_a_body_is_dry_friction_and_nothing_else(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    for name, start in (("a", 0.03), ("b", 0.0173), ("h", 0.0241)):
        time, x = held(start, 0.15)
        rows = np.column_stack([time, 1e3 * x + 0.03 * rng.standard_normal(time.size)])
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="t,x", comments="", fmt="%.9g")
    (tmp_path / "rig.toml").write_text(RIG)
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "h.csv")
    assert [f.code for e in data.train for f in e.recording.flags] == ["at_rest", "at_rest"]
    found = close_loop(data)
    assert (found.verdict, found.added) == ("explained", ("coulomb_friction",))
    assert found.after.values["f_c"] == pytest.approx(0.15, rel=5e-3)
    after = found.errors["after"]
    # While it moves it is predicted to its noise; held away from its rest, a smooth law creeps.
    assert after["holdout_moving"]["rms"] < 1.1 * found.errors["noise_floor"] < after["holdout"]["rms"]


def test_a_motion_that_ends_at_once_is_refused_as_that_and_not_as_a_short_recording(tmp_path: Path) -> None:
    time = np.arange(250) / 100
    read = 50 * np.exp(-time / 0.05) * np.cos(18 * time) + 0.2 * np.random.default_rng(0).standard_normal(250)
    (tmp_path / "rig.toml").write_text(RIG)
    np.savetxt(tmp_path / "r.csv", np.column_stack([time, read]), "%.6g", ",", header="t,x", comments="")
    with pytest.raises(InputError, match=r"at least 30 .* Let it move for longer, it has come to rest at 0\."):
        load_dataset(tmp_path / "rig.toml", [tmp_path / "r.csv"])
