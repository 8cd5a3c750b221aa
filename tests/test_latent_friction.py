"""A missing force beside dry friction, whose creep speed is far below what a step of the reconstruction resolves."""

from __future__ import annotations

import numpy as np
import pytest
from pushed_oscillator import NOISE, RIG, TIME, pushes
from scipy.integrate import solve_ivp

from discovery.diagnosis.latent_force import reconstruct
from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording

FRICTION, CREEP = 0.05, 1e-5


def force(t):
    """A force that no effect of the model makes."""
    return 0.06 * np.exp(-(((t - 9.0) / 1.2) ** 2))


def experiment() -> Experiment:
    drive = pushes(1.0, -1.5, 0.7, 0.3)

    def slopes(t, y):
        push = drive.evaluate(np.array([t]))[0][0] + force(t)
        return [y[1], push - 0.08 * y[1] - 9.0 * y[0] - FRICTION * y[1] / np.hypot(y[1], CREEP)]

    solved = solve_ivp(slopes, (0.0, 20.0), (0.25, 0.0), method="LSODA", t_eval=TIME, rtol=1e-8, atol=1e-10)
    read = solved.y[0] + NOISE * np.random.default_rng(7).standard_normal(TIME.size)
    recording = Recording(
        "r", TIME, drive.evaluate(TIME)[0], read[:, None], ("output",), ("V",), np.array([NOISE]), sha256="", source=""
    )
    return Experiment(recording, drive, RIG)


def test_a_force_is_seen_beside_friction_that_sticks() -> None:
    model = Model("oscillator", ("viscous_damping", "linear_stiffness", "coulomb_friction"), {"v_c": CREEP, "g": 1.0})
    found = reconstruct(fit(model, [experiment()], start={"xi": 0.08, "alpha": 9.0, "f_c": FRICTION}))
    wanted = force(found.time)
    assert np.corrcoef(found.mean, wanted)[0, 1] > 0.8
    assert found.mean[np.argmax(wanted)] == pytest.approx(wanted.max(), rel=0.3)
