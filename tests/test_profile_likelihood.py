"""Profile likelihoods against refits of the closed-form motion by another minimiser."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from test_posterior import ALPHA, EFFECTS, GAIN, NOISE, XI, experiment, responses

from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.posterior.likelihood import log_posterior
from discovery.posterior.profile_likelihood import CUT, Profile, profiles


@pytest.fixture(scope="module")
def recorded():
    return experiment(np.random.default_rng(8))


@pytest.fixture(scope="module")
def found(recorded):
    fitted = fit(Model("oscillator", EFFECTS), [recorded])
    return {p.name: p for p in profiles(log_posterior(fitted), points=9)}


def _smallest(measured: np.ndarray, alpha: float | None) -> float:
    """Return the smallest sum of squares, alpha held or free; gain, deflection and rate enter linearly."""

    def left(x: np.ndarray) -> np.ndarray:
        columns = responses(x[0], x[1] if alpha is None else alpha)
        return columns @ np.linalg.lstsq(columns, measured, rcond=None)[0] - measured

    return 2 * least_squares(left, [XI, ALPHA][: 2 - (alpha is not None)], xtol=1e-14, ftol=1e-14).cost


def test_every_held_value_is_refitted_to_the_best(recorded, found) -> None:
    measured = recorded.recording.output[:, 0]
    best = _smallest(measured, None)
    p = found["alpha"]
    expected = [measured.size * np.log(_smallest(measured, a) / best) for a in p.values]
    assert p.statistic == pytest.approx(expected, abs=0.02)


def test_every_physical_parameter_has_an_interval_around_its_estimate(found) -> None:
    assert set(found) == {"g", "xi", "alpha"}
    truth = {"g": GAIN, "xi": XI, "alpha": ALPHA}
    for name, p in found.items():
        low, high = p.interval
        assert low < p.best < high
        sd = (high - low) / (2 * CUT**0.5)
        assert abs(p.best - truth[name]) < 4 * sd
        assert p.statistic[p.values.size // 2] == pytest.approx(0.0, abs=1e-3)


def test_the_size_of_the_noise_is_the_fits_own(recorded) -> None:
    """A wrong statement of the noise changes nothing."""
    stated = experiment(np.random.default_rng(8), stated=10 * NOISE)
    model = Model("oscillator", EFFECTS)
    ends = [
        [p.interval for p in profiles(log_posterior(fit(model, [e])), points=9)] for e in (recorded, stated)
    ]  # fmt: skip
    assert np.array(ends[1]) == pytest.approx(np.array(ends[0]), rel=1e-3)


def test_at_a_bound_there_is_one_end_only() -> None:
    clean = experiment(np.random.default_rng(3), noise=1e-4)
    model = Model("oscillator", (*EFFECTS, "coulomb_friction"))
    fitted = fit(model, [clean], start={"f_c": 0.0})
    friction = next(p for p in profiles(log_posterior(fitted), points=9) if p.name == "f_c")
    assert friction.values[0] >= 0
    assert friction.best == 0
    assert friction.interval[0] is None
    assert friction.interval[1] is not None


def test_what_the_rig_states_counts_as_a_reading(found) -> None:
    own = found["xi"].interval
    half = 0.25 * (own[1] - own[0]) / CUT**0.5  # as narrow as a half of the recording's own interval
    fitted = fit(Model("oscillator", EFFECTS), [experiment(np.random.default_rng(8))], gaussian={"xi": (XI, half)})
    p = next(p for p in profiles(log_posterior(fitted), points=9) if p.name == "xi")
    expected = (half**-2 + (2 * half) ** -2) ** -0.5
    assert (p.interval[1] - p.interval[0]) / (2 * CUT**0.5) == pytest.approx(expected, rel=0.03)


def test_the_interval_of_a_parabola() -> None:
    values = np.linspace(1.0, 3.0, 9)
    p = Profile("x", values, ((values - 1.9) / 0.3) ** 2, 1.9)
    assert p.interval == pytest.approx((1.9 - 0.3 * CUT**0.5, 1.9 + 0.3 * CUT**0.5), rel=1e-9)
    lost = Profile("x", values, np.where(values < 1.6, np.inf, ((values - 1.9) / 0.3) ** 2), 1.9)
    assert lost.interval[0] is None
