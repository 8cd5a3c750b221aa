"""Recordings of one sensor whose estimated noise differs far are told."""

from pathlib import Path

import numpy as np
import pytest

from discovery.recordings.dataset import load_dataset

RIG = """name = "spring"
kind = "oscillator"

[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "x", unit = "mm"{noise} }}

[model]
effects = ["viscous_damping"]

[records]
train = [{{ file = "a.csv" }}, {{ file = "b.csv" }}]
"""
TIME = np.arange(600) * 0.011


@pytest.mark.parametrize(
    ("less", "stated", "told"), [(40.0, "", True), (4.0, "", False), (40.0, ", noise = 0.1", False)]
)
def test_a_recording_that_hides_its_noise_is_doubted(tmp_path: Path, *, less: float, stated: str, told: bool) -> None:
    rng = np.random.default_rng(8)
    for name, noise, start in (("a", 0.1, 20.0), ("b", 0.1 / less, 15.0)):
        read = start * np.exp(-0.3 * TIME) * np.cos(9.0 * TIME) + noise * rng.standard_normal(TIME.size)
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([TIME, read]), "%.7f", ",", header="t,x", comments="")
    (tmp_path / "rig.toml").write_text(RIG.format(noise=stated))
    loud, quiet = (e.recording for e in load_dataset(tmp_path / "rig.toml").train)
    assert not [f for f in loud.flags if f.code == "noise_uneven"]
    flags = [f for f in quiet.flags if f.code == "noise_uneven"]
    assert bool(flags) is told
    if told:
        assert flags[0].severity == "doubt"
        assert flags[0].numbers["sd"] == pytest.approx(0.1e-3 / less, rel=0.1)  # m
        assert "in 'a', of one sensor" in flags[0].sentence


def test_a_fast_recording_that_is_averaged_is_not_told_to_hide_its_noise(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for name, noise, time in (("a", 0.1, np.arange(600) * 0.011), ("b", 0.025, np.arange(66_000) * 1e-4)):
        read = 20.0 * np.exp(-0.3 * time) * np.cos(9.0 * time) + noise * rng.standard_normal(time.size)
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([time, read]), "%.7f", ",", header="t,x", comments="")
    (tmp_path / "rig.toml").write_text(RIG.format(noise=""))
    slow, fast = (e.recording for e in load_dataset(tmp_path / "rig.toml").train)
    assert "averaged" in [f.code for f in fast.flags]
    assert fast.noise[0] < 0.1 * slow.noise[0]
    assert "noise_uneven" not in [f.code for f in (*slow.flags, *fast.flags)]
