"""The sine and gravity fix the scale of a motion: another unit is doubted, other physics is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from test_unit_mistakes import FALL, pendulum

from discovery.cli.loop_page import write_page
from discovery.cli.say import doubts
from discovery.recordings.dataset import load_dataset
from discovery.recordings.unit_mistakes import _stretches, angle_doubt, fall_doubt
from discovery.report.sentences import refutations, verdict_sentence
from discovery.runs.loop import close_loop
from discovery.runs.stages import unexplained

RATE = 30.0
DEGREE = np.pi / 180.0


def swing(amplitude, noise=0.2 * DEGREE, *, xi=0.02, drag=0.0, coulomb=0.0, alpha=0.0, beta=0.0, duration=20.0):
    """Pendulum of 0.8 m with other effects, by an independent integrator [rad]."""
    t = np.arange(0.0, duration, 1.0 / RATE)

    def slope(_, s):
        extra = xi * s[1] + drag * abs(s[1]) * s[1] + coulomb * np.tanh(100.0 * s[1]) + alpha * s[0] + beta * s[0] ** 3
        return [s[1], -9.81 / 0.8 * np.sin(s[0]) - extra]

    y = solve_ivp(slope, (0.0, duration), [amplitude, 0.0], t_eval=t, rtol=1e-8, atol=1e-9).y[0]
    return t, y + noise * np.random.default_rng(int(1e3 * amplitude)).standard_normal(t.size)


MOTIONS = {
    "one large": [swing(1.2)],
    "small to large": [swing(0.15), swing(0.5), swing(1.0)],
    "drag": [swing(0.3, drag=0.05), swing(0.9, drag=0.05)],
    "dry friction": [swing(0.4, coulomb=0.05), swing(0.9, coulomb=0.05)],
    "hardening": [swing(0.4, beta=3.0), swing(0.9, beta=3.0)],
    "softening": [swing(0.4, beta=-3.0), swing(0.9, beta=-3.0)],
    "as the sine stiffens": [swing(0.4, beta=9.81 / 0.8 / 6.0), swing(0.9, beta=9.81 / 0.8 / 6.0)],
    "a spring": [swing(0.4, alpha=5.0), swing(0.9, alpha=5.0)],
    "very large": [swing(2.5), swing(1.5)],
    "small": [swing(0.1), swing(0.05)],
    "noisy": [swing(0.4, 0.05), swing(0.9, 0.05)],
}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("unit", ["rad", "deg", "mrad"])
def test_an_angle_in_its_unit_is_not_doubted(name, unit):
    # What is read in the right unit is the same in radians.
    assert angle_doubt(pendulum(unit=unit), MOTIONS[name]) is None


@pytest.mark.parametrize("name", ["one large", "small to large", "drag", "dry friction"])
@pytest.mark.parametrize(
    ("true", "declared", "factor"),
    [("rad", "deg", DEGREE), ("deg", "mrad", 1e-3 / DEGREE), ("rad", "mrad", 1e-3), ("turn", "rad", 0.5 / np.pi)],
)
def test_an_angle_in_another_unit_is_doubted(name, true, declared, factor):
    motions = [(t, factor * y) for t, y in MOTIONS[name]]
    said = str(angle_doubt(pendulum(unit=declared), motions))
    assert f"a pendulum whose angle is in {true}:" in said
    assert f'set unit = "{true}"' in said


def test_gaps_noise_and_rest_are_no_doubt():
    t, y = MOTIONS["one large"][0]
    holes = np.where(np.arange(t.size) % 7 == 0, np.nan, y)
    assert angle_doubt(pendulum(), [(t, holes)]) is None
    assert "in rad" in str(angle_doubt(pendulum(unit="deg"), [(t, DEGREE * holes)]))
    noise = np.random.default_rng(1).standard_normal(t.size)
    for motion in (noise, 0.0 * t, 0.0 * t + np.nan, np.linspace(0.0, 1.0, t.size)):
        assert angle_doubt(pendulum(unit="deg"), [(t, motion)]) is None


@pytest.mark.parametrize(("unit", "doubted"), [("rad", False), ("deg", True)])
def test_the_notes_of_recordings_tell_it(unit, doubted, tmp_path):
    for i, (t, y) in enumerate(MOTIONS["small to large"]):
        pd.DataFrame({"t": t, "a": y}).to_csv(tmp_path / f"{i}.csv", index=False)
    (tmp_path / "rig.toml").write_text(
        'name = "p"\nkind = "pendulum"\n[columns]\ntime = { name = "t" }\n'
        f'output = {{ name = "a", unit = "{unit}" }}\n'
    )
    made = load_dataset(tmp_path / "rig.toml", [tmp_path / "0.csv", tmp_path / "1.csv"], [tmp_path / "2.csv"])
    told = ["whose angle is in rad" in " ".join(e.recording.notes) for _, e in made.everything]
    assert told == [doubted] * 3


def fall(gravity=9.81, *, drag=0.0, viscous=0.0, speed=0.0, rate=60.0, noise=1e-3, duration=1.5):
    """Return times and heights of a falling body."""
    t = np.arange(0.0, duration, 1.0 / rate)

    def slope(_, s):
        return [s[1], -gravity - drag * abs(s[1]) * s[1] - viscous * s[1]]

    y = solve_ivp(slope, (0.0, duration), [20.0, speed], t_eval=t, rtol=1e-8).y[0]
    return t, y + noise * np.random.default_rng(2).standard_normal(t.size)


@pytest.mark.parametrize("drag", [0.0, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("viscous", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("speed", [0.0, -2.0])
@pytest.mark.parametrize("rate", [15.0, 60.0, 240.0])
def test_falls_with_drag_are_not_doubted(drag, viscous, speed, rate):
    assert fall_doubt(FALL, fall(drag=drag, viscous=viscous, speed=speed, rate=rate)) is None


@pytest.mark.parametrize("duration", [0.4, 1.0, 1.5])
@pytest.mark.parametrize("speed", [15.0, 40.0])
def test_on_the_way_up_drag_adds_to_gravity(speed, duration):
    assert fall_doubt(FALL, fall(drag=0.01, speed=speed, duration=duration)) is None


@pytest.mark.parametrize("drag", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("rate", [15.0, 60.0])
def test_falls_that_no_drag_explains_are_doubted(drag, rate):
    t, y = fall(drag=drag, rate=rate)
    assert 'in ft would fit: set unit = "ft"' in str(fall_doubt(FALL, (t, y / 0.3048)))
    assert "gravity?" in str(fall_doubt(FALL, (0.5 * t, y)))
    assert "drag never makes a fall faster" in str(fall_doubt(FALL, (0.5 * t, y)))
    # Another world.
    assert "drag is small" in str(fall_doubt(FALL, fall(1.62, drag=drag, rate=rate)))


def test_a_coarse_encoder_that_comes_to_rest_says_nothing_of_that_part() -> None:
    time = np.arange(0.0, 60.0, 0.01)
    angle = np.round(0.3 * np.exp(-0.2 * time) * np.cos(6.0 * time) / 0.01) * 0.01
    assert np.ptp(angle[-1000:]) == 0.0
    rows = _stretches(time, angle)
    assert all(0 < sd < 0.02 * frequency for _, frequency, sd in rows)


def test_a_dense_noisy_recording_is_looked_at_in_few_stretches() -> None:
    """Noise crosses the centre at every reading: what is looked at must not grow as the square of their number."""
    t = np.arange(1_000_000) / 50_000.0
    y = 0.9 * np.exp(-0.01 * t) * np.cos(3.4 * t) + 0.2 * np.random.default_rng(1).standard_normal(t.size)
    assert angle_doubt(pendulum(unit="rad"), [(t, y)]) is None


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("unit", "verdict"), [("deg", "unexplained"), ("rad", "nothing_missing")])
def test_readings_that_refute_the_unit_are_not_explained(unit, verdict, tmp_path):
    """A false unit makes a cubic spring of the sine, which would explain every reading."""
    for i, amplitude in enumerate((0.5, 1.0)):
        t, y = swing(amplitude)
        pd.DataFrame({"t": t, "a": y}).to_csv(tmp_path / f"{i}.csv", index=False)
    rig = tmp_path / "rig.toml"
    rig.write_text(
        'name = "p"\nkind = "pendulum"\n[columns]\ntime = { name = "t" }\n'
        f'output = {{ name = "a", unit = "{unit}" }}\n'
        '[records]\ntrain = [{ file = "0.csv" }]\nholdout = [{ file = "1.csv" }]\n'
    )
    dataset = load_dataset(rig)
    found = close_loop(dataset)
    assert found.verdict == verdict
    assert found.impossible == (verdict == "unexplained")
    # Nothing was added, so that one model is reported, by one estimate.
    assert found.errors["before"] == found.errors["after"]
    assert bool(doubts(found, dataset)) == found.impossible
    if not found.impossible:
        return
    assert (found.added, found.lead, unexplained(found, dataset)) == ((), None, None)
    assert found.steps[-1].code == "impossible"
    assert "cannot move as a recording says, so nothing was searched" in verdict_sentence(found.summary())
    (sentence,) = doubts(found, dataset)
    assert 'For rad, set unit = "rad"' in sentence
    assert "So in 1" in sentence
    assert [told.partition(":")[0] for told in refutations(found.summary())] == ["0", "1"]
    page = write_page(tmp_path, dataset, found, None, 1).read_text(encoding="utf-8")
    assert "The file is in doubt." in page
    assert page.count("as that of a pendulum whose angle is in rad") >= 2


def test_a_declared_law_that_bends_the_period_leaves_no_doubt():
    motions = [(t, DEGREE * y) for t, y in MOTIONS["one large"]]
    rig = pendulum(unit="deg")
    assert angle_doubt(rig, motions) is not None
    assert angle_doubt(replace(rig, declared=(*rig.declared, "cubic_stiffness")), motions) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_descent_under_a_parachute_is_not_held_against_gravity(tmp_path: Path, seed: int) -> None:
    """It opens, slows down and then sinks steadily, read by a barometer."""
    t = np.arange(0.0, 6.4, 0.064)
    height = 430.0 - 3.0 * t - 4.0 * (1 - np.exp(-t / 0.6))
    read = np.round(height + 0.5 * np.random.default_rng(seed).standard_normal(t.size), 2)
    np.savetxt(tmp_path / "a.csv", np.column_stack([t, read]), delimiter=",", header="t,h", comments="")
    (tmp_path / "rig.toml").write_text(
        'name = "parachute"\nkind = "falling_body"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'output = { name = "h", unit = "m" }\n'
    )
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"])
    assert "fall_rate" not in {flag.code for flag in data.train[0].recording.flags}
