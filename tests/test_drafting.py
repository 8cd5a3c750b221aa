"""A rig file drafted from a recording of any shape, and what is told of a data set before any model."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_cli import call

from discovery.drafting.centre import centre_of
from discovery.drafting.law_of_motion import is_relative, own_period
from discovery.drafting.names import meaning_of
from discovery.drafting.overview import overview
from discovery.drafting.rig_text import draft
from discovery.foundation.clock import seconds_of
from discovery.foundation.errors import InputError
from discovery.foundation.estimate_text import figures
from discovery.recordings.dataset import load_dataset
from discovery.recordings.running_on import runs_on
from discovery.rigs.kinds import KINDS
from discovery.rigs.rig_file import read_rig

ARM = Path(__file__).parents[1] / "datasets" / "arm"
RNG = np.random.default_rng(5)
TIME = np.arange(1500) / 100.0
SWING = np.exp(-0.1 * TIME) * np.cos(5.0 * TIME) + RNG.normal(0.0, 1e-3, TIME.size)
HELD = np.repeat(RNG.uniform(-4.0, 4.0, 30), 50)


def driven(spring: float) -> np.ndarray:
    """Return q'' = -2 q' - spring q + u at the times, by semi-implicit Euler steps of a tenth of a sample."""
    q, rate, found = 0.0, 0.0, []
    for u in HELD:
        found.append(q)
        for _ in range(10):
            rate += 1e-3 * (u - 2.0 * rate - spring * q)
            q += 1e-3 * rate
    return np.array(found) + RNG.normal(0.0, 1e-4, TIME.size)


def written(folder: Path, name: str, header: str, *columns: np.ndarray, separator: str = ",") -> Path:
    path = folder / name
    np.savetxt(path, np.column_stack(columns), "%.6f", separator, header=header, comments="", encoding="utf-8")
    return path


def drafted(path: Path, **more: object) -> dict:
    """Return a draft as a document, after it was found to be usable."""
    place = path.parent / "rig.toml"
    place.write_text(draft([path], path.parent, **more), encoding="utf-8")
    load_dataset(place)
    return tomllib.loads(place.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("t [ms]", "time", "ms"),
        ("Angle (°)", "motion", "deg"),
        ("displacement_in", "motion", "in"),
        ("voltage_in", "cause", None),
        ("force_kip", "cause", "kip"),
        ("motor_torque_Nm", "cause", "N m"),
        ("x / mm", "motion", "mm"),
        ("cart_x_m", "moved", "m"),
        ("road (mm)", "moved", "mm"),
        ("height_m", "height", "m"),
        ("angular_velocity_rad_s", "speed", "rad/s"),
        ("speed_kmh", "speed", "km/h"),
        ("v [kph]", "speed", "km/h"),
        ("car_speed_mph", "speed", "mile/h"),
        ("omega (rad/s)", "speed", "rad/s"),
        ("omega_rad_per_s", "speed", "rad/s"),
        ("v_m_s", "speed", "m/s"),
        ("speed m/s", "speed", "m/s"),
        ("v_mm_s", "speed", "mm/s"),
        ("rate_deg_s", "speed", "deg/s"),
        ("n_rpm", "speed", "rpm"),
        ("a_m_s2", "acceleration", "m/s^2"),
        ("acc_g", "acceleration", "g_0"),
        ("ax_g", "acceleration", "g_0"),
        ("x (g)", "acceleration", "g_0"),
        ("Acceleration [mg]", "acceleration", "mg_0"),
        ("load_g", "cause", "g"),
        ("mass_g", "", "g"),
        ("az_angle_deg", "motion", "deg"),
        ("turns", "motion", "rev"),
        ("rev", "motion", "rev"),
        ("Revolutions", "motion", "rev"),
        ("wheel_turns", "motion", "rev"),
        ("angle_rev", "motion", "rev"),
        ("rev_count", "motion", "rev"),
        ("turn_rate", "speed", None),
        ("torque_N_m", "cause", "N m"),
        ("position_V", "motion", "V"),
        ("lap_s", "time", "s"),
        ("speed_s", "other", "s"),
        ("Winkel Grad", "motion", "deg"),
        ("Winkel (Grad)", "motion", "deg"),
        ("Spannung [V]", "cause", "V"),
        ("volts", "cause", None),
        ("shaft [rev/min]", "speed", "rpm"),
        ("load_Nm", "cause", "N m"),
        ("channel 3", "", None),
        ("Pos A", "motion", None),
        ("Time A", "time", None),
        ("current_A", "cause", "A"),
        ("i_x [A]", "cause", "A"),
        ("position current [A]", "cause", "A"),
        ("Pos B [au]", "motion", "1"),
        ("Dist Error (cm)", "other", "cm"),
        ("x uncertainty (mm)", "other", "mm"),
    ],
)
def test_names_say_what_they_measure(name: str, role: str, unit: str | None) -> None:
    assert meaning_of(name) == (role, unit)


def test_a_spring_is_felt_and_its_absence_too() -> None:
    found = own_period(TIME, driven(30.0), HELD)
    assert found == pytest.approx(2.0 * np.pi / 30.0**0.5, rel=0.03)
    assert own_period(TIME, driven(0.0), HELD) is None


def test_a_swing_is_timed_by_readings_that_are_few_and_late() -> None:
    rng = np.random.default_rng(2)
    shown = np.sort(rng.uniform(0.0, 20.0, 230))
    # Each is up to a frame of 0.03 s older than its stamp.
    when = shown - rng.uniform(0.0, 0.03, shown.size)
    read = 15.0 * np.exp(-0.03 * when) * np.cos(2.0 * np.pi * when / 0.86) + 0.2 * rng.standard_normal(shown.size)
    assert own_period(shown, read, None) == pytest.approx(0.86, rel=0.01)


def test_a_spring_is_felt_where_the_place_of_rest_creeps() -> None:
    time = np.arange(400) / 100.0
    swing = 1.0 - np.exp(-0.8 * time) * np.cos(9.0 * time)
    read = np.round((0.1 * swing + 0.05 * (1.0 - np.exp(-time / 3.0))) / 0.001) * 0.001  # a step of a held input
    assert own_period(time, read, np.ones_like(time)) == pytest.approx(2.0 * np.pi / 9.0, rel=0.02)
    # The same creep without a swing, and what runs on.
    assert own_period(time, read - 0.1 * swing, np.ones_like(time)) is None
    assert own_period(time, time + 0.2 * np.exp(-5.0 * time), np.ones_like(time)) is None


@pytest.mark.parametrize(("damping", "drag", "friction"), [(1.1, 8.0, 0.0), (8.0, 0.0, 1.5), (1.1, 0.0, 1.5)])
def test_a_spring_is_felt_beside_friction_and_drag(damping: float, drag: float, friction: float) -> None:
    rng = np.random.default_rng(14)
    time = 0.004 * np.arange(3000)
    rate, phase, size = (rng.uniform(*ends, (10, 1)) for ends in ((0.4, 5.0), (0.0, 6.28), (0.9, 3.0)))

    def push(t: np.ndarray) -> np.ndarray:
        return (size * np.sin(2 * np.pi * rate * t + phase)).sum(0) * np.minimum(1, t / 0.3)

    def motion(t: float, y: np.ndarray) -> list[float]:
        lost = damping * y[1] + drag * abs(y[1]) * y[1] + friction * np.tanh(y[1] / 1e-3)
        return [y[1], (push(np.array([t]))[0] - 420.0 * y[0] - lost) / 1.35]

    found = solve_ivp(motion, (0, time[-1]), [0, 0], "LSODA", time, rtol=1e-8, atol=1e-10, max_step=0.004).y[0]
    noisy = found + (0.002 * found.std() + 5e-6) * rng.standard_normal(time.size)
    assert own_period(time, noisy, push(time)) == pytest.approx(2 * np.pi * (1.35 / 420.0) ** 0.5, rel=0.03)


def test_a_free_swing_in_other_units(tmp_path: Path) -> None:
    document = drafted(written(tmp_path, "a.csv", "t_ms,x_mm", 1e3 * TIME, 30.0 * SWING))
    assert document["kind"] == "oscillator"
    assert document["columns"]["time"] == {"name": "t_ms", "unit": "ms"}
    assert document["columns"]["output"] == {"name": "x_mm", "unit": "mm"}
    assert document["model"]["effects"] == list(KINDS["oscillator"].declared)
    assert document["records"]["train"] == [{"file": "a.csv"}]


def test_a_unit_that_no_name_states_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "a.csv", "Time,Position", TIME, 48.0 * SWING)
    said = call(capsys, "init", path)
    assert "rig.toml, line 9, output: the unit, which the name does not state" in said.out
    assert "to fill in: " in call(capsys, "check", tmp_path / "rig.toml").out
    assert drafted(path, kind="pendulum")["columns"]["output"]["unit"] == "deg"
    path = written(tmp_path, "b.csv", "Time,Position", TIME, SWING)
    assert drafted(path, kind="pendulum")["columns"]["output"]["unit"] == "rad"


def test_a_speed_at_rounded_times_that_repeat_is_drafted(tmp_path: Path) -> None:
    time = 11.0 + np.arange(400) / 40.0
    speed = 0.6 * np.exp(-0.05 * time) * np.cos(4.3 * time)
    path = written(tmp_path, "phone.csv", "Time (s);Gyroscope x (rad/s)", np.round(time, 1), speed, separator=";")
    rig = drafted(path)
    assert rig["columns"]["time"]["name"] == "Time (s)"
    assert rig["system"]["output"] == "dot(angle)"


@pytest.mark.parametrize(("name", "unit"), [("angular_velocity", "rad/s"), ("gyroVel", "rad/s"), ("velocity", "m/s")])
def test_a_velocity_of_what_turns_is_in_radians(tmp_path: Path, name: str, unit: str) -> None:
    document = drafted(written(tmp_path, "a.csv", f"time,{name}", TIME, SWING))
    assert document["columns"]["output"]["unit"] == unit
    assert ("angle" in document["system"]["coordinates"]) == (unit == "rad/s")


@pytest.mark.parametrize(
    ("others", "given"),
    [("PWM,Voltaje (V)", "Voltaje (V)"), ("PWM,battery_V", "PWM"), ("PWM,base_mm", "PWM"), ("voltage,PWM", "voltage")],
)
def test_of_several_causes_the_one_that_states_its_unit_is_the_input(tmp_path: Path, others: str, given: str) -> None:
    path = written(tmp_path, "a.csv", f"t_s,{others},angle_rad", TIME, HELD, 2.0 * HELD, driven(30.0))
    assert drafted(path)["columns"]["input"]["name"] == given


@pytest.mark.parametrize(("count", "unit"), [(345, "s"), (4000, "ms")])
def test_a_clock_that_rises_by_one_is_asked_for(tmp_path: Path, count: int, unit: str) -> None:
    clock, rng = np.arange(count, dtype=float), np.random.default_rng(1)
    rows = np.column_stack([clock, np.exp(-2 * clock / count) + 1e-3 * rng.normal(size=count)])
    np.savetxt(tmp_path / "tank.csv", rows, delimiter=",", fmt="%.6f")
    text = draft([tmp_path / "tank.csv"], tmp_path)
    assert f'time = {{ name = "c1", unit = "{unit}" }}   # FILL IN the unit, s or ms' in text


def test_of_several_motions_the_first_that_moves_is_the_output(tmp_path: Path) -> None:
    still = np.round(492 + RNG.normal(0.0, 0.4, TIME.size))
    document = drafted(written(tmp_path, "a.csv", "t_s,pos_a,pos_b,pos_c", TIME, still, 30.0 * SWING, 20.0 * SWING))
    assert document["columns"]["output"]["name"] == "pos_b"


def test_a_noisy_motion_comes_before_that_of_a_base(tmp_path: Path) -> None:
    read = 0.02 * SWING + RNG.normal(0.0, 0.01, TIME.size)
    path = written(tmp_path, "a.csv", "t_s,angle_rad,base_displacement_m", TIME, read, HELD)
    assert drafted(path)["columns"]["output"]["name"] == "angle_rad"


def test_an_angle_that_turns_on_and_on_is_that_of_a_drive(tmp_path: Path) -> None:
    angle = 12.0 * (TIME - 0.2 * (1.0 - np.exp(-5.0 * TIME)))
    path = written(tmp_path, "a.csv", "t_s,duty,angle_rad", TIME, np.full(TIME.size, 0.8), angle)
    document = drafted(path)
    assert document["kind"] == "drive"
    assert document["columns"]["input"] == {"name": "duty", "unit": "1", "interpolation": "hold"}
    assert drafted(written(tmp_path, "b.csv", "t_s,angle_deg", TIME, np.degrees(angle)))["kind"] == "system"
    # So does one whose encoder counts within a turn.
    document = drafted(written(tmp_path, "d.csv", "t_s,duty,angle_deg", TIME, HELD, np.degrees(angle) % 360.0))
    assert document["kind"] == "drive"
    assert f"# 0 to {figures(float(np.degrees(angle[-1])), 4)}" in (tmp_path / "rig.toml").read_text()
    whirled = written(tmp_path, "c.csv", "t_s,duty,angle_rad", TIME, np.full(TIME.size, 0.8), SWING)
    assert drafted(whirled)["kind"] == "pendulum"


def test_what_goes_back_while_its_input_rests_has_a_spring(tmp_path: Path) -> None:
    """It creeps back to where it was before the push, without a swing; a wheel that is pushed runs out."""
    push = np.where((TIME > 1.0) & (TIME < 3.0), 5.0, 0.0)
    gone = np.maximum(TIME - 3.0, 0.0)
    pushed = np.clip(TIME - 1.0, 0.0, 2.0)
    back, out = pushed * np.exp(-gone), pushed + 0.5 * (1.0 - np.exp(-2.0 * gone))
    # One that ran the other way before it was pushed was not brought back.
    ran = 3.0 * np.exp(-5.0 * TIME)
    for motion, kind in ((back, "oscillator"), (out, "drive"), (out + ran, "drive")):
        path = written(tmp_path, "a.csv", "t_s,voltage_V,angle_rad", TIME, push, motion)
        assert drafted(path)["kind"] == kind


def test_the_noise_that_is_told_is_never_less_than_that_of_rounding(tmp_path: Path) -> None:
    coarse = np.round(np.cos(0.6 * TIME) / 0.05) * 0.05
    text = draft([written(tmp_path, "a.csv", "t_s,x_mm", TIME, coarse)], tmp_path)
    assert "in steps of 0.05 mm. The sd of rounding, 0.014 mm, is taken as noise" in text
    assert "noise = 0.014 inside" in text


@pytest.mark.parametrize(
    ("cell", "words"), [("abc,def", r"'t_s', row 7 \(line 8 of the file\): 'abc'"), ("0.06,inf", "row 7 .* infinite")]
)
def test_a_cell_that_is_no_number_is_named(cell: str, words: str, tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "t_s,x_mm", TIME, SWING)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:7], cell, *lines[7:]]))
    with pytest.raises(InputError, match=words):
        draft([path], tmp_path)
    path.write_text("\n".join([f"{line},{'' if k == 7 else 'x' if k == 9 else k}" for k, line in enumerate(lines)]))
    with pytest.raises(InputError, match="'x' is not a number"):
        draft([path], tmp_path)
    draft([path], tmp_path, chosen={"time": "t_s", "output": "x_mm"})


def test_lines_above_a_table_are_told_from_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Date, Monday, noon\nt [s], x [mm]\n0.0, 1.0\n0.1, 2.0\n")
    with pytest.raises(InputError, match=r"'Date, Monday, noon' was taken .* delete it or put # before it"):
        draft([path], tmp_path)
    path.write_text("t [s], x [mm]\n0.0, 1.0\n")
    with pytest.raises(InputError, match=r"too few rows of readings \(1\)"):
        draft([path], tmp_path)


def test_a_table_with_both_decimal_marks_names_the_cell(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;x\n0.000;3,10\n" + "".join(f"0,{k};3,{k}\n" for k in range(101, 130)))
    with pytest.raises(InputError, match=r"line 2: '0.000' has a decimal point, and nearly all other .* decimal comma"):
        draft([path], tmp_path)
    path.write_text("t;x\n0.000;3.10\n" + "".join(f"0.{k};3,{k}\n" for k in range(101, 130)))
    with pytest.raises(InputError, match=r"'x', row 2 .*: '3,101' is not a number.*decimal point"):
        draft([path], tmp_path)


def test_a_reading_far_beside_rest_states_its_zero_as_a_guess(tmp_path: Path) -> None:
    document = drafted(written(tmp_path, "a.csv", "t_s,distance_mm", TIME, 312.0 + 30.0 * SWING))
    assert document["columns"]["output"]["zero"] == pytest.approx(312.0, abs=0.05)
    # What the guess is off by is fitted in every model, so that no law is found for it.
    assert document["model"]["effects"] == ["viscous_damping", "linear_stiffness", "angle_offset"]
    text = (tmp_path / "rig.toml").read_text()
    assert "# zero guessed from the motion; " in text
    assert "take it out where you state a zero that you measured" in text
    document = drafted(written(tmp_path, "b.csv", "t_s,acc_m_s2", TIME, 9.81 + SWING))
    assert (document["columns"]["output"]["zero"], document["model"]["effects"][-1]) == (
        pytest.approx(9.81, abs=0.01),
        "angle_offset",
    )
    drafted(written(tmp_path, "c.csv", "t_s,distance_mm", TIME, 30.0 * SWING))
    assert "angle_offset" not in (tmp_path / "rig.toml").read_text()


@pytest.mark.parametrize("kind", ["oscillator", "system"])
@pytest.mark.parametrize("read", ["raw", "in steps", "held at first"])
def test_a_zero_is_drafted_where_the_recording_tells_it_from_none(read: str, kind: str, tmp_path: Path) -> None:
    def zero_of(beside: float) -> float | None:
        motion = beside + 30.0 * SWING
        if read == "in steps":
            motion = np.round(motion / 0.4) * 0.4
        if read == "held at first":
            motion[:5] = 60.0  # the hand that lets go
        document = drafted(written(tmp_path, "a.csv", "t_s,x_mm", TIME, motion), kind=kind)
        zero = document["columns"]["output"].get("zero")
        assert ("angle_offset" in document.get("model", {}).get("effects", ())) == (zero is not None)
        return zero

    assert zero_of(0.0) is None
    assert zero_of(0.005) is None
    assert zero_of(-1.0) == pytest.approx(-1.0, abs=0.1)


@pytest.mark.parametrize(
    ("name", "kind"), [("angle_deg", None), ("force_N,x_m", None), ("force_N,x_m", "system"), ("base_m,x_m", None)]
)
def test_no_zero_is_drafted_where_it_is_meant_or_an_input_moves_the_centre(
    name: str, kind: str | None, tmp_path: Path
) -> None:
    columns = (30.0 * SWING + 5.0,) if name == "angle_deg" else (HELD, driven(30.0) + 0.5)
    text = draft([written(tmp_path, "a.csv", f"t_s,{name}", TIME, *columns)], tmp_path, kind=kind)
    assert "zero" not in text
    assert "angle_offset" not in text


def stuck() -> np.ndarray:
    """Return a swing that dry friction stops beside its centre: each half of it goes about a place 0.075 away."""
    half = np.minimum(np.floor(TIME / 0.5), 6)  # it then stands at 1 - 6 * 0.15
    way = np.where(half % 2 == 0, 1.0, -1.0)
    swing = (1.0 - 0.15 * half - 0.075) * np.cos(2.0 * np.pi * (TIME - 0.5 * half)) + 0.075
    return np.where(half < 6, way * swing, 0.1)


MOTIONS = {
    "decay": (TIME, np.exp(-0.3 * TIME) * np.cos(3.0 * TIME)),
    "one and a half swings": (TIME, np.cos(3.0 * np.pi * TIME / TIME[-1])),
    "one and a half swings, begun elsewhere": (TIME, np.cos(3.0 * np.pi * TIME / TIME[-1] + 2.0)),
    "clipped": (TIME, np.maximum(np.exp(-0.05 * TIME) * np.cos(3.0 * TIME), -0.5)),
    "gaps": (
        TIME,
        np.where((TIME % 4.0 < 0.7) | (np.abs(TIME - 7.0) < 2.0), np.nan, np.exp(-0.1 * TIME) * np.cos(3.0 * TIME)),
    ),
    "wrong readings": (TIME, np.cos(3.0 * TIME) + np.where(np.arange(TIME.size) % 90 == 50, 8.0, 0.0)),
    "uneven times": (TIME**2 / 15.0, np.exp(-0.1 * TIME**2 / 15.0) * np.cos(3.0 * TIME**2 / 15.0)),
    "at rest in the end": (TIME, np.exp(-TIME) * np.cos(5.0 * TIME)),
    "back to rest without a swing": (TIME, np.exp(-TIME)),
    "stuck beside the centre": (TIME, stuck()),
    "a single swing": (TIME, np.cos(2.0 * np.pi * TIME / TIME[-1])),
    "times that begin again": (TIME % 7.5, np.exp(-0.1 * (TIME % 7.5)) * np.cos(3.0 * (TIME % 7.5))),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_centre_of_a_motion_is_found(motion: str) -> None:
    time, moved = MOTIONS[motion]
    for seed in range(5):
        read = -60.0 + 2.0 * moved + np.random.default_rng(seed).normal(0.0, 0.01, time.size)
        centre = centre_of(time, read, 0.01)
        assert centre.at == pytest.approx(-60.0, abs=min(0.06, 3.0 * centre.sd))


@pytest.mark.usefixtures("undrawn")
def test_where_few_swings_tell_a_centre_badly_the_end_does() -> None:
    """They go about another place the larger they are, and something shakes beside."""
    time = np.arange(115) / 10.0
    swing = -70.0 * np.exp(-0.8 * time) * np.cos(4.0 * time)
    moved = swing + 0.006 * swing**2 + 12.0 * np.exp(-0.3 * time) * np.sin(7.0 * time)
    for seed in range(5):
        centre = centre_of(time, 9.3 + moved + np.random.default_rng(seed).normal(0.0, 0.1, time.size), 0.1)
        assert centre.at == pytest.approx(9.3, abs=0.3)


def test_a_zero_that_is_guessed_is_no_discovery(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(200) / 30.0  # four swings and a half, read by a ranger
    swing = np.exp(-0.04 * time) * np.cos(4.4 * time) + RNG.normal(0.0, 0.004, time.size)
    assert call(capsys, "init", written(tmp_path, "a.csv", "t_s,distance_mm", time, 168.0 + 30.0 * swing)).status == 0
    said = call(capsys, "loop", tmp_path / "rig.toml", "--out", tmp_path / "out", "--quiet", "--json")
    assert said.status == 0, said.err
    assert json.loads(said.out)["verdict"] == "nothing_missing"


@pytest.mark.parametrize("unit", ["counts", "x_m", "x_mm", "angle_deg"])
def test_what_runs_on_is_driven_by_a_constant_in_any_unit(unit: str, tmp_path: Path) -> None:
    way = 900.0 * (TIME - 0.2 * (1.0 - np.exp(-5.0 * TIME)))
    still = (np.full(TIME.size, 12.0), 0.0 * TIME, np.full(TIME.size, 0.2))
    path = written(tmp_path, "a.csv", f"t_s,volts,unused,error_mm,{unit}", TIME, *still, way)
    document = drafted(path)
    assert (document["kind"], document["columns"]["input"]["name"]) == ("drive", "volts")
    assert (
        "# not used: error_mm, unused (never changes: name it with --input if it drives)"
        in (tmp_path / "rig.toml").read_text()
    )


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, "M1, ball_m (vary: name one with --input if it drives, or with --output if it is the motion)"),
        ({"output": "beam_rad"}, "M1, ball_m (vary: name one with --input if it drives)"),
        ({"input": "M1"}, "ball_m (varies: name it with --output if it is the motion)"),
        ({"input": "M1", "output": "beam_rad"}, "ball_m"),
    ],
)
def test_columns_left_that_vary_may_have_a_role(
    more: dict[str, str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    others = (np.arange(TIME.size), TIME, 0.1 * SWING, HELD, driven(0.0))
    path = written(tmp_path, "a.csv", "t_s,count,clock_time_s,beam_rad,M1,ball_m", TIME, *others)
    options = [part for role, name in more.items() for part in (f"--{role}", name)]
    told = call(capsys, "init", path, *options)
    text = (tmp_path / "rig.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("# not used: "))
    assert line.removeprefix("# not used: count, clock_time_s, ").removeprefix("# not used: ") == said
    assert (f"not used: count, clock_time_s, {said}\n" in told.out) == ("--" in said)
    assert "nothing drives" not in text
    if not more:
        assert "guessed: an angle, and no column is known to drive it" in text


@pytest.mark.parametrize("name", ["ESC signal (µs)", "pwm_us", "servo_ms"])
def test_a_pulse_that_varies_may_drive(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "a.csv", f"t_s,{name},clock_ms,rpm", TIME, 1500.0 + HELD, 1e3 * TIME, 900.0 + driven(0.0))
    said = f"clock_ms, {name} (varies: name it with --input if it drives, or with --output if it is the motion)"
    assert f"not used: {said}\n" in call(capsys, "init", path).out
    assert drafted(path, chosen={"input": name})["columns"]["input"]["name"] == name


def test_a_column_that_rises_by_its_unit_is_the_time_and_counts_a_second_are_a_speed(tmp_path: Path) -> None:
    speed = 8500.0 - 3600.0 * np.exp(-8.0 * TIME)
    document = drafted(written(tmp_path, "a.csv", "i_ms,vfilt_cps,duty", 1e3 * TIME, speed, np.full(TIME.size, 999.0)))
    assert document["columns"]["time"] == {"name": "i_ms", "unit": "ms"}
    assert (document["kind"], document["system"]["output"]) == ("system", "dot(angle)")


@pytest.mark.parametrize("name", ["counts", "x_mm", "angle_rad"])
def test_a_constant_that_is_named_is_the_input(name: str, tmp_path: Path) -> None:
    step = 5.0 * (1.0 - np.exp(-0.5 * TIME) * (np.cos(4.0 * TIME) + np.sin(4.0 * TIME) / 8.0))
    path = written(tmp_path, "a.csv", f"t_s,volts,{name}", TIME, np.full(TIME.size, 12.0), step)
    assert "input" not in drafted(path)["columns"]
    assert "# not used: volts (never changes: name it with --input if it drives)" in (tmp_path / "rig.toml").read_text()
    document = drafted(path, chosen={"input": "volts"})
    assert document["kind"] == "oscillator"
    assert document["columns"]["input"] == {"name": "volts", "unit": "V", "interpolation": "hold"}


@pytest.mark.parametrize("name", ["setpoint_rpm", "Target Speed (rpm)", "ref_rpm"])
def test_what_a_controller_is_asked_for_is_told_from_what_drives(name: str, tmp_path: Path) -> None:
    speed = 100.0 * (1.0 - np.exp(-3.0 * TIME))
    path = written(tmp_path, "a.csv", f"t_s,{name},speed_rpm", TIME, np.full(TIME.size, 100.0), speed)
    drafted(path, chosen={"input": name})
    told = "# By its name it is what a controller is asked for." in (tmp_path / "rig.toml").read_text()
    assert told == (name != "ref_rpm")  # a short word that may mean anything


@pytest.mark.parametrize("name", ["volts", "fan_speed_setting", "x_error_mm", "trial"])
def test_what_is_held_and_differs_between_recordings_may_drive(name: str, tmp_path: Path) -> None:
    step = 5.0 * (1.0 - np.exp(-0.5 * TIME) * (np.cos(4.0 * TIME) + np.sin(4.0 * TIME) / 8.0))
    first, other = (
        written(tmp_path, f"{k}.csv", f"t_s,{name},same,x_mm", TIME, np.full(TIME.size, 1.0 + k), TIME * 0.0, k * step)
        for k in (1, 2)
    )
    alone = drafted(first)
    assert "input" not in alone["columns"]
    document = drafted(first, holdout=[other])
    text = (tmp_path / "rig.toml").read_text()
    assert "same (never changes: name it with --input if it drives)" in text
    if name == "volts":
        assert document["columns"]["input"] == {"name": "volts", "unit": "V", "interpolation": "hold"}
        assert "# guessed as the input: it is held, and differs between recordings. Remove the line" in text
        assert 'kind = "oscillator"   # guessed: in 1.csv it swings about its rest' in text
    else:
        said = f"{name} (is held, and differs between recordings: name it with --input if it drives)"
        assert "input" not in document["columns"]
        assert (said in text) == (name != "x_error_mm")


def coasting(count: int = 160) -> np.ndarray:
    """Return when each turn of a wheel is complete that bearings slow down [s]: q = v t - a t^2 / 2."""
    speed, slowing = 0.9, 0.0022
    return (speed - np.sqrt(speed**2 - 2.0 * slowing * np.arange(count))) / slowing


@pytest.mark.parametrize(("name", "unit"), [("turns", "rev"), ("angle_rev", "rev"), ("pulses", "1")])
def test_a_counter_that_never_goes_back_is_that_of_a_rotor(tmp_path: Path, name: str, unit: str) -> None:
    path = written(tmp_path, "coast.csv", f"t_s,{name}", coasting(), 4264.0 + np.arange(160.0))
    document = drafted(path, chosen={"output": name})
    assert (document["kind"], document["columns"]["output"]["unit"]) == ("system", unit)
    assert "zero" not in document["columns"]["output"]
    # Nothing pushes what only slows down.
    assert "forces" not in document["system"]
    assert document["system"]["kinetic"] == "inertia*dot(angle)^2/2"


def test_the_mean_rate_is_told_by_init_and_by_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "coast.csv", "t_s,turns", coasting(), np.arange(160.0))
    said = call(capsys, "init", path, "--out", tmp_path / "rig.toml")
    rate = f"{figures(159.0 / coasting()[-1], 4)} a second on average"
    assert f"at uneven times, {rate}" in said.out
    assert rate in (tmp_path / "rig.toml").read_text()


def test_what_comes_to_an_end_does_not_run_on() -> None:
    assert runs_on(TIME**2, "m")
    assert not runs_on(1.0 - np.exp(-TIME), "m")
    assert not runs_on(SWING, "1")
    assert not runs_on(np.ones(9), "1")


def test_what_falls_is_driven_by_nothing_else(tmp_path: Path) -> None:
    time = TIME[:100]
    path = written(tmp_path, "a.csv", "t_s,volts,height_m", time, np.full(100, 5.0), 5.0 - 4.9 * time**2)
    assert drafted(path)["kind"] == "falling_body"


def test_a_height_that_swings_is_that_of_a_bob_on_a_spring(tmp_path: Path) -> None:
    time = np.arange(600) / 50
    height = 0.09 * np.exp(-0.05 * time) * np.cos(6.0 * time)
    assert drafted(written(tmp_path, "a.csv", "t_s,height_m", time, height))["kind"] == "oscillator"


def test_what_turns_back_beyond_half_a_turn_hangs_on_a_spring(tmp_path: Path) -> None:
    found = drafted(written(tmp_path, "wheel.csv", "time_s,angle_rad", TIME, 4.5 * SWING))
    assert (found["kind"], found["model"]["effects"]) == ("oscillator", ["viscous_damping", "linear_stiffness"])


def test_an_angle_that_swings_freely_is_a_pendulum_and_its_unit_is_seen(tmp_path: Path) -> None:
    document = drafted(written(tmp_path, "a.csv", "time;angle", TIME, 50.0 * SWING, separator=";"))
    assert document["kind"] == "pendulum"
    assert document["columns"]["output"]["unit"] == "deg"


@pytest.mark.parametrize(("spring", "kind"), [(30.0, "oscillator"), (0.0, "drive")])
def test_a_driven_system_is_told_by_what_pulls_it_back(spring: float, kind: str, tmp_path: Path) -> None:
    document = drafted(written(tmp_path, "a.csv", "time_s,voltage_V,position_m", TIME, HELD, driven(spring)))
    assert document["kind"] == kind
    assert document["columns"]["input"] == {"name": "voltage_V", "unit": "V", "interpolation": "hold"}


@pytest.mark.parametrize("kind", [None, "system"])
@pytest.mark.parametrize("role", ["files", "holdout"])
def test_any_recording_shows_what_pulls_a_system_back(role: str, kind: str | None, tmp_path: Path) -> None:
    columns = np.column_stack([TIME, HELD, driven(30.0)])
    short, long = (
        written(tmp_path, name, "time_s,voltage_V,position_m", *columns[:size].T)
        for name, size in (("short.csv", 120), ("long.csv", 1500))
    )
    files, holdout = ([short, long], []) if role == "files" else ([short], [long])
    alone = draft([short], tmp_path, kind=kind)
    both = draft(files, tmp_path, holdout=holdout, kind=kind)
    if kind is None:
        assert 'kind = "drive"   # guessed: an input moves it, and short.csv shows no swing about a place' in alone
        assert 'kind = "oscillator"   # guessed: in long.csv it swings about its rest, once in about 1.1' in both
    else:
        assert tomllib.loads(both)["system"]["constants"]["stiffness"]["guess"] == pytest.approx(30.0, rel=0.1)
        assert "potential" not in tomllib.loads(alone)["system"]


def test_recordings_that_lack_a_column_of_the_first_are_told(tmp_path: Path) -> None:
    first = written(tmp_path, "a.csv", "time_s,voltage_V,position_m", TIME, HELD, driven(30.0))
    other = written(tmp_path, "b.csv", "time_s,voltage_V,position_mm", TIME, HELD, driven(30.0))
    with pytest.raises(InputError, match=r"b\.csv has no column of numbers 'position_m'.*Did you mean 'position_mm'"):
        draft([first], tmp_path, holdout=[other])


def test_a_moved_base_is_an_input(tmp_path: Path) -> None:
    base = 0.1 * np.sin(2.0 * TIME)
    document = drafted(written(tmp_path, "a.csv", "time_s,hub_rad,deflection_rad", TIME, base, 0.1 * SWING))
    assert document["kind"] == "base_excited"


def turning() -> np.ndarray:
    """Return w' = 40 u - 5 w at the times."""
    speed, found = 0.0, []
    for u in HELD:
        found.append(speed)
        for _ in range(10):
            speed += 1e-3 * (40.0 * u - 5.0 * speed)
    return np.array(found) + RNG.normal(0.0, 0.02, TIME.size)


@pytest.mark.parametrize("name", ["speed_rad_s", "omega (rad/s)", "speed_rpm"])
def test_a_speed_at_a_voltage_is_a_motor(name: str, tmp_path: Path) -> None:
    factor = 60.0 / (2.0 * np.pi) if "rpm" in name else 1.0
    path = written(tmp_path, "a.csv", f"time_s,voltage_V,{name}", TIME, HELD, factor * turning())
    document = drafted(path)
    assert document["system"]["like"] == "dc_motor"
    assert document["columns"]["input"]["name"] == "voltage_V"
    assert document["columns"]["output"]["name"] == name
    constants = document["system"]["constants"]
    k, r = constants["torque_constant"]["guess"], constants["resistance"]["value"]
    inertia, loss = constants["inertia"]["guess"], constants["loss"]["value"]
    # The guesses move as the recording does.
    assert k / r / inertia == pytest.approx(40.0, rel=0.05)
    assert (k**2 / r + loss) / inertia == pytest.approx(5.0, rel=0.05)
    assert "docs/YOUR_SYSTEM.md" in (tmp_path / "rig.toml").read_text()
    assert overview(load_dataset(tmp_path / "rig.toml"))["recordings"][0]["own_period"] is None
    with pytest.raises(InputError, match="is a speed, and drive reads none"):
        draft([path], tmp_path, kind="drive")


def test_what_is_to_be_filled_in_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place, names = tmp_path / "rig.toml", ("torque_constant", "resistance", "loss")
    said = call(capsys, "init", written(tmp_path, "a.csv", "time_s,voltage_V,speed_rad_s", TIME, HELD, turning()))
    lines = place.read_text().splitlines()
    for name in names:
        number = next(number for number, line in enumerate(lines, 1) if line.startswith(name))
        assert f"to fill in: {place}, line {number}, {name}: " in said.out
    assert call(capsys, "check", place).out.count("to fill in: ") == len(names)
    assert len(json.loads(call(capsys, "check", place, "--json").out)["rig"]["to_fill_in"]) == len(names)
    place.write_text("\n".join(line.partition("   # FILL IN")[0] for line in lines))
    assert "to fill in" not in call(capsys, "check", place).out


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_draft_without_a_data_sheet_names_the_right_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A motor with a dead zone, most of whose draft nobody has touched: a known constant that is wrong adds others."""

    def driven_by(name: str, seed: int) -> Path:
        rng = np.random.default_rng(seed)
        time = np.arange(1200) / 150.0
        rates, phases, sizes = rng.uniform(0.6, 9.0, 7), rng.uniform(0.0, 6.0, 7), rng.uniform(0.8, 2.0, 7)
        volts = sizes @ np.sin(np.multiply.outer(rates, time) + phases[:, None])

        def law(t: float, speed: np.ndarray) -> float:
            u = float(sizes @ np.sin(rates * t + phases))
            passed = np.sign(u) * max(abs(u) - 0.55, 0.0)
            return (0.042 * (passed - 0.042 * speed[0]) / 1.8 - 4e-5 * speed[0]) / 9e-5

        speed = solve_ivp(law, (0.0, time[-1]), (0.0,), t_eval=time, rtol=1e-8, atol=1e-8, max_step=2e-3).y[0]
        return written(
            tmp_path, name, "time_s,voltage_V,speed_rad_s", time, volts, speed + rng.normal(0.0, 0.4, time.size)
        )

    assert call(capsys, "init", driven_by("a.csv", 7), "--holdout", driven_by("b.csv", 8)).status == 0
    said = call(capsys, "loop", tmp_path / "rig.toml", "--out", tmp_path / "out", "--quiet", "--json")
    assert said.status == 0, said.err
    found = json.loads(said.out)
    assert [effect["id"] for effect in found["effects"]] == ["input_dead_zone"]
    assert "still says FILL IN (line " in found["doubts"][0]


def test_other_speeds_are_read_by_a_body(tmp_path: Path) -> None:
    document = drafted(written(tmp_path, "a.csv", "time_s,force_N,v_m_s", TIME, HELD, turning()))
    assert document["system"]["output"] == "dot(x)"
    assert document["system"]["constants"]["mass"]["guess"] == pytest.approx(1 / 40.0, rel=0.05)
    document = drafted(written(tmp_path, "b.csv", "time_s,omega_rpm", TIME, 100.0 * np.exp(-TIME / 3.0)))
    assert document["system"]["constants"]["damping"]["guess"] == pytest.approx(1 / 3.0, rel=0.01)


def test_what_is_no_cause_is_the_output_and_no_time_is(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "time_s,u_V,y_V", TIME, HELD, driven(30.0))
    assert drafted(path)["columns"]["output"]["name"] == "y_V"
    path = written(tmp_path, "b.csv", "time_s,force_N,acc_m_s2", TIME, HELD, np.gradient(turning(), TIME))
    assert drafted(path)["columns"]["output"]["reads"] == "acceleration"
    path = written(tmp_path, "c.csv", "time_s,voltage_V,speed_s", TIME, HELD, turning())
    with pytest.raises(InputError, match="Name one with --output"):
        draft([path], tmp_path)
    assert drafted(path, chosen={"output": "speed_s"})["columns"]["output"]["unit"] == "1"


def test_equations_of_a_system_are_drafted_on_demand(tmp_path: Path) -> None:
    document = drafted(written(tmp_path, "a.csv", "time_s,x_mm", TIME, 30.0 * SWING), kind="system")
    assert document["system"]["constants"]["stiffness"]["guess"] == pytest.approx(25.0, rel=0.05)
    assert "model" not in document
    document = drafted(written(tmp_path, "b.csv", "time_s,voltage_V,x_m", TIME, HELD, driven(0.0)), kind="system")
    assert document["system"]["constants"]["gain"]["guess"] == pytest.approx(1.0, rel=0.05)
    with pytest.raises(InputError, match=r"docs/YOUR_SYSTEM\.md"):
        draft([written(tmp_path, "c.csv", "time_s,x_pixel", TIME, SWING)], tmp_path, kind="system")


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_runs_on_without_an_input_is_drafted_with_a_constant_torque(way: float, tmp_path: Path) -> None:
    """Of theta'' = b - 5 theta' with b = 60, a torque that the guess has the sign and the size of."""
    angle = 2.0 + way * 12.0 * (TIME - 0.2 * (1.0 - np.exp(-5.0 * TIME)))
    document = drafted(written(tmp_path, "a.csv", "t_s,angle_deg", TIME, np.degrees(angle) % 360.0), kind="system")
    assert document["system"]["forces"] == {"angle": "steady_push"}
    guess = document["system"]["constants"]["steady_push"]["guess"]
    assert 15.0 < way * guess < 120.0
    swing = drafted(written(tmp_path, "b.csv", "t_s,angle_rad", TIME, SWING), kind="system")
    assert "forces" not in swing["system"]


def test_what_turns_one_way_beyond_half_a_turn_is_no_torsion_pendulum(tmp_path: Path) -> None:
    turned = 5.65 * (TIME / TIME[-1] - 0.5)  # 11.3 rad, all one way
    assert drafted(written(tmp_path, "a.csv", "time_s,angle_rad", TIME, 2.0 * turned))["kind"] == "system"
    assert drafted(written(tmp_path, "b.csv", "time_s,angle_rad", TIME, 5.0 * SWING))["kind"] == "oscillator"


def test_of_a_file_without_a_column_of_numbers_the_first_wrong_cell_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time_s,x_m\n0.5,\n" + "".join(f"0.{i:02}0.5,\n" for i in range(60)))
    with pytest.raises(InputError, match=r"column 'time_s', row 2 .*'0\.000\.5' is not a number"):
        draft([path], tmp_path)


def test_what_stands_still_before_it_is_driven_is_drafted_as_at_rest(tmp_path: Path) -> None:
    later, rng = np.where(TIME < 1.0, 0.0, 1.0 - np.exp(1.0 - TIME)), np.random.default_rng(3)
    volts, noise = np.where(TIME < 1.0, 0.0, 9.0), 0.002 * rng.standard_normal(TIME.size)

    def said(read: np.ndarray, header: str = "time_s,voltage_V,angle_rad") -> bool:
        part = drafted(written(tmp_path, "a.csv", header, TIME, volts, read))["records"]["train"][0]
        return bool(part.get("at_rest", False))

    assert said(later + noise)
    assert said(later)
    assert said(later + noise, "time_s,voltage_V,speed_rad_s")
    assert not said(0.05 * TIME + later + noise)  # it moves already
    assert not said(3.0 + later + noise, "time_s,voltage_V,speed_rad_s")  # it turns already


def test_an_encoder_that_stays_on_its_step_under_a_rising_input_begins_at_rest(tmp_path: Path) -> None:
    push = 0.1 * TIME / TIME[-1]
    held = np.maximum(0.0, TIME - 2.0) ** 2

    def said(given: np.ndarray) -> bool:
        path = written(tmp_path, "a.csv", "time_s,duty,angle_rad", TIME, given, np.round(held / 0.01) * 0.01)
        return bool(drafted(path)["records"]["train"][0].get("at_rest", False))

    assert said(push)
    assert not said(1.0 + push)  # it was pushed before, and friction may hold it anywhere


def regulated(sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the speed of a motor that a controller holds, filtered and in counts, and the input that it chose."""
    rng, step = np.random.default_rng(8), TIME[1]
    speed, read, asked, sums, load = 0.0, 0.0, 3.0, 0.0, 0.0
    found = []
    for _ in TIME:
        load += step * (-0.2 * load + 2.0 * rng.standard_normal())
        sums += step * (asked - read)
        given = sign * (40.0 * sums + 20.0 * (asked - read))
        speed += step * (-1.5 * speed + sign * 0.1 * given + load)
        read += step / 0.6 * (speed - read)
        found.append((np.round(read, 2), given))
    speeds, inputs = np.array(found).T
    return speeds, inputs


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_gain_of_an_input_that_a_controller_chose_has_its_sign(sign: float, tmp_path: Path) -> None:
    speed, given = regulated(sign)
    constants = drafted(written(tmp_path, "a.csv", "time_s,PWM,speed_rad_s", TIME, given, speed))["system"]["constants"]
    assert 0.02 < sign * constants["gain"]["guess"] < 0.5
    assert constants["damping"]["guess"] > 0.0
    # Of several trials the first tells.
    twice = (np.tile(each, 2) for each in (TIME, given, speed))
    again = tomllib.loads(draft([written(tmp_path, "b.csv", "time_s,PWM,speed_rad_s", *twice)], tmp_path))
    assert 0.02 < sign * again["system"]["constants"]["gain"]["guess"] < 0.5


def test_a_current_drives_where_nothing_else_does(tmp_path: Path) -> None:
    columns = (TIME, np.sin(TIME), np.sin(TIME + 0.1), np.cos(TIME))
    both = drafted(written(tmp_path, "a.csv", "time_s,current_mA,PWM,MotorRPM", *columns))["columns"]
    assert (both["input"]["name"], both["output"]["unit"]) == ("PWM", "rpm")
    alone = drafted(written(tmp_path, "b.csv", "time_s,current_mA,speed_rad_s", *columns[:2], columns[3]))
    assert alone["columns"]["input"]["name"] == "current_mA"


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_place_that_accelerates_as_gravity_does_is_that_of_a_fall(way: float, tmp_path: Path) -> None:
    """Counted upwards, or downwards as a motion sensor above it does."""
    time = np.arange(120) / 200.0
    rng = np.random.default_rng(2)
    fallen = 0.5 * time + 4.8 * time**2 + 2e-4 * rng.standard_normal(time.size)
    document = drafted(written(tmp_path, "a.csv", "time_s,Posición (m)", time, 0.3 + way * fallen))
    assert document["kind"] == "falling_body"
    assert document["columns"]["output"].get("scale", 1) == -way
    chute = drafted(written(tmp_path, "c.csv", "time_s,height_m", TIME, 9.0 + np.exp(-TIME) - TIME))
    assert (chute["kind"], chute["columns"]["output"].get("scale")) == ("falling_body", None)
    slope = drafted(written(tmp_path, "b.csv", "time_s,Posición (m)", time, 0.3 + 0.4 * way * fallen))
    assert slope["kind"] == "system"


@pytest.mark.parametrize("noise", [0.5, 2.0])
def test_a_few_readings_of_a_swing_are_no_rest(noise: float, tmp_path: Path) -> None:
    """In 12 ms a swing of 0.1 m/s goes no farther than its noise."""
    time, rng = np.arange(0.0, 4.0, 1e-3), np.random.default_rng(4)
    swing = 20.0 * np.sin(5.0 * time) + noise * rng.standard_normal(time.size)
    pushed = np.repeat(rng.normal(size=time.size // 10), 10)
    pushed[:12] = 0.0
    part = drafted(written(tmp_path, "a.csv", "time_s,force_N,x_mm", time, pushed, swing))["records"]["train"][0]
    assert not part.get("at_rest", False)


def test_a_draft_offers_only_kinds_that_fit_and_says_how(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "time_s,angle_deg", TIME, 30.0 * SWING)
    text = draft([path], tmp_path)
    assert "on a torsion spring: `discovery init a.csv --kind oscillator`" in text
    assert "# or oscillator: `" in text
    assert drafted(path, kind="oscillator")["model"]["effects"] == ["viscous_damping", "linear_stiffness"]


def shaken(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, the motion of a base, and the way of a mass on a spring from it, from another start than rest."""
    rng = np.random.default_rng(seed)
    own = rng.uniform(2.0, 6.0)
    time = np.arange(1200) / 60.0
    rates, phases, loss = own * rng.uniform(0.1, 2.5, 6), rng.uniform(0.0, 6.0, 6), rng.uniform(0.01, 0.6) * own
    sizes = rng.uniform(1.0, 4.0, 6)

    def law(t: float, state: np.ndarray) -> tuple[float, float]:
        return state[1], -(own**2) * state[0] - loss * state[1] + sizes * rates**2 @ np.sin(rates * t + phases)

    way = solve_ivp(law, (0.0, time[-1]), (rng.normal(), 0.0), t_eval=time, rtol=1e-7, atol=1e-8).y[0]
    return time, np.sin(np.multiply.outer(time, rates) + phases) @ sizes, way


def test_recordings_tell_whether_a_motion_is_relative_to_its_base() -> None:
    told = []
    for seed in range(8):
        time, base, way = shaken(seed)
        noise = np.random.default_rng(seed).normal(size=time.size)
        for motion in (way, way + base):
            told.append(is_relative(time, motion + 0.01 * motion.std() * noise, base))
    assert False not in told[0::2]
    assert True not in told[1::2]
    assert told.count(None) < 8
    # One frequency fits both.
    assert is_relative(TIME, 2.0 * np.sin(3.0 * TIME), np.sin(3.0 * TIME)) is None


def test_a_base_says_that_the_output_is_relative_and_what_else_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time, base, way = shaken(3)
    path = written(tmp_path, "a.csv", "time_s,table_mm,mass_mm", time, base, base + way)
    said = call(capsys, "init", path)
    assert "read as relative to the base, 'table_mm'" in said.out
    assert "But the recording looks like a motion against the floor." in said.out
    text = (tmp_path / "rig.toml").read_text()
    # What stands in the comment is a rig file that can be used.
    start = text.index("# [system]")
    lines = [line.removeprefix("# ").removeprefix("#") for line in text[start : text.index("\n[model]")].splitlines()]
    head = "\n".join(line for line in text[:start].splitlines() if not line.startswith("kind"))
    tail = text[text.index("[records]") :]
    (tmp_path / "floor.toml").write_text("\n".join([head, *lines, "", tail]))
    data = load_dataset(tmp_path / "floor.toml")
    assert data.rig.kind == "system"
    said = call(capsys, "fit", tmp_path / "floor.toml", "--out", tmp_path / "out", "--quiet")
    assert said.status == 0, said.err


def test_an_arm_keeps_its_columns(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(draft([ARM / "train_paper.csv"], tmp_path))
    load_dataset(tmp_path / "rig.toml")
    rig = read_rig(tmp_path / "rig.toml")
    assert rig.kind == "flexible_arm"
    assert rig.length is not None
    assert rig.length.value == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("title", ["", "beats 29.2cm\n"])
def test_numbers_without_names_get_some(title: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([TIME, SWING]), "%.6f", ",")
    path.write_text(title + path.read_text())
    document = drafted(path)
    assert document["columns"]["header"] == ["c1", "c2"]
    assert document["columns"]["time"]["name"] == "c1"


def test_a_clock_that_was_set_back_is_told_where_it_was(tmp_path: Path) -> None:
    time = np.cumsum(np.random.default_rng(5).uniform(0.01, 0.09, 200))
    time[120:] -= 1.0
    path = tmp_path / "swing.tsv"
    np.savetxt(path, np.column_stack([time, 0.2 * np.cos(3.0 * time)]), "%.6f", "\t")
    rig = tmp_path / "rig.toml"
    rig.write_text(draft([path], tmp_path))
    with pytest.raises(InputError, match=r"'c1', row 121 .* is earlier than the row before"):
        load_dataset(rig)


def test_times_without_a_name_in_uneven_steps_are_the_only_column_that_rises(tmp_path: Path) -> None:
    time = np.cumsum(np.random.default_rng(5).uniform(0.01, 0.09, 200))
    path = tmp_path / "swing.tsv"
    np.savetxt(path, np.column_stack([time, 0.2 * np.cos(3.0 * time)]), "%.6f", "\t")
    assert drafted(path)["columns"]["time"]["name"] == "c1"
    np.savetxt(path, np.column_stack([time, time**2, np.cos(3.0 * time)]), "%.6f", "\t")
    with pytest.raises(InputError, match="no column of times"):
        draft([path], tmp_path)


def test_numbers_of_frames_are_the_clock_of_what_moves_most(tmp_path: Path) -> None:
    """A tracker's rows are counted, too, and a frame without a body is lost."""
    frames = 120 + np.delete(np.arange(TIME.size), 40)
    time = (frames - frames[0]) / 50.0
    x, y = 3.0 + 0.2 * np.sin(40.0 * time), 9.0 * np.cos(3.0 * time)
    path = written(tmp_path, "a.csv", "row,frame_num,x,y", np.arange(time.size), frames, np.round(x, 2), np.round(y, 2))
    columns = drafted(path)["columns"]
    assert (columns["time"]["name"], columns["output"]["name"]) == ("frame_num", "y")
    text = draft(path)
    assert "FILL IN scale = 1 over the frames a second" in text
    line = 'name = "frame_num", unit = "s"'
    rig = text.replace(line, f"{line}, scale = 0.02").replace("FILL IN", "").replace('unit = "1"', 'unit = "m"')
    (tmp_path / "rig.toml").write_text(rig)
    recording = load_dataset(tmp_path / "rig.toml").train[0].recording
    assert recording.time - recording.time[0] == pytest.approx(time)


def test_a_column_that_stands_still_is_no_clock(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "state,step,theta", np.zeros(TIME.size), 1e3 * TIME + 9e3, SWING)
    assert drafted(path)["columns"]["time"] == {"name": "step", "unit": "ms"}


@pytest.mark.parametrize("day", ["", "2024-05-01 ", "2024-05-01T"])
def test_times_of_a_clock_are_seconds(day: str, tmp_path: Path) -> None:
    seconds = 59 + TIME[:900]
    stamps = [f"{day}14:{43 + int(s // 60)}:{s % 60:06.3f}" for s in seconds]
    rows = [f"{stamp},{angle:.6f}" for stamp, angle in zip(stamps, SWING, strict=False)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Timestamp,theta", *rows]), encoding="utf-8")
    assert drafted(path)["columns"]["time"] == {"name": "Timestamp", "unit": "s"}
    time = load_dataset(tmp_path / "rig.toml").train[0].recording.time
    np.testing.assert_allclose(np.diff(time), 0.01, atol=1e-9)
    (tmp_path / "rig.toml").write_text((tmp_path / "rig.toml").read_text().replace('"s"', '"s", scale = 0.5', 1))
    with pytest.raises(InputError, match=r"times of a clock are in s, not in 0.5 s"):
        load_dataset(tmp_path / "rig.toml")


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["23:59:59.5", "0:00:00.0", " ", "00:00:00.5"], [0.0, 0.5, np.nan, 1.0]),
        (["", "59:59.9", "00:00.1"], [np.nan, 0.0, 0.2]),
        (["00:00:00", "13:00:00", "126:00:00"], [0.0, 46800.0, 453600.0]),
        (["2024-03-30T23:00:00+01:00", "2024-03-31T01:00:00+02:00"], [0.0, 3600.0]),
    ],
)
def test_times_that_pass_midnight_go_on(cells: list[str], seconds: list[float]) -> None:
    np.testing.assert_allclose(seconds_of(np.array(cells, object)), seconds, atol=1e-9)


@pytest.mark.parametrize("cell", ["25:61:00", "noon", "2024-13-41 10:00:00", "12.5", "2024-05-01 10:00:01Z"])
def test_what_is_no_time_of_a_clock_is_refused(cell: str) -> None:
    date = "2024-05-01 " if "-" in cell else ""
    assert seconds_of(np.array([f"{date}10:00:00", cell], object)) is None
    assert seconds_of(np.array(["", cell.replace("Z", "+99:99")], object)) is None


def test_whole_numbers_of_an_angle_may_be_counts(tmp_path: Path) -> None:
    counts = np.round(400 * SWING)
    path = written(tmp_path, "a.csv", "t_s,theta", TIME, counts)
    assert "of an encoder's counts it is rev, scale = 1 over those of a turn" in draft([path], tmp_path)
    path = written(tmp_path, "b.csv", "t_s,theta", TIME, counts + 0.25)
    assert "counts" not in draft([path], tmp_path)


def test_an_instrument_that_reads_volts_is_in_volts(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "t_s,Volt", TIME, SWING)
    assert drafted(path)["columns"]["output"]["unit"] == "V"


def test_a_rate_takes_the_place_of_times(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "reading", SWING)
    with pytest.raises(InputError, match="--rate"):
        draft([path], tmp_path)
    assert drafted(path, rate=100.0)["columns"]["time"] == {"rate_hz": 100.0}


@pytest.mark.parametrize(
    ("name", "scale", "unit", "known"),
    [
        ("x", 1.0, "m", False),
        ("stroke", 1.0, "m", False),
        ("x", 30.0, "1", False),
        ("y", 1.0, "1", False),
        ("theta", 1.0, "rad", True),
    ],
)
def test_what_goes_along_a_line_is_in_metres(
    tmp_path: Path, name: str, scale: float, unit: str, *, known: bool
) -> None:
    path = written(tmp_path, "a.csv", f"time_s,{name}", TIME, scale * SWING)
    text = draft([path], tmp_path)
    output = tomllib.loads(text)["columns"]["output"]
    assert (output["unit"], "FILL IN the unit" not in text) == (unit, known)


def test_a_body_that_slides_under_a_constant_push_is_drafted_in_metres(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "time_s,x", TIME, 0.1 * TIME + 0.03 * TIME**2)
    found = drafted(path)
    assert found["system"]["coordinates"] == {"x": "m"}
    fall = -4.9 * TIME[:140] ** 2 + RNG.normal(0.0, 1e-3, 140)
    path = written(tmp_path, "b.csv", "time_s,x", TIME[:140], fall)
    assert drafted(path, kind="falling_body")["kind"] == "falling_body"


def test_of_several_accelerations_the_largest_is_pointed_at(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "time_s,ax,ay,az", TIME, 0.3 * SWING, SWING, 0.1 * SWING)
    with pytest.raises(InputError, match=r"ax, ay, az could be the output; ay varies most\. Name it"):
        draft([path], tmp_path)


def test_what_cannot_be_told_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "time_s,one,two", TIME, SWING, HELD)
    with pytest.raises(InputError, match=r"one, two could be the output\. Name it with --output"):
        draft([path], tmp_path)
    columns = drafted(path, chosen={"output": "one", "input": "two"})["columns"]
    assert (columns["output"]["name"], columns["input"]["name"]) == ("one", "two")
    with pytest.raises(InputError, match="Did you mean 'one'"):
        draft([path], tmp_path, chosen={"output": "on"})


def test_init_writes_once_and_says_what_it_understood(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "a.csv", "t_s,x_mm", TIME, 30.0 * SWING)
    said = call(capsys, "init", path)
    assert said.status == 0, said.err
    assert "train a: 1500 readings over 14.99 s, 100 a second, the first 1000 are fitted" in said.out
    assert f"written: {tmp_path / 'rig.toml'}" in said.out
    before = (tmp_path / "rig.toml").read_text()
    said = call(capsys, "init", path)
    assert said.status == 2
    assert "is there already" in said.err
    assert (tmp_path / "rig.toml").read_text() == before


def test_a_hold_out_that_takes_no_part_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    folder = ARM.parent / "spring_bench"
    train = ("check", folder / "rig.toml", "--train", folder / "train_high.csv")
    assert f"--train alone leaves out holdout of {folder / 'rig.toml'}." in call(capsys, *train).err
    assert "leaves out" not in call(capsys, *train, "--holdout", folder / "holdout.csv").err
    assert "leaves out" not in call(capsys, "check", folder / "rig.toml").err


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that nobody can write to, root included")
def test_a_draft_that_cannot_be_written_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "a.csv", "t_s,x_mm", TIME, SWING)
    said = call(capsys, "init", path, "--out", "/proc/rig.toml")
    assert said.status == 2
    assert "Nothing can be written to /proc" in said.err
    assert call(capsys, "init", path, "--out", tmp_path / "new" / "rig.toml").status == 0


def test_check_shows_noise_excitation_and_flags(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stuck = driven(30.0)
    stuck[700:760] = stuck[700]
    path = written(tmp_path, "a.csv", "time_s,voltage_V,position_m", TIME, HELD, stuck)
    drafted(path)
    said = call(capsys, "check", tmp_path / "rig.toml", "--plot", tmp_path / "a.svg")
    assert said.status == 0, said.err
    assert "flag: 'position_m' is stuck" in said.out
    assert "<svg" in (tmp_path / "a.svg").read_text()[:600]
    content = json.loads(call(capsys, "check", tmp_path / "rig.toml", "--json").out)
    (found,) = content["recordings"]
    assert found["channels"][0]["noise"] == pytest.approx(1e-4, rel=0.2)
    assert found["input"]["largest"] == pytest.approx(HELD.max(), abs=1e-6)
    assert found["own_period"] == pytest.approx(1.15, rel=0.3)  # roughly, beside a stuck sensor
    assert found["missing"] >= 59
    assert len(found["flags"]) == 1


def test_a_periodic_input_is_seen(tmp_path: Path) -> None:
    wave = np.sin(2.0 * np.pi * TIME / 1.5) + 0.5 * np.cos(6.0 * np.pi * TIME / 1.5)
    drafted(written(tmp_path, "a.csv", "time_s,force_N,x_m", TIME, wave, np.roll(wave, 9) + 1e-3 * SWING))
    (found,) = overview(load_dataset(tmp_path / "rig.toml"))["recordings"]
    assert found["input"]["period"] == pytest.approx(1.5)
    assert found["input"]["band"] == pytest.approx([1 / 1.5, 3 / 1.5], abs=0.1)


def test_a_picture_that_nobody_can_open_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--plot" in call(capsys, "check", ARM / "rig.toml", "--open").err
    assert call(capsys, "check", ARM / "rig.toml", "--plot", tmp_path / "a.txt").status == 2


def test_the_version_names_its_revision(capsys: pytest.CaptureFixture[str]) -> None:
    from importlib.metadata import version

    from discovery.foundation.revision import git_revision

    revision = git_revision()
    assert call(capsys, "--version").out.strip() == f"discovery {version('discovery')}" + (
        f", revision {revision}" if revision else ""
    )


def test_lists_are_printed_as_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    cards = json.loads(call(capsys, "effects", "--system", "oscillator", "--json").out)
    assert "coulomb_friction" in {card["id"] for card in cards}
    card = json.loads(call(capsys, "effects", "coulomb_friction", "--json").out)
    assert card == next(c for c in cards if c["id"] == "coulomb_friction")
    assert {p["name"] for p in card["parameters"]} == {"f_c", "v_c"}
    assert json.loads(call(capsys, "data", "list", "--json").out)[0]["licence"]


@pytest.mark.usefixtures("undrawn")
def test_a_new_user_gets_the_right_answer_from_init_and_loop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pendulum in degrees with drag in air, whose user writes no line of a rig file."""

    def released(name: str, angle: float) -> Path:
        time = np.arange(800) / 40.0

        def pull(_: float, state: np.ndarray) -> tuple[float, float]:
            return state[1], -16.35 * np.sin(state[0]) - 0.03 * state[1] - 0.06 * abs(state[1]) * state[1]

        seen = solve_ivp(pull, (0.0, 20.0), (np.radians(angle), 0.0), t_eval=time, rtol=1e-9, atol=1e-9).y[0]
        return written(
            tmp_path, name, "time;Angle (°)", time, np.degrees(seen) + RNG.normal(0.0, 0.15, 800), separator=";"
        )

    assert call(capsys, "init", released("a.csv", 70.0), "--holdout", released("b.csv", 40.0)).status == 0
    out = tmp_path / "out"
    said = call(capsys, "loop", tmp_path / "rig.toml", "--out", out, "--quiet", "--json")
    assert said.status == 0, said.err
    found = json.loads(said.out)
    assert found["verdict"] == "explained"
    assert [effect["id"] for effect in found["effects"]] == ["quadratic_drag"]
    assert found["effects"][0]["parameters"]["c_2"]["value"] == pytest.approx(0.06, rel=0.05)
    assert found["files"] == [str(out / "loop.json"), str(out / "report.html")]
    kept = json.loads((out / "loop.json").read_text())
    assert {key: found[key] for key in kept} == kept


def test_large_numbers_are_said_in_digits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "a.csv", "time_s,u_mV,speed_rpm", TIME, 1e3 * HELD, 100.0 * turning())
    assert "e+0" not in call(capsys, "init", path).out


@pytest.mark.parametrize("told", ["number", "word"])
def test_trials_of_one_file_are_told_apart_by_their_column(tmp_path, told):
    values = [3.0, 1.0, 2.0] if told == "number" else ["high", "low", "mid"]
    swings = [a * SWING + RNG.normal(0.0, 1e-3, TIME.size) for a in (1.0, 0.6, 0.8)]
    rows = [f"{v},{t:.2f},{x:.6f},7" for v, swing in zip(values, swings, strict=True)
            for t, x in zip(TIME, swing, strict=True)]  # fmt: skip
    path = tmp_path / "all.csv"
    path.write_text("\n".join(["take no,t_s,angle_rad,battery", *rows]), encoding="utf-8")
    records = drafted(path)["records"]
    assert [part["where"]["take no"] for part in (*records["train"], *records["holdout"])] == values
    assert len(records["train"]) == 2


@pytest.mark.parametrize("above", [",mass A,\nt,x,\n", ",mass A\nt,x\n", "mass_A\t\t\nt\tx\ty\n", "mass_A,,\nt,x,y\n"])
def test_a_title_with_empty_cells_is_passed_over(above: str, tmp_path: Path) -> None:
    """As trackers of videos export the track of a body."""
    separator, columns = ("\t" if "\t" in above else ","), above.splitlines()[1].strip(",").count("y") + 2
    path = tmp_path / "a.txt"
    np.savetxt(path, np.column_stack([TIME, SWING, SWING**2][:columns]), "%.6f", separator)
    path.write_text(above + path.read_text())
    document = drafted(path)
    assert document["columns"]["time"]["name"] == "t"
    assert document["columns"]["output"]["name"] == "x"


def test_a_force_that_answers_an_imposed_motion_gets_a_view(tmp_path):
    place = np.sin(2.0 * np.pi * TIME)
    force = np.tanh(20.0 * np.cos(2.0 * np.pi * TIME)) + RNG.normal(0.0, 3e-3, TIME.size)
    path = written(tmp_path, "bench.csv", "time_s,displacement_mm,load cell_N", TIME, 10.0 * place, force)
    # Named by nobody, the force drives; the draft says how it is turned round.
    again = "discovery init bench.csv --output 'load cell_N' --input displacement_mm"
    assert again in draft(path)
    found = drafted(path, chosen={"output": "load cell_N", "input": "displacement_mm"})
    assert (found["kind"], found["view"]["output"]) == ("drive", "force")
    assert found["view"]["cutoff_hz"] == pytest.approx(20.0, rel=0.3)
    assert found["view"]["motion_cutoff_hz"] == pytest.approx(2.0 * found["view"]["cutoff_hz"], rel=0.1)
    # A slow readout bounds what is guessed.
    slow = written(tmp_path, "slow.csv", "time_s,displacement_mm,force_N", TIME[::5], place[::5], force[::5])
    assert drafted(slow, chosen={"output": "force_N", "input": "displacement_mm"})["view"]["motion_cutoff_hz"] == 8.0


def test_a_kind_that_nothing_drives_is_drafted_without_an_input(tmp_path: Path) -> None:
    time = TIME[:100]
    path = written(tmp_path, "a.csv", "t_s,volts,height_m", time, np.sin(3.0 * time), 5.0 - 4.9 * time**2)
    asked = {"output": "height_m"}
    assert "input" in drafted(path, kind="drive", chosen=asked)["columns"]
    assert "input" not in drafted(path, kind="falling_body", chosen=asked)["columns"]
