"""Noise that a filter has passed is told from white noise and from motion, and what is averaged is worth its noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import butter, lfilter

from discovery.recordings.averaging import averaged_down
from discovery.recordings.flags import OVERSTATED, UNDERSTATED
from discovery.recordings.reading_noise import BandNoise, band_noise, estimate_noise
from discovery.recordings.recording import Recording, read_recording
from discovery.rigs.rig import Rig
from discovery.rigs.rig_file import read_rig

STEP, COUNT, SIZE = 1e-3, 12_000, 0.01
T = STEP * np.arange(COUNT)
RIG = """
name = "bench"
kind = "oscillator"
[columns]
time = {{ name = "t", unit = "s" }}
{input}
output = {{ name = "y", unit = "m"{noise} }}
[model]
effects = ["viscous_damping", "linear_stiffness"]
"""


def white(seed: int, size: int = COUNT) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(size)


def low_passed(cutoff: float, seed: int = 0, order: int = 2, size: int = COUNT) -> np.ndarray:
    """Noise of unit variance, of which a filter passes what is below a share of half the sampling rate."""
    passed = lfilter(*butter(order, cutoff), white(seed, size + 2000))[2000:]
    return np.asarray(passed / passed.std())


def sliding() -> np.ndarray:
    """The speed of a swing with dry friction, of unit standard deviation."""

    def rates(_: float, x: np.ndarray) -> list[float]:
        return [x[1], -200 * x[0] - 0.05 * x[1] - 1.2 * np.tanh(x[1] / 0.02)]

    speed = solve_ivp(rates, (0, T[-1]), [1.0, 0.0], t_eval=T, rtol=1e-7, atol=1e-9).y[1]
    return np.asarray(speed / speed.std())


def kicked() -> np.ndarray:
    """A swing with a mode that rings when it is struck, at any time."""
    rng = np.random.default_rng(3)
    kicks = np.zeros(COUNT)
    kicks[rng.integers(0, COUNT, 40)] = rng.standard_normal(40)
    ringing = (np.exp(-40 * T) * np.sin(300 * T))[:600]
    return np.sin(14 * T) + 0.05 * np.convolve(kicks, ringing)[:COUNT]


def multisine() -> np.ndarray:
    lines = np.zeros(COUNT // 2 + 1, complex)
    lines[1 : COUNT // 10] = np.exp(2j * np.pi * np.random.default_rng(4).random(COUNT // 10 - 1))
    drive = np.fft.irfft(lines, COUNT)
    return np.asarray(drive / drive.std())


DECAY = np.exp(-0.1 * T) * np.cos(14 * T)
MOTIONS = {
    "decay": DECAY,
    "dry friction": sliding(),
    "struck mode": kicked(),
    "two modes": DECAY + 0.05 * np.exp(-2 * T) * np.cos(150 * T),
    "encoder": np.round(DECAY / 0.02) * 0.02,
    "steps": lfilter(*butter(2, 0.01), np.sign(np.sin(4 * T))),
}


def found(values: np.ndarray, given: np.ndarray | None = None) -> BandNoise | None:
    time = STEP * np.arange(values.size)
    return band_noise(time, values, estimate_noise(values, time), given)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("size", [0.0, 1e-3, SIZE])
def test_motions_and_white_noise_are_none(motion: str, size: float) -> None:
    assert found(MOTIONS[motion] + size * white(1)) is None


def test_what_an_input_moves_is_none() -> None:
    drive = multisine()
    # A mass moves less above its resonance; the motion is small beside a slow swing.
    moved = DECAY + SIZE * lfilter(*butter(1, 0.1), drive) + 1e-4 * white(1)
    assert found(moved) is not None
    assert found(moved, drive) is None


@pytest.mark.parametrize("motion", ["decay", "dry friction"])
@pytest.mark.parametrize("cutoff", [0.1, 0.24, 0.5])
def test_filtered_noise_has_its_size_and_memory(motion: str, cutoff: float) -> None:
    errors = low_passed(cutoff)
    noise = found(MOTIONS[motion] + SIZE * errors, np.sin(14 * T))
    assert noise is not None
    assert noise.sd == pytest.approx(SIZE, rel=0.05)
    # Means over many readings scatter so much more than those of independent noise.
    means = low_passed(cutoff, seed=5, size=400_000).reshape(-1, 200).mean(axis=1)
    assert noise.alike == pytest.approx(200 * np.var(means), rel=0.25)
    assert estimate_noise(DECAY + SIZE * errors) < SIZE / 4


def test_noise_that_grows_with_the_motion_or_is_its_size_is_none() -> None:
    assert found(MOTIONS["decay"] + SIZE * low_passed(0.24)) is not None
    assert found(MOTIONS["decay"] + SIZE * np.exp(-0.3 * T) * low_passed(0.24)) is None
    assert found(0.02 * MOTIONS["decay"] + SIZE * low_passed(0.24)) is None


def rig_of(path: Path, noise: str = "", given: str = "") -> Rig:
    (path / "rig.toml").write_text(RIG.format(noise=noise, input=given))
    return read_rig(path / "rig.toml")


def reading(path: Path, rig: Rig, readings: np.ndarray, u: np.ndarray | None = None) -> Recording:
    table = {"t": STEP * np.arange(readings.size), "y": readings} | ({} if u is None else {"u": u})
    pd.DataFrame(table).to_csv(path / "one.csv", index=False)
    return read_recording(path / "one.csv", rig)


def test_readings_are_averaged_until_neighbours_are_independent(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    read = reading(tmp_path, rig, DECAY + SIZE * low_passed(0.24))
    assert read.noise[0] == pytest.approx(SIZE, rel=0.05)
    (flag,) = (f for f in read.flags if f.code == "noise_alike")
    assert "'y' err alike" in flag.sentence
    kept = averaged_down(read, rig)
    assert kept.time.size < COUNT / 6
    errors = kept.output[1:-1, 0] - np.exp(-0.1 * kept.time[1:-1]) * np.cos(14 * kept.time[1:-1])
    assert np.std(errors) == pytest.approx(kept.noise[0], rel=0.15)
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 0.2
    assert kept.bands == ()


def test_a_stated_noise_stays_and_is_scaled_by_what_averages_give(tmp_path: Path) -> None:
    readings = DECAY + SIZE * low_passed(0.24)
    for stated, code in ((SIZE, None), (0.1 * SIZE, UNDERSTATED), (5 * SIZE, OVERSTATED)):
        rig = rig_of(tmp_path, f", noise = {stated}")
        read = reading(tmp_path, rig, readings)
        assert read.noise[0] == stated
        assert [f.code for f in read.flags if f.code in (UNDERSTATED, OVERSTATED)] == ([code] if code else [])
        kept = averaged_down(read, rig)
        (band,), length = read.bands, COUNT // kept.time.size
        assert band is not None
        assert length >= 2 * band.alike
        assert kept.noise[0] == pytest.approx(stated * np.sqrt(band.alike / length), rel=1e-6)


def test_short_recordings_are_averaged_too_unless_their_motion_needs_every_reading(tmp_path: Path) -> None:
    rig = rig_of(tmp_path)
    count = 3000
    slow = DECAY[:count] + SIZE * low_passed(0.4, size=count)
    assert averaged_down(reading(tmp_path, rig, slow), rig).time.size < count / 3
    ringing = DECAY + 0.3 * np.cos(250 * T) + SIZE * low_passed(0.4)
    kept = averaged_down(reading(tmp_path, rig, ringing), rig)
    assert kept.time.size == COUNT
    assert kept.flags[-1].code == "alike_kept"
    assert kept.flags[-1].severity == "doubt"


def test_a_held_input_keeps_readings_and_says_what_they_are_worth(tmp_path: Path) -> None:
    rig = rig_of(tmp_path, given='input = { name = "u", unit = "N", interpolation = "hold" }')
    kept = averaged_down(reading(tmp_path, rig, DECAY + SIZE * low_passed(0.24), 0.0 * T), rig)
    assert kept.time.size == COUNT
    assert "err alike, and are not averaged" in kept.notes[-1]


@pytest.mark.parametrize("alternates", [True, False])
def test_readings_that_err_in_opposite_directions_are_told(tmp_path: Path, alternates: bool) -> None:
    # A speed by counts, each in one of two places: what one reading has too much, its neighbour lacks.
    rng, sign = np.random.default_rng(2), np.where(np.arange(600) % 2, 1.0, -1.0)
    errors = rng.standard_normal(600) if not alternates else sign * (1.0 + 0.3 * rng.standard_normal(600))
    read = reading(tmp_path, rig_of(tmp_path), DECAY[:600] + SIZE * errors)
    assert ["noise_alternates"] * alternates == [f.code for f in read.flags if f.code == "noise_alternates"]


@pytest.mark.parametrize("count", [70, 100, 400])
def test_few_readings_that_alternate_are_no_noisier_than_they_scatter(count: int) -> None:
    time, sign = np.arange(count), np.where(np.arange(count) % 2, 1.0, -1.0)
    rise, found = 1.0 - np.exp(-time / 2.5), []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        found.append(estimate_noise(rise + 0.05 * (sign + 0.6 * rng.standard_normal(count))) / 0.058)
    # Differences alone tell twice the scatter.
    assert np.mean(np.array(found) < 1.5) > 0.85
    white = [estimate_noise(np.random.default_rng(seed).standard_normal(count)) for seed in range(500)]
    assert np.mean(np.array(white) < 0.4) < 0.01
