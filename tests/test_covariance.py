from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from discovery.estimation.covariance import covariance_of, given
from discovery.estimation.least_squares import Minimum

N = 2000
TIME = np.linspace(0.0, 40.0, N)
#: A decaying swing, its quadrature, and a slow drift: what residuals of a fitted arm depend on.
SLOPES = np.column_stack(
    [np.exp(-0.05 * TIME) * np.cos(3 * TIME), np.exp(-0.05 * TIME) * np.sin(3 * TIME), np.cos(0.3 * TIME)]
)


def problem(accuracy: float = 0.0) -> SimpleNamespace:
    """Return a problem whose base is wrong by `accuracy` lengths of 1 m, with a noise of 1 m."""
    recording = SimpleNamespace(time=TIME, noise=np.ones(1), units=("m",))
    experiments = [SimpleNamespace(recording=recording)]
    blocks = [(slice(0, N), np.ones((N, 1), bool))]
    bench = SimpleNamespace(experiments=experiments, blocks=lambda: blocks, n_rows=N, n_data=N)
    return SimpleNamespace(
        names=("a", "b", "c"),
        bench=bench,
        gaussian={"b": (0.0, 1.0)},
        model=SimpleNamespace(mechanics=SimpleNamespace(accuracy=accuracy)),
        units=SimpleNamespace(length=1.0, time=3.0),
    )


def fitted(noise: np.ndarray, accuracy: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return estimates of three zeros by least squares, and their standard deviations."""
    estimate, *_ = np.linalg.lstsq(SLOPES, noise, rcond=None)
    residual = SLOPES @ estimate - noise
    minimum = Minimum(estimate, 0.5 * float(residual @ residual), residual, SLOPES, np.zeros(3, bool), True, 1)
    covariance, reasons, _ = covariance_of(problem(accuracy), minimum)
    assert not reasons
    return estimate, np.sqrt(np.diag(covariance))


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_intervals_hold_for_correlated_noise(memory: float) -> None:
    rng = np.random.default_rng(3)
    runs = []
    for _ in range(400):
        noise = lfilter([1.0], [1.0, -memory], rng.standard_normal(N + 200))[200:]
        estimate, sd = fitted(noise)
        runs.append(np.abs(estimate) < 1.645 * sd)
    # 400 runs: a share of 0.9 is known to 0.015; the spectrum's own scatter costs a little.
    assert np.mean(runs, axis=0) == pytest.approx([0.9] * 3, abs=0.06)


@pytest.mark.parametrize("stated", [False, True])
def test_what_a_base_idealises_widens_intervals_where_noise_hides_it(stated: bool) -> None:
    """An error of the base, 0.2 noise sds and smooth, is not seen in the residual but moves the estimates."""
    rng, memory = np.random.default_rng(5), np.exp(-TIME[1] / 3)
    runs = []
    for _ in range(400):
        smooth = lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], rng.standard_normal(N + 400))[400:]
        estimate, sd = fitted(rng.standard_normal(N) + 0.2 * smooth, 0.2 if stated else 0.0)
        runs.append(np.abs(estimate) < 1.645 * sd)
    share = np.mean(runs, axis=0)
    if stated:
        assert share == pytest.approx([0.9] * 3, abs=0.06)
    else:
        assert share[2] < 0.8


def test_white_residuals_below_the_stated_noise_do_not_narrow_the_interval() -> None:
    quiet = 0.1 * np.random.default_rng(1).standard_normal(N)
    _, sd = fitted(quiet)
    np.testing.assert_allclose(sd, np.sqrt(np.diag(np.linalg.inv(SLOPES.T @ SLOPES))), rtol=1e-9)


def test_a_prior_counts_as_one_reading_of_its_own() -> None:
    jacobian = np.vstack([SLOPES, [50.0, 0.0, 0.0]])
    quiet = np.zeros(N + 1)
    minimum = Minimum(np.zeros(3), 0.0, quiet, jacobian, np.zeros(3, bool), True, 1)
    covariance, _, _ = covariance_of(problem(), minimum)
    np.testing.assert_allclose(covariance, np.linalg.inv(jacobian.T @ jacobian), rtol=1e-9)


def test_what_the_rig_knows_stays_uncertain_at_its_bound() -> None:
    jacobian = np.vstack([SLOPES, [0.0, 1.0, 0.0]])
    at_bound = np.array([True, True, False])
    minimum = Minimum(np.zeros(3), 0.0, np.zeros(N + 1), jacobian, at_bound, True, 1)
    covariance, reasons, _ = covariance_of(problem(), minimum)
    assert reasons == {"a": "at its bound"}
    np.testing.assert_allclose(covariance[1:, 1:], np.linalg.inv(jacobian[:, 1:].T @ jacobian[:, 1:]), rtol=1e-9)


@pytest.mark.parametrize("held", [[], [0], [0, 2]])
def test_what_is_held_gives_the_others_the_covariance_of_a_fit_without_it(held: list[int]) -> None:
    slopes = np.column_stack([SLOPES[:, 0], SLOPES[:, 0] + 0.1 * SLOPES[:, 1], SLOPES[:, 2]])
    rest = [i for i in range(3) if i not in held]
    found = given(np.linalg.inv(slopes.T @ slopes), held)
    alone = np.linalg.inv(slopes[:, rest].T @ slopes[:, rest])
    np.testing.assert_allclose(found[np.ix_(rest, rest)], alone, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(found[held], 0.0, atol=1e-9)
