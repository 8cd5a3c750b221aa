"""The models whose posteriors are calibrated, each on a recording of its own kind."""

from __future__ import annotations

from functools import cache

import numpy as np
from discovery_datasets.manoeuvres import trapezoid

from benchmarks.calibration.replicate import Study
from discovery.equations.model import Model
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.step import choose_step
from discovery.posterior.noise import GAUSSIAN
from discovery.recordings.experiment import make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Quantity, Rig

PAPER = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law")
#: Around the paper's fit, wide enough for the data to decide and narrow enough for one swing to be one swing.
PRIORS = {"xi": (0.0458, 0.01), "alpha": (8.79, 0.3), "beta": (0.51, 0.15), "gamma": (0.446, 0.01)}
#: An initial deflection of about 0.05 rad, and a rate of about 0.15 rad/s.
UNITS = NaturalUnits(time=1 / 3, coordinate=0.05, length=1.0)
#: Name, title, added effects, noise model, duration [s], rate [Hz], camera noise [m].
KINDS = {
    "gaussian": ("the paper's model, white Gaussian noise", (), GAUSSIAN, 10.0, 50.0, 3e-4),
    "few_readings": ("the paper's model, 60 readings with 3 mm of noise", (), GAUSSIAN, 3.0, 10.0, 3e-3),
    "student_t": ("the paper's model, noise with outliers", (), "student_t", 10.0, 50.0, 3e-4),
    "correlated": ("the paper's model, correlated noise", (), "correlated", 10.0, 50.0, 3e-4),
    "coulomb_friction": ("with dry friction, white Gaussian noise", ("coulomb_friction",), GAUSSIAN, 10.0, 50.0, 3e-4),
}


@cache
def study(name: str) -> Study:
    """Return a study by its name."""
    title, added, noise, duration, rate, camera = KINDS[name]
    time = np.arange(round(duration * rate) + 1) / rate
    motor = trapezoid(1.0, 1.25)(time)[0]
    nothing = np.zeros((time.size, 2))
    noises = np.full(2, camera)
    recording = Recording(name, time, motor, nothing, ("tip_x", "tip_y"), ("m", "m"), noises, name, "")
    rig = Rig("arm", length=Quantity(1.0, 1e-3), position_noise=camera, angle_noise=7e-5)
    experiment = make_experiment(recording, rig)
    model = Model("constant_radius", (*PAPER, *added), {"length": 1.0})
    middle = {name: mean for name, (mean, _) in PRIORS.items()}
    step = choose_step(model, [experiment], UNITS, middle)
    return Study(name, title, model, experiment, PRIORS, UNITS, step, noise)
