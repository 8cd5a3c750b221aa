from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from discovery.estimation.residual import ResidualReport, errors, examine, memory, systematic_share, variance_left
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn

TIME = np.arange(2500) / 100.0
PERIOD = 2.0
NOISE = 2e-3
RIG = Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "V")))
#: A free decay: deflection and amplitude both change.
MOTION = 0.5 * np.exp(-TIME / 20) * np.cos(2 * np.pi * TIME / PERIOD)


def experiment(output: np.ndarray, fitted: int | None = None, time: np.ndarray = TIME) -> Experiment:
    recording = Recording("r", time, None, output[:, None], ("output",), ("V",), np.array([NOISE]), "", "")
    return Experiment(recording, None, RIG, fitted)


def report(residual: np.ndarray, **options) -> ResidualReport:
    """Examine a residual given in sds of the noise: prediction minus measurement."""
    return examine([experiment(MOTION - NOISE * residual, **options)], [MOTION[:, None]], PERIOD)


def white(seed: int, n: int = TIME.size) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def test_what_is_left_of_the_variance_is_none_within_the_noise() -> None:
    one = experiment(MOTION)
    problem = SimpleNamespace(bench=SimpleNamespace(experiments=[one], n_data=TIME.size))
    spread = float(np.sum((MOTION - MOTION.mean()) ** 2)) / NOISE**2
    assert variance_left(problem, 0.6 * spread) == pytest.approx(0.6)
    assert variance_left(problem, 3.9 * TIME.size) == 0.0
    assert variance_left(problem, 4.1 * TIME.size) > 0.0
    # The part that is not fitted does not count.
    half = SimpleNamespace(bench=SimpleNamespace(experiments=[experiment(MOTION, 1000)], n_data=1000))
    assert variance_left(half, 0.6 * spread) > 0.65


def test_readings_that_are_compared_rarely_have_a_rate_of_their_own() -> None:
    """Of a force one reading of six is compared: its spectrum ends at half of their rate, without images of it."""
    read = MOTION - NOISE * (white(1) + 5.0 * np.sin(2 * np.pi * 2.0 * TIME))
    read[np.arange(TIME.size) % 6 != 2] = np.nan
    found = examine([experiment(read)], [MOTION[:, None]], PERIOD)
    assert found.frequency[-1] == pytest.approx(100.0 / 6 / 2, rel=0.01)
    assert found.frequency[int(np.argmax(found.spectrum))] == pytest.approx(2.0, abs=0.1)


# The systematic part.


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 10_000), st.floats(0.5, 20.0), st.floats(0.9, 4.0), st.floats(0.0, 6.3))
def test_a_known_systematic_part_is_recovered(seed: int, size: float, period: float, phase: float) -> None:
    systematic = size * np.sqrt(2) * np.sin(2 * np.pi * TIME / period + phase)
    residual = systematic + white(seed)
    expected = np.sqrt(np.mean(systematic**2))
    # 2500 samples of noise leave 0.02 uncertain; the average over a bin attenuates the fastest wave by 1.4 per cent.
    assert abs(systematic_share(residual[:, None], TIME, PERIOD) - expected) < 0.1 + 0.02 * expected


@given(st.integers(0, 10_000))
def test_white_noise_has_no_systematic_part(seed: int) -> None:
    # The excess of its square scatters by 0.01 around zero: five times that is the square of 0.23.
    assert systematic_share(white(seed)[:, None], TIME, PERIOD) < 0.23


def test_the_excess_of_white_noise_is_zero_on_average() -> None:
    shares = [systematic_share(white(seed)[:, None], TIME, PERIOD) for seed in range(400)]
    assert np.mean(np.array(shares) == 0) == pytest.approx(0.5, abs=0.1)


def test_channels_are_averaged_in_the_square_and_gaps_are_passed_over() -> None:
    wave = 3 * np.sin(2 * np.pi * TIME / PERIOD)
    residual = np.column_stack([wave + white(1), white(2)])
    assert systematic_share(residual, TIME, PERIOD) == pytest.approx(1.5, rel=0.05)
    residual[300:700, 0] = np.nan
    residual[900:] = np.nan
    assert systematic_share(residual, TIME, PERIOD) == pytest.approx(1.5, rel=0.1)


def test_irregular_times_count_by_bins() -> None:
    time = np.sort(np.random.default_rng(0).uniform(0, 25, 2500))
    residual = 2 * np.sin(2 * np.pi * time / PERIOD) + white(3)
    assert systematic_share(residual[:, None], time, PERIOD) == pytest.approx(np.sqrt(2), rel=0.07)


def test_fast_ringing_is_not_motion() -> None:
    # Forty times as fast as the motion: an average over a 24th of a period does not see it.
    ringing = 2 * np.sin(2 * np.pi * 40 * TIME / PERIOD)
    assert systematic_share((ringing + white(4))[:, None], TIME, PERIOD) < 0.6


# Whiteness.


@pytest.mark.slow
def test_the_probability_is_uniform_under_white_noise() -> None:
    motion, time = MOTION[:600], TIME[:600]
    found = [
        examine([experiment(motion - NOISE * white(seed, 600), time=time)], [motion[:, None]], PERIOD)
        for seed in range(300)
    ]
    p = [r.ljung_box_p for r in found]
    assert kstest(p, "uniform").pvalue > 1e-3


def test_correlated_noise_is_not_white() -> None:
    noise = white(0)
    correlated = noise + 0.5 * np.concatenate([[0.0], noise[:-1]])
    found = report(correlated)
    assert not found.white
    assert found.ljung_box_p < 1e-6
    # First-order moving average: 0.5 / (1 + 0.25).
    assert found.autocorrelation == pytest.approx(0.4, abs=0.06)
    assert report(noise).white


def test_several_channels_pay_for_their_number() -> None:
    one, other = experiment(MOTION - NOISE * white(1)), experiment(MOTION - NOISE * white(2))
    alone = [examine([e], [MOTION[:, None]], PERIOD).ljung_box_p for e in (one, other)]
    together = examine([one, other], [MOTION[:, None]] * 2, PERIOD).ljung_box_p
    assert together == pytest.approx(min(1.0, 2 * min(alone)))


# Size and spectrum.


def test_size_in_units_of_the_noise() -> None:
    found = report(3 * white(0))
    assert found.rms == pytest.approx(3.0, rel=0.05)
    assert found.reduced_chi2 == pytest.approx(found.rms**2)


def test_held_out_samples_and_gaps_do_not_count() -> None:
    residual = white(0)
    residual[2000:] += 50
    residual[100:120] += np.nan
    found = report(residual, fitted=2000)
    assert found.rms == pytest.approx(1.0, rel=0.05)
    assert found.systematic < 0.25


def test_the_spectrum_holds_the_mean_square_and_shows_a_line() -> None:
    found = report(white(0) + 2 * np.sin(2 * np.pi * 7.0 * TIME))
    frequency, density = np.array(found.frequency), np.array(found.spectrum)
    assert frequency[np.argmax(density)] == pytest.approx(7.0, abs=0.1)
    assert np.sum(density) * frequency[1] == pytest.approx(found.reduced_chi2, rel=0.05)


# What it depends on.


@pytest.mark.parametrize(
    ("variable", "dependent"),
    [
        ("output", MOTION * 20),
        ("rate", np.gradient(MOTION, TIME) * 6),
        ("time", 4 * (TIME / TIME[-1]) ** 2),
        ("amplitude", 16 * np.exp(-TIME / 20) ** 3),
    ],
)
def test_the_state_that_drives_the_residual_comes_first(variable: str, dependent: np.ndarray) -> None:
    found = report(dependent - dependent.mean() + white(0))
    strong = {d.variable: d for d in found.dependence}
    # The amplitude of a decay falls with time: each stands for the other.
    same = {"time", "amplitude"}
    assert found.dependence[0].variable in (same if variable in same else {variable})
    expected = np.var(dependent) / (np.var(dependent) + 1)
    assert strong[variable].share == pytest.approx(expected, rel=0.15)
    assert strong[variable].p_value < 1e-12


def test_what_drifts_otherwise_in_each_recording_depends_on_time() -> None:
    drift = 3 * (TIME / TIME[-1] - 0.5)
    both = [experiment(MOTION - NOISE * (sign * drift + white(seed))) for seed, sign in enumerate((1, -1))]
    found = {d.variable: d.share for d in examine(both, [MOTION[:, None]] * 2, PERIOD).dependence}
    assert found["time"] == pytest.approx(np.var(drift) / (np.var(drift) + 1), rel=0.15)
    assert found["time"] > 2 * max(share for name, share in found.items() if name != "time")


def test_white_noise_depends_on_nothing() -> None:
    p = [d.p_value for seed in range(40) for d in report(white(seed)).dependence if d.variable == "phase"]
    assert kstest(p, "uniform").pvalue > 1e-3


def test_a_perfect_prediction_is_reported_without_trouble() -> None:
    found = report(np.zeros(TIME.size))
    assert found.rms == 0
    assert found.white
    assert all(d.share == 0 for d in found.dependence)


def test_the_summary_is_plain_json() -> None:
    text = json.dumps(report(white(0)).summary(), allow_nan=False)
    assert set(json.loads(text)) >= {"rms", "systematic", "ljung_box_p", "white", "dependence", "spectrum"}


# Errors.


def test_errors_are_distances_over_complete_samples() -> None:
    predicted = np.array([[3.0, 4.0], [0.0, 1.0], [1.0, 1.0], [9.0, 9.0]])
    measured = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, np.nan], [9.0, 9.0]])
    assert errors(predicted, measured) == {
        "rms": pytest.approx(np.sqrt(26 / 3)),
        "mean": pytest.approx(2.0),
        "peak": pytest.approx(5.0),
    }


@pytest.mark.parametrize("last", [np.nan, np.inf, 1e200])
def test_what_blew_up_is_not_near(last: float) -> None:
    found = errors(np.array([[0.0], [1.0], [last]]), np.array([[0.0], [np.nan], [0.0]]))
    assert found == {"rms": np.inf, "mean": np.inf, "peak": np.inf}


def test_errors_of_nothing_are_not_numbers() -> None:
    found = errors(np.zeros((3, 1)), np.full((3, 1), np.nan))
    assert all(np.isnan(v) for v in found.values())


def test_what_is_off_throughout_is_no_noise_of_single_readings() -> None:
    noise = white(7)
    assert memory(noise) == pytest.approx(1.0, abs=0.1)
    lasting = np.convolve(white(8), np.ones(3), "valid")
    assert memory(lasting) == pytest.approx(5.0, rel=0.2)
    assert memory(noise + 1.0) == pytest.approx(3.0, rel=0.1)
    assert memory(np.zeros(9)) == 1.0
