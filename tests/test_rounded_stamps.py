"""Time stamps that a file rounds: a steady clock explains them, and readings fit it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.recordings.dataset import load_dataset
from discovery.recordings.recording import read_recording
from discovery.recordings.time_stamps import steady_clock
from discovery.rigs.rig_file import read_rig

FILM = 2.7 + np.delete(np.arange(150), [40, 41, 90]) / 29.97  # three pictures are lost
NOISE = np.random.default_rng(1).normal(0.0, 1e-3, FILM.size)


def swing(time: np.ndarray) -> np.ndarray:
    return np.asarray(np.cos(7.0 * time))


@pytest.mark.parametrize("form", ["%.2f", "%.3g"])
@pytest.mark.parametrize("unit", [1.0, 1e3], ids=["s", "ms"])
def test_times_of_a_film_are_found_again(form: str, unit: float) -> None:
    stamps = np.array([float(form % time) for time in FILM]) * unit
    found = steady_clock(stamps, [swing(FILM) + NOISE])
    assert found is not None
    assert np.abs(found.time / unit - FILM).max() < 0.1 * np.abs(stamps / unit - FILM).max()
    assert unit / found.step == pytest.approx(29.97, rel=2e-3)
    assert found.rounding == pytest.approx(0.01 * unit)


@pytest.mark.parametrize("form", ["%.2f", "%.2E"])
def test_stamps_that_repeat_since_they_are_rounded_so_far_are_told_apart(tmp_path: Path, form: str) -> None:
    film = np.arange(400) / 119.88  # steps are shorter than the rounding
    stamps, readings = np.array([float(form % time) for time in film]), swing(film)
    assert (np.diff(stamps) == 0.0).any()
    found = steady_clock(stamps, [readings])
    assert found is not None
    assert np.abs(found.time - film).max() < 2e-3
    assert 1.0 / found.step == pytest.approx(119.88, rel=2e-3)
    data, rig = tmp_path / "film.csv", tmp_path / "rig.toml"
    np.savetxt(data, np.column_stack([film, readings]), [form, "%.6f"], ",", header="t,q", comments="")
    rig.write_text(
        'name = "film"\nkind = "oscillator"\n[columns]\ntime = { name = "t" }\noutput = { name = "q", unit = "m" }'
    )
    assert np.abs(read_recording(data, read_rig(rig)).time - film).max() < 2e-3


@pytest.mark.parametrize("start", [0.07, 511.87], ids=["near", "far"])
def test_stamps_most_of_which_repeat_are_told_apart(tmp_path: Path, start: float) -> None:
    time = start + np.arange(400) / 49.9  # five readings to a stamp
    readings, data, rig = swing(time), tmp_path / "phone.csv", tmp_path / "rig.toml"
    assert np.median(np.diff(np.round(time, 1))) == 0.0
    np.savetxt(data, np.column_stack([time, readings]), ["%.1f", "%.6f"], ",", header="t,q", comments="")
    rig.write_text(
        'name = "phone"\nkind = "oscillator"\n[columns]\ntime = { name = "t" }\noutput = { name = "q", unit = "m" }\n'
        '[records]\ntrain = [{ file = "phone.csv" }]'
    )
    recording = load_dataset(rig).train[0].recording  # which counts times from where they begin, if that is far
    assert "times_rounded" in [flag.code for flag in recording.flags]
    assert np.ptp(recording.time - time) < 0.02


def test_rows_that_stand_twice_are_no_rounding() -> None:
    time = np.insert(np.arange(300) / 100, 120, 1.2)
    assert steady_clock(time, [swing(time)]) is None
    assert steady_clock(time) is None


def test_stamps_that_are_missing_or_go_back_are_left_to_the_check() -> None:
    time = np.round(np.arange(200) / 119.88, 2)
    gap, back = time.copy(), time.copy()
    gap[50], back[100:] = np.nan, back[:100]
    for stamps in (gap, back, np.full(200, 1.0)):
        assert steady_clock(stamps, [np.cos(np.arange(200.0))]) is None


def test_where_samples_are_not_steady_no_clock_is_made() -> None:
    uneven = FILM + np.random.default_rng(2).normal(0.0, 4e-3, FILM.size)
    assert steady_clock(np.round(uneven, 2), [swing(uneven) + NOISE]) is None
    assert steady_clock(uneven, [swing(uneven) + NOISE]) is None


def test_readings_that_were_taken_at_the_stamps_keep_them() -> None:
    ticks = np.round(FILM, 2)  # a computer that reads at the tick of its clock
    assert steady_clock(ticks, [np.zeros(FILM.size), swing(ticks) + NOISE]) is None
    assert steady_clock(ticks, [swing(FILM) + NOISE]) is not None


def test_a_body_that_rests_does_not_hide_what_its_motion_tells() -> None:
    ticks = np.round(FILM, 2)
    for begin in (3.0, 4.5, 6.0):  # it rests for up to two thirds
        for time, taken_on_the_clock in ((ticks, False), (FILM, True)):
            motion = swing(np.maximum(time - begin, 0.0)) + NOISE
            assert (steady_clock(ticks, [motion]) is not None) == taken_on_the_clock
            motion[[20, 130]] += 50.0  # wild readings
            assert (steady_clock(ticks, [motion]) is not None) == taken_on_the_clock


def test_an_input_that_jumps_does_not_tell_what_is_smooth() -> None:
    rng = np.random.default_rng(3)
    for at in rng.integers(5, FILM.size - 5, (40, 3)):
        held = np.cumsum(np.isin(np.arange(FILM.size), at) * rng.uniform(-1.0, 1.0, FILM.size))
        assert steady_clock(np.round(FILM, 2), [held, swing(FILM) + NOISE]) is not None


def test_even_stamps_of_which_some_are_off_by_one_have_no_clock_between_them() -> None:
    ticks = 10.0 * np.arange(150)
    ticks[[52, 90, 91]] += 1.0
    assert steady_clock(ticks, [np.zeros(150)]) is None
    assert steady_clock(np.round(np.arange(150) / 8.0, 2)) is not None  # every other one between two decimals


def test_stamps_that_are_off_by_nothing_that_matters_stay() -> None:
    assert steady_clock(np.round(FILM, 5)) is None
    assert steady_clock(np.arange(100) / 50) is None


def test_a_recording_takes_the_times_of_the_clock_and_says_so(tmp_path: Path) -> None:
    data, rig = tmp_path / "film.csv", tmp_path / "rig.toml"
    np.savetxt(data, np.column_stack([FILM, swing(FILM) + NOISE]), ["%.2f", "%.6f"], ",", header="t,q", comments="")
    columns = 'time = {{ name = "t"{} }}\noutput = {{ name = "q", unit = "m" }}'
    text = f'name = "film"\nkind = "oscillator"\n[columns]\n{columns}'
    rig.write_text(text.format(""))
    found = read_recording(data, read_rig(rig))
    assert np.abs(found.time - FILM).max() < 1e-3
    assert any("rounded to 0.01 s: a steady clock of 29.9" in note for note in found.notes)
    assert not any("jitter:" in note for note in found.notes)
    rig.write_text(text.format(", jitter = 0"))
    kept = read_recording(data, read_rig(rig))
    assert kept.time == pytest.approx(np.round(FILM, 2))
