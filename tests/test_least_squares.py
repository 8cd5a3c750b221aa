from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from discovery.estimation.least_squares import FloatArray, Minimum, levenberg_marquardt, minimise

Residuals = Callable[[FloatArray], FloatArray]


def solve(residuals: Residuals, start, lower=None, upper=None, scale=None, at_once: int = 0, **options) -> Minimum:
    """Minimise one problem whose residuals take parameter vectors (p, k) and return (n, k)."""
    start = np.asarray(start, float)
    lower = np.full(start.size, -np.inf) if lower is None else np.asarray(lower, float)
    upper = np.full(start.size, np.inf) if upper is None else np.asarray(upper, float)
    scale = np.maximum(np.abs(start), 1e-3) if scale is None else np.asarray(scale, float)
    request = levenberg_marquardt(start, lower, upper, scale, **options)
    (found,) = minimise([request], lambda wanted: [residuals(x) for _, x in wanted], at_once)
    return found


# Certified regressions.


@dataclass(frozen=True)
class Certified:
    """A nonlinear regression with certified results."""

    model: Callable[[FloatArray, FloatArray], FloatArray]
    data: tuple[float, ...]
    starts: tuple[tuple[float, ...], ...]
    estimates: tuple[float, ...]
    sds: tuple[float, ...]
    residual_sum: float

    @property
    def xy(self) -> FloatArray:
        return np.array(self.data).reshape(2, -1)


#: Statistical Reference Datasets of the National Institute of Standards and Technology (United States), nonlinear
#: regression: data, starts, certified estimates, standard deviations and residual sums of squares. Predictors
#: first, responses second. Misra1a is of lower, Roszman1 of average, the others of higher difficulty. From the far
#: starts of BoxBOD and MGH09, which are left out, the search runs off to a plateau at infinity.
NIST = {
    "Misra1a": Certified(
        lambda b, x: b[0] * (1 - np.exp(-b[1] * x)),
        (77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0,
         10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78),
        ((500, 0.0001), (250, 0.0005)),
        (2.3894212918e02, 5.5015643181e-04),
        (2.7070075241e00, 7.2668688436e-06),
        1.2455138894e-01,
    ),
    "Roszman1": Certified(
        lambda b, x: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi,
        (-4868.68, -4868.09, -4867.41, -3375.19, -3373.14, -3372.03, -2473.74, -2472.35, -2469.45, -1894.65, -1893.40,
         -1497.24, -1495.85, -1493.41, -1208.68, -1206.18, -1206.04, -997.92, -996.61, -996.31, -834.94, -834.66,
         -710.03, -530.16, -464.17,
         0.252429, 0.252141, 0.251809, 0.297989, 0.296257, 0.295319, 0.339603, 0.337731, 0.333820, 0.389510, 0.386998,
         0.438864, 0.434887, 0.427893, 0.471568, 0.461699, 0.461144, 0.513532, 0.506641, 0.505062, 0.535648, 0.533726,
         0.568064, 0.612886, 0.624169),
        ((0.1, -0.00001, 1000, -100), (0.2, -0.000005, 1200, -150)),
        (2.0196866396e-01, -6.1953516256e-06, 1.2044556708e03, -1.8134269537e02),
        (1.9172666023e-02, 3.2058931691e-06, 7.4050983057e01, 4.9573513849e01),
        4.9484847331e-04,
    ),
    "BoxBOD": Certified(
        lambda b, x: b[0] * (1 - np.exp(-b[1] * x)),
        (1, 2, 3, 5, 7, 10, 109, 149, 149, 191, 213, 224),
        ((100, 0.75),),
        (2.1380940889e02, 5.4723748542e-01),
        (1.2354515176e01, 1.0455993237e-01),
        1.1680088766e03,
    ),
    "Rat43": Certified(
        lambda b, x: b[0] / (1 + np.exp(b[1] - b[2] * x)) ** (1 / b[3]),
        (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16.08, 33.83, 65.80, 97.20, 191.55, 326.20, 386.87, 520.53,
         590.03, 651.92, 724.93, 699.56, 689.96, 637.56, 717.41),
        ((100, 10, 1, 1), (700, 5, 0.75, 1.3)),
        (6.9964151270e02, 5.2771253025e00, 7.5962938329e-01, 1.2792483859e00),
        (1.6302297817e01, 2.0828735829e00, 1.9566123451e-01, 6.8761936385e-01),
        8.7864049080e03,
    ),
    "MGH09": Certified(
        lambda b, x: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
        (4, 2, 1, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625,
         0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246),
        ((0.25, 0.39, 0.415, 0.39),),
        (1.9280693458e-01, 1.9128232873e-01, 1.2305650693e-01, 1.3606233068e-01),
        (1.1435312227e-02, 1.9633220911e-01, 8.0842031232e-02, 9.0025542308e-02),
        3.0750560385e-04,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("name", "start"), [(name, s) for name, c in NIST.items() for s in c.starts])
def test_certified_regressions(name: str, start: tuple[float, ...]) -> None:
    certified = NIST[name]
    x, y = certified.xy
    freedom = x.size - len(start)
    noise = np.sqrt(certified.residual_sum / freedom)

    def residuals(b: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return np.stack([(certified.model(column, x) - y) / noise for column in b.T], axis=1)

    found = solve(residuals, start, iterations=200)
    sds = np.array(certified.sds)
    assert found.converged
    assert found.cost == pytest.approx(freedom / 2, rel=1e-6)
    # Far beyond what statistics needs: a thousandth of a standard deviation.
    np.testing.assert_allclose((found.x - np.array(certified.estimates)) / sds, 0.0, atol=1e-3)
    covariance = np.linalg.inv(found.jacobian.T @ found.jacobian)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sds, rtol=5e-3)


# Bounds.


def decay(t: FloatArray, y: FloatArray) -> Residuals:
    return lambda b: (b[0] * np.exp(-b[1] * t[:, None]) + b[2] - y[:, None]) * 100


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000))
def test_bounded_problems_end_where_scipy_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 5, 40)
    truth = rng.uniform((0.5, 0.3, -0.5), (2.0, 1.5, 0.5))
    y = truth[0] * np.exp(-truth[1] * t) + truth[2] + 0.01 * rng.standard_normal(t.size)
    # Some of the bounds cut the minimum off.
    lower, upper = truth - rng.uniform(-0.05, 0.4, 3), truth + rng.uniform(0.1, 0.4, 3)
    start = rng.uniform(lower, upper)
    residuals = decay(t, y)
    found = solve(residuals, start, lower, upper)
    other = least_squares(
        lambda b: residuals(b[:, None])[:, 0], start, bounds=(lower, upper), xtol=1e-14, ftol=1e-14, gtol=1e-12
    )
    assert found.converged
    assert ((found.x >= lower) & (found.x <= upper)).all()
    assert found.cost <= other.cost * (1 + 1e-6) + 1e-5
    np.testing.assert_array_equal(found.at_bound, (found.x == lower) | (found.x == upper))
    free = ~found.at_bound
    gradient = found.jacobian.T @ found.residual
    # First-order conditions: no slope along free directions (in sds), slope into the wall at bounds.
    size = np.linalg.norm(found.jacobian, axis=0)
    assert (np.abs(gradient[free]) / size[free] < 5e-3).all()
    assert (gradient[found.x == lower] >= 0).all()
    assert (gradient[found.x == upper] <= 0).all()


def test_a_bound_that_the_path_touches_is_left_again() -> None:
    def residuals(b: FloatArray) -> FloatArray:
        return np.stack([10 * (b[1] - b[0] ** 2), 1 - b[0]]) * 1e3

    found = solve(residuals, [-1.2, 1.0], [-1.5, 0.0], [2.0, 2.0], iterations=80)
    np.testing.assert_allclose(found.x, 1.0, atol=1e-6)
    assert not found.at_bound.any()


def test_a_corner_that_holds_everything_ends_the_search() -> None:
    found = solve(lambda b: 10 * (b + 3.0), [0.5, 0.5], [0.0, 0.0], [1.0, 1.0])
    assert found.converged
    np.testing.assert_array_equal(found.x, 0.0)
    assert found.at_bound.all()


# The quick search.


def test_the_quick_search_reaches_the_same_minimum_with_fewer_questions() -> None:
    rng = np.random.default_rng(3)
    t = np.linspace(0, 5, 60)
    y = 1.3 * np.exp(-0.7 * t) + 0.2 + 0.01 * rng.standard_normal(t.size)
    asked = 0

    def residuals(b: FloatArray) -> FloatArray:
        nonlocal asked
        asked += b.shape[1]
        return decay(t, y)(b)

    start = np.array([1.2, 0.8, 0.15])
    thorough = solve(residuals, start)
    questions, asked = asked, 0
    jacobian = np.stack([np.exp(-0.8 * t), -1.2 * t * np.exp(-0.8 * t), np.ones(t.size)], axis=1) * 100
    given_jacobian = jacobian.copy()
    quick = solve(residuals, start, jacobian=jacobian, tolerance=1e-3)
    assert quick.converged
    assert asked < questions
    # It stops within a tenth of a chi-square, which is a third of a standard deviation.
    assert 0 <= quick.cost - thorough.cost < 0.05
    sd = 1 / np.linalg.norm(thorough.jacobian, axis=0)
    assert (np.abs(quick.x - thorough.x) < 2 * sd).all()
    np.testing.assert_array_equal(jacobian, given_jacobian)


def test_unknown_columns_of_a_quick_search_are_found_out() -> None:
    t = np.linspace(0, 5, 60)
    y = 1.3 * np.exp(-0.7 * t) + 0.2 + 0.01 * np.random.default_rng(3).standard_normal(t.size)
    start = np.array([1.2, 0.8, 0.15])
    jacobian = np.stack([np.exp(-0.8 * t), 0 * t, np.ones(t.size)], axis=1) * 100
    quick = solve(decay(t, y), start, jacobian=jacobian, tolerance=1e-3)
    assert quick.cost - solve(decay(t, y), start).cost < 0.05
    assert quick.x[1] != start[1]


def test_the_quick_search_survives_a_wrong_jacobian() -> None:
    t = np.linspace(0, 5, 60)
    y = 1.3 * np.exp(-0.7 * t) + 0.2
    start = np.array([1.0, 1.2, 0.0])
    wrong = np.random.default_rng(0).standard_normal((t.size, 3))
    found = solve(decay(t, y), start, jacobian=wrong, tolerance=1e-3, iterations=60)
    assert found.cost < 0.06


# Trouble.


def test_trial_steps_into_a_blow_up_are_refused() -> None:
    def residuals(b: FloatArray) -> FloatArray:
        x = b[0]
        # Beyond 2 the simulation has no finite answer; the full first step from -3 would go there.
        bad = np.where(x > 2.0, np.nan, 0.0)
        with np.errstate(over="ignore"):
            return np.stack([np.tanh(x) - np.tanh(1.5), 0.01 * (x - 1.5)]) * 1e3 + bad

    found = solve(residuals, [-3.0], iterations=200)
    assert found.converged
    assert found.x[0] == pytest.approx(1.5, abs=1e-4)
    assert np.isfinite(found.jacobian).all()
    # Whoever wonders whether they stopped it can tell.
    assert found.blown
    assert not solve(residuals, [1.4], iterations=200).blown


def test_a_start_without_a_finite_answer_is_given_up() -> None:
    found = solve(lambda b: np.full((4, b.shape[1]), np.nan), [1.0, 2.0])
    assert not found.converged
    assert found.cost == np.inf
    np.testing.assert_array_equal(found.x, [1.0, 2.0])


def test_overflow_counts_as_a_blow_up() -> None:
    found = solve(lambda b: np.full((4, b.shape[1]), 1e200), [1.0])
    assert found.cost == np.inf
    assert found.blown
    assert not found.converged


def test_a_parameter_without_influence_stays_where_it_is() -> None:
    found = solve(lambda b: np.stack([b[0] - 2.0, b[0] - 2.2]) * 10, [0.5, 7.0])
    assert found.converged
    assert found.x[0] == pytest.approx(2.1, abs=1e-6)
    assert found.x[1] == 7.0


@pytest.mark.parametrize("unit", [1e-12, 1e-5, 1.0, 1e5, 1e12])
@pytest.mark.parametrize("power", [1, 3])
def test_the_unit_of_a_parameter_changes_no_minimum(unit: float, power: int) -> None:
    t = np.linspace(0.0, 3.0, 40)
    sizes = np.array([unit, unit**-power])

    def residuals(x: FloatArray) -> FloatArray:
        first, second = x / sizes[:, None]
        return first * np.exp(-t[:, None] * second) - 2.0 * np.exp(-0.7 * t[:, None])

    found = solve(residuals, sizes, scale=sizes)
    np.testing.assert_allclose(found.x / sizes, [2.0, 0.7], rtol=1e-6)


def test_identical_columns_do_not_break_the_linear_algebra() -> None:
    found = solve(lambda b: np.stack([b[0] + b[1] - 2.0, b[0] + b[1] - 2.2]) * 10, [0.5, 0.5])
    assert found.converged
    assert found.x.sum() == pytest.approx(2.1, abs=1e-6)


def test_running_out_of_iterations_is_said() -> None:
    def residuals(b: FloatArray) -> FloatArray:
        return np.stack([10 * (b[1] - b[0] ** 2), 1 - b[0]]) * 1e4

    found = solve(residuals, [-1.2, 1.0], iterations=2)
    assert not found.converged
    assert found.iterations == 2


SWUNG = np.array([1.3, 0.7, 0.2, 0.1, -0.3, 0.05, 0.4, 0.1])


@pytest.fixture
def swing() -> Residuals:
    """Residuals of a decaying swing on a few slow ones, eight parameters, with noise."""
    t = np.linspace(0, 5, 200)

    def model(b: FloatArray) -> FloatArray:
        return (
            b[0] * np.exp(-b[1] * t) * np.cos(3 * (1 + 0.1 * b[2]) * t) + np.cos(np.outer(t, [0, 1, 2, 4, 5])) @ b[3:]
        )

    target = model(SWUNG) + 0.01 * np.random.default_rng(4).standard_normal(t.size)
    return lambda x: 100 * (np.stack([model(b) for b in x.T], axis=1) - target[:, None])


@pytest.mark.parametrize("bounded", [False, True])
def test_a_rough_search_ends_in_the_same_minimum_for_less(swing: Residuals, bounded: bool) -> None:
    upper = np.full(8, 5.0)
    if bounded:
        upper[1] = 0.6
    asked = {}

    def counted(rough: bool) -> Minimum:
        asked[rough] = 0

        def residuals(x: FloatArray) -> FloatArray:
            asked[rough] += x.shape[1]
            return swing(x)

        return solve(residuals, 0.5 * SWUNG, np.full(8, -5.0), upper, np.ones(8), tolerance=1e-7, rough=rough)

    fine, rough = counted(False), counted(True)
    assert rough.converged
    assert rough.x == pytest.approx(fine.x, abs=1e-4)
    assert rough.cost == pytest.approx(fine.cost, rel=1e-6)
    # It ends on a Jacobian that was differenced there, not on one that was carried along.
    assert rough.jacobian == pytest.approx(fine.jacobian, rel=1e-2, abs=1e-2 * np.abs(fine.jacobian).max())
    assert asked[True] < 0.8 * asked[False]


def test_derivatives_that_come_along_spare_rounds(swing: Residuals) -> None:
    free = np.full(8, 5.0)
    rounds: dict[int, list[int]] = {}

    def counted(at_once: int) -> Minimum:
        rounds[at_once] = []

        def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
            rounds[at_once].append(sum(x.shape[1] for _, x in wanted))
            return [swing(x) for _, x in wanted]

        request = levenberg_marquardt(0.5 * SWUNG, -free, free, np.ones(8), tolerance=1e-7, rough=True)
        return minimise([request], answer, at_once)[0]

    plain, foreseen = counted(0), counted(16)
    assert foreseen.converged
    assert foreseen.x == pytest.approx(plain.x, abs=1e-4)
    assert foreseen.cost == pytest.approx(plain.cost, rel=1e-6)
    assert len(rounds[16]) < len(rounds[0])
    assert max(rounds[16]) <= 16


@pytest.mark.parametrize(("together", "expected"), [(2, [11, 3]), (3, [3, 3, 3])])
def test_what_is_needed_goes_before_what_may_be_wanted_next(
    swing: Residuals, together: int, expected: list[int]
) -> None:
    free = np.full(8, 5.0)
    sizes: list[list[int]] = []

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        sizes.append([x.shape[1] for _, x in wanted])
        return [swing(x) for _, x in wanted]

    starts = [0.5 * SWUNG, 0.6 * SWUNG, 0.7 * SWUNG][:together]
    minimise([levenberg_marquardt(x, -free, free, np.ones(8), tolerance=1e-7, rough=True) for x in starts], answer, 16)
    # Two times three trials leave ten places, enough for the eight derivatives of one; nine leave too few.
    trials = [each for each in sizes if len(each) == together and min(each) == 3 and 8 not in each]
    assert trials
    assert all(each == expected for each in trials)


def test_a_search_to_both_sides_wants_nothing_ahead(swing: Residuals) -> None:
    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        # Start and both sides, three trials, both sides.
        assert all(x.shape[1] in (17, 3, 16) for _, x in wanted)
        return [swing(x) for _, x in wanted]

    free = np.full(8, 5.0)
    (found,) = minimise([levenberg_marquardt(0.5 * SWUNG, -free, free, np.ones(8))], answer, 64)
    assert found.converged


@pytest.mark.parametrize("quick", [False, True])
def test_derivatives_that_come_along_are_carried_to_where_the_step_ends(swing: Residuals, quick: bool) -> None:
    free = np.full(8, 5.0)
    start = 0.5 * SWUNG
    near = (swing(start[:, None] + 1e-6 * np.eye(8)) - swing(start[:, None])) / 1e-6
    options = {"jacobian": near} if quick else {"rough": True}
    request = levenberg_marquardt(start, -free, free, np.ones(8), tolerance=1e-9, **options)
    (found,) = minimise([request], lambda wanted: [swing(x) for _, x in wanted], 16)
    true = (swing(found.x[:, None] + 1e-6 * np.eye(8)) - swing(found.x[:, None])) / 1e-6
    assert found.converged
    assert found.jacobian == pytest.approx(true, abs=2e-3 * np.abs(true).max())


def test_derivatives_that_blow_up_ahead_are_not_used() -> None:
    t = np.linspace(0, 5, 60)
    rounds: list[int] = []

    def residuals(x: FloatArray) -> FloatArray:
        rounds.append(x.shape[1])
        found = 100 * (x[0] * np.exp(-np.outer(t, x[1])) + x[2] - (1.3 * np.exp(-0.7 * t) + 0.2)[:, None])
        # The trials are finite; what lies beside one of them is not.
        found[:, 3:] = np.nan if x.shape[1] > 4 else found[:, 3:]
        return found

    free = np.full(3, 5.0)
    request = levenberg_marquardt(np.array([0.5, 0.2, 0.0]), -free, free, np.ones(3), tolerance=1e-9, rough=True)
    (found,) = minimise([request], lambda wanted: [residuals(x) for _, x in wanted], 16)
    assert 6 in rounds
    assert found.converged
    assert found.x == pytest.approx([1.3, 0.7, 0.2], abs=1e-6)


@pytest.mark.parametrize("at_once", [0, 16])
@pytest.mark.parametrize("rough", [False, True])
def test_a_search_follows_a_narrow_bent_valley_to_its_end(rough: bool, at_once: int) -> None:
    asked = 0

    def residuals(b: FloatArray) -> FloatArray:
        nonlocal asked
        asked += b.shape[1]
        noise = np.ones((4000, b.shape[1]))
        # Two parameters trade along a parabola, a hundred times as steep across as along.
        return np.concatenate([noise, np.stack([2e3 * (b[1] - b[0] ** 2), 30 * (1 - b[0])])])

    found = solve(residuals, [-1.2, 1.44], scale=[1.0, 1.0], tolerance=1e-4, rough=rough, at_once=at_once)
    assert found.converged
    assert found.x == pytest.approx([1.0, 1.0], abs=0.03)
    assert asked < 250


# Many at once.


def test_a_batch_gives_the_same_numbers_as_each_problem_alone() -> None:
    t = np.linspace(0, 5, 40)
    rng = np.random.default_rng(1)
    targets = [a * np.exp(-b * t) + 0.01 * rng.standard_normal(t.size) for a, b in ((1, 0.5), (2, 1.0), (0.7, 2.0))]
    start, low, high, size = np.array([1.0, 0.8, 0.0]), np.full(3, -5.0), np.full(3, 5.0), np.ones(3)

    def request():
        return levenberg_marquardt(start, low, high, size)

    together = minimise([request() for _ in targets], lambda wanted: [decay(t, targets[i])(x) for i, x in wanted])
    for target, found in zip(targets, together, strict=True):
        (alone,) = minimise([request()], lambda wanted, y=target: [decay(t, y)(x) for _, x in wanted])
        np.testing.assert_array_equal(found.x, alone.x)
        np.testing.assert_array_equal(found.jacobian, alone.jacobian)
        assert found.iterations == alone.iterations


def test_no_problem_at_all_is_no_trouble() -> None:
    assert minimise([], lambda wanted: []) == []
