"""An oscillator pushed by steps of a force, simulated with any effect of the catalogue."""

from __future__ import annotations

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.natural_units import NaturalUnits
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.testing.states import every_effect

TRUTH = {"g": 1.0, "xi": 0.08, "alpha": 9.0}
DECLARED = ("viscous_damping", "linear_stiffness")
EFFECTS = every_effect("oscillator")
UNITS = NaturalUnits(1 / 3, 0.3, 1.0)
NOISE = 1e-3
TIME = np.linspace(0.0, 20.0, 801)
RIG = Rig("o", "oscillator", columns=Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V")))
_EDGES = np.array([0.0, 1.0, 2.5, 6.0, 20.0])


def pushes(*sizes: float) -> Drive:
    return Drive(_EDGES, np.array([sizes]), _EDGES[1:-1])


def experiment(name: str, output: np.ndarray, drive: Drive) -> Experiment:
    recording = Recording(
        name, TIME, drive.evaluate(TIME)[0], output[:, None], ("output",), ("V",), np.array([NOISE]), "", ""
    )
    return Experiment(recording, drive, RIG)


def recorded(name: str, drive: Drive, seed: int, **effects: float) -> Experiment:
    """Simulate a recording with the given parameters of effects that the declared model lacks."""
    b = Bench("oscillator", EFFECTS, [experiment(name, np.zeros(TIME.size), drive)], 0.02)
    whole = Model("oscillator", EFFECTS)
    values = {n: p.default * UNITS.scale(p) for n, p in whole.parameters.items()} | TRUTH | effects
    (clean,) = b.predict(np.array([[values[n]] for n in b.names]), np.array([[[0.25], [0.0]]]))
    return experiment(name, clean[:, 0, 0] + NOISE * np.random.default_rng(seed).standard_normal(TIME.size), drive)
