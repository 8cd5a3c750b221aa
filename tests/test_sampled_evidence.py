"""Importance sampling of the evidence against quadrature: next to a bound, and where Laplace's method is right."""

import numpy as np
import pytest
from driven_oscillator import ALPHA, DRIVE, EFFECTS, NOISE, experiment, responses
from scipy.special import logsumexp

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.laplace import Belief, Mode, belief_of
from discovery.estimation.linear_problem import Linearised
from discovery.estimation.model_error import Channel, ModelError, innovations
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.sampled_evidence import sampled

TIME = np.linspace(0.0, 6.0, 61)
UNITS = NaturalUnits(time=1 / DRIVE, coordinate=1.0, length=1.0, drive=1.0)
SIZE = 0.4


def fitted(damping: float, seed: int) -> tuple[Problem, np.ndarray, Linearised]:
    """An oscillator whose damping and initial state are free, linearised at its minimum."""
    noise = NOISE * np.random.default_rng(seed).normal(size=TIME.size)
    errors = (responses(TIME, damping) - responses(TIME)) @ [1.7, 0.4, -0.2] + noise
    bench = Bench("oscillator", EFFECTS, [experiment(errors, TIME)], 0.02)
    problem = Problem(Model("oscillator", EFFECTS, {"alpha": ALPHA, "g": 1.7}), bench, UNITS, {})
    (minimum,) = fit_problems([problem], [problem.start({"xi": max(damping, 0.01)})], tolerance=1e-8)
    x, apart = minimum.x, np.array([1e-3, 1e-4, 1e-4])
    left = bench.residuals(*problem.expand(x[:, None] + np.hstack([np.diag(apart), -np.diag(apart), np.zeros((3, 1))])))
    columns = np.column_stack([(left[:, :3] - left[:, 3:6]) / (2 * apart), left[:, 6]])
    belief: Belief = belief_of(problem, x, minimum.at_bound, ())
    return problem, x, Linearised([Channel(TIME, columns)], [], belief, 3, UNITS.time, 0.15)


def by_quadrature(problem: Problem, x: np.ndarray, linear: Linearised) -> float:
    """The readings are linear in the initial state: the damping alone is integrated by a sum."""
    error = ModelError.of(SIZE, UNITS.time)
    low, spread = problem.bounds[0][0], 12 / np.sqrt(linear.mode(SIZE).precision[0, 0])
    grid = np.linspace(max(low, x[0] - spread), x[0] + spread, 801)
    logs = []
    for xi in grid:
        points = np.array([[xi] * 3, [x[1], x[1] + 1, x[1]], [x[2], x[2], x[2] + 1]])
        left, logarithms = innovations(TIME, problem.bench.residuals(*problem.expand(points)), error)
        slopes, at = left[:, 1:] - left[:, :1], left[:, 0]
        step, *_ = np.linalg.lstsq(slopes, -at, rcond=None)
        rest = float(np.sum((at + slopes @ step) ** 2))
        determinant = float(np.linalg.slogdet(slopes.T @ slopes)[1])
        logs.append(-0.5 * (rest + logarithms + determinant + (TIME.size - 2) * np.log(2 * np.pi)))
    return float(logsumexp(logs) + np.log(grid[1] - grid[0]) + linear.belief.log_density.sum())


@pytest.mark.parametrize(("damping", "most"), [(0.3, 0.3), (-0.01, 5.0)], ids=["inside", "on its bound"])
def test_the_corrected_evidence_is_that_of_quadrature(damping: float, most: float) -> None:
    problem, x, linear = fitted(damping, 2)
    mode: Mode = linear.mode(SIZE)
    assert mode.white == 1.0
    exact = by_quadrature(problem, x, linear)
    found = sampled(problem, x, linear, SIZE, np.random.default_rng(1))
    assert found.reliable
    assert mode.log_evidence + found.correction == pytest.approx(exact, abs=4 * found.error + 0.02)
    assert abs(found.correction) < most


def test_next_to_a_bound_the_normal_distribution_is_wrong() -> None:
    problem, x, linear = fitted(-0.01, 2)
    assert x[0] == problem.bounds[0][0]
    assert abs(sampled(problem, x, linear, SIZE, np.random.default_rng(1)).correction) > 0.5


def test_beyond_a_bound_no_draw_is_lost() -> None:
    beside, inside = (
        [sampled(*fitted(damping, 2), SIZE, np.random.default_rng(seed)).error for seed in range(4)]
        for damping in (-0.01, 0.3)
    )
    assert np.mean(beside) < 1.5 * np.mean(inside)


def test_the_same_seed_gives_the_same_digits() -> None:
    problem, x, linear = fitted(0.3, 2)
    first, second = (sampled(problem, x, linear, SIZE, np.random.default_rng(7)) for _ in range(2))
    assert first == second


def test_where_no_draw_is_possible_nothing_is_corrected() -> None:
    problem, x, linear = fitted(0.3, 2)
    away = Problem(problem.model, problem.bench, problem.units, {"xi": (1e6, 1.0)})
    found = sampled(away, x, linear, SIZE, np.random.default_rng(1))
    assert not found.reliable
    assert found.correction == 0.0


def test_where_hardly_a_draw_is_possible_nothing_is_corrected() -> None:
    problem, x, linear = fitted(0.3, 2)
    spread = 1 / np.sqrt(linear.mode(SIZE).precision[0, 0])
    # Bounds that let one draw in twenty pass.
    corner = Problem(problem.model, problem.bench, problem.units, {"xi": (x[0], 0.02 * spread)})
    assert not sampled(corner, x, linear, SIZE, np.random.default_rng(1)).reliable
