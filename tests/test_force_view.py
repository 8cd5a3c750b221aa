"""Inverse dynamics: what the declared filters do to motion and force."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from discovery.drafting.overview import overview, overview_lines
from discovery.drafting.rig_text import draft
from discovery.estimation.told import as_read
from discovery.foundation.errors import InputError
from discovery.recordings.dataset import load_dataset
from discovery.recordings.force_view import cutoff_for, force_samples, noise_gain, zero_phase
from discovery.recordings.recording import read_recording
from discovery.report.results import Trajectory
from discovery.rigs.rig import Columns, Controller, ForceView, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.runs.loop import close_loop

RATE, CUTOFF = 1000.0, 10.0
T = np.arange(20000) / RATE


def test_slow_signals_pass_without_delay_and_fast_ones_do_not():
    slow, fast = np.sin(2 * np.pi * 1.0 * T), np.sin(2 * np.pi * 100.0 * T)
    np.testing.assert_allclose(zero_phase(slow, RATE, CUTOFF)[500:-500], slow[500:-500], atol=1e-5)
    assert np.abs(zero_phase(fast, RATE, CUTOFF)[500:-500]).max() < 1e-6
    at_cutoff = np.sin(2 * np.pi * CUTOFF * T)
    np.testing.assert_allclose(zero_phase(at_cutoff, RATE, CUTOFF)[500:-500], 0.5 * at_cutoff[500:-500], atol=1e-3)
    both = np.column_stack([slow, fast])[:, None, :]
    np.testing.assert_array_equal(zero_phase(both, RATE, CUTOFF)[:, 0, 0], zero_phase(slow, RATE, CUTOFF))
    assert zero_phase(slow, RATE, RATE) is slow


def test_the_gain_of_noise_is_that_of_the_filter():
    noise = np.random.default_rng(0).normal(size=200_000)
    assert zero_phase(noise, RATE, CUTOFF).std() == pytest.approx(noise_gain(RATE, CUTOFF), rel=0.05)


def test_two_samples_in_a_period_of_the_cutoff():
    used = force_samples(ForceView(50.0, CUTOFF), T, RATE)
    assert np.diff(np.flatnonzero(used)).tolist() == [50] * (used.sum() - 1)
    assert not used[:100].any()
    assert force_samples(ForceView(50.0, CUTOFF, 7), T, RATE)[1400]


@pytest.mark.parametrize("third", [False, True])
@pytest.mark.parametrize(("count", "duration"), [(30, 3.0), (90, 20.0), (200, 7.0)])
def test_a_cutoff_leaves_as_many_samples_as_it_is_asked_for(count, duration, *, third):
    time = np.arange(duration * RATE) / RATE
    cutoff = cutoff_for(count, duration, third=third)
    used = force_samples(ForceView(500.0, cutoff), time, RATE)
    found = used[(2 * time.size) // 3 :].sum() if third else used.sum()
    assert count - 1 <= found <= 1.1 * count + 1


def force_rig(cutoff: float, motion_cutoff: float, more: str = "") -> str:
    return f"""
name = "carriage"
kind = "drive"
[columns]
time = {{ name = "t", unit = "s" }}
input = {{ name = "q", unit = "m" }}
output = {{ name = "f", unit = "N" }}
[model]
effects = ["viscous_damping"]
[view]
output = "force"
motion_cutoff_hz = {motion_cutoff}
cutoff_hz = {cutoff}
{more}
"""


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("held", [False, True])
def test_what_is_compared_of_a_force_is_told_and_too_little_has_a_remedy_that_works(tmp_path, every, *, held):
    record(tmp_path / "r.csv", T[:2000:every])
    record(tmp_path / "h.csv", T[:15000:every])
    given = {"train": [tmp_path / "r.csv"], "holdout": [tmp_path / "h.csv"] if held else []}
    (tmp_path / "rig.toml").write_text(force_rig(6.0, 6.0))
    with pytest.raises(InputError, match=r"raise cutoff_hz from 6 to (\d+) Hz") as refused:
        load_dataset(tmp_path / "rig.toml", **given)
    enough = re.search(r"from 6 to (\d+) Hz", str(refused.value))
    assert enough is not None
    (tmp_path / "rig.toml").write_text(force_rig(float(enough[1]), float(enough[1])))
    (e,) = load_dataset(tmp_path / "rig.toml", **given).train
    (told,) = (f for f in e.recording.flags if f.code == "force_thinned")
    assert (told.numbers["count"], told.severity) == (2000 // every, "note")
    assert told.numbers["kept"] == np.isfinite(e.recording.output).sum() >= (30 if held else 90)


@pytest.mark.parametrize(
    ("more", "every", "remedy"),
    [("decimation = 100", 1, "lower decimation"), ("", 50, "sample it more often")],
)
def test_where_no_cutoff_is_enough_another_remedy_is_told(tmp_path, more, every, remedy):
    record(tmp_path / "r.csv", T[:3000:every])
    (tmp_path / "rig.toml").write_text(force_rig(6.0, 6.0, more))
    with pytest.raises(InputError, match=remedy) as refused:
        load_dataset(tmp_path / "rig.toml", [tmp_path / "r.csv"])
    assert "raise cutoff_hz" not in str(refused.value)


@pytest.mark.parametrize(("rate", "duration"), [(60.0, 1.6), (20.0, 6.0), (1000.0, 2.0)])
def test_a_draft_of_a_short_recording_can_be_loaded(tmp_path, rate, duration):
    time = np.arange(duration * rate) / rate
    rng = np.random.default_rng(2)
    q, f = 5.0 * np.sin(4.0 * time), 8.0 * np.sin(4.0 * time) + 3.0 * np.cos(4.0 * time)
    frame = pd.DataFrame({"t_s": time, "q_mm": q, "f_N": f + 0.02 * rng.normal(size=time.size)})
    frame.to_csv(tmp_path / "r.csv", index=False)
    (tmp_path / "rig.toml").write_text(draft([tmp_path / "r.csv"], chosen={"output": "f_N", "input": "q_mm"}))
    assert load_dataset(tmp_path / "rig.toml").train[0].rig.view is not None


def rig(**changes):
    columns = Columns(TimeColumn("t"), InputColumn("q", "m", "spline"), OutputColumn("f", "N", None, "position", 0, 2))
    return Rig("d", kind="drive", columns=columns, **changes)


def record(path, time=T):
    q = np.sin(2.0 * time)
    f = 0.5 * (3.0 * -4.0 * q + 5.0 * 2.0 * np.cos(2.0 * time))
    rng = np.random.default_rng(1)
    frame = pd.DataFrame({"t": time, "q": q, "f": f + rng.normal(0.0, 0.05, f.size), "p": 4.0})
    frame.to_csv(path, index=False)
    return q, 2.0 * f


def test_a_recording_is_seen_as_force(tmp_path):
    q, force = record(tmp_path / "r.csv")
    recording = read_recording(tmp_path / "r.csv", rig(view=ForceView(50.0, CUTOFF)))
    used = np.isfinite(recording.output[:, 0])
    assert recording.time.size == T.size
    # Without its force it moves the same.
    moved = read_recording(tmp_path / "r.csv", rig(view=ForceView(50.0, CUTOFF)), with_output=False)
    np.testing.assert_array_equal(moved.input, recording.input)
    assert np.isnan(moved.output).all()
    assert used.sum() == pytest.approx(T.size / 50, rel=0.05)
    error = recording.output[used, 0] - force[used]
    assert error.std() == pytest.approx(recording.noise[0], rel=0.15)
    assert recording.noise[0] == pytest.approx(0.1 * noise_gain(RATE, CUTOFF), rel=0.05)
    np.testing.assert_allclose(recording.input, q, atol=2e-3)
    assert recording.units == ("N",)


def test_a_motion_given_by_its_speed_is_integrated(tmp_path):
    q, _ = record(tmp_path / "r.csv")
    frame = pd.read_csv(tmp_path / "r.csv")
    frame["q"] = 2.0 * np.cos(2.0 * T)
    frame.to_csv(tmp_path / "speed.csv", index=False)
    viewed = rig(view=ForceView(50.0, CUTOFF))
    speed = replace(viewed, columns=replace(viewed.columns, input=InputColumn("q", "m/s", "spline")))
    found = read_recording(tmp_path / "speed.csv", speed)
    np.testing.assert_allclose(found.input[100:-100], q[100:-100], atol=2e-3)
    assert (speed.input_unit, viewed.input_unit) == ("m", "m")
    # Without the view, a speed is an input like any other.
    assert replace(speed, view=None).input_unit == "m/s"


def test_friction_is_told_from_a_speed_and_its_torque(tmp_path):
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 12.0, 0.004)
    for name, size, w in (("a", 6.0, 2.5), ("b", 4.0, 5.0)):
        speed = size * (np.sin(w * time) + 0.4 * np.sin(2.3 * w * time + size))
        rate = size * w * (np.cos(w * time) + 0.92 * np.cos(2.3 * w * time + size))
        torque = 0.02 * rate + 0.05 * speed + 0.3 * np.tanh(speed / 0.02) + rng.normal(0.0, 0.02, time.size)
        frame = pd.DataFrame({"time_s": time, "qd_rad_s": speed, "torque_Nm": torque})
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    chosen = {"input": "qd_rad_s", "output": "torque_Nm"}
    (tmp_path / "rig.toml").write_text(draft(tmp_path / "a.csv", holdout=tmp_path / "b.csv", chosen=chosen))
    dataset = load_dataset(tmp_path / "rig.toml")
    lines = list(overview_lines(dataset, overview(dataset)))
    assert "  input: the place, integrated from the speed 'qd_rad_s'" in lines
    result = close_loop(dataset)
    assert result.verdict == "explained"
    effect = result.summary()["effects"][0]
    assert effect["id"] in ("coulomb_friction", "stribeck_friction")
    assert effect["parameters"]["f_c"]["value"] == pytest.approx(0.3, rel=0.02)
    assert effect["parameters"]["f_c"]["unit"] == "N m"


def test_times_that_jitter_are_made_even(tmp_path):
    time = T + np.random.default_rng(2).uniform(-0.2, 0.2, T.size) / RATE
    record(tmp_path / "r.csv", time)
    recording = read_recording(tmp_path / "r.csv", rig(view=ForceView(50.0, CUTOFF)))
    assert "evened" in [flag.code for flag in recording.flags]
    assert np.ptp(np.diff(recording.time)) < 1e-9
    used = np.isfinite(recording.output[:, 0])
    at = recording.time[used]
    error = recording.output[used, 0] - (3.0 * -4.0 * np.sin(2.0 * at) + 5.0 * 2.0 * np.cos(2.0 * at))
    assert error.std() == pytest.approx(recording.noise[0], rel=0.3)
    np.testing.assert_allclose(recording.input, np.sin(2.0 * recording.time), atol=2e-3)


def test_gaps_are_refused(tmp_path):
    view = ForceView(50.0, CUTOFF)
    record(tmp_path / "gap.csv", np.delete(T, slice(300, 320)))
    with pytest.raises(InputError, match="not equally spaced"):
        read_recording(tmp_path / "gap.csv", rig(view=view))
    record(tmp_path / "r.csv")
    frame = pd.read_csv(tmp_path / "r.csv")
    frame.loc[7, "f"] = np.nan
    frame.to_csv(tmp_path / "nan.csv", index=False)
    with pytest.raises(InputError, match="the force has gaps"):
        read_recording(tmp_path / "nan.csv", rig(view=view))


def test_what_is_added_to_the_command_moves_the_reference(tmp_path):
    q, _ = record(tmp_path / "r.csv")
    controller = Controller(kp=10.0, kv=2.0, unit="mV", added="p")
    recording = read_recording(tmp_path / "r.csv", rig(controller=controller))
    # kv (kp (reference - q) - q') + p with p = 4 mV.
    np.testing.assert_allclose(recording.input, q + 4e-3 / 20.0, rtol=0, atol=1e-12)
    without = read_recording(tmp_path / "r.csv", rig(controller=Controller(10.0, 2.0, added="absent")))
    np.testing.assert_allclose(without.input, q, atol=1e-12)


@pytest.mark.slow
def test_a_force_that_is_read_is_told_as_one(tmp_path):
    rng, time = np.random.default_rng(2), np.arange(0.0, 12.0, 0.01)
    (tmp_path / "rig.toml").write_text(force_rig(10.0, 20.0))
    for name, turns in (("a", (2.0, 3.1)), ("h", (1.4, 3.7))):
        x, speed, acceleration = (
            sum(0.2 * w**k * np.sin(w * time + 0.5 * np.pi * k) for w in turns) for k in range(3)
        )  # fmt: skip
        force = 70.0 * acceleration + 40.0 * speed + 13.0 * np.sign(speed) + rng.standard_normal(time.size)
        pd.DataFrame({"t": time, "q": x, "f": force}).to_csv(tmp_path / f"{name}.csv", index=False)
    found = close_loop(load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"], [tmp_path / "h.csv"]))
    (effect,) = found.summary()["effects"]
    friction = effect["parameters"]["f_c"]
    assert (effect["id"], friction["unit"]) == ("coulomb_friction", "N")
    assert "physical" not in friction
    assert friction["value"] == pytest.approx(13.0, abs=4 * friction["sd"])


def test_a_force_is_told_in_newtons_and_its_page_draws_every_model(tmp_path):
    record(tmp_path / "r.csv", T[:12000])
    (tmp_path / "rig.toml").write_text(force_rig(6.0, 6.0))
    result = close_loop(load_dataset(tmp_path / "rig.toml", [tmp_path / "r.csv"]))
    assert as_read(result.after, "xi")["unit"] == "N s m^-1"
    assert as_read(result.after, "m")["unit"] == "s^2 m^-1"  # which the row of the inertia tells in kilograms
    n, left = 60, np.arange(60.0)
    measured = np.where(np.arange(n) % 6 == 1, left, np.nan)[:, None]
    whole = Trajectory(
        "r", "train", left, ("output",), ("N",), measured, {"after": left[:, None]}, left, None, np.ones(n, bool), None
    )
    thinned = whole.thinned()
    assert thinned.time.tolist() == left[1::6].tolist() == thinned.models["after"][:, 0].tolist()
    assert np.isfinite(thinned.measured).all()
    assert thinned.thinned() is thinned
