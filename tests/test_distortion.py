from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from measured_data import DATASETS, needs
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from discovery.recordings.recording import Recording, read_recording
from discovery.rigs.rig_file import read_rig
from discovery.signals.distortion import Multisine, analyse_multisine
from discovery.signals.spectral_lines import find_periods

RATE = 200.0
RESONANCE = ([0.05], [1.0, -1.86, 0.9409])  # poles of radius 0.97: settles by 60 dB in 227 samples


def recording(u, y, time=None):
    time = np.arange(len(y)) / RATE if time is None else time
    return Recording("synthetic", time, u, y[:, None], ("output",), ("V",), np.array([1e-3]), "", "")


def realisations(rng, period=1024, lines=None, count=6, length=None, phases=None):
    """Random-phase multisines of unit rms, one after another, each cut to ``length`` samples."""
    lines = np.arange(1, period // 4, 2) if lines is None else lines
    length = period + 400 if length is None else length
    parts = []
    for _ in range(count):
        spectrum = np.zeros(period // 2 + 1, complex)
        spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
        one = np.fft.irfft(spectrum, period) * period / np.sqrt(2.0 * len(lines))
        parts.append(np.tile(one, -(-length // period))[:length])
    return np.concatenate(parts)


def linear(u):
    return lfilter(*RESONANCE, u)


def respond(u, square=0.0, cube=0.0, noise=0.0, rng=None):
    """A linear resonance followed by a static curve, and white noise."""
    x = linear(u)
    y = x + square * x**2 + cube * x**3
    return y + noise * rng.standard_normal(y.size) if noise else y


def found(u, y) -> Multisine:
    result = analyse_multisine(recording(u, y))
    assert result is not None
    return result


def detected(result: Multisine) -> dict[str, bool | None]:
    return {distortion.parity: distortion.detected for distortion in result.distortions}


@pytest.mark.parametrize(
    ("square", "cube", "odd", "even"),
    [(0.0, 0.0, False, False), (0.0, 0.02, True, False), (0.01, 0.0, False, True), (0.01, 0.02, True, True)],
)
@pytest.mark.parametrize("length", [1424, 4096], ids=["one period and a part", "four periods"])
def test_powers_show_at_lines_of_their_parity(square, cube, odd, even, length):
    rng = np.random.default_rng(1)
    u = realisations(rng, length=length)
    result = found(u, respond(u, square, cube, 1e-2, rng))
    assert (result.period, len(result.periods), result.kind, result.steady) == (1024, 6, "odd", True)
    assert detected(result) == {"odd": odd, "even": even}


def test_free_odd_lines_and_even_lines_hold_exactly_what_the_curve_puts_there():
    rng = np.random.default_rng(2)
    kept = np.arange(1, 256, 2)
    kept = np.sort(np.concatenate([rng.permutation(group)[:3] for group in kept.reshape(-1, 4)]))
    u = realisations(rng, lines=kept, count=3, length=3072)
    result = found(u, respond(u, 0.02, 0.03, 1e-4, rng))
    x = linear(u)
    spectra = {}
    for parity, extra in (("odd", 0.03 * x**3), ("even", 0.02 * x**2)):
        each = [np.fft.rfft(extra[stop - 1024 : stop]) / 1024 for stop in (3072, 6144, 9216)]
        spectra[parity] = np.mean(np.abs(each) ** 2, axis=0)[1:512]
    for distortion in result.distortions:
        lines = result.line_class == distortion.parity
        exact = np.sqrt(2.0 * np.sum(spectra[distortion.parity][lines]))
        assert distortion.basis == "unexcited lines"
        assert distortion.level == pytest.approx(exact, rel=0.01)
    assert set(detected(result).values()) == {True}
    np.testing.assert_array_equal(np.flatnonzero(result.line_class == "excited") + 1, kept)


def test_spread_has_the_size_of_the_stochastic_distortion():
    """Static cube of Gaussian x: x^3 = 3 s^2 x + rest, where the rest, of power 6 s^6, is not coherent with x."""
    rng = np.random.default_rng(3)
    u = realisations(rng, period=2048, lines=np.arange(1, 1024, 2), count=10, length=4096)
    result = found(u, u + 0.05 * u**3 + 1e-4 * rng.standard_normal(u.size))
    odd = next(distortion for distortion in result.distortions if distortion.parity == "odd")
    periods = np.array([u[starts[-1] : starts[-1] + 2048] for starts in result.periods])
    assert odd.level == pytest.approx(0.05 * np.std(periods**3 - 3.0 * periods), rel=0.02)
    assert odd.level == pytest.approx(0.05 * np.sqrt(6.0), rel=0.1)


@pytest.mark.parametrize("sd", [1e-4, 1e-2])
@pytest.mark.parametrize(("count", "length"), [(8, 1624), (1, 5120), (3, 3072)])
def test_noise_is_recovered_within_ten_per_cent(sd, count, length):
    rng = np.random.default_rng(4)
    u = realisations(rng, count=count, length=length)
    result = found(u, respond(u, 0.0, 0.02, sd, rng))
    assert result.noise_rms == pytest.approx(sd, rel=0.1)
    assert result.noise_source == "change from period to period"


def test_noise_through_the_system_keeps_its_colour():
    rng = np.random.default_rng(5)
    u = realisations(rng, count=4, length=8 * 1024)
    disturbance = linear(1e-3 * rng.standard_normal(u.size))
    result = found(u, linear(u) + disturbance)
    assert result.noise_rms == pytest.approx(np.std(disturbance), rel=0.1)
    z = np.exp(2j * np.pi * result.frequency / RATE)
    b, a = RESONANCE
    density = np.abs(b[0] / (a[0] + a[1] / z + a[2] / z**2))
    expected = 1e-3 * np.sqrt(2.0 / 1024 / len(result.periods[0])) * density
    near = density > 0.1 * density.max()
    assert np.median((result.noise / expected)[near]) == pytest.approx(1.0, rel=0.1)
    assert detected(result) == {"odd": False, "even": False}


@pytest.mark.parametrize("coloured", [False, True])
@pytest.mark.parametrize(("count", "length"), [(5, 924), pytest.param(2, 1536, marks=pytest.mark.slow)])
def test_linear_systems_raise_few_false_alarms(coloured, count, length):
    verdicts = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        u = realisations(rng, period=512, count=count, length=length)
        noise = 0.02 * rng.standard_normal(u.size)
        result = found(u, linear(u) + (linear(noise) if coloured else noise))
        verdicts += detected(result).values()
    assert len(verdicts) == 120
    assert verdicts.count(True) <= 1
    assert verdicts.count(None) <= 4


def test_duffing_oscillator_is_odd_until_its_rest_position_moves():
    """y'' + 20 y' + 900 y + k y^3 = u + offset: shifted from the origin, the cube has a square in it."""
    period, count, rng = 512, 3, np.random.default_rng(6)
    lines = np.arange(1, 60, 2)
    phase = 2.0 * np.pi * rng.random((count, lines.size))

    def force(t):
        return 40.0 * np.cos(2.0 * np.pi * RATE / period * lines * t + phase).sum(axis=1)

    def simulated(offset):
        def rate(t, state):
            y, v = state.reshape(2, count)
            return np.concatenate([v, force(t) + offset - 20.0 * v - 900.0 * y - 2000.0 * y**3])

        t = np.arange(period + 300) / RATE
        solution = solve_ivp(rate, (0.0, t[-1]), np.zeros(2 * count), t_eval=t, rtol=1e-8, atol=1e-9, method="DOP853")
        u = np.concatenate(np.transpose([force(moment) for moment in t]))
        y = solution.y[:count].ravel()
        return found(u, y + 1e-5 * np.random.default_rng(7).standard_normal(y.size))

    centred, shifted = simulated(0.0), simulated(300.0)
    assert detected(centred) == {"odd": True, "even": False}
    assert detected(shifted) == {"odd": True, "even": True}


def test_what_the_generator_adds_is_not_blamed_on_the_system():
    rng = np.random.default_rng(8)
    u = realisations(rng)
    u = u + 0.01 * u**2
    result = found(u, respond(u, noise=1e-3, rng=rng))
    even = result.line_class == "even"
    assert np.median(result.input[even]) > 1e-3 * np.median(result.input[result.line_class == "excited"])
    assert detected(result)["even"] is False


def test_mains_hum_is_named_and_left_out():
    rng = np.random.default_rng(9)
    u = realisations(rng, count=6, length=2048)
    hum = 17.3
    u = u + 0.05 * np.sin(2.0 * np.pi * hum * np.arange(u.size) / RATE)
    result = found(u, respond(u, noise=1e-2, rng=rng))
    assert any(abs(tone - hum) < RATE / 1024 for tone in result.interference)
    assert result.line_class[round(hum * 1024 / RATE) - 1] == "interference"
    assert detected(result)["even"] is False


def test_full_multisine_cannot_tell_the_parity():
    rng = np.random.default_rng(10)
    u = realisations(rng, lines=np.arange(1, 200))
    assert detected(found(u, respond(u, 0.02, 0.0, 1e-2, rng))) == {"odd or even": True}
    assert detected(found(u, respond(u, 0.0, 0.0, 1e-2, rng))) == {"odd or even": False}
    gaps = realisations(rng, lines=np.sort(rng.permutation(200)[:150] + 1), count=1, length=4096)
    result = found(gaps, respond(gaps, 0.02, 0.0, 1e-2, rng))
    assert [(d.parity, d.basis, d.detected) for d in result.distortions] == [("odd or even", "unexcited lines", True)]


def test_no_verdict_on_periods_that_never_settle():
    rng = np.random.default_rng(11)
    u = realisations(rng, length=1024)
    result = found(u, respond(u, noise=1e-3, rng=rng))
    assert result.period == 1024
    assert not result.steady
    assert set(detected(result).values()) == {None}
    assert all("cannot be judged" in sentence for sentence in result.verdict()[1:])
    assert result.noise_source == "lines above the band, taken as white"


def test_unknown_noise_is_said_to_be_unknown():
    rng = np.random.default_rng(17)
    u = realisations(rng, lines=np.arange(1, 512, 2), length=1024)
    result = found(u, respond(u, noise=1e-3, rng=rng))
    assert np.isnan(result.noise_rms)
    assert result.verdict()[0] == "noise: not known, no period is repeated and no line is free above the band"
    assert set(detected(result).values()) == {None}


def test_realisations_with_gaps_are_left_out():
    rng = np.random.default_rng(12)
    u = realisations(rng)
    y = respond(u, 0.0, 0.02, 1e-2, rng)
    y[3600:3610] = np.nan
    result = found(u, y)
    assert len(result.periods) == 5
    assert detected(result) == {"odd": True, "even": False}
    assert np.isfinite(result.noise_rms)


def test_pauses_between_realisations_do_no_harm():
    rng = np.random.default_rng(13)
    pause = np.zeros(150)
    u = np.concatenate([part for _ in range(4) for part in (realisations(rng, count=1), pause)])
    result = found(u, respond(u, 0.01, 0.0, 1e-3, rng))
    assert (result.period, len(result.periods)) == (1024, 4)
    assert detected(result) == {"odd": False, "even": True}


@settings(max_examples=25, deadline=None)
@given(
    period=st.integers(150, 700),
    count=st.integers(1, 4),
    extra=st.floats(0.7, 2.5),
    odd=st.booleans(),
    scale=st.sampled_from([1e-6, 1.0, 1e6]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_period_is_found(period, count, extra, odd, scale, seed):
    rng = np.random.default_rng(seed)
    period += odd * (period % 2)  # half a period of an odd multisine is a whole number of samples
    length = period + int(extra * period)
    lines = np.arange(1, period // 3, 2) if odd else np.arange(1, period // 3)
    u = realisations(rng, period, lines, count, length)
    u = u + 1e-3 * rng.standard_normal(u.size)
    result = found(scale * u, scale * u)
    assert result.period == period
    assert result.kind == ("odd" if odd else "full")
    np.testing.assert_array_equal(np.flatnonzero(result.line_class == "excited") + 1, lines)
    assert len(result.periods) == count
    for realisation, starts in enumerate(result.periods):
        assert all(b - a == period for a, b in pairwise(starts))
        assert starts[0] >= realisation * length
        assert starts[-1] + period <= (realisation + 1) * length + 1


def swing(t, repeats):
    """A drive that turns to and fro between two stops: exactly periodic, and yet no multisine."""
    return np.clip(1.5 * np.abs((t * repeats / t[-1]) % 2.0 - 1.0) - 0.25, 0.0, 1.0)


@pytest.mark.parametrize(
    "signal",
    [
        lambda t, rng: rng.standard_normal(t.size),
        lambda t, rng: linear(rng.standard_normal(t.size)),
        lambda t, rng: np.sin(3.0 * t),
        lambda t, rng: np.sin(3.0 * t) + 1e-4 * rng.standard_normal(t.size),
        lambda t, rng: swing(t, 8),
        lambda t, rng: np.round(swing(t, 8) / 7e-5) * 7e-5,
        lambda t, rng: np.sin(0.5 * t**2),
        lambda t, rng: np.where(t > 5.0, 1.0, 0.0),
        lambda t, rng: np.minimum(t, 5.0) + 1e-5 * rng.standard_normal(t.size),
        lambda t, rng: np.ones(t.size),
    ],
    ids=["white", "coloured", "sine", "noisy sine", "swing", "encoder", "chirp", "step", "ramp", "constant"],
)
def test_other_inputs_are_no_multisine(signal):
    t = np.arange(8000) / RATE
    u = signal(t, np.random.default_rng(14))
    assert analyse_multisine(recording(u, linear(u))) is None


def test_recordings_without_input_or_regular_samples_are_none():
    rng = np.random.default_rng(15)
    u = realisations(rng)
    y, t = linear(u), np.arange(u.size) / RATE
    assert analyse_multisine(recording(u, y, t)) is not None
    assert analyse_multisine(recording(u, y, np.round(t, 4))) is not None
    assert analyse_multisine(recording(None, y, t)) is None
    assert analyse_multisine(recording(u, y, t + 0.2 / RATE * rng.random(t.size))) is None
    assert analyse_multisine(recording(u[:40], y[:40], t[:40])) is None


@pytest.mark.parametrize("path", sorted(DATASETS.glob("arm*/*.csv")), ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_manoeuvres_of_the_arm_are_none(path):
    assert analyse_multisine(read_recording(path, read_rig(path.parent / "rig.toml"))) is None


def test_summary_is_json_and_says_what_was_found():
    rng = np.random.default_rng(16)
    u = realisations(rng)
    result = found(u, respond(u, 0.0, 0.02, 1e-2, rng))
    summary = json.loads(json.dumps(result.summary()))
    assert summary["period_s"] == 1024 / RATE
    assert summary["band_hz"] == pytest.approx([RATE / 1024, 255 * RATE / 1024])
    assert summary["verdict"][1].startswith("odd nonlinearity: yes, ")
    assert summary["verdict"][1].endswith("odd powers are suggested")
    assert summary["verdict"][2].startswith("even nonlinearity: no, ")


@pytest.mark.measured
def test_silverbox_is_odd_far_above_its_noise():
    needs("silverbox")
    rig = read_rig(DATASETS / "silverbox" / "rig.toml")
    part = rig.records["train"][0]
    result = analyse_multisine(read_recording(part.file, rig, part.samples))
    assert result is not None
    print("\n".join(result.verdict()))
    assert (result.period, len(result.periods), result.kind, result.steady) == (8192, 7, "odd", True)
    assert result.frequency[result.line_class == "excited"][-1] == pytest.approx(200.0, abs=0.2)
    assert any(abs(tone - 50.0) < 0.1 for tone in result.interference)
    odd, even = result.distortions
    assert odd.detected
    assert even.detected
    assert odd.ratio_db > 25.0
    assert even.ratio_db < odd.ratio_db - 20.0
    assert 1e-4 < result.noise_rms < 3e-4
    arrow = read_recording(part.file, rig, (100, 40575))
    assert analyse_multisine(arrow) is None


@pytest.mark.parametrize("tail", [10.0, 20.0, 30.0])
def test_the_slow_tail_of_a_step_repeats_nothing(tail: float) -> None:
    since = np.arange(700) / 500 - 0.1
    step = np.where(since < 0.0, 0.0, 200 * np.exp(-since / 0.05) * np.cos(4 * np.pi * since))
    step += np.where(since > 0.3, tail * np.exp((0.3 - since) / 2), 0.0)
    found = find_periods(step - step.mean())
    assert found is None or max(stop for _, stop in found.stretches) < 350
