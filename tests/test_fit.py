from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import SHIFT, Fit, fit, refined
from discovery.estimation.least_squares import levenberg_marquardt, minimise
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.foundation.errors import InputError
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn
from discovery.testing.states import every_effect

PAPER = {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139, "gamma": 0.4462, "length": 1.0}
DECLARED = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law")
UNITS = NaturalUnits(1 / 3, 1.0, 1.0)
NOISE = 3e-4
STEP = 0.02


def trapezoid(angle: float, rate: float, end: float) -> Drive:
    start, duration = 0.3, angle / rate / 0.88
    rise = 0.12 * duration
    a, stop = rate / rise, start + duration
    edges = np.array([0.0, start, start + rise, stop - rise, stop, end])
    squares, slopes = [0.0, a / 2, 0.0, -a / 2, 0.0], [0.0, 0.0, rate, rate, 0.0]
    return Drive(
        edges, np.array([squares, slopes, [0.0, 0.0, rate * rise / 2, angle - rate * rise / 2, angle]]), edges[1:-1]
    )


def arm(name: str, time: np.ndarray, drive: Drive, output: np.ndarray) -> Experiment:
    recording = Recording(
        name, time, drive.evaluate(time)[0], output, ("tip_x", "tip_y"), ("m", "m"), np.full(2, NOISE), "", ""
    )
    return Experiment(recording, drive, Rig("test", length=Quantity(1.0, 0.0)))


def bench(*experiments: Experiment) -> Bench:
    return Bench("constant_radius", every_effect("constant_radius"), experiments, STEP)


def simulated(name: str, time: np.ndarray, drive: Drive, values: Mapping[str, float], seed: int) -> Experiment:
    empty = arm(name, time, drive, np.zeros((time.size, 2)))
    b = bench(empty)
    defaults = {**dict.fromkeys(b.names, 0.0), "v_c": 1e-3, "tau_v": 1.0, **values}
    (clean,) = b.predict(np.array([[defaults[n]] for n in b.names]), np.zeros((1, 2, 1)))
    noise = NOISE * np.random.default_rng(seed).standard_normal(clean.shape[:2])
    return arm(name, time, drive, clean[:, :, 0] + noise)


@cache
def paper_arm(seed: int = 0) -> tuple[Experiment, ...]:
    slow = simulated("slow", np.linspace(0.0, 8.0, 401), trapezoid(1.0, 1.0, 8.0), PAPER, seed)
    # Irregular times, and another manoeuvre.
    times = np.sort(np.random.default_rng(seed).uniform(0.0, 6.0, 300))
    fast = simulated("fast", times, trapezoid(1.2, 1.3, 6.0), PAPER, seed + 1)
    return slow, fast


def paper_fit(experiments: tuple[Experiment, ...], effects: tuple[str, ...] = DECLARED, **start: float) -> Fit:
    model = Model("constant_radius", effects, {"length": 1.0})
    start = {"xi": 0.02, "alpha": 8.0, **start}
    return fit(model, experiments, start=start, bench=bench(*experiments), units=UNITS)


# The fit.


def test_the_papers_model_is_recovered_from_two_recordings() -> None:
    found = paper_fit(paper_arm(), beta=0.0, gamma=0.2)
    assert found.status == "Converged."
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.1)
    for name in ("xi", "alpha", "beta", "gamma"):
        assert abs(found.values[name] - PAPER[name]) < 4 * found.sd[name]
        assert found.sd[name] < 0.1 * PAPER[name]
    assert found.solver_shift < SHIFT
    assert found.null_directions == ()


def test_the_solver_is_refined_until_it_shifts_nothing() -> None:
    experiments = paper_arm()
    problem = paper_fit(experiments, beta=0.5, gamma=0.45).problem
    coarse = fit(problem.model, experiments, bench=Bench.like(problem.bench, 0.1), units=UNITS, start=PAPER)
    assert coarse.solver_shift > 10 * SHIFT
    assert "still shifts" in coarse.status
    fine = refined(coarse)
    assert fine.solver_shift < SHIFT
    assert fine.status == "Converged."
    exact = fit(problem.model, experiments, bench=Bench.like(problem.bench, 0.002), units=UNITS, start=PAPER)
    for name in ("xi", "alpha", "beta", "gamma"):
        assert abs(fine.values[name] - exact.values[name]) < 2 * SHIFT * fine.sd[name]
        # The reported shift is that of the estimates: against half the step, a sixteenth of the error is left.
        assert abs(coarse.values[name] - exact.values[name]) < 1.3 * coarse.solver_shift * fine.sd[name]
    assert refined(fine) is fine


def test_refining_ends_where_finer_steps_do_not_help(monkeypatch: pytest.MonkeyPatch) -> None:
    found = paper_fit(paper_arm(), beta=0.5, gamma=0.45)
    rough, rounds = replace(found, solver_shift=0.4), []

    def shift(problem: Problem, *_: object) -> float:
        rounds.append(problem.bench.step)
        return 0.3

    monkeypatch.setattr("discovery.estimation.fit.solver_shift", shift)
    best = refined(rough)
    assert rounds == [best.problem.bench.step]
    assert best.solver_shift == 0.3
    assert "still shifts an estimate by 0.3 standard deviations" in best.status


def test_a_specialised_fit_leaps_to_the_same_minimum() -> None:
    found = refined(paper_fit(paper_arm(), beta=0.5, gamma=0.45))
    own = found.specialised()
    assert own.problem.bench.leap > 5 * found.problem.bench.step
    (again,) = fit_problems([own.problem], [found.minimum.x])
    sd = np.array(list(found.sd.values()))
    np.testing.assert_allclose((again.x - found.minimum.x) / sd, 0.0, atol=2 * SHIFT)


def test_the_covariance_is_the_scatter_over_noise() -> None:
    fits = [paper_fit(paper_arm(seed)[:1], beta=0.5, gamma=0.45) for seed in range(10, 34)]
    for name in ("xi", "alpha", "beta", "gamma"):
        z = np.array([(f.values[name] - PAPER[name]) / f.sd[name] for f in fits])
        # Of 24 draws: four standard errors.
        assert abs(z.mean()) < 4 / np.sqrt(24)
        assert 0.45 < z.std() < 1.6


def test_the_minimum_is_that_of_scipy() -> None:
    experiments = paper_arm()
    found = paper_fit(experiments, beta=0.3, gamma=0.4)
    problem = found.problem

    def residuals(x: np.ndarray) -> np.ndarray:
        return problem.bench.residuals(*problem.expand(x[:, None]))[:, 0]

    lower, upper = problem.bounds
    other = least_squares(
        residuals, found.minimum.x * 1.001, bounds=(lower, upper), x_scale=problem.scale, xtol=1e-12, ftol=1e-12
    )
    sd = np.array(list(found.sd.values()))
    np.testing.assert_allclose((other.x - found.minimum.x) / sd, 0.0, atol=0.02)


def test_a_gap_in_the_output_counts_nothing() -> None:
    slow, _ = paper_arm()
    output = slow.recording.output.copy()
    output[100:150] = np.nan
    gap = arm("slow", slow.recording.time, slow.drive, output)
    found = paper_fit((gap,), beta=0.5, gamma=0.45)
    assert found.problem.bench.n_data == 2 * 351
    assert abs(found.values["alpha"] - PAPER["alpha"]) < 4 * found.sd["alpha"]


def test_held_out_samples_are_not_fitted() -> None:
    slow, _ = paper_arm()
    spoiled = slow.recording.output.copy()
    spoiled[300:] += 0.1
    part = Experiment(arm("slow", slow.recording.time, slow.drive, spoiled).recording, slow.drive, slow.rig, 300)
    found = paper_fit((part,), beta=0.5, gamma=0.45)
    assert found.problem.bench.n_data == 600
    assert found.reduced_chi2 < 1.2
    (predicted,) = found.predict()
    assert predicted.shape == (401, 2)
    assert np.abs(predicted[300:] - slow.recording.output[300:]).max() < 10 * NOISE


def test_a_bound_is_respected_and_said() -> None:
    # Without any loss in the data, noise would drive some of three losses below zero.
    values = {**PAPER, "xi": 0.0}
    experiment = simulated("free", np.linspace(0.0, 8.0, 401), trapezoid(1.0, 1.0, 8.0), values, 5)
    found = paper_fit((experiment,), (*DECLARED, "quadratic_drag", "structural_damping"), beta=0.5, gamma=0.45)
    losses = [found.values[n] for n in ("xi", "c_2", "c_s")]
    assert min(losses) >= 0.0
    stuck = [n for n, b in zip(found.problem.names, found.minimum.at_bound, strict=True) if b]
    assert stuck
    for name in stuck:
        assert found.reasons[name] == "at its bound"
        assert np.isnan(found.sd[name])
        assert found.summary()["parameters"][name]["sd"] is None
    assert "at a bound" in found.status


def test_what_cannot_be_told_apart_is_named() -> None:
    # In a free decay, an instrument that is off and a spring that rests elsewhere read the same.
    columns = Columns(TimeColumn(), None, OutputColumn("output", "V"))
    time = np.linspace(0.0, 6.0, 301)
    truth = 0.3 * np.cos(3 * time) * np.exp(-0.05 * time)
    noisy = truth + 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    recording = Recording("decay", time, None, noisy[:, None], ("output",), ("V",), np.array([1e-3]), "", "")
    experiment = Experiment(recording, None, Rig("test", "oscillator", columns=columns))
    model = Model(
        "oscillator", ("viscous_damping", "linear_stiffness", "equilibrium_offset", "angle_offset"), {"g": 0.0}
    )
    together = Bench("oscillator", every_effect("oscillator"), [experiment], STEP)
    found = fit(
        model, [experiment], start={"xi": 0.05, "alpha": 8.8}, bench=together, units=NaturalUnits(1 / 3, 0.3, 1.0)
    )
    (direction,) = found.null_directions
    assert {"delta_0", "theta_0"} <= set(direction)
    assert found.reasons["theta_0"] == "not identifiable from these recordings"
    assert "undetermined" in found.status
    assert "alpha" not in found.reasons


def test_a_parameter_without_influence_is_said() -> None:
    columns = Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("output", "V"))
    time = np.linspace(0.0, 6.0, 301)
    truth = 0.3 * np.cos(3 * time)
    recording = Recording("still", time, 0 * time, truth[:, None], ("output",), ("V",), np.array([1e-3]), "", "")
    still = Drive(time[[0, -1]], np.zeros((1, 1)), np.empty(0))
    experiment = Experiment(recording, still, Rig("test", "oscillator", columns=columns))
    together = Bench("oscillator", every_effect("oscillator"), [experiment], STEP)
    model = Model("oscillator", ("linear_stiffness",))
    found = fit(
        model, [experiment], start={"alpha": 8.9, "g": 1.0}, bench=together, units=NaturalUnits(1 / 3, 0.3, 1.0)
    )
    assert found.reasons == {"g": "the data do not depend on it"}
    assert found.values["alpha"] == pytest.approx(9.0, abs=1e-5)


def test_many_problems_at_once_are_the_same_problems_one_by_one() -> None:
    together = bench(*paper_arm())
    problems = [
        Problem(Model("constant_radius", effects, {"length": 1.0}), together, UNITS, {})
        for effects in (DECLARED, (*DECLARED, "sensor_delay"), (*DECLARED, "coulomb_friction"))
    ]
    starts = [p.start({"xi": 0.03, "alpha": 8.6, "gamma": 0.4}) for p in problems]
    for problem, start, minimum in zip(problems, starts, fit_problems(problems, starts), strict=True):
        (alone,) = fit_problems([problem], [start])
        np.testing.assert_array_equal(alone.x, minimum.x)


def test_problems_on_different_benches_are_fitted_as_each_alone() -> None:
    model = Model("constant_radius", DECLARED, {"length": 1.0})
    slow, fast = (Problem(model, bench(e), UNITS, {}) for e in paper_arm())
    problems = [slow, fast, slow]
    starts = [
        p.start({"xi": xi, "alpha": 8.6, "gamma": 0.4}) for p, xi in zip(problems, (0.03, 0.03, 0.05), strict=True)
    ]
    for problem, start, minimum in zip(problems, starts, fit_problems(problems, starts), strict=True):
        (alone,) = fit_problems([problem], [start])
        np.testing.assert_array_equal(alone.x, minimum.x)


def test_residuals_in_pieces_are_those_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    b = bench(*paper_arm())
    problem = Problem(Model("constant_radius", DECLARED, {"length": 1.0}), b, UNITS, {})
    many = np.repeat(problem.start({"xi": 0.03, "alpha": 8.6})[:, None], 150, axis=1)
    many[problem.free.index("alpha")] = np.linspace(8.0, 9.0, 150)
    # A stiffness that makes the solver blow up: refused, and its neighbours are not.
    many[problem.free.index("alpha"), 70] = 1e9
    at_once = b.residuals(*problem.expand(many))
    monkeypatch.setattr("discovery.estimation.bench._PIECE", 64.0 * b.n_rows)
    assert [p.indices(150)[:2] for p in b.pieces(150)] == [(0, 64), (64, 128), (128, 150)]
    np.testing.assert_array_equal(b.residuals(*problem.expand(many)), at_once)
    assert np.flatnonzero(~np.isfinite(at_once).all(axis=0)).tolist() == [70]
    assert np.isinf(at_once[:, 70]).all()
    for e, (rows, present), predicted in zip(b.experiments, b.blocks(), problem.predict(many[:, 0]), strict=True):
        expected = np.where(present, (predicted - e.recording.output) / NOISE, 0.0)
        np.testing.assert_allclose(at_once[rows, 0].reshape(present.shape), expected, rtol=1e-9)


# The minimiser.


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.integers(1, 4))
def test_a_linear_problem_within_bounds(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, target = rng.standard_normal((12, size)), rng.standard_normal(12)
    upper = rng.uniform(0.05, 0.5, size)
    (minimum,) = minimise(
        [levenberg_marquardt(np.zeros(size), -upper, upper, np.ones(size))],
        lambda wanted: [matrix @ x - target[:, None] for _, x in wanted],
    )
    expected = least_squares(
        lambda x: matrix @ x - target, np.zeros(size), bounds=(-upper, upper), xtol=1e-14, ftol=1e-14
    )
    assert minimum.converged
    assert minimum.cost == pytest.approx(expected.cost, rel=1e-6, abs=1e-6)
    assert (np.abs(minimum.x) <= upper).all()


def test_rosenbrock() -> None:
    def residuals(x: np.ndarray) -> np.ndarray:
        return np.stack([10 * (x[1] - x[0] ** 2), 1 - x[0]]) * 1e4

    request = levenberg_marquardt(np.array([-1.2, 1.0]), np.full(2, -9.0), np.full(2, 9.0), np.ones(2), iterations=80)
    (minimum,) = minimise([request], lambda wanted: [residuals(x) for _, x in wanted])
    np.testing.assert_allclose(minimum.x, 1.0, atol=1e-6)


def test_a_start_outside_the_bounds_is_moved_inside() -> None:
    request = levenberg_marquardt(np.array([7.0]), np.array([0.0]), np.array([2.0]), np.ones(1))
    (minimum,) = minimise([request], lambda wanted: [100 * (x - 5.0) for _, x in wanted])
    assert minimum.x[0] == 2.0
    assert minimum.at_bound[0]


def test_a_rig_alone_declares_no_model() -> None:
    with pytest.raises(InputError, match=r"of an Experiment, not of a Rig; make one with `make_experiment"):
        declared_model(Rig("bare"))  # type: ignore[arg-type]
