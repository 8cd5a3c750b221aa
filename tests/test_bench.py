from __future__ import annotations

import threading
import tracemalloc
from functools import partial

import numpy as np
import pytest

from discovery.estimation.bench import Bench
from discovery.foundation.workers import aside, at_once, in_threads
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, ForceView, InputColumn, OutputColumn, Quantity, Rig, TimeColumn
from discovery.simulation import simulate

EFFECTS = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law", "sensor_delay")
VALUES = {"length": 1.0, "xi": 0.05, "alpha": 9.0, "beta": 0.5, "gamma": 0.45}
UNITS = {"tip_x": "m", "tip_y": "m", "tip_angle": "rad", "tip_deflection": "m"}
RAMP = Drive(np.array([0.0, 0.3, 1.3, 50.0]), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.3, 1.3]))


def arm(name: str, channels: tuple[str, ...], samples: int, fitted: int | None = None) -> Experiment:
    """Noise around a slow turn, with a gap."""
    time = np.linspace(0.0, 2.0, samples)
    turn = RAMP.evaluate(time)[0]
    clean = {"tip_x": np.cos(turn), "tip_y": np.sin(turn), "tip_angle": turn, "tip_deflection": 0 * turn}
    output = np.column_stack([clean[c] for c in channels])
    output += 0.01 * np.random.default_rng(len(name)).standard_normal(output.shape)
    output[5:9] = np.nan
    units, noise = tuple(UNITS[c] for c in channels), 3e-3 * np.arange(1, len(channels) + 1)
    recording = Recording(name, time, turn, output, channels, units, noise, "", "")
    return Experiment(recording, RAMP, Rig("test", length=Quantity(1.0, 0.0)), fitted)


def scattered(bench: Bench, k: int, late: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Parameter sets around VALUES, one in three of them read late."""
    rng = np.random.default_rng(3)
    parameters = np.repeat([[VALUES.get(n, 0.0)] for n in bench.names], k, axis=1)
    parameters *= 1 + 0.02 * rng.standard_normal(parameters.shape)
    if late:
        parameters[bench.names.index("tau"), ::3] = rng.uniform(-0.3, 0.05, -(-k // 3))
    return parameters, 0.1 * rng.standard_normal((len(bench.experiments), 2, k))


def expected(bench: Bench, parameters: np.ndarray, initial: np.ndarray) -> list[np.ndarray]:
    """What `Bench.residuals` says, by numpy from the simulated channels: (n, c, k) for each experiment."""
    found = []
    for e, channels in zip(bench.experiments, bench.predict(parameters, initial), strict=True):
        weights = e.weights()[:, :, None]
        left = np.where(weights > 0, (channels - e.recording.output[:, :, None]) * weights, 0.0)
        found.append(left[: e.fitted.stop])
    return found


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("channels", [("tip_x", "tip_y"), ("tip_angle",), ("tip_deflection",)])
def test_residuals_and_their_squares_are_those_of_the_channels(channels: tuple[str, ...], late: bool) -> None:
    experiments = (arm("a", channels, 150), arm("bb", channels, 90, fitted=60))
    bench = Bench("constant_radius", EFFECTS, experiments, 0.02)
    sets = scattered(bench, 70, late)
    wanted = expected(bench, *sets)
    got = bench.residuals(*sets)
    np.testing.assert_allclose(got, np.concatenate([w.reshape(-1, 70) for w in wanted]), rtol=1e-12, atol=1e-10)
    squares = np.array([np.einsum("nck,nck->k", w, w) for w in wanted])
    np.testing.assert_allclose(bench.chi2(*sets), squares, rtol=1e-11)


def test_a_filtered_force_is_compared_after_its_filter() -> None:
    time = np.arange(400) / 100.0
    drive = Drive(np.array([0.0, 4.0]), np.array([[0.5], [-0.8], [0.3], [0.1]]), np.empty(0))
    output = np.random.default_rng(0).standard_normal((400, 1))
    recording = Recording("f", time, drive.evaluate(time)[0], output, ("output",), ("N",), np.ones(1), "", "")
    columns = Columns(TimeColumn("t"), InputColumn("q", "m", "spline"), OutputColumn("f", "N", None, "position", 0, 2))
    rig = Rig("d", kind="drive", columns=columns, view=ForceView(50.0, 10.0))
    bench = Bench("inverse_dynamics", ("viscous_damping",), [Experiment(recording, drive, rig)], 0.02)
    parameters = 1.0 + np.random.default_rng(1).random((len(bench.names), 1100))
    sets = parameters, np.zeros((1, 2, 1100))
    (wanted,) = expected(bench, *sets)
    np.testing.assert_allclose(bench.residuals(*sets), wanted[:, 0], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(bench.chi2(*sets)[0], (wanted**2).sum(axis=(0, 1)), rtol=1e-12)


def test_a_trial_that_blows_up_is_infinite_in_every_experiment() -> None:
    # The second recording ends before the motion grows.
    experiments = (arm("a", ("tip_angle",), 150), arm("bb", ("tip_angle",), 90).first(20))
    bench = Bench("constant_radius", EFFECTS, experiments, 0.02)
    parameters, initial = scattered(bench, 40)
    calm = bench.chi2(parameters, initial)
    parameters[bench.names.index("beta"), 7] = -1e4
    parameters[bench.names.index("xi"), 33] = -12.0
    for found in (bench.chi2(parameters, initial), bench.residuals(parameters, initial)[None]):
        for each in found:
            assert np.isinf(np.atleast_2d(each)[:, [7, 33]]).all()
    others = np.delete(np.arange(40), [7, 33])
    np.testing.assert_array_equal(bench.chi2(parameters, initial)[:, others], calm[:, others])


def test_the_number_of_threads_changes_no_digit(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench("constant_radius", EFFECTS, [arm("a", ("tip_x", "tip_y"), 150)], 0.02)
    sets = scattered(bench, 333, late=True)
    found = []
    for threads in (1, 2, 5):
        monkeypatch.setattr(simulate, "THREADS", threads)
        found.append((bench.residuals(*sets), bench.chi2(*sets)))
    for other in found[1:]:
        for a, b in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_recordings_side_by_side_answer_as_each_alone() -> None:
    experiments = (arm("a", ("tip_x", "tip_y"), 150), arm("bb", ("tip_x", "tip_y"), 90), arm("ccc", ("tip_angle",), 40))
    together = Bench("constant_radius", EFFECTS, experiments, 0.02)
    parameters, initial = scattered(together, 77)
    residuals, chi2 = together.residuals(parameters, initial), together.chi2(parameters, initial)
    predicted = together.predict(parameters, initial)
    first = 0
    for i, e in enumerate(experiments):
        alone = Bench("constant_radius", EFFECTS, [e], 0.02)
        own = initial[i : i + 1]
        np.testing.assert_array_equal(residuals[first : first + alone.n_rows], alone.residuals(parameters, own))
        np.testing.assert_array_equal(chi2[i], alone.chi2(parameters, own)[0])
        np.testing.assert_array_equal(predicted[i], alone.predict(parameters, own)[0])
        first += alone.n_rows
    assert first == len(residuals)


def test_memory_does_not_grow_with_samples_times_sets() -> None:
    bench = Bench("constant_radius", EFFECTS, [arm("a", ("tip_x", "tip_y"), 4000)], 0.05)

    def peak(k: int) -> int:
        sets = scattered(bench, k)
        bench.chi2(*sets)
        tracemalloc.start()
        bench.chi2(*sets)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    # Numbers that a set needs anyway: its parameters, its start, its sums.
    own = 50 * 8 * len(bench.names)
    assert peak(1280) - peak(128) < 1152 * own < 0.1 * 1152 * 8000 * 8


def test_what_fails_in_a_thread_fails() -> None:
    def work(waiting) -> None:
        for block in waiting:
            if block == 5:
                raise ValueError("block five")

    with pytest.raises(ValueError, match="block five"):
        in_threads(work, 12, threads=3)


def test_threads_share_all_blocks() -> None:
    done: list[int] = []
    in_threads(done.extend, 23, threads=3)
    assert sorted(done) == list(range(23))


def test_calls_at_once_overlap_and_answer_in_their_order() -> None:
    meet = threading.Barrier(2, timeout=30)
    # Two and two of them wait for each other: whoever is done takes the next.
    assert at_once([lambda k=k: (meet.wait(), k)[1] for k in range(6)], threads=2) == [*range(6)]

    def name(_: int = 0) -> int:
        return threading.get_ident()

    # Calls within such a call have its thread to themselves.
    for inner in at_once([lambda: at_once([name] * 3, threads=2)] * 2, threads=2):
        assert len(set(inner)) == 1
    assert len(set(at_once([name] * 3, threads=1))) == 1

    # The last of them finds a helper for its blocks when the others are done.
    meet, done = threading.Barrier(2, timeout=30), threading.Event()

    def last() -> int:
        assert done.wait(30)
        in_threads(lambda waiting: [meet.wait() for _ in waiting], 2, threads=2)
        return threading.get_ident()

    assert at_once([lambda: done.set() or 0, last], threads=2)[0] == 0

    def fail() -> int:
        raise ValueError("the second")

    with pytest.raises(ValueError, match="the second"):
        at_once([name, fail], threads=2)


def interrupt(*_: object) -> int:
    raise KeyboardInterrupt


def test_an_interruption_waits_for_nobody() -> None:
    free, done = threading.Event(), []
    main = threading.current_thread()

    def work(waiting) -> None:
        for block in waiting:
            if threading.current_thread() is main:
                interrupt()
            assert free.wait(30)
            done.append(block)

    # None of these calls returns before the others are let go.
    try:
        with pytest.raises(KeyboardInterrupt):
            at_once([interrupt, partial(free.wait, 30)], threads=2)
        with pytest.raises(KeyboardInterrupt):
            in_threads(work, 50, threads=2)
        assert not free.is_set()
    finally:
        free.set()
    # And nobody goes on with what is left.
    assert len(done) <= 1


def test_what_is_made_aside_is_made_in_another_thread_of_the_main_one_only() -> None:
    there, inner = aside(lambda: (threading.current_thread(), aside(threading.current_thread)))
    assert there is inner
    assert there is not threading.main_thread()
    with pytest.raises(KeyboardInterrupt):
        aside(interrupt)


@pytest.mark.parametrize("late", [False, True])
def test_what_an_instrument_alone_does_is_read_of_one_motion(late: bool) -> None:
    recordings = [arm("a", ("tip_x", "tip_y"), 150), arm("b", ("tip_x", "tip_y"), 90)]
    bench = Bench("constant_radius", ("linear_stiffness", "sensor_delay", "camera_origin_offset"), recordings, 0.02)
    parameters, initial = scattered(bench, 40, late)
    instrument = np.isin(bench.names, ["tau", "x_0", "y_0"])
    parameters[~instrument], initial[:] = parameters[~instrument, :1], initial[:, :, :1]
    parameters[bench.names.index("x_0")] = np.linspace(-0.01, 0.01, 40)
    assert bench.moves_alike(parameters).all()
    own = bench.residuals(parameters, initial)
    np.testing.assert_array_equal(bench.residuals(parameters, initial, bench.motions(parameters, initial)), own)
    assert np.unique(own[100]).size == 40
    for name in set(bench.names) - {"tau", "x_0", "y_0"}:
        other = parameters.copy()
        other[bench.names.index(name), 7] += 0.01
        if name in bench.simulators[0].kernel.program.moving:
            assert np.flatnonzero(~bench.moves_alike(other)).tolist() == [7]


def test_leaps_give_the_same_residuals() -> None:
    experiment = arm("a", ("tip_x", "tip_y"), 150)
    fine = Bench("constant_radius", EFFECTS[:4], [experiment], 0.002)
    leaping = Bench("constant_radius", EFFECTS[:4], [experiment], 0.02, leap=0.12)
    sets = scattered(fine, 5)
    assert leaping.simulators[0].grid.steps.size < 0.2 * 2.0 / 0.02
    np.testing.assert_allclose(leaping.residuals(*sets), fine.residuals(*sets), rtol=0, atol=1e-4)
    halved = Bench.like(leaping, 0.01)
    assert halved.leap == pytest.approx(0.06)
    # Dry friction has a kink: no method of high order.
    rough = Bench("constant_radius", (*EFFECTS[:2], "coulomb_friction"), [experiment], 0.02, leap=0.12)
    assert rough.leap is None
    plain = Bench(rough.base, rough.effects, rough.experiments, rough.step)
    np.testing.assert_array_equal(rough.residuals(*scattered(rough, 5)), plain.residuals(*scattered(plain, 5)))
