"""Readings of another age: to first order, what reading the same motion at that age gives."""

from concurrent.futures import ThreadPoolExecutor
from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest
from test_bench import arm

from discovery.estimation.bench import Bench
from discovery.screening.responses import ages_of, ages_only, per_age, respond

EFFECTS = ("linear_stiffness", "viscous_damping", "sensor_delay", "time_base_error", "camera_origin_offset")
SAWTOOTH = {"j_t": 2e-5, "Omega_j": 4.0, "phi_j": 1.0}
LATE = [{"tau": 1e-5}, {"d_t": 1e-5}, SAWTOOTH, {**SAWTOOTH, "phi_j": 2.5}]
OTHER = [{"x_0": 1e-3}, {"xi": 0.01}, {**SAWTOOTH, "x_0": 1e-3}]


@pytest.fixture(scope="module", params=["tip_x tip_y", "tip_angle", "tip_deflection"])
def bench(request: pytest.FixtureRequest) -> Bench:
    """Two recordings of different lengths."""
    channels = tuple(request.param.split())
    return Bench("constant_radius", EFFECTS, [arm("a", channels, 150), arm("b", channels, 90)], 0.02)


def fitted(bench: Bench, **values: float) -> tuple[np.ndarray, np.ndarray]:
    """Return kernel parameters and initial states of one set."""
    given = {"alpha": 8.0, "xi": 0.05, "length": 1.0} | values
    parameters = np.array([[given.get(name, 0.0)] for name in bench.names])
    return parameters, np.tile([[[0.2], [-0.1]]], (len(bench.experiments), 1, 1))


def read_anew(bench: Bench, base: tuple[np.ndarray, np.ndarray], changed: dict[str, float]) -> np.ndarray:
    """Return how far a change moves the residual, simulated."""
    parameters, initial = base
    other = parameters.copy()
    for name, value in changed.items():
        other[bench.names.index(name)] = value
    return (bench.residuals(other, initial) - bench.residuals(parameters, initial))[:, 0]


def test_the_age_alone_is_what_late_instruments_change(bench: Bench) -> None:
    assert ages_only(bench, LATE).all()
    assert not ages_only(bench, OTHER).any()


@pytest.mark.parametrize(("view", "reads_acceleration"), [(object(), False), (None, True)])
def test_what_is_filtered_or_may_jump_is_read_anew(bench: Bench, view: object, reads_acceleration: bool) -> None:
    other = copy(bench)
    other.experiments = (SimpleNamespace(rig=SimpleNamespace(view=view), reads_acceleration=reads_acceleration),)
    assert not ages_only(other, LATE).any()


def test_without_a_delay_in_the_kernel_it_is_read_anew() -> None:
    effects = tuple(e for e in EFFECTS if e != "sensor_delay")
    assert not ages_only(Bench("constant_radius", effects, [arm("a", ("tip_angle",), 90)], 0.02), LATE).any()


@pytest.mark.parametrize("tau", [0.0, 0.03])
def test_small_ages_move_the_residual_as_reading_it_anew_does(bench: Bench, tau: float) -> None:
    base = fitted(bench, tau=tau)
    slope = per_age(bench, base, bench.motions(*base))
    # Beside a delay that is fitted, another one is only a candidate where it is absent.
    for changed, ages in zip(LATE[1:], ages_of(bench, LATE[1:]).T, strict=True):
        expected = read_anew(bench, base, changed)
        assert np.abs(expected).max() > 0.005
        assert slope[:, 0] * ages == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_ages_are_those_of_the_clock_at_each_reading(bench: Bench) -> None:
    ages = ages_of(bench, [{"tau": 0.02}, {"d_t": 0.001}])
    channels = [e.recording.output.shape[1] for e in bench.experiments]
    times = np.concatenate([np.repeat(s.time, c) for s, c in zip(bench.simulators, channels, strict=True)])
    np.testing.assert_allclose(ages, np.column_stack([np.full(times.size, 0.02), 0.001 * times]), rtol=1e-6)


@pytest.mark.parametrize("threads", [1, 2])
def test_responses_mix_ages_and_motions_in_the_order_asked_for(bench: Bench, threads: int) -> None:
    base = fitted(bench)
    settings = [OTHER[1], LATE[2], OTHER[0], LATE[0], OTHER[2], LATE[1]]
    reference = bench.residuals(*base)[:, 0]
    known = np.linalg.qr(np.random.default_rng(1).normal(size=(reference.size, 2)))[0]
    with ThreadPoolExecutor(threads) as pool:
        found = respond(pool, bench, base, settings, reference, known).moved(np.arange(len(settings)))
    for k, changed in enumerate(settings):
        expected = read_anew(bench, base, changed)
        assert found[:, k] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())
