"""Recordings that are taken from the release on, and split where the input is not known."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from discovery.recordings.dataset import Dataset, load_dataset
from discovery.recordings.own_parts import bridged, release

FREE = """name = "mass"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "x", unit = "mm", noise = 0.05 }
"""
DRIVEN = FREE.replace("output", 'input = { name = "u", unit = "N" }\noutput')
T = 0.01 * np.arange(1500)


def loaded(folder: Path, rig: str, part: str = "", **columns: NDArray[np.float64]) -> Dataset:
    (folder / "rig.toml").write_text(rig + f'[records]\ntrain = [{{ file = "a.csv"{part} }}]\n', encoding="utf-8")
    pd.DataFrame(columns).to_csv(folder / "a.csv", index=False)
    return load_dataset(folder / "rig.toml")


def swing(held: float, noise: float = 0.05) -> NDArray[np.float64]:
    """Return a decay of 30 mm at 1 Hz [mm] that is let go after `held` seconds."""
    t = np.maximum(T - held, 0.0)
    return 30 * np.exp(-0.2 * t) * np.cos(2 * np.pi * t) + noise * np.random.default_rng(1).standard_normal(T.size)


def driven(keep: NDArray[np.bool_]) -> dict[str, NDArray[np.float64]]:
    rng = np.random.default_rng(2)
    u = sum(np.sin(2 * np.pi * f * T + p) for f, p in zip(rng.uniform(0.5, 3, 9), rng.uniform(0, 6, 9), strict=True))
    x = 1e3 * np.convolve(u, np.exp(-0.5 * T) * np.sin(2 * np.pi * T))[: T.size] * 1e-4
    return {"t": T[keep], "u": u[keep], "x": (x + 0.05 * rng.standard_normal(T.size))[keep]}


@pytest.mark.parametrize("held", [0.5, 1.5, 5.0])
def test_a_body_that_is_held_is_taken_from_its_release_on(tmp_path: Path, held: float) -> None:
    data = loaded(tmp_path, FREE, ", samples = [20, 1490]", t=T, x=swing(held))
    (experiment,) = data.train
    assert experiment.recording.time[0] == pytest.approx(held, abs=0.06)
    (flag,) = [f for f in experiment.recording.flags if f.code == "held"]
    begun = round(100 * experiment.recording.time[0])
    assert (flag.severity, flag.numbers["part"]) == ("left_out", [begun, 1490])
    assert f"samples = [{begun}, 1490]" in flag.sentence


def test_a_release_is_told_on_the_clock_of_its_column(tmp_path: Path) -> None:
    recording = loaded(tmp_path, FREE, t=4000.0 + T, x=swing(1.5)).train[0].recording
    (flag,) = [f for f in recording.flags if f.code == "held"]
    assert recording.time[0] == 0.0
    assert flag.numbers["until"] == pytest.approx(4001.5, abs=0.06)


def test_what_is_no_hold_stays_whole() -> None:
    rng = np.random.default_rng(3)
    turns = [np.cos(2 * np.pi * T + phase) * np.exp(-0.1 * T) for phase in (-0.4, -0.1, 0.0, 0.1, 1.0)]
    stuck = np.where(T < 3.25, np.cos(2 * np.pi * T), 0.0) + 0.1 * (T > 3)  # it ends off its middle
    rest = np.where(T < 2.0, 0.0, np.sin(2 * np.pi * (T - 2.0)))  # at rest before it is struck
    for motion in (*turns, stuck, rest):
        for noise in (1e-3, 1e-2, 4e-2):
            assert release(T, motion + noise * rng.standard_normal(T.size), noise) is None
    assert release(T, swing(10.0), 0.05) == pytest.approx(1000, abs=6)


def released(system: str, readings: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return times, positions of a release at once that goes a way of about one, and its first acceleration."""
    duration = {"rotor": 4.0, "oscillator": 20.0}.get(system, 30.0)
    t = duration / readings * np.arange(readings)
    if system == "rotor":  # a constant torque against friction, dry and viscous
        return t, -0.7 * (t - 1.0 + np.exp(-t)), 0.7
    if system == "oscillator":
        return t, np.exp(-0.1 * t) * (np.cos(t) + 0.1 * np.sin(t)), 1.01
    start = np.radians(float(system))  # a pendulum, with dry friction
    slope = lambda _, s: [s[1], -np.sin(s[0]) - 0.1 * s[1] - 0.05 * np.tanh(s[1] / 0.02)]  # noqa: E731
    return t, solve_ivp(slope, (0.0, duration), [start, 0.0], t_eval=t, rtol=1e-8).y[0], float(np.sin(start))


def readings_of(x: NDArray[np.float64], noise: float, rounded: bool, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    if not rounded:
        return np.asarray(x + noise * rng.standard_normal(x.size))
    step = noise * np.sqrt(12.0)
    return np.asarray(step * np.round((x + 0.2 * noise * rng.standard_normal(x.size)) / step + rng.random()))


SYSTEMS = ["rotor", "oscillator", "20", "90", "160"]


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("readings", [60, 300, 1500])
def test_a_release_at_once_is_never_taken_for_a_hold(system: str, readings: int) -> None:
    t, x, _ = released(system, readings)
    cases = [(noise, rounded, seed) for noise in (1e-4, 1e-3, 1e-2) for rounded in (0, 1) for seed in range(8)]
    cut = [case for case in cases if release(t, readings_of(x, case[0], bool(case[1]), case[2]), case[0]) is not None]
    assert cut == []


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("rounded", [False, True])
@pytest.mark.parametrize("noise", [1e-4, 1e-3, 5e-3])
def test_a_hold_longer_than_noise_hides_is_cut_at_the_release(system: str, rounded: bool, noise: float) -> None:
    t, x, acceleration = released(system, 1500)
    hidden = np.sqrt(2.0 * 5.0 * noise / acceleration)  # single readings do not tell a motion from none
    for times in (4.0, 10.0, 40.0):
        count = min(max(20, int(times * hidden / t[1])), 1200)  # of the longest, more than half is left
        y = np.concatenate([np.full(count, x[0]), x])
        found = [release(t[1] * np.arange(y.size), readings_of(y, noise, rounded, s), noise) for s in range(4)]
        late = [np.inf if at is None else t[1] * (at - count) for at in found]
        assert max(late) <= 1.5 * max(hidden, 8 * t[1]), (times, late)
        assert min(late) >= -0.5 * count * t[1], (times, late)


KINDS = {
    "pendulum": 'kind = "pendulum"',
    "oscillator": 'kind = "oscillator"',
    "system": '[system]\ncoordinates = { angle = "rad" }\nkinetic = "inertia*dot(angle)^2/2"\n'
    'forces = { angle = "torque" }\noutput = "angle"\nplaces = { shaft = "angle" }\n[system.constants]\n'
    'inertia = { value = 1e-4, unit = "kg m^2" }\ntorque = { guess = 1e-3, unit = "N m" }',
}


def switched_on(speed: float, at: float) -> NDArray[np.float64]:
    """Return the angle of a motor that reaches a `speed` [deg/s] after it is switched on [deg]."""
    t = np.maximum(T[:300] - at, 0.0)
    return speed * (t - 0.15 * (1.0 - np.exp(-t / 0.15))) + 0.05 * np.random.default_rng(1).standard_normal(t.size)


@pytest.mark.parametrize(("kind", "speed"), [(kind, 30.0) for kind in KINDS] + [("oscillator", 370.0), ("system", 1e3)])
def test_what_stands_still_and_then_runs_on_is_held_for_every_kind(tmp_path: Path, kind: str, speed: float) -> None:
    rig = FREE.replace('kind = "oscillator"', KINDS[kind]).replace('"mm"', '"deg"')
    recording = loaded(tmp_path, rig, t=T[:300], x=switched_on(speed, 0.5) % 360.0).train[0].recording
    assert recording.time[0] == pytest.approx(0.6, abs=0.1)
    told = {flag.code: flag for flag in recording.flags}
    assert ("held" in told, "runs_on" in told) == (True, kind != "system")
    if kind != "system":
        assert told["runs_on"].severity == "doubt"
        assert "a constant force in a table [system]" in told["runs_on"].sentence


def test_a_body_that_is_dropped_late_is_held(tmp_path: Path) -> None:
    t = 0.004 * np.arange(300)
    height = 3.0 - 0.5 * 9.81 * np.maximum(t - 0.5, 0.0) ** 2 + 1e-4 * np.random.default_rng(1).standard_normal(t.size)
    rig = FREE.replace("oscillator", "falling_body").replace('"mm", noise = 0.05', '"m"')
    recording = loaded(tmp_path, rig, t=t, x=height).train[0].recording
    assert recording.time[0] == pytest.approx(0.53, abs=0.04)
    assert [flag.code for flag in recording.flags if flag.severity in ("left_out", "doubt")] == ["held"]


def test_a_gap_that_hides_the_input_splits_the_recording(tmp_path: Path) -> None:
    data = loaded(tmp_path, DRIVEN, **driven((T < 5.0) | (T > 6.2)))
    assert [(e.recording.time[0], e.recording.time.size) for e in data.train] == [(0.0, 500), (6.21, 879)]
    told = [[f for f in e.recording.flags if f.code == "split_at_gaps"] for e in data.train]
    assert [len(flags) for flags in told] == [1, 0]
    assert told[0][0].numbers["parts"] == [[0, 500], [500, 1379]]
    assert "samples = [0, 500] and [500, 1379]" in told[0][0].sentence


def test_a_gap_that_hides_little_or_leaves_no_good_parts_does_not(tmp_path: Path) -> None:
    short = loaded(tmp_path, DRIVEN, **driven((T < 5.0) | (T > 5.05)))
    assert [e.recording.time.size for e in short.train] == [1494]
    end = loaded(tmp_path, DRIVEN, **driven((T < 13.0) | (T > 14.2)))
    (flag,) = [f for f in end.train[0].recording.flags if f.code == "input_unknown"]
    assert (flag.severity, flag.numbers["parts"]) == ("doubt", [[0, 1300], [1300, 1380]])
    free = (T < 5.0) | (T > 6.2)
    assert len(loaded(tmp_path, FREE, t=T[free], x=swing(0.0)[free]).train) == 1


def test_an_input_faster_than_the_motion_is_not_split_at_each_lost_sample() -> None:
    rng = np.random.default_rng(4)
    u, keep = rng.standard_normal(T.size), rng.random(T.size) > 0.1
    x = np.convolve(u, 0.01 * np.exp(-0.5 * T) * np.sin(2 * np.pi * T))[: T.size]
    r = SimpleNamespace(time=T[keep], input=u[keep], output=x[keep, None])
    assert bridged(r).all()  # type: ignore[arg-type]


def test_a_gap_is_no_hold() -> None:
    # Two stretches of a flywheel that runs down: in the first it loses 1.5 % of its speed.
    time = np.concatenate([np.arange(30) / 10.0, 80.0 + np.arange(60) / 10.0, 240.0 + np.arange(200) / 10.0])
    speed = 404.0 - 1.2 * time + 0.02 * np.random.default_rng(1).standard_normal(time.size)
    assert release(time, speed, 0.024) is None
    held = np.concatenate([np.full(30, 404.0), speed[30:]])
    assert release(time, held, 0.024) is None
