"""The log evidence of a set: exact for linear models, and right where the model error or the noise is not as stated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import multivariate_normal

from discovery.declarations.priors import HalfStudent, LogNormal, Normal, Prior, Student
from discovery.estimation.laplace import Belief, bounded_step
from discovery.estimation.linear_problem import Linearised
from discovery.estimation.log_evidence import constant_score, evidence_of
from discovery.estimation.model_error import Channel

TIME = np.arange(0, 30, 0.05)
#: Natural time of the motion, and the memory of the model error.
NATURAL, MEMORY = 4.5, 0.5


def belief(width: np.ndarray) -> Belief:
    """Zero-mean Gaussian priors, linearised around zero."""
    p = width.size
    free = np.full(p, np.inf)
    log = -np.log(width * np.sqrt(2 * np.pi))
    return Belief(log, width, np.zeros(p), -free, free, np.zeros(p, bool))


def problem(slopes: np.ndarray, y: np.ndarray, *, held: np.ndarray | None = None, width: float = 3.0) -> Linearised:
    """y = slopes @ theta + error, as residuals of a model at theta = 0."""
    own = belief(np.full(slopes.shape[1], width))
    blocks = [Channel(TIME[: y.size], np.column_stack([-slopes[: y.size], y]))]
    others = [] if held is None else [[Channel(TIME[: held.size], np.column_stack([-slopes[: held.size], held]))]]
    return Linearised(blocks, others, own, slopes.shape[1], NATURAL, 0.15)


def correlation() -> np.ndarray:
    lag = np.abs(np.subtract.outer(TIME, TIME)) / MEMORY
    return (1 + lag) * np.exp(-lag)


#: Factor of the correlation, which is singular to round-off.
FACTOR = np.linalg.cholesky(correlation() + 1e-9 * np.eye(TIME.size))


def drawn(size: float, seed: int, noise: float = 1.0) -> np.ndarray:
    white, smooth = np.random.default_rng(seed).normal(size=(2, TIME.size))
    return noise * white + size * FACTOR @ smooth


SLOPES = np.column_stack([np.sin(1.3 * TIME), np.cos(0.4 * TIME)])


@pytest.mark.parametrize("size", [0.0, 0.7, 12.0])
def test_the_evidence_of_a_linear_model_is_that_of_the_dense_gaussian(size: float) -> None:
    y = SLOPES @ [0.5, -1.0] + drawn(size, 3)
    found = problem(SLOPES, y).mode(size)
    dense = np.eye(TIME.size) + size**2 * correlation() + 9.0 * SLOPES @ SLOPES.T
    exact = multivariate_normal.logpdf(y, np.zeros(TIME.size), dense)
    # The noise may exceed what is stated, by as much as chance makes it seem to.
    assert found.log_evidence == pytest.approx(exact, abs=3.0)
    assert 1.0 <= found.white < 1.1


def test_the_step_is_the_generalised_least_squares_estimate() -> None:
    y = SLOPES @ [0.5, -1.0] + drawn(4.0, 5)
    found = problem(SLOPES, y).mode(4.0)
    inverse = np.linalg.inv(found.white**2 * (np.eye(TIME.size) + 16.0 * correlation()))
    precision = SLOPES.T @ inverse @ SLOPES + np.eye(2) / 9.0
    assert found.step == pytest.approx(np.linalg.solve(precision, SLOPES.T @ inverse @ y), rel=1e-6)


@pytest.mark.parametrize("size", [0.5, 3.0, 20.0])
def test_the_size_of_the_model_error_is_found(size: float) -> None:
    found = [evidence_of(problem(SLOPES, drawn(size, seed))).error for seed in range(6)]
    assert np.mean(found) == pytest.approx(size, rel=0.15)


def test_the_size_does_not_depend_on_the_sampling_rate() -> None:
    # What a wrong model leaves is smooth: read ten times as often, it is no smaller.
    def size(step: float) -> float:
        time = np.arange(0, 30, step)
        left = 20 * np.sin(1.1 * time + np.sin(0.21 * time)) + np.random.default_rng(1).normal(size=time.size)
        columns = np.column_stack([np.zeros(time.size), left])
        return evidence_of(Linearised([Channel(time, columns)], [], belief(np.ones(1)), 1, NATURAL, 0.15)).error

    assert size(0.01) == pytest.approx(size(0.1), rel=0.25)


def test_an_error_larger_than_what_is_left_is_none() -> None:
    # A remainder that forgets at once asks a slow process for a size that it does not have.
    fast = 10 * np.random.default_rng(3).normal(size=TIME.size)
    found = evidence_of(problem(SLOPES, fast))
    assert found.error <= 1.01 * np.sqrt(np.mean(fast**2))


def test_noise_alone_has_no_model_error() -> None:
    found = [evidence_of(problem(SLOPES, drawn(0.0, seed))) for seed in range(20)]
    assert all(e.error < 0.3 for e in found)
    assert sum(e.nil < 3.0 for e in found) >= 19


def test_noise_that_is_stated_too_small_is_no_model_error() -> None:
    found = evidence_of(problem(SLOPES, drawn(0.0, 4, noise=5.0)))
    assert found.white == pytest.approx(5.0, rel=0.1)
    assert found.error < 0.3 * found.white


def test_an_effect_that_is_not_there_loses_and_one_that_is_wins() -> None:
    extra = np.column_stack([SLOPES, np.sin(2.2 * TIME)])
    absent = [drawn(2.0, seed) for seed in range(10)]
    gains = [evidence_of(problem(extra, y)).train - evidence_of(problem(SLOPES, y)).train for y in absent]
    assert max(gains) < 3.0
    there = drawn(0.0, 1) + 2.0 * np.sin(2.2 * TIME)
    assert evidence_of(problem(extra, there)).train - evidence_of(problem(SLOPES, there)).train > 20


def test_what_shaves_a_smooth_leftover_gains_little_and_what_halves_it_gains_much() -> None:
    smooth = 100 * np.sin(0.9 * TIME + np.sin(0.31 * TIME))
    whole = evidence_of(problem(SLOPES, smooth + drawn(0.0, 2))).train
    shaved = evidence_of(problem(SLOPES, 0.95 * smooth + drawn(0.0, 2))).train
    third = evidence_of(problem(SLOPES, smooth / 3 + drawn(0.0, 2))).train
    pieces = TIME[-1] / MEMORY
    assert third - whole > 10 * (shaved - whole) > 0
    assert shaved - whole < 0.1 * TIME.size
    assert third - whole > 0.5 * pieces


def test_intervals_hold_a_model_error_that_looks_like_a_parameter() -> None:
    # Half of the model error moves the readings as the first parameter does.
    y = SLOPES @ [0.5, -1.0] + drawn(20.0, 3) + 10.0 * np.sqrt(2) * SLOPES[:, 0]
    narrow, wide = (evidence_of(replace(problem(SLOPES, y, width=50.0), form=form)) for form in (0.0, 0.5))
    assert narrow.step == pytest.approx(wide.step)
    off = abs(wide.step[0] - 0.5)
    ninety = 1.645
    assert ninety * np.sqrt(narrow.covariance[0, 0]) < off < ninety * np.sqrt(wide.covariance[0, 0])
    # The movement of the readings that a standard deviation makes is that share of the model error.
    moved = np.sqrt(np.mean(np.outer(SLOPES[:, 0], np.sqrt(wide.covariance[0, 0] - narrow.covariance[0, 0])) ** 2))
    assert moved == pytest.approx(0.5 * wide.error, rel=0.1)


def test_a_model_error_does_not_widen_what_the_prior_alone_tells() -> None:
    # The readings know the first parameter, and nothing of the second.
    y = SLOPES @ [0.5, 0.0] + drawn(20.0, 3)
    known = evidence_of(replace(problem(SLOPES * [1.0, 1e-3], y), form=0.5))
    assert known.nil > 0
    assert np.sqrt(known.covariance[1, 1]) == pytest.approx(3.0, rel=0.01)
    alone = evidence_of(replace(problem(SLOPES[:, :1], y), form=0.5))
    assert known.covariance[0, 0] == pytest.approx(alone.covariance[0, 0], rel=0.01)


def test_without_a_model_error_intervals_are_those_of_the_noise() -> None:
    y = SLOPES @ [0.5, -1.0] + drawn(0.0, 6)
    found = evidence_of(replace(problem(SLOPES, y), form=0.5))
    assert found.nil <= 0
    assert found.covariance == pytest.approx(evidence_of(problem(SLOPES, y)).covariance)


def test_the_held_out_score_is_that_of_the_posterior_predictive() -> None:
    y, held = SLOPES @ [1.0, 0.5] + drawn(0.0, 7), SLOPES @ [1.0, 0.5] + drawn(0.0, 8)
    both = problem(SLOPES, y, held=held)
    train = both.mode(0.0)
    judged = both.mode(0.0, both.held[0], both.prior.after(train, both.belief))
    dense = np.eye(TIME.size) + SLOPES @ np.linalg.inv(train.precision) @ SLOPES.T
    exact = multivariate_normal.logpdf(held, SLOPES @ train.step, dense)
    assert judged.log_evidence == pytest.approx(exact, abs=3.0)


def test_a_model_that_is_wrong_on_the_held_out_part_loses_there() -> None:
    y = SLOPES @ [1.0, 0.5] + drawn(0.0, 7)
    right = evidence_of(problem(SLOPES, y, held=SLOPES @ [1.0, 0.5] + drawn(0.0, 8)))
    wrong = evidence_of(problem(SLOPES, y, held=SLOPES @ [1.0, -2.5] + drawn(0.0, 8)))
    assert right.held - wrong.held > 50
    assert wrong.error_held > 5 * wrong.error


def test_what_could_be_fitted_to_the_held_out_part_does_not_predict_it() -> None:
    # Held out, the first parameter is of the other sign; beside a model error its interval is wide.
    y, held = SLOPES @ [20.0, 0.5] + drawn(5.0, 3), SLOPES @ [-20.0, 0.5] + drawn(5.0, 4)
    found, without = (
        evidence_of(replace(problem(slopes, y, held=held, width=50.0), form=1.4)) for slopes in (SLOPES, SLOPES[:, 1:])
    )
    assert found.held > without.held + 20
    assert found.ahead < without.ahead - 20
    # Where the parameters are known, the two scores are one.
    y, held = (SLOPES @ [1.0, 0.5] + drawn(0.0, seed) for seed in (7, 8))
    known = evidence_of(problem(SLOPES, y, held=held))
    assert known.ahead == pytest.approx(known.held, abs=5.0)


def test_what_lies_on_a_bound_does_not_move() -> None:
    y = SLOPES @ [-0.5, 1.0] + drawn(0.0, 9)
    whole = problem(SLOPES, y)
    bounded = replace(whole.belief, low=np.array([0.0, -np.inf]), frozen=np.array([False, False]))
    step = replace(whole, belief=bounded).mode(0.0).step
    assert step[0] == 0.0
    alone = problem(SLOPES[:, 1:], y).mode(0.0).step
    assert step[1] == pytest.approx(alone[0], rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_bounded_step_is_that_of_bounded_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, target = rng.normal(size=(30, 4)), rng.normal(size=30)
    low, high = -rng.random(4) * 0.2, rng.random(4) * 0.2
    found = bounded_step(matrix.T @ matrix, matrix.T @ target, low, high, np.ones(4, bool))
    exact = lsq_linear(matrix, -target, (low, high)).x
    cost, least = (np.sum((matrix @ x + target) ** 2) for x in (found, exact))
    assert np.all((found >= low) & (found <= high))
    assert cost <= 1.0001 * least


def test_a_bound_moves_nothing_along_what_hangs_together_closely() -> None:
    # Two parameters that are all but one, their difference told at a ten-thousand-millionth; a third on its bound.
    form = np.array([[1.0, 1.0 - 1e-10, 0.0], [1.0 - 1e-10, 1.0, 0.0], [0.0, 0.0, 1.0]])
    push = np.array([-0.5e-10, 0.5e-10, 1.0])
    low, high = np.array([-np.inf, -np.inf, 0.0]), np.full(3, np.inf)
    found = bounded_step(form, push, low, high, np.ones(3, bool))
    assert found == pytest.approx([0.5, -0.5, 0.0], abs=1e-4)


def test_a_bound_takes_nothing_along_what_no_reading_tells() -> None:
    """Two parameters of which the readings tell the sum, beside one that a bound stops."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((50, 2)) @ np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    residual = columns @ np.array([2.0, 1.0, 3.0]) + 1e-3 * rng.standard_normal(50)
    form, push = columns.T @ columns, columns.T @ residual
    low, high = np.array([-np.inf, -np.inf, -1.0]), np.full(3, np.inf)
    step = bounded_step(form, push, low, high, np.ones(3, bool))
    assert np.abs(step).max() < 10.0
    assert step[2] == -1.0
    least = np.sum((residual + columns @ step) ** 2)
    assert residual @ residual + 2 * step @ push + step @ form @ step == pytest.approx(least, rel=1e-9)


def test_what_predicts_worse_than_a_constant_gains_nothing_over_what_runs_away() -> None:
    """Of two predictions that both miss by more than the readings scatter, neither is the merit of the other's law."""
    held = drawn(300.0, 5)
    held -= held.mean()
    least = constant_score([Channel(TIME, held[:, None])], NATURAL, 0.15)
    y = SLOPES @ [0.5, -1.0] + drawn(0.0, 3)

    def scores(off: np.ndarray) -> tuple[float, float]:
        found = evidence_of(replace(problem(SLOPES, y, held=off), constants=[least]))
        return found.held, found.ahead

    bad, mad = (held + size * np.exp(TIME / 4) for size in (800.0, 1e6))
    good = 1.0 + drawn(1.0, 6)
    # The parameters of these slopes could take some of a miss; the estimate alone cannot.
    assert scores(mad) == (least, least)
    assert scores(bad)[1] == least
    assert min(scores(good)) > least + 100
    free = [evidence_of(problem(SLOPES, y, held=off)).ahead for off in (bad, mad)]
    assert free[0] > free[1] + 100


@pytest.mark.parametrize(("second", "missed"), [(-1.0, False), (-2.0, True)])
def test_a_hold_out_is_missed_where_the_estimate_leaves_more_than_noise(second: float, *, missed: bool) -> None:
    """Whatever it takes for its own: fitted to it, the law would leave noise."""
    held = SLOPES @ [0.5, second] + drawn(0.0, 8)
    found = evidence_of(problem(SLOPES, SLOPES @ [0.5, -1.0] + drawn(0.0, 7), held=held))
    assert found.misses is missed
    assert found.chi2_ahead > found.chi2_held


@pytest.mark.parametrize("prior", [Student(0.5), HalfStudent(0.5), LogNormal(0.5, 1.0)], ids=lambda p: p.law)
def test_a_prior_that_is_not_gaussian_has_no_centre(prior: Prior) -> None:
    """A Gaussian of the same slope believes more than a heavy tail does, and without end in what is nearly nothing."""
    assert np.isnan(prior.centre)
    assert Normal(0.3, 2.0).centre == 0.3


@pytest.mark.parametrize("along", [0.0, 5.0, -8.0])
def test_where_a_fit_ends_between_two_parameters_that_do_the_same_costs_nothing(along: float) -> None:
    slopes = np.column_stack([SLOPES[:, 0], SLOPES[:, 0]])
    y = slopes @ [0.5, 0.5] + drawn(0.0, 3)
    own = belief(np.full(2, 3.0))
    at = np.array([along, -along])
    moved = Belief(own.log_density, own.width, own.centre - at, own.low, own.high, own.frozen)
    found = Linearised([Channel(TIME, np.column_stack([-slopes, y]))], [], moved, 2, NATURAL, 0.15).mode(0.0)
    assert found.log_evidence == pytest.approx(problem(slopes, y).mode(0.0).log_evidence, abs=1e-6)
    assert at + found.step == pytest.approx(problem(slopes, y).mode(0.0).step, abs=1e-6)
