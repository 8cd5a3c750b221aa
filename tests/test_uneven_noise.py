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
        assert "in 'a'. One sensor reads both" in flags[0].sentence
