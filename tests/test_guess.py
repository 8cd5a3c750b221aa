from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.estimation.guess import scan
from discovery.estimation.natural_units import natural_units
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

LINEAR = ("viscous_damping", "linear_stiffness")
TIME = np.linspace(0.0, 30.0, 1501)
NOISE = 1e-3


def free_decay(alpha: float, xi: float, seed: int = 0, amplitude: float = 0.3) -> Experiment:
    """Exact damped cosine of unit inertia."""
    rate = np.sqrt(alpha - xi**2 / 4)
    motion = amplitude * np.exp(-xi * TIME / 2) * np.cos(rate * TIME + 0.4)
    noisy = motion + NOISE * np.random.default_rng(seed).standard_normal(TIME.size)
    recording = Recording("d", TIME, None, noisy[:, None], ("output",), ("V",), np.array([NOISE]), "", "")
    return Experiment(
        recording, None, Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "V")))
    )


def forced(g: float, alpha: float, xi: float, seed: int = 0) -> Experiment:
    """Steady response to five sines, exact."""
    rng = np.random.default_rng(seed)
    rates, phases = np.sqrt(alpha) * np.array([0.3, 0.7, 0.95, 1.2, 1.6]), rng.uniform(0, 2 * np.pi, 5)
    response = g / (alpha - rates**2 + 1j * xi * rates)
    wave = np.exp(1j * (np.multiply.outer(TIME, rates) + phases))
    u, y = wave.real.sum(axis=1), (wave * response).real.sum(axis=1)
    noisy = y + NOISE * rng.standard_normal(TIME.size)
    recording = Recording("f", TIME, u, noisy[:, None], ("output",), ("V",), np.array([NOISE]), "", "")
    columns = Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V"))
    from discovery.recordings.smooth_input import build_drive

    rig = Rig("o", "oscillator", columns=columns)
    drive = build_drive(recording, rig)
    return Experiment(recording, drive, rig)


def slip(alpha: float, guess: float) -> float:
    """Return by how much of a period guess and truth drift apart over the recording."""
    return abs(np.sqrt(guess) - np.sqrt(alpha)) * TIME[-1] / (2 * np.pi)


@settings(deadline=None, max_examples=15)
@given(st.floats(2.0, 60.0), st.floats(0.01, 0.3), st.integers(0, 1000))
def test_a_free_decay_is_guessed_to_a_third_of_a_period(alpha: float, damping: float, seed: int) -> None:
    experiment = free_decay(alpha, damping * 0.2 * np.sqrt(alpha), seed)
    model = Model("oscillator", LINEAR, {"g": 0.0})
    found = scan(model, [experiment], natural_units([experiment]), {})
    # Nearer than half a period, least squares slides into the right minimum.
    assert slip(alpha, found["alpha"]) < 0.35
    assert found["xi"] > 0


@pytest.mark.parametrize("g", [2.5, -0.4])
def test_a_forced_system_is_guessed_by_regression(g: float) -> None:
    experiment = forced(g, 20.0, 0.4)
    found = scan(Model("oscillator", LINEAR), [experiment], natural_units([experiment]), {})
    assert found["g"] == pytest.approx(g, rel=0.1)
    assert found["alpha"] == pytest.approx(20.0, rel=0.03)
    assert 0 < found["xi"] < 2.0


def test_what_is_given_is_not_guessed() -> None:
    experiment = free_decay(9.0, 0.05)
    model = Model("oscillator", (*LINEAR, "cubic_stiffness"), {"g": 0.0})
    found = scan(model, [experiment], natural_units([experiment]), {"beta": 0.123, "xi": 0.5})
    assert found["beta"] == 0.123
    assert found["xi"] == 0.5


def test_a_guess_fits_without_any_start() -> None:
    experiment = forced(2.5, 20.0, 0.4)
    found = fit(Model("oscillator", LINEAR), [experiment])
    assert found.status == "Converged."
    for name, value in {"g": 2.5, "alpha": 20.0, "xi": 0.4}.items():
        assert abs(found.values[name] - value) < 5 * found.sd[name]


def test_an_arm_is_guessed_from_the_stretch_that_may_be_fitted() -> None:
    # The held-out third swings twice as fast: it must not be looked at.
    rate = np.where(TIME < 20.0, 3.0, 6.0)
    motion = 0.3 * np.cos(np.cumsum(rate) * (TIME[1] - TIME[0]))
    still = Drive(TIME[[0, -1]], np.zeros((1, 1)), np.empty(0))
    recording = Recording("a", TIME, 0 * TIME, motion[:, None], ("tip_angle",), ("rad",), np.array([NOISE]), "", "")
    experiment = Experiment(recording, still, Rig("arm", length=Quantity(1.0, 0.0)), fitted_samples=1000)
    model = Model("constant_radius", LINEAR, {"length": 1.0})
    units = natural_units([experiment])
    assert 1 / units.time == pytest.approx(3.0, rel=0.03)
    assert units.coordinate == 1.0
    assert slip(9.0, scan(model, [experiment], units, {})["alpha"]) < 0.35
