"""Units that gravity contradicts, and angles that turn."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from discovery.foundation.errors import InputError
from discovery.recordings.recording import read_recording
from discovery.recordings.turns import joined_turns, near_hanging
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

T = np.arange(0.0, 30.0, 0.02)


def swing(amplitude, rate=0.0):
    """Pendulum of a metre, damped, by an independent integrator."""
    found = solve_ivp(lambda _, s: [s[1], -9.81 * np.sin(s[0]) - 0.1 * s[1]], (0, 30), [amplitude, rate], t_eval=T,
                      rtol=1e-9)  # fmt: skip
    return found.y[0]


def pendulum(length=None, driven=False, **output):
    column = OutputColumn("a", **({"unit": "rad"} | output))
    columns = Columns(TimeColumn("t"), InputColumn("u", "1", "spline") if driven else None, column)
    declared = ("viscous_damping", "gravity_torque")
    return Rig("p", kind="pendulum", length=length, columns=columns, gravity=Quantity(9.81, 0.02), declared=declared)


def read(tmp_path, rig, angle, time=T):
    pd.DataFrame({"t": time, "u": 0.0 * time, "a": angle}).to_csv(tmp_path / "p.csv", index=False)
    return read_recording(tmp_path / "p.csv", rig)


@pytest.mark.parametrize("amplitude", [0.05, 1.0, 3.0])
def test_swings_are_plausible(tmp_path, amplitude):
    angle = swing(amplitude)
    np.testing.assert_array_equal(read(tmp_path, pendulum(Quantity(1.0, 1e-3)), angle).output[:, 0], angle)


def test_one_that_turns_over_first_is_plausible_and_counted_from_where_it_rests(tmp_path):
    angle = swing(0.0, 8.0)
    assert np.ptp(angle) > 3 * np.pi
    recording = read(tmp_path, pendulum(), angle)
    assert abs(np.median(recording.output[-500:])) < 0.5


def test_turns_are_joined():
    angle = swing(2.0) + np.pi
    wrapped = np.angle(np.exp(1j * angle))
    wrapped[100:110] = np.nan
    joined, notes = near_hanging(wrapped)
    joined = joined - joined[0] + angle[0]
    np.testing.assert_allclose(joined[~np.isnan(wrapped)], angle[~np.isnan(wrapped)], atol=1e-9)
    jumps = np.flatnonzero(np.abs(np.diff(wrapped[~np.isnan(wrapped)])) > np.pi)
    assert f"in {jumps.size} places" in str(notes[0])
    assert "the turns are joined" in str(notes[0])
    whole, notes = near_hanging(angle)
    assert whole is angle
    assert notes == []


def test_full_turns_that_are_taken_off_are_told() -> None:
    counted, (told,) = near_hanging(swing(0.5) - 4 * np.pi, "a")
    np.testing.assert_allclose(counted, swing(0.5), atol=1e-9)
    assert str(told) == "The angle 'a' lies 2 full turns from where a pendulum hangs: it is counted from there."


@pytest.mark.parametrize("wrong", [1e4, 3.2, -2.9])
def test_one_bad_reading_is_left_out_and_shifts_nothing(tmp_path, wrong):
    """Half a turn away, unwrapping would take it for a turn, and everything behind it with it."""
    angle = swing(0.3)
    bad = angle.copy()
    bad[500] += wrong
    recording = read(tmp_path, pendulum(), bad)
    assert np.flatnonzero(np.isnan(recording.output[:, 0])).tolist() == [500]
    np.testing.assert_array_equal(np.delete(recording.output[:, 0], 500), np.delete(angle, 500))
    assert any("sample 500" in note and "left out" in note for note in recording.notes)


@pytest.mark.parametrize("count", [2, 4, 40])
@pytest.mark.parametrize("value", [np.radians(-9999), 1e4, np.radians(-3600)])
def test_what_is_written_for_no_reading_is_no_full_turn(tmp_path, value, count):
    angle = swing(0.3)
    marked = angle.copy()
    marked[500 : 500 + count] = value
    marked[700] = value
    recording = read(tmp_path, pendulum(), marked)
    good = marked == angle
    assert np.isnan(recording.output[~good, 0]).all()
    np.testing.assert_array_equal(recording.output[good, 0], angle[good])
    assert any("sample 500" in note for note in recording.notes)
    assert not any("joined" in note for note in recording.notes)


def test_readings_that_jump_often_are_kept(tmp_path):
    """Sampled four times a period, every turning point lies far from its neighbours, which agree."""
    angle = 2.5 * np.sin(0.5 * np.pi * np.arange(200) + 0.1)
    assert near_hanging(angle)[0] is angle


ENCODER = np.radians(0.088)
SPINS = {
    "up": 4.0 + 6.0 * (T - 1.0 + np.exp(-T)),
    "back": 4.0 - 7.0 * T,
    "to and fro": 4.0 + 9.0 * np.sin(0.7 * T),
    "at rest": 2e-3 * np.random.default_rng(1).standard_normal(T.size),
}


@pytest.mark.parametrize("spin", SPINS.values(), ids=SPINS.keys())
def test_an_angle_that_is_counted_within_a_turn_goes_on_from_its_first_reading(spin):
    counted = np.round(spin / ENCODER) * ENCODER % (2 * np.pi)
    read = (np.arange(T.size) % 97 != 60) & ~((T > 4.0) & (T < 4.1))
    for keep in (np.full(T.size, True), read):
        empty = np.where(keep, counted, np.nan)
        for time, angle in ((T, empty), (T[keep], counted[keep])):  # cells that are empty, rows that are missing
            joined, (flag,) = joined_turns(angle, time, "shaft")
            good = np.isfinite(angle)
            assert joined[0] == angle[0]
            away = joined[good] - (spin[keep] - spin[0] + angle[0])
            assert np.abs(away).max() < 2 * ENCODER
            assert flag.sentence.startswith("The angle 'shaft' jumps by full turns in ")
    half = np.where(counted < np.pi, counted, counted - 2 * np.pi)
    np.testing.assert_allclose(np.diff(joined_turns(half, T)[0]), np.diff(joined_turns(counted, T)[0]), atol=1e-9)


def test_nearly_half_a_turn_a_reading_is_joined():
    fast = 4.0 + 0.45 * 2 * np.pi * np.arange(T.size)
    np.testing.assert_allclose(joined_turns(fast % (2 * np.pi), T)[0], fast, atol=1e-9)


def test_jumps_that_are_no_turn_are_kept():
    levels = np.where(T % 4.0 < 2.0, -2.0, 2.5) + ENCODER * np.round(np.sin(T))
    pulses = 2 * np.pi * np.floor(T)  # one mark a turn
    wild = np.sin(T)
    wild[500] += 4.2
    coarse = np.radians(120.0) * np.round(0.5 * T)
    gearless = 2 * np.pi * 0.7 * np.arange(T.size)  # counted beyond a turn, read less than twice in one
    for angle in (levels, pulses, wild, coarse, gearless, SPINS["up"], np.full(T.size, np.nan)):
        assert joined_turns(angle, T) == (pytest.approx(angle, abs=0.0, nan_ok=True), [])
        assert joined_turns(angle, T)[0] is angle


def test_turns_are_joined_of_all_angles_that_are_measured_and_of_no_command(tmp_path):
    turning = np.round(SPINS["up"] / ENCODER) * ENCODER
    counted = pd.DataFrame({"t": T, "u": turning % (2 * np.pi), "a": (turning + 0.01 * np.sin(3 * T)) % (2 * np.pi)})
    counted.to_csv(tmp_path / "p.csv", index=False)

    def found(kind, unit="rad", output="rad"):
        columns = Columns(TimeColumn("t"), InputColumn("u", unit, "spline"), OutputColumn("a", output))
        return read_recording(tmp_path / "p.csv", Rig("r", kind=kind, columns=columns, declared=("viscous_damping",)))

    moved = found("base_excited")
    assert [flag.column for flag in moved.flags if flag.code == "turns_joined"] == ["a", "u"]
    np.testing.assert_allclose(moved.input, turning, atol=1e-6)
    np.testing.assert_allclose(moved.output[:, 0], turning + 0.01 * np.sin(3 * T), atol=1e-6)
    pushed = found("drive")
    assert [flag.column for flag in pushed.flags if flag.code == "turns_joined"] == ["a"]
    np.testing.assert_array_equal(pushed.input, counted["u"])
    assert "turns_joined" not in [flag.code for flag in found("drive", "N", "mm").flags]


def test_noise_alone_is_no_swing(tmp_path):
    still = 1e-3 * np.random.default_rng(1).standard_normal(T.size)
    with pytest.raises(InputError, match=r"nothing swings\. The readings scatter by 0\.00"):
        read(tmp_path, pendulum(Quantity(1.0, 1e-3)), still)


def test_a_swing_with_a_long_dead_tail_is_a_swing(tmp_path):
    angle = np.where(T < 6.0, swing(0.3), 0.0) + 4e-3 * np.random.default_rng(1).standard_normal(T.size)
    assert read(tmp_path, pendulum(Quantity(1.0, 1e-3)), angle).time.size == T.size


def test_zero_and_scale_apply_to_the_column(tmp_path):
    angle = swing(0.5)
    turned = np.angle(np.exp(1j * (np.pi - angle)))
    recording = read(tmp_path, pendulum(zero=np.pi, scale=-1.0), turned)
    np.testing.assert_allclose(recording.output[:, 0], angle, atol=1e-9)


@pytest.mark.parametrize(
    ("rig", "angle", "time", "words"),
    [
        (pendulum(), np.degrees(swing(0.3)), T, ["to and fro by", "reading would be 17.19 rad", 'unit = "deg"']),
        (pendulum(), np.degrees(swing(-1.0)), T, ["to and fro by", "reading would be 57.3 rad"]),
        (pendulum(), swing(0.3) + np.pi, T, ["upright", "zero = 3.14159265"]),
        (pendulum(), swing(1.2) + 1.8, T, ["the horizontal", "zero = 1.57079633"]),
        (pendulum(), swing(0.3) - 1.5, T, ["the horizontal", "zero = -1.57079633"]),
        (
            pendulum(),
            swing(0.3),
            1e3 * T,
            ["column 't'", 'set unit = "ms" for the time', "as if it were", "unit of the"],
        ),
        (pendulum(), swing(0.3), 1e-3 * T, ["column 't'", "as if it were", "unit of the time"]),
        (pendulum(unit="deg"), np.degrees(swing(0.3)) + 180.0, T, ["about 179.8 deg", "set zero = 180 (in the unit"]),
        (
            pendulum(),
            2.6 + 0.04 * T,
            T,
            ["upright", "runs on in one direction", "a constant force in a table [system]"],
        ),
        (pendulum(), 2.6 + 2.0 * T, T, ["to and fro by", 'input of kind = "drive"']),
        (pendulum(Quantity(0.03, 1e-3)), swing(0.3), T, ["the rig file states 0.03 m"]),
    ],
)
def test_mistakes_of_a_pendulum(tmp_path, rig, angle, time, words):
    with pytest.raises(InputError) as error:
        read(tmp_path, rig, angle, time)
    for word in words:
        assert word in str(error.value)


def test_the_clock_is_blamed_for_what_it_did_and_no_unit_offered_that_is_there(tmp_path):
    for time, stated, offered in ((1e3 * T, "s", "ms"), (1e-3 * T, "s", None), (T, "ms", "s"), (1e6 * T, "s", "us")):
        rig = replace(pendulum(), columns=replace(pendulum().columns, time=TimeColumn("t", stated)))
        with pytest.raises(InputError, match=r"p\.csv, column 't': the pendulum would swing once in") as error:
            read(tmp_path, rig, swing(0.3), time)
        assert ("If the times are in" in str(error.value)) == (offered is not None)
        assert offered is None or f'set unit = "{offered}" for the time' in str(error.value)


def test_a_driven_pendulum_may_do_anything(tmp_path):
    angle = 5.0 * swing(2.0)
    assert read(tmp_path, pendulum(driven=True), angle).output[0, 0] == pytest.approx(10.0)


FALL = Rig(
    "b", kind="falling_body", columns=Columns(TimeColumn("t"), None, OutputColumn("a", "m")), gravity=Quantity(9.81, 0)
)


def test_falls(tmp_path):
    time = np.arange(45) / 15.0
    height = 45.0 - 4.9 * time**2
    assert read(tmp_path, FALL, height, time).time.size == 45
    for fall, at, words in [
        (100.0 * height, time, "unit of the time or of the height"),
        (1e3 * height, time, "unit of the time or of the height"),
        (height, 1e3 * time, "unit of the time or of the height"),
        (-height, time, "fall upwards.*scale = -1"),
    ]:
        with pytest.raises(InputError, match=words):
            read(tmp_path, FALL, fall, at)


def test_a_fall_that_reaches_terminal_speed_is_plausible_and_in_another_unit_refused(tmp_path):
    """A coffee filter falls without acceleration for most of the record: where it is slow, gravity acts alone."""
    for terminal, thrown, rate in product([1.3, 4.0], [0.0, 2.0], [15.0, 120.0]):
        time = np.arange(0.0, 4.0, 1.0 / rate)
        drag = 9.81 / terminal**2
        found = solve_ivp(
            lambda _, s, c=drag: [s[1], -9.81 - c * abs(s[1]) * s[1]], (0, 4), [20.0, thrown], t_eval=time
        )
        height = found.y[0] + 1e-3 * np.random.default_rng(1).standard_normal(time.size)
        assert read(tmp_path, FALL, height, time).time.size == time.size
        for fall, at in [(height, rate * time), (1e-2 * height, time)] if rate == 120.0 else []:
            with pytest.raises(InputError, match="unit of the time or of the height"):
                read(tmp_path, FALL, fall, at)


def test_what_is_thrown_down_faster_than_it_falls_in_the_end_is_plausible(tmp_path):
    time = np.arange(0.0, 12.0, 0.02)
    found = solve_ivp(lambda _, s: [s[1], -9.81 + 0.01 * s[1] ** 2], (0, 12), [900.0, -45.0], t_eval=time, rtol=1e-9)
    height = found.y[0] + 0.1 * np.random.default_rng(1).standard_normal(time.size)
    assert read(tmp_path, FALL, height, time).time.size == time.size


def test_a_fall_filmed_at_terminal_speed_only_is_plausible(tmp_path):
    time = np.arange(60) / 30.0
    height = 3.0 - 1.2 * time + 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    assert read(tmp_path, FALL, height, time).time.size == time.size
