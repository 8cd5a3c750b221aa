"""An end of a range at which readings waver by a step is found, and turns and standstills are none."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from discovery.recordings.range_ends import cut_off
from discovery.recordings.recording import read_recording
from discovery.recordings.rounding import quantum
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn


def cut(
    samples: int, limit: float, size: float = 4000.0, seed: int = 0, wavers: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Return a decay in steps of one, cut off at a limit where readings waver, and which readings those are."""
    k, rng = np.arange(20 * samples), np.random.default_rng(seed)
    swing = size * np.exp(-0.02 * k / samples) * np.cos(2.0 * np.pi * 1.013 * k / samples + 0.3)
    beyond = np.abs(swing) >= limit * size
    waver = np.where(beyond, -np.sign(swing) * rng.integers(0, wavers + 1, k.size), 0)
    return np.round(np.clip(swing, -limit * size, limit * size) + waver), beyond


@pytest.mark.parametrize("samples", [16, 30, 100])
@pytest.mark.parametrize("limit", [0.4, 0.6, 0.8])
def test_readings_that_waver_at_an_end_are_cut_off(samples, limit):
    values, beyond = cut(samples, limit)
    found, limits = cut_off(values, quantum(values))
    assert limits == (-limit * 4000.0, limit * 4000.0)
    assert found[beyond].all()
    # A motion is hardly ever within a few steps of an end that it does not reach.
    assert found[~beyond].sum() <= 0.02 * values.size + 2


@pytest.mark.parametrize("samples", [8, 13, 20, 60, 400])
@pytest.mark.parametrize("size", [5.0, 20.0, 300.0, 2e4])
@pytest.mark.parametrize("noise", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("form", ["sine", "flat turns", "rounded square"])
@pytest.mark.parametrize("decay", [0.0, 0.02, 0.2])
def test_turns_are_no_ends(samples, size, noise, form, decay):
    turn = 2.0 * np.pi / samples * np.arange(25 * samples) + 0.4
    swing = np.exp(-decay * turn) * np.cos(turn)
    if form == "flat turns":
        swing = swing - 0.12 * np.exp(-decay * turn) * np.cos(3.0 * turn)
    elif form == "rounded square":
        swing = np.tanh(1.5 * swing)
    values = np.round(size * swing + noise * np.random.default_rng(3).standard_normal(turn.size))
    assert cut_off(values, quantum(values))[1] == ()


@pytest.mark.parametrize("rest", [3, 6, 20, 60])
@pytest.mark.parametrize("half", [8, 20, 50])
@pytest.mark.parametrize("size", [20.0, 300.0, 5000.0])
def test_a_body_that_rests_where_it_turns_is_at_no_end(rest, half, size):
    way = 0.5 - 0.5 * np.cos(np.pi * np.arange(half) / half)
    values = np.round(size * np.tile(np.concatenate([way, np.ones(rest), 1.0 - way, np.zeros(rest)]), 8))
    assert cut_off(values, quantum(values))[1] == ()


def test_cut_off_readings_are_left_out_and_are_no_noise(tmp_path):
    rng = np.random.default_rng(4)
    values, beyond = cut(30, 0.6)
    values = np.where(beyond, values, np.round(values + 4.0 * rng.standard_normal(values.size)))
    pd.DataFrame({"t": 0.001 * np.arange(values.size), "y": values}).to_csv(tmp_path / "r.csv", index=False)
    rig = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("y", "mV", reads="position")))
    recording = read_recording(tmp_path / "r.csv", rig)
    assert any("'y' saturates at -2400 mV and 2400 mV" in note for note in recording.notes)
    assert np.isnan(recording.output[beyond, 0]).all()
    assert recording.noise[0] == pytest.approx(4e-3, rel=0.3)
