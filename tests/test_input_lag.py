"""A first-order lag of the input: its response in closed form, its limits, and its name on a machine that has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from benchmarks.systems.cases import CASES
from benchmarks.systems.run import run
from discovery import close_loop, declared_model, fit_model, load_dataset, predict_motion
from discovery.equations.model import Model
from discovery.estimation.predict import arrived
from discovery.export import to_latex, to_sympy
from discovery.recordings.drive import Drive
from discovery.simulation.simulate import Simulator

TIME = np.linspace(0.0, 4.0, 81)
LONGEST = 0.05  # step of the integration [s]
#: A step of the input at 0.52 s, between two readings.
STEP = Drive(np.array([0.0, 0.52, 4.0]), np.array([[0.0, 1.0]]), np.array([0.52]))

#: An input of 1.5 that has acted for long, and steps by one at 0.52 s.
HELD = Drive(np.array([0.0, 0.52, 4.0]), np.array([[1.5, 2.5]]), np.array([0.52]))
RIG = """name = "lagging"
kind = "oscillator"

[columns]
time = { name = "time", unit = "s" }
input = { name = "force", unit = "N", interpolation = "hold" }
output = { name = "place", unit = "m", noise = 0.001 }
"""


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


@pytest.mark.parametrize("tau", [1.0, 0.3])
@pytest.mark.parametrize("begun", [0.0, 1.5, -0.7])
def test_what_had_arrived_decays_as_in_closed_form(tau: float, begun: float) -> None:
    """q'' = u_l with u_l = 1.5 + (u_a - 1.5) exp(-t/tau), and the step behind it."""
    simulator = Simulator("oscillator", ("input_lag",), TIME, HELD, step=LONGEST)
    parameters = np.array([[{"g": 1.0, "tau_u": tau, "u_a": begun}.get(n, 0.0)] for n in simulator.names])
    late = np.maximum(TIME - 0.52, 0.0)
    held = 1.5 * TIME**2 / 2 + (begun - 1.5) * (tau * TIME + tau**2 * np.expm1(-TIME / tau))
    expected = held + late**2 / 2 - tau * late - tau**2 * np.expm1(-late / tau)
    np.testing.assert_allclose(simulator(parameters, np.zeros(1), np.zeros(1))[:, 0, 0], expected, atol=2e-4)


def lagging_recording(rng: np.random.Generator, *, begins: float) -> pd.DataFrame:
    """A mass on a spring whose input acted before the first reading, by another integrator."""
    time = np.arange(0.0, 8.0, 0.02)
    change = 0.02 * np.cumsum(rng.integers(30, 70, 12))
    level = rng.uniform(-1.0, 1.0, change.size + 1)
    level[0] = 0.8

    def given(t: float) -> float:
        return float(level[np.searchsorted(change - 1e-9, t, side="right")])

    def slope(t: float, y: np.ndarray) -> list[float]:
        return [y[1], 20.0 * y[2] - 0.6 * y[1] - 25.0 * y[0], (given(t) - y[2]) / 0.25]

    found = solve_ivp(slope, (0.0, 8.0), [0.1, 0.0, begins], t_eval=time, max_step=0.005, rtol=1e-9, atol=1e-11)
    read = found.y[0] + rng.normal(0.0, 1e-3, time.size)
    return pd.DataFrame({"time": time, "force": [given(t) for t in time], "place": read})


def test_recordings_that_begin_under_an_input_tell_what_had_arrived(tmp_path: Path) -> None:
    """Cut out of a longer session: of one nothing had arrived, of another all, of the last the opposite."""
    rng, begins = np.random.default_rng(7), {"a": 0.0, "b": 0.8, "c": -0.5}
    for name, begun in begins.items():
        lagging_recording(rng, begins=begun).to_csv(tmp_path / f"{name}.csv", index=False)
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv", tmp_path / "b.csv"], [tmp_path / "c.csv"])
    model = declared_model(data).with_effect("input_lag")
    fit = fit_model(model, data)
    assert fit.values["tau_u"] == pytest.approx(0.25, rel=0.02)
    starts = fit.initial_states()
    for name in ("a", "b"):
        assert starts.loc[name, "u_a"] == pytest.approx(begins[name], abs=4 * starts.loc[name, "u_a_sd"] + 0.01)
        assert 0 < starts.loc[name, "u_a_sd"] < 0.1
    assert np.sqrt(fit.chi2 / fit.problem.bench.n_data) == pytest.approx(1.0, abs=0.1)
    # A prediction without a reading takes what acts at its first time for arrived.
    predicted, _ = predict_motion(fit, data.holdout[0])
    rest = 0.8 * 20.0 / 25.0
    assert predicted[0, 0] == pytest.approx(rest, rel=0.02)
    np.testing.assert_allclose(predicted[:10, 0], rest, rtol=0.02)
    result = close_loop(data)
    assert list(result.added) == ["input_lag"]
    assert result.verdict == "explained"
    assert result.errors["after"]["holdout"]["rms"] < 1.3e-3


def test_what_has_arrived_is_told_of_each_of_several_recordings(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    for name, begins in (("a", 0.8), ("b", 0.8)):
        lagging_recording(rng, begins=begins).to_csv(tmp_path / f"{name}.csv", index=False)
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv", tmp_path / "b.csv"], keep_third=False)
    problem = fit_model(declared_model(data).with_effect("input_lag"), data).problem
    assert dict(zip(problem.names[len(problem.free) :], arrived(problem)[:, 0], strict=True)) == {
        state.name: 0.8 if state.name.startswith("u_a") else 0.0 for state in problem.states
    }
    assert len(problem.states) == 6


def test_nothing_had_arrived_of_what_begins_at_rest(tmp_path: Path) -> None:
    lagging_recording(np.random.default_rng(3), begins=0.0).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "rig.toml").write_text(
        RIG + '[records]\ntrain = [{ file = "a.csv", at_rest = true }]\n', encoding="utf-8"
    )
    data = load_dataset(tmp_path / "rig.toml")
    problem = fit_model(declared_model(data).with_effect("input_lag"), data).problem
    (begun,) = [state for state in problem.states if state.name.startswith("u_a")]
    assert begun.still
    assert begun.guess == 0.0


def test_exports_begin_where_the_input_had_arrived() -> None:
    """The symbol of what had arrived is the start of its state, in every language that is written from it."""
    found = to_sympy(Model("oscillator", ("linear_stiffness", "input_lag")))
    assert [str(e) for e in found.initial][2:] == ["u_a"]


@pytest.mark.slow
@pytest.mark.parametrize("case", [name for name in CASES if "lags" in name])
def test_it_is_named_on_a_machine_that_has_it(case: str, tmp_path: Path) -> None:
    outcome = run(CASES[case], tmp_path, 1)
    assert outcome.right, outcome
