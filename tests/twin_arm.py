"""Recordings of the twin as experiments, for tests of what happens after a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.manoeuvres import Manoeuvre
from discovery_datasets.quick import readings
from discovery_datasets.twin import PAPER_RIG, ArmRig

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.declared import rig_uncertainty
from discovery.estimation.fit import Fit, fit
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import known_values
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Quantity, Rig

#: What the bare exact arm declares, and what the shared kernel may add to it.
BASE = ("viscous_damping", "linear_stiffness")
EFFECTS = (
    "base_compliance",
    "encoder_ripple",
    "linear_stiffness",
    "position_scale",
    "sensor_delay",
    "structural_damping",
    "table_tilt",
    "viscous_damping",
)
STEP = 5.5e-3


def rig_file(rig: ArmRig = PAPER_RIG, *, noise: float = 3e-4, **quantities: Quantity) -> Rig:
    """Return what the experimenter of an arm would state."""
    stated = {
        "length": Quantity(rig.length, 1e-3 * rig.length),
        "tip_mass": Quantity(rig.tip_mass, 5e-3 * rig.tip_mass),
        "beam_mass": Quantity(rig.beam_mass, 2e-2 * rig.beam_mass),
        "flexural_rigidity": Quantity(rig.flexural_rigidity, 2e-2 * rig.flexural_rigidity),
    }
    return Rig("arm", **{**stated, **quantities}, position_noise=noise, angle_noise=7e-5)


def recorded(
    manoeuvre: Manoeuvre,
    *hidden: Disturbance,
    rig: ArmRig = PAPER_RIG,
    stated: Rig | None = None,
    duration: float = 6.0,
    rate: float = 100.0,
    seed: int = 0,
    name: str = "first",
) -> Experiment:
    """Return a noisy recording of the twin with hidden effects."""
    stated = stated or rig_file(rig)
    noise = stated.position_noise
    assert noise is not None
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate) + 1) / rate
    seen = readings(rig, manoeuvre, time, disturbances=hidden)
    tip = np.column_stack([seen.reading_x, seen.reading_y]) + noise * rng.standard_normal((time.size, 2))
    motor = seen.motor_angle + rng.uniform(-7e-5, 7e-5, time.size)
    recording = Recording(name, time, motor, tip, ("tip_x", "tip_y"), ("m", "m"), np.full(2, noise), "", "")
    return make_experiment(recording, stated)


def fitted(
    experiments: Sequence[Experiment],
    *effects: str,
    gaussian: Mapping[str, tuple[float, float]] | None = None,
    start: Fit | None = None,
) -> Fit:
    """Fit the exact arm with effects, on the kernel that all tests share, from where another fit ended."""
    first = experiments[0]
    return fit(
        Model("elastica", (*BASE, *effects), known_values(first)),
        experiments,
        start=None if start is None else {n: v for n, v in start.values.items() if "[" not in n},
        bench=Bench("elastica", EFFECTS, experiments, STEP),
        units=natural_units(experiments),
        gaussian={**rig_uncertainty(first), **(gaussian or {})},
    )
