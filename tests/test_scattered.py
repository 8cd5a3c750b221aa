"""A declared system whose guesses are far off is started from the recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.recordings.dataset import load_dataset

RIG = """
name = "body on a spring"

[system]
coordinates = { x = "m" }
input = { force = "N" }
kinetic = "mass*dot(x)^2/2"
potential = "stiffness*x^2/2"
dissipation = "loss*dot(x)^2/2"
forces = { x = "force" }
output = "x"
places = { body = "x" }

[system.constants]
mass = { guess = MASS, unit = "kg" }
stiffness = { guess = STIFFNESS, unit = "N / m" }
loss = { guess = LOSS, unit = "N s / m" }

[columns]
time = { name = "t", unit = "s" }
input = { name = "force", unit = "N" }
output = { name = "x", unit = "mm", noise = 0.05 }
"""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sines on a body of 0.5 kg, 80 N/m and 0.4 N s/m, in closed form, from what it does in the steady state."""
    time = np.arange(1200) / 100
    force = np.zeros_like(time)
    x = np.zeros_like(time)
    for frequency, size, phase in ((9.0, 1.0, 0.3), (21.0, 2.0, 1.0)):
        wave = size * np.exp(1j * (frequency * time + phase))
        force += wave.real
        x += (wave / (80.0 - 0.5 * frequency**2 + 0.4j * frequency)).real
    x += np.random.default_rng(3).normal(0.0, 5e-5, time.size)
    path = tmp_path_factory.mktemp("bench") / "record.csv"
    np.savetxt(path, np.column_stack([time, force, 1e3 * x]), "%.8g", ",", header="t,force,x", comments="")
    return path


@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (0.1, 10.0, 10.0), (10.0, 0.1, 0.1), (8.0, 8.0, 0.1)])
def test_guesses_may_be_ten_times_off(record: Path, factors: tuple[float, float, float]) -> None:
    text = RIG
    for word, true, factor in zip(("MASS", "STIFFNESS", "LOSS"), (0.5, 80.0, 0.4), factors, strict=True):
        text = text.replace(word, repr(true * factor))
    rig = record.parent / "rig.toml"
    rig.write_text(text, encoding="utf-8")
    data = load_dataset(rig, [record])
    found = fit(declared_model(data), data.train)
    assert found.reduced_chi2 < 1.2
    assert [found.values[n] for n in ("mass", "stiffness", "loss")] == pytest.approx([0.5, 80.0, 0.4], rel=0.01)
