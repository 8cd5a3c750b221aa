from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.recordings.dataset import load_dataset
from discovery.recordings.parts import fitted_count, motion_over_noise
from discovery.recordings.recording import Recording

TIME = np.linspace(0.0, 60.0, 3000)


def recording(output: np.ndarray, noise: float, drive: np.ndarray | None = None, unit: str = "rad") -> Recording:
    return Recording("r", TIME, drive, output, ("output",), (unit,), np.array([noise]), sha256="", source="")


def recorded(values: np.ndarray, noise: float = 1e-3, drive: np.ndarray | None = None, unit: str = "rad") -> Recording:
    read = values + noise * np.random.default_rng(0).standard_normal(values.size)
    return recording(read[:, None], noise, drive, unit)


def step(at: float, time_constant: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return a voltage switched on and the speed of a motor under it."""
    gone = np.maximum(TIME - at, 0.0)
    return np.where(at > TIME, 0.0, 9.0), 10.0 * (1.0 - np.exp(-gone / time_constant))


def test_a_lasting_motion_is_held_out_from_two_thirds() -> None:
    assert fitted_count(recorded(np.sin(6 * TIME))) == 2000


@pytest.mark.parametrize("rate", [0.3, 0.6])
def test_a_decay_is_held_out_where_it_is_seen(rate: float) -> None:
    swing = recorded(np.exp(-rate * TIME) * np.sin(6 * TIME))
    # An amplitude of root two times three sds: from there on no stretch scatters by three.
    ends = np.log(1 / (3 * np.sqrt(2) * 1e-3)) / rate
    count = fitted_count(swing)
    assert TIME[count] == pytest.approx(2 / 3 * ends, rel=0.12)
    assert motion_over_noise(swing, count) > 3 * motion_over_noise(swing, 2000)


def test_rest_alone_is_divided_as_it_is() -> None:
    assert fitted_count(recorded(np.zeros(3000))) == 2000


def test_where_too_few_would_be_fitted_all_is_divided() -> None:
    swing = recorded(np.exp(-8.0 * TIME) * np.sin(60 * TIME))
    few = fitted_count(swing)
    assert 0 < few < 300
    assert fitted_count(swing, fewest=few) == few
    assert fitted_count(swing, fewest=few + 1) == 2000


def test_where_a_motion_is_seen_late_enough_is_held_out() -> None:
    grown = recorded(np.exp(0.5 * (TIME - 60.0)) * np.sin(6 * TIME), noise=0.02)
    late = 3000 - fitted_count(grown)
    assert late < 500
    assert 3000 - fitted_count(grown, fewest=late) == late
    assert 3000 - fitted_count(grown, fewest=late + 20) == late + 20
    # Not where nothing moves before.
    step = recorded(np.where(np.arange(3000) > 2985, 1.0, 0.0))
    assert fitted_count(step, fewest=30) == fitted_count(step)


@given(offset=st.floats(-1e3, 1e3), scale=st.sampled_from([1e-6, 1.0, 1e6]))
def test_neither_place_nor_unit_matters(offset: float, scale: float) -> None:
    swing = np.exp(-0.3 * TIME) * np.sin(6 * TIME)
    plain = recorded(swing)
    moved = recording(scale * (plain.output + offset), scale * 1e-3)
    assert abs(fitted_count(moved) - fitted_count(plain)) <= 50


def test_gaps_do_not_count_as_motion() -> None:
    swing = recorded(np.exp(-0.6 * TIME) * np.sin(6 * TIME))
    swing.output[2000:2400] = np.nan
    assert fitted_count(swing) < 800


@pytest.mark.parametrize("values", [np.sin(0.2 * TIME), np.exp(-0.03 * TIME)], ids=["slow swing", "slowing down"])
def test_a_motion_slow_against_a_stretch_has_not_ended(values: np.ndarray) -> None:
    """It moves by less than three sds in a second, and by more than fifty in the minute."""
    slow = recorded(values, noise=0.02)
    assert fitted_count(slow) == 2000


def test_a_decay_below_its_noise_has_ended_however_slowly_it_swings() -> None:
    assert fitted_count(recorded(np.exp(-0.3 * TIME) * np.sin(1.5 * TIME), noise=0.02)) < 1000


@pytest.mark.parametrize("unit", ["rad/s", "rad"])
def test_a_step_and_the_level_behind_it_are_motion(unit: str) -> None:
    drive, speed = step(20.0)
    assert fitted_count(recorded(speed, drive=drive, unit=unit)) == 2000


@pytest.mark.parametrize("at", [42.0, 50.0, 56.0])
@pytest.mark.parametrize("time_constant", [1e-4, 0.5])
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["up", "down"])
def test_a_late_step_is_fitted_in_part(at: float, time_constant: float, sign: float) -> None:
    drive, speed = step(at, time_constant)
    if sign < 0.0:
        drive, speed = 9.0 - drive, 10.0 - speed
    count = fitted_count(recorded(speed, drive=drive, unit="rad/s"))
    assert np.ptp(speed[:count]) > 6.0
    assert count < 2950


def test_at_rest_without_an_input_nothing_is_told() -> None:
    """A motor switched off coasts to rest; what a voltage holds, and a steady speed, are told of losses."""
    drive, speed = step(10.0)
    coasting = fitted_count(recorded(10.0 - speed, drive=9.0 - drive, unit="rad/s"))
    assert 500 < coasting < 1000
    assert coasting == fitted_count(recorded(10.0 - speed, unit="rad/s"))
    assert fitted_count(recorded(speed, drive=drive, unit="rad")) == 2000
    assert fitted_count(recorded(speed, drive=drive, unit="rad"), pushed=False) < 1000
    assert fitted_count(recorded(speed, unit="rad/s")) == 2000


DRAWN = """
name = "cart"
kind = "{kind}"
[columns]
time = {{ name = "t", unit = "s" }}
input = {{ name = "u", unit = "V" }}
output = {{ name = "y", unit = "mm", noise = 0.1 }}
[model]
effects = {effects}
"""


@pytest.mark.parametrize(
    ("kind", "effects", "apart"),
    [
        ("drive", ["viscous_damping"], True),
        ("drive", ["viscous_damping", "negative_stiffness"], True),
        ("drive", ["viscous_damping", "cubic_stiffness"], False),
        ("oscillator", ["viscous_damping", "linear_stiffness"], False),
    ],
)
def test_what_nothing_pulls_back_is_judged_from_a_start_of_its_own(tmp_path, kind, effects, apart) -> None:
    u = np.sin(3.0 * TIME) + np.cos(1.3 * TIME)
    y = 40.0 * np.sin(1.1 * TIME) + 0.1 * np.random.default_rng(1).standard_normal(TIME.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([TIME, u, y]), delimiter=",", header="t,u,y", comments="")
    (tmp_path / "rig.toml").write_text(DRAWN.format(kind=kind, effects=effects), encoding="utf-8")
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"])
    assert [flag.code for flag in data.train[0].recording.flags].count("third_apart") == apart
    (first,) = data.train
    if not apart:
        assert first.fitted_samples == 2000
        assert not data.holdout
        return
    (rest,) = data.holdout
    assert first.fitted_samples is None
    assert rest.recording.name == "a_last_third"
    np.testing.assert_array_equal(np.append(first.recording.time, rest.recording.time), TIME)
    kept = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"], keep_third=False)
    assert kept.train[0].recording.time.size == TIME.size
