from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.foundation.errors import InputError
from discovery.recordings.averaging import averaged
from discovery.recordings.experiment import make_experiment
from discovery.recordings.recording import read_recording
from discovery.recordings.time_stamps import estimate_jitter, scatter, stamp_deviation
from discovery.rigs.rig_file import read_rig

STEP, COUNT, RATE, NOISE, JITTER = 0.01, 4000, 6.0, 1e-3, 1e-3
STEADY = STEP * np.arange(COUNT)


def swing(time: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-0.02 * time) * np.cos(RATE * time))


def stamped(seed: int = 0) -> tuple[np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return STEADY + JITTER * rng.standard_normal(COUNT), rng


def written(folder: Path, time: np.ndarray, values: np.ndarray, jitter: str = "") -> tuple[Path, Path]:
    rig, data = folder / "rig.toml", folder / "swing.csv"
    rig.write_text(
        'name = "swing"\nkind = "oscillator"\n[columns]\n'
        f'time = {{ name = "t", unit = "ms"{jitter} }}\noutput = {{ name = "q", unit = "rad", noise = {NOISE} }}\n'
    )
    np.savetxt(data, np.column_stack([1e3 * time, values]), delimiter=",", header="t,q", comments="", fmt="%.9g")
    return rig, data


def test_a_reading_errs_by_its_noise_and_by_its_slope_times_the_error_of_its_stamp() -> None:
    values = np.column_stack([3.0 * STEADY, np.full(COUNT, 7.0)])
    values[10, 0] = np.nan
    found = scatter(STEADY, values, np.array([4e-3, 2e-3]), 1e-3)
    assert found == pytest.approx(np.broadcast_to([5e-3, 2e-3], found.shape))
    assert scatter(STEADY, values, np.array([4e-3, 2e-3]), 0.0) == pytest.approx(
        np.broadcast_to([4e-3, 2e-3], found.shape)
    )


def test_stamps_that_err_are_told_from_samples_that_are_not_steady() -> None:
    stamps, rng = stamped()
    noise = NOISE * rng.standard_normal(COUNT)
    assert stamp_deviation(stamps) == pytest.approx(JITTER, rel=0.1)
    # The samples are steady, and their stamps err.
    assert estimate_jitter(stamps, swing(STEADY) + noise, NOISE) == pytest.approx(JITTER, rel=0.15)
    # The stamps are right, and the samples are not steady.
    assert estimate_jitter(stamps, swing(stamps) + noise, NOISE) == 0.0
    # A steady clock does not err, whatever the noise is.
    assert estimate_jitter(STEADY, swing(STEADY) + 5 * noise, NOISE) == 0.0


def test_rounded_stamps_are_not_taken_for_stamps_that_err() -> None:
    _, rng = stamped()
    rounded = np.round(STEADY + STEP / 3, 7)
    read = swing(STEADY + JITTER * rng.standard_normal(COUNT)) + NOISE * rng.standard_normal(COUNT)
    assert stamp_deviation(rounded) > 0
    assert estimate_jitter(rounded, read, NOISE) == 0.0


def test_a_coarse_encoder_is_not_taken_for_stamps_that_err() -> None:
    # Readings in steps stand still where the motion is slow: they seem to have no noise there.
    stamps, _ = stamped()
    quantum = 5e-3
    read = quantum * np.round(swing(stamps) / quantum)
    assert estimate_jitter(stamps, read, quantum / np.sqrt(12)) == 0.0


def test_noise_that_is_stated_too_small_is_not_taken_for_stamps_that_err() -> None:
    stamps, rng = stamped()
    read = swing(stamps) + NOISE * rng.standard_normal(COUNT)
    assert estimate_jitter(stamps, read, 0.1 * NOISE) == 0.0


def test_stated_jitter_weighs_less_what_moves_fast(tmp_path: Path) -> None:
    rig_path, data = written(tmp_path, STEADY, swing(STEADY), ", jitter = 2.0")
    rig = read_rig(rig_path)
    recording = read_recording(data, rig)
    assert recording.jitter == pytest.approx(2e-3)
    weights = make_experiment(recording, rig).weights()[:, 0]
    speed = RATE * np.sin(RATE * STEADY) * np.exp(-0.02 * STEADY)
    assert weights == pytest.approx(1 / np.hypot(NOISE, 2e-3 * speed), rel=0.03)
    # Averages over four readings have half the error of their stamps, too.
    assert averaged(recording, 4).jitter == pytest.approx(1e-3)


def test_jitter_that_nobody_stated_is_estimated_and_told(tmp_path: Path) -> None:
    stamps, rng = stamped()
    rig_path, data = written(tmp_path, stamps, swing(STEADY) + NOISE * rng.standard_normal(COUNT))
    recording = read_recording(data, read_rig(rig_path))
    assert recording.jitter == pytest.approx(JITTER, rel=0.2)
    assert any("time stamps erred by 0.001 s" in note for note in recording.notes)
    # Standardised by it, what is left of the true motion is white noise of unit size, fast or slow.
    left = (recording.output[:, 0] - swing(stamps)) / recording.scatter[:, 0]
    fast = np.abs(np.sin(RATE * STEADY)) > 0.7
    assert np.std(left[fast]) == pytest.approx(1.0, rel=0.15)
    assert np.std(left[~fast]) == pytest.approx(1.0, rel=0.15)
    # Stated as none, it is not estimated.
    (tmp_path / "none").mkdir()
    rig_path, data = written(tmp_path / "none", stamps, swing(STEADY), ", jitter = 0.0")
    assert read_recording(data, read_rig(rig_path)).jitter == 0.0


def test_a_negative_jitter_is_refused(tmp_path: Path) -> None:
    rig_path, _ = written(tmp_path, STEADY, swing(STEADY), ", jitter = -1.0")
    with pytest.raises(InputError, match="jitter"):
        read_rig(rig_path)
