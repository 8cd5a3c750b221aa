from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from discovery.estimation.model_error import ModelError, innovations
from discovery.screening.attribution import Candidate, Shapes
from discovery.screening.significance import chance_gains, surrogates

N = 400
RNG = np.random.default_rng(5)


def as_is(columns: np.ndarray) -> np.ndarray:
    return columns


def bench(output: np.ndarray) -> SimpleNamespace:
    """Return what the bootstrap asks of a bench: one recording with its gaps."""
    return SimpleNamespace(blocks=lambda: [(slice(0, output.size), np.isfinite(output))])


def candidate(name: str, *bases: np.ndarray) -> Candidate:
    k = bases[0].shape[1]
    first = np.linalg.qr(bases[0])[0]
    responses = np.concatenate([np.linalg.qr(b)[0].T for b in bases]).astype(np.float32)
    rows = np.arange(len(responses)).reshape(len(bases), k)
    unbounded, transform = np.zeros(len(bases)), np.array([np.eye(k)] * len(bases))
    return Candidate(name, 0.0, (), first, Shapes(responses, rows, transform, unbounded))


def test_surrogates_keep_the_spectrum_of_every_channel() -> None:
    slow = np.cumsum(RNG.standard_normal((N, 2)), axis=0)
    made = surrogates(slow.ravel(), bench(slow), np.random.default_rng(1), 3).reshape(N, 2, 3)
    power = np.abs(np.fft.rfft(slow, axis=0))
    for k in range(3):
        # The first and the last line are real; their phase is a sign.
        np.testing.assert_allclose(np.abs(np.fft.rfft(made[:, :, k], axis=0))[1:-1], power[1:-1], rtol=1e-9)
    assert abs(np.corrcoef(made[:, 0, 0], slow[:, 0])[0, 1]) < 0.9


def test_a_line_is_none_of_smooth_noise() -> None:
    n = 4000
    turns = 2 * np.pi * 446 * np.arange(n) / n
    noise = np.random.default_rng(2).standard_normal((n, 1))
    line = 0.4 * np.sin(turns)[:, None]
    pair = candidate("force", np.column_stack([np.sin(turns), np.cos(turns)]))

    def chance(residual: np.ndarray, *, smooth: bool) -> float:
        made = surrogates(residual.ravel(), bench(residual), np.random.default_rng(1), 400, smooth=smooth)
        assert np.mean(made**2) == pytest.approx(np.mean(residual**2), rel=0.02)
        return float(np.median(chance_gains([pair], np.ones((n, 1)), made, as_is)))

    promised = float(chance_gains([pair], np.ones((n, 1)), noise + line, as_is)[0])
    assert promised > 200
    # Its own spectrum has the line in every replicate; of noise alone a line takes two of chi-square.
    assert chance(noise + line, smooth=False) > 0.9 * promised
    assert chance(noise + line, smooth=True) < 8
    assert chance(noise, smooth=True) == pytest.approx(stats.chi2(2).median(), rel=0.2)


def test_gaps_stay_empty_and_the_rest_keeps_its_power() -> None:
    output = RNG.standard_normal((N, 1))
    output[100:200] = np.nan
    residual = np.where(np.isfinite(output), output, 0.0).ravel()
    made = surrogates(residual, bench(output), np.random.default_rng(1), 400)
    assert not made[100:200].any()
    assert np.mean(made**2) == pytest.approx(np.mean(residual**2), rel=0.02)


def test_one_direction_gains_chi_square_of_one_degree() -> None:
    noise = RNG.standard_normal((N, 4000))
    gains = chance_gains([candidate("a", RNG.standard_normal((N, 1)))], np.ones((N, 1)), noise, as_is)
    assert stats.kstest(gains, stats.chi2(1).cdf).pvalue > 1e-3


def test_slow_noise_gains_no_more_under_the_model_error_that_it_is() -> None:
    time, error = np.linspace(0.0, 40.0, N), ModelError(3.0, 1.0)
    apart = np.abs(time[:, None] - time) / error.memory
    covariance = error.size**2 * (1 + apart) * np.exp(-apart) + np.eye(N)
    noise = np.linalg.cholesky(covariance) @ RNG.standard_normal((N, 4000))
    slow = candidate("a", np.column_stack([np.sin(0.7 * time), np.cos(0.7 * time)]))
    known = np.column_stack([np.ones(N), time])
    gains = chance_gains([slow], known, noise, lambda columns: innovations(time, columns, error)[0])
    assert stats.kstest(gains, stats.chi2(2).cdf).pvalue > 1e-3
    assert np.median(chance_gains([slow], known, noise, as_is)) > 20 * np.median(gains)


def test_the_whole_catalogue_counts() -> None:
    noise = RNG.standard_normal((N, 2000))
    sizes = [(k, size) for k in range(10) for size in (1, 2)]
    many = [candidate(f"{k}_{size}", *RNG.standard_normal((2, N, size))) for k, size in sizes]
    gains = chance_gains(many, np.ones((N, 1)), noise, as_is)
    # The largest of twenty with one and twenty with two degrees of freedom, all but independent.
    expected = stats.chi2(1).cdf(gains) ** 20 * stats.chi2(2).cdf(gains) ** 20
    assert stats.kstest(expected, "uniform").statistic < 0.06


def test_what_the_fitted_parameters_absorb_gains_nothing() -> None:
    known = RNG.standard_normal((N, 3))
    gains = chance_gains(
        [candidate("a", RNG.standard_normal((N, 1)))], known, known @ RNG.standard_normal((3, 5)), as_is
    )
    np.testing.assert_allclose(gains, 0.0, atol=1e-4)
