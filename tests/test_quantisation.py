"""The part of rounding that lasts over readings, and what it takes from the model error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.recordings.reading_flags import time_flags
from discovery.recordings.reading_noise import estimate_noise, noise_flags
from discovery.recordings.rounding import lasting_rounding, quantum, resolution
from discovery.rigs.rig import TimeColumn

STEP, TIME = 0.5, np.arange(4000) * 0.01
ROUNDING = STEP / np.sqrt(12.0)


def rounded(speed: float) -> np.ndarray:
    return STEP * np.round(4000 * speed * np.sin(TIME / 20.0) / STEP)


@given(speed=st.floats(0.002, 20.0))
def test_it_is_what_neighbouring_errors_share(speed: float) -> None:
    true, read = 4000 * speed * np.sin(TIME / 20.0), rounded(speed)
    error = read - true
    shared = np.mean(error[1:] * error[:-1]) / np.mean(error**2)
    found = lasting_rounding(read, float(ROUNDING), STEP) / ROUNDING
    assert 0.0 <= found <= 1.0
    # Errors that hardly share anything count for little, those that last for almost all.
    assert found**2 == pytest.approx(max(shared, 0.0), abs=0.25)


def test_noise_of_several_steps_makes_rounding_random_and_no_step_none() -> None:
    slow = rounded(0.004)
    assert lasting_rounding(slow, float(ROUNDING), STEP) > 0.9 * ROUNDING
    assert lasting_rounding(slow, 3 * float(ROUNDING), STEP) == 0.0
    assert lasting_rounding(np.random.default_rng(0).standard_normal(500), 1.0, 0.0) == 0.0


def test_the_step_of_two_readings_is_their_difference() -> None:
    assert quantum(np.array([0.7, 0.7, np.nan, 1.2, 0.7])) == pytest.approx(0.5)
    assert quantum(np.array([0.7, 0.7, np.nan])) == 0.0


@given(step=st.floats(6.5, 40.0), seed=st.integers(0, 1000), unit=st.sampled_from([1.0, np.pi / 30, 0.01]))
def test_counts_that_were_printed_in_whole_numbers_keep_their_own_step(step: float, seed: int, unit: float) -> None:
    """A speed from the counts of an encoder, in rpm without decimals."""
    rng = np.random.default_rng(seed)
    counts = np.round(8.0 * np.sin(0.05 * np.arange(400)) + rng.standard_normal(400))
    assert quantum(np.round(counts * step) * unit) == pytest.approx(step * unit, rel=0.03)


@given(seed=st.integers(0, 1000), size=st.floats(2.0, 60.0))
def test_whole_numbers_have_no_coarser_step(seed: int, size: float) -> None:
    read = np.round(size * np.random.default_rng(seed).standard_normal(400))
    assert quantum(read) == pytest.approx(1.0)


@pytest.mark.parametrize("count", [60, 300, 3000])
def test_the_step_of_an_encoder_is_seen_behind_the_decimals_that_are_printed(count: int) -> None:
    """Of 3960 counts a turn, printed to 0.01 degrees, a swing passes most once; printed alone it has no other step."""
    time = np.linspace(0.0, 3.0, count)
    swing = 80.0 * np.cos(6.0 * time) * np.exp(-0.2 * time)
    counted = np.round(np.round(swing * 11.0) / 11.0, 2)
    assert quantum(counted) == pytest.approx(1.0 / 11.0, rel=1e-3)
    noisy = counted + np.random.default_rng(1).normal(0.0, 0.1, count)
    assert quantum(np.round(noisy, 2)) in (0.0, pytest.approx(0.01))


@pytest.mark.parametrize("rate", [77.5, 137.3])
def test_a_ramp_has_no_step_but_that_of_its_decimals(rate: float) -> None:
    """What goes on by as much each time lies on a line over its number by itself, also behind a rest."""
    ramp = rate * np.maximum(0.0, np.arange(-0.5, 2.0, 0.01))
    assert quantum(np.round(ramp, 1)) in (0.0, pytest.approx(0.1))
    assert quantum(np.round(ramp[50:], 1)) in (0.0, pytest.approx(0.1))


def test_readings_that_are_stamped_where_a_mark_passes_are_not_rounded():
    marks = STEP * np.arange(60)
    passed = np.log1p(marks / 40.0)  # of a wheel that drag slows down
    assert quantum(marks, passed) == 0.0
    assert resolution(marks, passed) < 1e-12
    assert quantum(marks) == pytest.approx(STEP)  # where nothing is known of the times
    assert quantum(marks, 0.01 * np.arange(60)) == pytest.approx(STEP)  # a steady turn that is read at a rate
    shaken = TIME[:400] + np.random.default_rng(0).uniform(-2e-3, 2e-3, 400)
    assert quantum(STEP * np.round(40.0 * np.sin(shaken) / STEP), shaken) == pytest.approx(STEP)


def test_what_turns_between_two_marks_passes_the_last_one_twice() -> None:
    time = np.linspace(0.0, 6.0, 400_000)
    number = np.floor(10.3 * np.cos(2.0 * time))
    # The encoder's edge between two counts is read when it is passed, either way.
    at = np.flatnonzero(np.diff(number))
    edges = STEP * np.maximum(number[at], number[at + 1])
    assert np.sum(np.diff(edges) == 0.0) >= 2
    assert quantum(edges, time[at]) == 0.0


def test_the_noise_of_marks_is_that_of_the_times_at_which_they_pass():
    """Plain differences of what counts one by one are zero, and say nothing."""
    rng, count = np.random.default_rng(1), np.arange(160.0)
    speed, slowing, error = 0.9, 0.0022, 1e-4
    time = (speed - np.sqrt(speed**2 - 2.0 * slowing * count)) / slowing
    stamped = time + error * rng.standard_normal(160)
    # Errors of stamps are those of turns at the speed there.
    turns = error * float(np.median(speed - slowing * time))
    assert estimate_noise(count, stamped) == pytest.approx(turns, rel=0.3)
    assert noise_flags("n", "rev", stamped, count, turns) == []
    (flag,) = time_flags(3.0 * stamped, TimeColumn(), marks=True)
    assert (flag.code, flag.severity) == ("read_at_marks", "note")


def test_a_step_that_no_two_readings_are_apart_is_seen() -> None:
    """A fast motion passes over its steps by two and more: the smallest difference is twice the step."""
    counts = np.cumsum([0, 0, *np.random.default_rng(1).choice([2, 3, 4, 5, 7, 10, 13, 22, 31, 44], 60)])
    assert quantum(0.006879 * counts) == pytest.approx(0.006879, rel=1e-3)
    # Of few differences a part of the smallest would fit by chance.
    assert quantum(0.006879 * counts[:8]) == 0.0


@given(seed=st.integers(0, 500), size=st.integers(40, 300))
def test_readings_with_noise_have_no_part_of_a_difference_as_their_step(seed: int, size: int) -> None:
    assert quantum(np.cumsum(np.random.default_rng(seed).normal(size=size))) == 0.0


def test_a_signal_that_mostly_rests_tells_its_noise_where_it_moves() -> None:
    """Its rest is one number: the median of differences says nothing, and the last bit is no noise."""
    rng = np.random.default_rng(3)
    moving = np.sin(np.arange(120) / 15.0) + rng.normal(0, 1e-3, 120)
    resting = np.concatenate([np.zeros(300), moving])
    assert 0.5e-3 < estimate_noise(resting) < 3e-3
