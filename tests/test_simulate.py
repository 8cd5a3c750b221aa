from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from discovery.declarations.registry import catalogue, get_effect
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.step import choose_step
from discovery.foundation.errors import ComputationError, SimulationFailure
from discovery.mechanics import get_base
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn
from discovery.simulation.grid import DriveLike, Grid
from discovery.simulation.kernel import compile as compiled
from discovery.simulation.kernel.compile import compile_kernel, numpy_derivative
from discovery.simulation.kernel.source import kernel_source
from discovery.simulation.runge_kutta import dormand_prince
from discovery.simulation.simulate import Simulator, check_finite
from discovery.testing.states import every_effect

PAPER = {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139, "gamma": 0.4462, "length": 1.0, "mu": 0.2845, "tau_r": 0.0}


def trapezoid(angle: float, rate: float, start: float = 0.3, end: float = 10.0) -> Drive:
    """Trapezoidal speed, constant accelerations in the first and last 12 %."""
    duration = angle / rate / 0.88
    rise = 0.12 * duration
    a, stop = rate / rise, start + duration
    return Drive(
        np.array([0.0, start, start + rise, stop - rise, stop, end]),
        np.array(
            [
                [0.0, a / 2, 0.0, -a / 2, 0.0],
                [0.0, 0.0, rate, rate, 0.0],
                [0.0, 0.0, rate * rise / 2, angle - rate * rise / 2, angle],
            ]
        ),
        np.array([start, start + rise, stop - rise, stop]),
    )


@dataclass(frozen=True)
class Sine:
    """A smooth input."""

    amplitude: float
    rate: float
    kinks: np.ndarray

    def evaluate(self, time, side="right"):
        phase = self.rate * np.atleast_1d(time)
        value = self.amplitude * np.array([np.sin(phase), self.rate * np.cos(phase), -(self.rate**2) * np.sin(phase)])
        return value


@dataclass(frozen=True)
class Silent:
    """A drive that does not tell where it has kinks."""

    drive: Drive
    kinks: np.ndarray

    def evaluate(self, time, side="right"):
        return self.drive.evaluate(time, side)


SMOOTH = Sine(0.5, 2.0, np.empty(0))


def simulator(base: str, time: np.ndarray, drive: DriveLike | None, step: float) -> Simulator:
    """All effects of a base in one kernel; those that are not wanted are at their defaults, that is absent."""
    return Simulator(base, every_effect(base), time, drive, step=step)


def columns(names: tuple[str, ...], values: Mapping[str, float], k: int = 1) -> np.ndarray:
    shapes = {p.name: p.default for e in catalogue().values() for p in e.parameters() if p.shape}
    defaults = {**dict.fromkeys(names, 0.0), **shapes, "v_c": 1e-3, "length": 1.0, "tau_v": 1.0}
    return np.repeat([[{**defaults, **values}[n]] for n in names], k, axis=1)


def run(sim: Simulator, values: Mapping[str, float], deflection: float = 0.1, rate: float = 0.0) -> np.ndarray:
    return sim(columns(sim.names, values), np.array([deflection]), np.array([rate]))[:, :, 0]


def reference(
    slopes: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
    drive: DriveLike | None,
    y: np.ndarray,
    time: np.ndarray,
) -> np.ndarray:
    """States (n, m) by an adaptive method of order eight at 1e-12, restarted at every kink."""
    kinks = np.empty(0) if drive is None else drive.kinks
    edges = np.unique(np.concatenate([time[[0, -1]], kinks[(kinks > time[0]) & (kinks < time[-1])]]))
    states = np.empty((y.size, time.size))
    for a, b in pairwise(edges):

        def right_hand_side(t: float, y: np.ndarray, a: float = a, b: float = b) -> np.ndarray:
            # Inside a stretch, the drive is that of the stretch also at its ends.
            at = min(max(t, a + 1e-12), b - 1e-12)
            recorded = np.zeros(3) if drive is None else drive.evaluate(at)[:, 0]
            return slopes(t, recorded, y)

        inside = (time >= a) & (time <= b)
        path = solve_ivp(
            right_hand_side,
            (a, b),
            y,
            "DOP853",
            dense_output=False,
            t_eval=np.union1d(time[inside], b),
            rtol=1e-12,
            atol=1e-12,
        )
        states[:, inside] = path.y[:, np.isin(path.t, time[inside])]
        y = path.y[:, -1]
    return states


def angle_equation(values: Mapping[str, float]) -> Callable[[float, np.ndarray, np.ndarray], np.ndarray]:
    """The paper's equation (15) and the coupling of the rod's mass, written here once more."""

    def slopes(t: float, recorded: np.ndarray, y: np.ndarray) -> np.ndarray:
        delta = y[0] - recorded[0]
        spring = values["alpha"] * delta + values.get("beta", 0.0) * delta**3
        return np.array([y[1], -values["xi"] * y[1] - spring - values.get("A", 0.0) * recorded[2]])

    return slopes


def printed_equations(base: str, values: Mapping[str, float]) -> Callable[[float, np.ndarray, np.ndarray], np.ndarray]:
    effects = ("viscous_damping", "linear_stiffness")
    program = build_program(base, effects)
    derivative = numpy_derivative(program)
    parameters = [values[n] for n in program.parameters]
    return lambda t, recorded, y: np.array(derivative(t, recorded, y, parameters), float)


def arm_experiment(base: str, time: np.ndarray, drive: Drive) -> tuple[Experiment, Model]:
    output = np.zeros((time.size, 2))
    output[0] = np.cos(0.1), np.sin(0.1)
    recording = Recording(
        "test", time, drive.evaluate(time)[0], output, ("tip_x", "tip_y"), ("m", "m"), np.full(2, 3e-4), "", ""
    )
    known = {n: PAPER[n] for n in ("length", "mu") if n in {p.name for p in get_base(base).parameters()}}
    model = Model(base, ("viscous_damping", "linear_stiffness"), known)
    return Experiment(recording, drive, Rig("test", length=Quantity(1.0, 0.0))), model


# Accuracy.


@pytest.mark.parametrize("base", ["constant_radius", "reduced", pytest.param("elastica", marks=pytest.mark.slow)])
def test_default_step_keeps_the_trajectory_within_a_microradian(base: str) -> None:
    time, drive = np.linspace(0.0, 3.0, 151), trapezoid(1.0, 1.25)
    experiment, model = arm_experiment(base, time, drive)
    # A rod is as damped as rods are; undamped ringing may have no converged solution.
    values = {**PAPER, "beta": 0.0, "gamma": 0.0, "tau_r": 1.5e-4}
    start = {**values, "delta_0_init[test]": 0.1, "rate_0_init[test]": 0.0}
    units = NaturalUnits(1 / 3, 1.0, 1.0)
    step = choose_step(model, [experiment], units, start, effects=every_effect(base))
    sim = simulator(base, time, drive, step)
    got = run(sim, {n: values[n] for n in ("xi", "alpha", "length", "mu", "tau_r") if n in sim.names})
    bare = get_base(base)
    q, qd = bare.initial_coordinates(np.array([0.1]), np.zeros(1), np.zeros(2))
    slopes = angle_equation(values) if base == "constant_radius" else printed_equations(base, values)
    states = reference(slopes, drive, np.concatenate([q, qd])[:, 0], time)
    program = build_program(base, model.effects)
    read = numpy_derivative(replace(program, derivative=(), slopes=program.reading))
    expected = np.array(read(0.0, drive.evaluate(time), states, [values[n] for n in program.parameters]))
    error = np.abs(np.arctan2(got[:, 1], got[:, 0]) - np.arctan2(expected[1], expected[0]))
    assert error.max() < 1e-6
    assert error.max() > 1e-12, "the comparison is with itself"


def test_default_step_of_a_driven_oscillator() -> None:
    values = {"g": 2.0, "xi": 0.3, "alpha": 9.0, "beta": 4.0}
    time = np.linspace(0.0, 8.0, 401)
    columns_ = Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V"))
    output = np.linspace(-0.3, 0.3, time.size)[:, None]
    recording = Recording("test", time, SMOOTH.evaluate(time)[0], output, ("output",), ("V",), np.full(1, 1e-4), "", "")
    experiment = Experiment(recording, SMOOTH, Rig("test", "oscillator", columns=columns_))
    model = Model("oscillator", ("viscous_damping", "linear_stiffness", "cubic_stiffness"))
    start = {**values, "delta_0_init[test]": 0.1, "rate_0_init[test]": 0.0}
    step = choose_step(model, [experiment], NaturalUnits(1 / 3, 0.3, 1.0), start, effects=every_effect("oscillator"))
    got = run(simulator("oscillator", time, SMOOTH, step), values)[:, 0]

    def duffing(t: float, u: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], 2.0 * u[0] - 0.3 * y[1] - 9.0 * y[0] - 4.0 * y[0] ** 3])

    assert np.abs(got - reference(duffing, SMOOTH, np.array([0.1, 0.0]), time)[0]).max() < 0.3e-6


def test_a_step_below_the_shortest_is_not_tried() -> None:
    time, drive = np.linspace(0.0, 3.0, 151), trapezoid(1.0, 1.25)
    experiment, model = arm_experiment("elastica_2", time, drive)
    # So strongly damped that the higher shape creeps back fast: it sets the step, whatever the tolerance.
    values = {**PAPER, "tau_r": 0.1, "delta_0_init[test]": 0.1, "rate_0_init[test]": 0.0}
    asked = model, [experiment], NaturalUnits(1 / 3, 1.0, 1.0), values, 1e-3, every_effect("elastica_2")
    step = choose_step(*asked)
    assert step < 0.01
    assert 0.5 * step <= choose_step(*asked, shortest=0.5 * step) < 0.01
    with pytest.raises(ComputationError, match="No step"):
        choose_step(*asked, shortest=4 * step)


def test_no_step_is_so_short_that_memory_would_not_hold_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error of some motions falls, but slowly: the steps of an arm with backlash took 8 GB."""
    experiment, model = arm_experiment("constant_radius", np.linspace(0.0, 3.0, 151), trapezoid(1.0, 1.25))
    tried: list[float] = []
    monkeypatch.setattr("discovery.estimation.step.Probe.bench", lambda _, __, step: tried.append(step) or step)
    monkeypatch.setattr("discovery.estimation.step.Probe.error", lambda _, step: 1e-3 * step)
    values = {**PAPER, "delta_0_init[test]": 0.1, "rate_0_init[test]": 0.0}
    step = choose_step(model, [experiment], NaturalUnits(1 / 3, 1.0, 1.0), values, 1e-15)
    assert step == min(tried)
    assert 0.25 * 3.0 / 2_000_000 <= step < 1e-5


def test_a_step_is_not_far_shorter_than_its_error_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    time, drive = np.linspace(0.0, 3.0, 151), trapezoid(1.0, 1.25)
    experiment, model = arm_experiment("elastica_2", time, drive)
    # The error falls from what rings unresolved to nothing at once, and so the first step that passes is very short.
    values = {**PAPER, "tau_r": 0.1, "delta_0_init[test]": 0.1, "rate_0_init[test]": 0.0}
    asked = model, [experiment], NaturalUnits(1 / 3, 1.0, 1.0), values, 1e-3, every_effect("elastica_2")
    step = choose_step(*asked)

    def error(h: float) -> float:
        paths = [run(simulator("elastica_2", time, drive, each), values) for each in (h, 0.5 * h)]
        return float(np.abs(paths[0] - paths[1]).max())

    assert error(step) < 1e-3
    # Some of the way to the blow-up is left to candidates.
    assert error(1.2 * step) < 5e-3
    monkeypatch.setattr("discovery.estimation.step._LONGER", 0)
    assert step > 1.5 * choose_step(*asked)


@pytest.mark.parametrize(("base", "first"), [("constant_radius", 0.1), ("elastica_2", 0.01)])
def test_order_of_convergence(base: str, first: float) -> None:
    # Sample times on no grid, so that the interpolation is measured too.
    time = np.concatenate([[0.0], np.sort(np.random.default_rng(0).uniform(0, 2, 40)), [2.0]])
    values = {n: PAPER[n] for n in ("xi", "alpha", "length", "mu")}
    steps = first / 2.0 ** np.arange(5)
    paths = [run(simulator(base, time, SMOOTH, h), values) for h in (*steps, steps[-1] / 8)]
    errors = np.array([np.abs(p - paths[-1]).max() for p in paths[:-1]])
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.2), errors


def test_order_of_convergence_of_leaps() -> None:
    # At the ends of steps; between them the interpolation is of order six.
    time = np.linspace(0.0, 4.0, 11)
    effects = ("viscous_damping", "linear_stiffness", "cubic_stiffness")
    steps = 0.4 / 2.0 ** np.arange(3)
    values = {n: PAPER[n] for n in ("xi", "alpha", "beta", "length")}

    def path(step: float) -> np.ndarray:
        sim = Simulator("constant_radius", effects, time, SMOOTH, step=step, method=dormand_prince())
        assert sim.kernel.method.order == 8
        assert sim.grid.steps.size == round(4.0 / step)
        return run(sim, values)

    # The tip starts with the motor's rate.
    states = reference(angle_equation(values), SMOOTH, np.array([0.1, 1.0]), time)
    errors = np.array([np.abs(np.arctan2(*path(h).T[::-1]) - states[0]).max() for h in steps])
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(8.0, abs=0.8), errors


@pytest.mark.slow
def test_a_step_in_one_loop_is_that_in_stages(monkeypatch: pytest.MonkeyPatch) -> None:
    time, drive = np.linspace(0.0, 3.0, 61), trapezoid(1.0, 1.25)
    effects = ("viscous_damping", "linear_stiffness", "cubic_stiffness")
    fused = Simulator("constant_radius", effects, time, drive, step=0.02)
    monkeypatch.setattr("discovery.simulation.kernel.source._SHORT", 0)
    text = kernel_source(fused.kernel.program, fused.kernel.lanes, {})
    assert "for stage in range(5)" in text
    namespace: dict = {}
    exec(compile(text.replace("cache=True, ", ""), "kernel", "exec"), namespace)
    staged = copy(fused)
    staged.kernel = replace(fused.kernel, run=namespace["run"])
    values = {n: PAPER[n] for n in ("xi", "alpha", "beta", "length")}
    np.testing.assert_allclose(run(fused, values), run(staged, values), rtol=0, atol=1e-13)


def test_kinks_are_respected() -> None:
    time, drive = np.linspace(0.0, 3.0, 61), trapezoid(1.0, 1.25, start=0.3021)
    # The coupling hands the jumps of the motor's acceleration on to the tip.
    values = {"xi": 0.05, "alpha": 9.0, "A": 0.0105}
    states = reference(angle_equation(values), drive, np.array([0.1, 0.0]), time)

    def error(drive: DriveLike) -> float:
        x, y = run(simulator("constant_radius", time, drive, 0.02), values).T
        return float(np.abs(np.arctan2(y, x) - states[0]).max())

    declared, ignored = error(drive), error(Silent(drive, np.empty(0)))
    assert declared < 1e-6
    assert ignored > 100 * declared


# Output.


@pytest.mark.parametrize("base", ["constant_radius", "elastica_2"])
def test_output_at_arbitrary_times_is_that_of_one_trajectory(base: str) -> None:
    rng = np.random.default_rng(3)
    dense = np.linspace(0.0, 2.0, 401)
    chosen = np.concatenate([[0], np.sort(rng.choice(np.arange(1, 400), 60, replace=False)), [400]])
    values = {"xi": 0.05, "alpha": 9.0, "length": 1.0, "mu": 0.3}
    drive, step = trapezoid(1.0, 1.25), 0.01
    all_of_them = run(simulator(base, dense, drive, step), values)
    np.testing.assert_array_equal(run(simulator(base, dense[chosen], drive, step), values), all_of_them[chosen])


def test_interpolation_between_steps_is_below_the_step_error() -> None:
    values = {"xi": 0.05, "alpha": 9.0, "length": 1.0}
    time = np.linspace(0.0, 2.0, 1001)
    coarse = run(simulator("constant_radius", time, SMOOTH, 0.02), values)
    fine = run(simulator("constant_radius", time, SMOOTH, 0.002), values)
    at_steps = np.abs(coarse - fine)[::10].max()
    assert np.abs(coarse - fine).max() < 1.5 * at_steps


@settings(deadline=None)
@given(
    st.lists(st.floats(0.01, 0.5), min_size=1, max_size=20),
    st.lists(st.floats(-1.0, 8.0), max_size=6, unique=True),
    st.floats(0.003, 1.0),
)
def test_the_grid_covers_the_record_and_ends_at_kinks(gaps: list[float], kinks: list[float], step: float) -> None:
    time = 0.2 + np.concatenate([[0.0], np.cumsum(gaps)])
    grid = Grid.build(time, Sine(1.0, 1.0, np.sort(kinks)), step)
    ends = grid.times + grid.steps
    assert grid.times[0] == time[0]
    assert ends[-1] == pytest.approx(time[-1], rel=1e-14)
    np.testing.assert_allclose(grid.times[1:], ends[:-1], rtol=1e-12)
    assert (grid.steps > 0).all()
    assert grid.steps.max() <= step * (1 + 1e-6)
    edges = np.append(grid.times, ends[-1])
    for kink in kinks:
        if time[0] < kink < time[-1]:
            assert np.abs(edges - kink).min() <= 1e-6 * step
    where = grid.times[grid.out_step] + grid.out_fraction * grid.steps[grid.out_step]
    np.testing.assert_allclose(where, time, rtol=1e-12)


# Lanes.


@pytest.mark.parametrize("base", ["constant_radius", "elastica_2"])
def test_lanes_do_not_know_each_other(base: str) -> None:
    time = np.linspace(0.0, 1.0, 21)
    sim = simulator(base, time, trapezoid(1.0, 1.25), 0.02)
    rng = np.random.default_rng(1)
    k = 70
    sets = columns(sim.names, {"length": 1.0}, k)
    for name, low, high in (("xi", 0, 0.5), ("alpha", 5, 12), ("mu", 0.2, 0.4), ("c_2", 0, 0.3), ("tau", -0.05, 0.05)):
        if name in sim.names:
            sets[sim.names.index(name)] = rng.uniform(low, high, k)
    deflection, rate = rng.uniform(-0.5, 0.5, (2, k))
    together = sim(sets, deflection, rate)
    assert together.shape == (21, 2, k)
    order = rng.permutation(k)
    np.testing.assert_array_equal(sim(sets[:, order], deflection[order], rate[order]), together[:, :, order])
    for lane in (0, 31, 69):
        one = slice(lane, lane + 1)
        np.testing.assert_array_equal(sim(sets[:, one], deflection[one], rate[one]), together[:, :, one])


@pytest.mark.parametrize("base", ["constant_radius", "elastica_2", "oscillator"])
def test_effects_of_a_neighbour_change_no_digit(base: str) -> None:
    time = np.linspace(0.0, 1.0, 21)
    sim = simulator(base, time, trapezoid(1.0, 1.25), 0.02)
    values = {"xi": 0.05, "alpha": 9.0, "mu": 0.3, "g": 1.0}
    # One effect a column, those of odd columns with a second one; the last columns have none.
    effects = [e for e in every_effect(base) if e not in ("viscous_damping", "linear_stiffness")]
    sets = columns(sim.names, values, len(effects) + 3)
    for k, effect in enumerate(effects):
        for name in (effect, *effects[k % 2 * 7 : k % 2 * 8]):
            for p in catalogue()[name].parameters():
                if p.name in sim.names and not p.shape:
                    sets[sim.names.index(p.name), k] = p.starts[0] if p.starts else 1e-3
    start = np.full(sets.shape[1], 0.3), np.zeros(sets.shape[1])
    together = sim(sets, *start)
    assert np.isfinite(together).all()
    moved = np.abs(together - together[:, :, -1:]).max(axis=(0, 1))
    assert (moved[: len(effects)] > 0).mean() > 0.9
    order = np.random.default_rng(2).permutation(sets.shape[1])
    np.testing.assert_array_equal(sim(sets[:, order], *start), together[:, :, order])
    for k in range(sets.shape[1]):
        one = slice(k, k + 1)
        np.testing.assert_array_equal(sim(sets[:, one], start[0][one], start[1][one]), together[:, :, one])


@pytest.mark.parametrize("base", ["constant_radius", "elastica_2", "oscillator"])
def test_absent_effects_leave_the_motion_to_the_others(base: str) -> None:
    time, drive = np.linspace(0.0, 2.0, 41), trapezoid(1.0, 1.25)
    values = {"xi": 0.05, "alpha": 9.0, "mu": 0.3, "c_2": 0.1, "tau": 0.02, "v": 0.05}
    effects = ("viscous_damping", "linear_stiffness", "quadratic_drag", "sensor_delay", "viscoelastic_relaxation")
    few = Simulator(base, effects, time, drive, step=0.01)
    whole = run(simulator(base, time, drive, 0.01), values)
    np.testing.assert_allclose(whole, run(few, values), rtol=0, atol=1e-13)


def test_a_late_instrument_leaves_a_prompt_one_beside_it_alone() -> None:
    # Samples on the steps, where a prompt and a late reading lie in different ones.
    time = np.linspace(0.0, 2.0, 101)
    sim = simulator("constant_radius", time, trapezoid(1.0, 1.25), 0.02)
    sets = columns(sim.names, {"xi": 0.05, "alpha": 9.0}, 2)
    sets[sim.names.index("tau"), 1] = 0.013
    both = sim(sets, np.full(2, 0.2), np.zeros(2))
    np.testing.assert_array_equal(both[:, :, :1], sim(sets[:, :1], np.full(1, 0.2), np.zeros(1)))
    np.testing.assert_array_equal(both[:, :, 1:], sim(sets[:, 1:], np.full(1, 0.2), np.zeros(1)))


def test_a_lane_that_blows_up_leaves_its_neighbours_alone() -> None:
    sim = simulator("oscillator", np.linspace(0.0, 3.0, 31), None, 0.02)
    sets = columns(sim.names, {"alpha": 9.0}, 3)
    alone = sim(sets, np.full(3, 0.2), np.zeros(3))
    sets[sim.names.index("beta"), 1] = -1e4
    with_neighbour = sim(sets, np.full(3, 0.2), np.zeros(3))
    assert not np.isfinite(with_neighbour[-1, 0, 1])
    np.testing.assert_array_equal(with_neighbour[:, :, [0, 2]], alone[:, :, [0, 2]])


# Delay.


@pytest.mark.parametrize("delay", [0.0, 0.0137, -0.0137, 0.25, -0.25])
def test_a_delay_shifts_the_trajectory(delay: float) -> None:
    time = np.linspace(0.5, 2.5, 101)
    drive, values = trapezoid(1.0, 1.25), {"xi": 0.05, "alpha": 9.0, "length": 1.0}
    ends = np.array([0.0, 3.0])
    late = simulator("constant_radius", np.concatenate([ends[:1], time, ends[1:]]), drive, 0.01)
    plain = simulator("constant_radius", np.concatenate([ends[:1], time - delay, ends[1:]]), drive, 0.01)
    got, expected = run(late, {**values, "tau": delay}), run(plain, values)
    np.testing.assert_allclose(got[1:-1], expected[1:-1], atol=1e-12)


@pytest.mark.parametrize("base", ["constant_radius", "elastica_2", "oscillator"])
@pytest.mark.parametrize("gap", [0.003, 0.05])
def test_each_lane_reads_at_its_own_age(base: str, gap: float) -> None:
    """Delays, drifts and sawtooths side by side, several samples in a step and several steps between samples."""
    time = np.arange(0.5, 2.5, gap)
    drive, values, ends = trapezoid(1.0, 1.25), {"xi": 0.05, "alpha": 9.0, "length": 1.0, "mu": 0.3}, np.array([0, 3.0])
    few = ("viscous_damping", "linear_stiffness", "sensor_delay", "time_base_error")
    # Read in one loop where there is little to read, else in several.
    effects = few if base == "constant_radius" else every_effect(base)
    late = Simulator(base, effects, np.concatenate([ends[:1], time, ends[1:]]), drive, step=0.01)
    clocks = [
        *({"tau": tau} for tau in (-0.25, -0.011, 0.0, 0.004, 0.3)),
        *({"d_t": d_t} for d_t in (-0.05, 0.02)),
        *({"j_t": j_t, "Omega_j": 8.0, "phi_j": 0.7, "tau": tau} for j_t in (0.1, -0.003) for tau in (0.0, 0.02)),
    ]
    sets = columns(late.names, values, len(clocks))
    for k, clock in enumerate(clocks):
        sets[[late.names.index(n) for n in clock], k] = list(clock.values())
    got = late(sets, np.full(len(clocks), 0.2), np.zeros(len(clocks)))[1:-1]
    for k, clock in enumerate(clocks):
        angle = clock.get("Omega_j", 0.0) * time - clock.get("phi_j", 0.0)
        fall = np.arctan(0.99 * np.sin(angle) / (1 - 0.99 * np.cos(angle))) / np.pi
        age = clock.get("tau", 0.0) + clock.get("d_t", 0.0) * time + clock.get("j_t", 0.0) * (0.5 - 1.0274391 * fall)
        read, place = np.unique(time - age, return_inverse=True)
        plain = simulator(base, np.concatenate([ends[:1], read, ends[1:]]), drive, 0.01)
        expected = run(plain, values, deflection=0.2)[1:-1]
        np.testing.assert_allclose(got[:, :, k], expected[place].reshape(got.shape[:2]), rtol=0, atol=1e-12)


def test_an_instrument_that_is_late_reports_the_rest_before_the_start() -> None:
    time = np.linspace(0.0, 1.0, 51)
    sim = simulator("constant_radius", time, trapezoid(1.0, 1.25), 0.01)
    got = run(sim, {"xi": 0.05, "alpha": 9.0, "tau": 0.1}, deflection=0.0)
    np.testing.assert_allclose(got[time < 0.4], [[1.0, 0.0]] * int((time < 0.4).sum()), atol=1e-15)


# Failure.


def test_a_blow_up_keeps_its_length_and_names_parameters_and_time() -> None:
    # q'' = q^3 with q = 1, q' = 1/sqrt 2 is q = 1/(1 - t/sqrt 2): infinite at t = sqrt 2.
    time = np.linspace(0.0, 3.0, 301)
    sim = simulator("oscillator", time, None, 0.002)
    sets = columns(sim.names, {}, 2)
    sets[sim.names.index("beta")] = 0.0, -1.0
    out = sim(sets, np.ones(2), np.full(2, np.sqrt(0.5)))
    assert out.shape == (301, 1, 2)
    np.testing.assert_allclose(out[:140, 0, 1], 1 / (1 - time[:140] / np.sqrt(2)), rtol=1e-4)
    with pytest.raises(SimulationFailure) as failure:
        check_finite(out, time, sim.names, sets)
    assert failure.value.time == pytest.approx(np.sqrt(2), abs=0.02)
    assert failure.value.parameters["beta"] == -1.0
    assert set(failure.value.parameters) == set(sim.names)
    assert "beta = -1" in str(failure.value)
    assert "beta = 0" not in str(failure.value)
    assert "f_c = " not in str(failure.value)
    check_finite(out[:, :, :1], time, sim.names, sets[:, :1])


# Cache.


@pytest.mark.slow
def test_a_second_process_does_not_compile(tmp_path: Path) -> None:
    code = """
import json, numba, numpy as np
from discovery.simulation.kernel.compile import heard_compiling
from discovery.simulation.simulate import Simulator
s = Simulator("oscillator", ("linear_stiffness",), np.linspace(0, 1, 3), None, step=0.1)
heard = []
with heard_compiling(lambda: heard.append("began"), lambda: heard.append("ended")):
    y = s(np.array([[0.0], [9.0]]), np.ones(1), np.zeros(1))
    s(np.array([[0.0], [9.0]]), np.ones(1), np.zeros(1))
    # A function that others compile, of a module without a name.
    exec("def twice(x): return 2 * x", made := {"__name__": None})
    assert numba.njit(made["twice"])(1.5) == 3.0
stats = s.kernel.run.stats
print(json.dumps([sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), heard, y[-1, 0, 0]]))
"""

    def process() -> list[Any]:
        environment = {**os.environ, "DISCOVERY_CACHE": str(tmp_path)}
        result = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        )
        return json.loads(result.stdout)

    hits, misses, heard, first = process()
    assert (hits, misses, heard) == (0, 1, ["began", "ended"])
    hits, misses, heard, second = process()
    assert (hits, misses, heard) == (1, 0, [])
    assert first == second
    assert first == pytest.approx(np.cos(3.0), abs=1e-3)


@pytest.mark.slow
def test_a_kernel_computes_the_same_when_just_compiled_and_when_loaded(tmp_path: Path) -> None:
    code = """
import hashlib, numpy as np
from discovery.simulation.simulate import Simulator
from discovery.posterior.noise.filters import oscillating
from discovery.posterior.noise.quantised import rounded
effects = ("linear_stiffness", "viscous_damping", "cubic_stiffness", "coulomb_friction", "sensor_delay")
s = Simulator("elastica_calm", effects, np.linspace(0, 2, 101), None, step=0.01)
values = {"length": 1.0, "mu": 0.05, "xi": 0.05, "alpha": 9.0, "tau": 0.0137}
sets = np.array([np.full(8, values.get(name, 0.0)) for name in s.names]) * np.linspace(1.0, 1.1, 8)
y = s(sets, np.full(8, 0.2), np.zeros(8))
assert np.ptp(y) > 0.1
time, residual, row = np.arange(101) / 50.0, np.ascontiguousarray(y - y[0]), np.linspace(0.1, 0.5, 8)
seen = np.ones(residual.shape[:2], bool)
parts = [y, *oscillating(time, seen, residual, row, 3.0 + row, row, residual[:, :, 1], True)]
parts.append(rounded(seen, residual, np.full(residual.shape[1], 0.01), row))
assert all(np.isfinite(part).all() for part in parts)
print(hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest())
"""

    def process() -> str:
        environment = {**os.environ, "DISCOVERY_CACHE": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
        return subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        ).stdout

    assert process() == process()


def test_what_is_kept_on_disk_is_what_would_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISCOVERY_CACHE", str(tmp_path))
    effects = ("coulomb_friction", "linear_stiffness", "table_tilt")
    fresh = compile_kernel.__wrapped__("elastica", effects)

    def refuse(*_: object) -> None:
        raise AssertionError("written again")

    monkeypatch.setattr(compiled, "kernel_source", refuse)
    kept = compile_kernel.__wrapped__("elastica", effects)
    assert kept.run is fresh.run
    assert kept.program == build_program("elastica", effects)
    # Another version of the package writes its own.
    monkeypatch.setattr(compiled, "source_hash", lambda *_: "another")
    with pytest.raises(AssertionError, match="written again"):
        compile_kernel.__wrapped__("elastica", effects)


def test_effects_of_other_packages_are_never_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Foreign(type(catalogue()["quadratic_drag"])):  # type: ignore[misc]
        pass

    monkeypatch.setenv("DISCOVERY_CACHE", str(tmp_path))
    monkeypatch.setattr(
        compiled, "get_effect", lambda name: Foreign() if name == "quadratic_drag" else get_effect(name)
    )
    written = []
    source = compiled.kernel_source
    monkeypatch.setattr(compiled, "kernel_source", lambda *a: written.append(a) or source(*a))
    for _ in range(2):
        compile_kernel.__wrapped__("oscillator", ("linear_stiffness", "quadratic_drag"))
    assert len(written) == 2


def test_an_instrument_that_is_early_reads_what_a_free_motion_goes_on_to_do() -> None:
    time = np.linspace(0.0, 4.0, 81)
    simulate = Simulator("oscillator", ("linear_stiffness", "sensor_delay"), time, None, step=0.01)
    given = {"alpha": 9.0, "tau": -0.3}
    values = np.array([[given.get(name, 0.0)] for name in simulate.names])
    read = simulate(values, np.ones(1), np.zeros(1))[:, 0, 0]
    np.testing.assert_allclose(read, np.cos(3.0 * (time + 0.3)), atol=1e-6)
