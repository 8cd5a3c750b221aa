"""A first-order lag of the input: its response in closed form, its limits, and its name on a machine that has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.systems.cases import CASES
from benchmarks.systems.run import run
from discovery.equations.model import Model
from discovery.export import to_latex, to_sympy
from discovery.recordings.drive import Drive
from discovery.simulation.simulate import Simulator

TIME = np.linspace(0.0, 4.0, 81)
LONGEST = 0.05  # step of the integration [s]
#: A step of the input at 0.52 s, between two readings.
STEP = Drive(np.array([0.0, 0.52, 4.0]), np.array([[0.0, 1.0]]), np.array([0.52]))


def pushed(*effects: str, **values: float) -> np.ndarray:
    simulator = Simulator("oscillator", effects, TIME, STEP, step=LONGEST)
    parameters = np.array([[values.get(n, 0.0)] for n in simulator.names])
    return simulator(parameters, np.zeros(1), np.zeros(1))[:, 0, 0]


@pytest.mark.parametrize(
    ("tau", "late"), [(3.0, 1e-6), (0.2, 1e-4), (0.05, 3e-3), (0.02, 0.012), (1e-3, 0.15), (1e-9, 0.167)]
)
def test_a_free_body_follows_a_step_as_in_closed_form(tau: float, late: float) -> None:
    """q'' = g u_l with u_l = 1 - exp(-t/tau), to a part `late` of a step of the integration, which bounds its error."""
    t = np.maximum(TIME - 0.52, 0.0)
    expected = 2.0 * (t**2 / 2 - tau * t - tau**2 * np.expm1(-t / tau))
    missed = np.abs(pushed("input_lag", g=2.0, tau_u=tau) - expected)
    assert (missed <= 2.0 * late * LONGEST * t + 1e-12).all()


def test_without_a_time_constant_it_is_absent() -> None:
    bare = pushed("viscous_damping", "linear_stiffness", g=2.0, xi=0.3, alpha=5.0)
    present = pushed("viscous_damping", "linear_stiffness", "input_lag", g=2.0, xi=0.3, alpha=5.0)
    np.testing.assert_allclose(present, bare, rtol=1e-12, atol=1e-14)


def test_what_saturates_before_it_lags() -> None:
    """The amplifier's limit comes first: with the drives in this order a limit of 0.5 halves the step."""
    halved = 0.5 * pushed("input_lag", g=2.0, tau_u=0.2)
    np.testing.assert_allclose(pushed("input_saturation", "input_lag", g=2.0, tau_u=0.2, s_u=2.0), halved, rtol=1e-9)


def test_its_equation_is_written_without_what_computing_needs() -> None:
    model = Model("oscillator", ("linear_stiffness", "input_lag"))
    assert [str(line) for line in to_sympy(model).memory] == ["Eq(u_l', (r_0 - u_l)/tau_u)"]
    assert r"\dot{u_{l}} = \frac{" in to_latex(model)
    assert "10^{-30}" not in to_latex(model)


@pytest.mark.slow
@pytest.mark.parametrize("case", [name for name in CASES if "lags" in name])
def test_it_is_named_on_a_machine_that_has_it(case: str, tmp_path: Path) -> None:
    outcome = run(CASES[case], tmp_path, 1)
    assert outcome.right, outcome
