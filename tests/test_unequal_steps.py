"""Short steps where a motion asks for them, and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from discovery.equations.model import Model
from discovery.estimation import step_control
from discovery.estimation.bench import Bench
from discovery.estimation.fit import fit, refined
from discovery.estimation.holdout import HoldOut
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.step import choose_step
from discovery.estimation.step_control import unequal_bench
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

EFFECTS = ("linear_stiffness", "viscous_damping")
UNITS = NaturalUnits(1 / 3, 1.0, 1.0)
VALUES = {
    "xi": 0.05, "alpha": 9.0, "length": 1.0, "mu": 0.05, "tau_r": 5e-4,
    "delta_0_init[arm]": 0.0, "rate_0_init[arm]": 0.0,
}  # fmt: skip
TOLERANCE = 2e-5


def turns(*moves: tuple[float, float, float], end: float = 16.0) -> Drive:
    """Return a motor that turns by angles [rad] from times on, within durations [s], at speed and back evenly."""
    knots, rows, kinks = [0.0], [[0.0, 0.0, 0.0]], []
    angle = 0.0
    for start, by, lasting in moves:
        a = 4 * by / lasting**2
        knots += [start, start + lasting / 2, start + lasting]
        kinks += knots[-3:]
        half = a * lasting / 2
        rows += [[a / 2, 0.0, angle], [-a / 2, half, angle + by / 2], [0.0, 0.0, angle + by]]
        angle += by
    return Drive(np.array([*knots, end]), np.array(rows).T, np.array(kinks))


def arm(drive: Drive, values: Mapping[str, float] = VALUES) -> tuple[Experiment, Model]:
    """Return an arm on a motor, with readings of no use, and its exact mechanics."""
    time = np.arange(801) / 50
    output = np.tile([1.0, 0.0], (time.size, 1))
    motor = drive.evaluate(time)[0]
    recording = Recording("arm", time, motor, output, ("tip_x", "tip_y"), ("m", "m"), np.full(2, 3e-4), "", "")
    known = {n: values[n] for n in ("length", "mu", "tau_r")}
    return Experiment(recording, drive, Rig("test", length=Quantity(1.0, 0.0))), Model("elastica_calm", EFFECTS, known)


#: Slow, and once so violent that the rod bends far and rings.
VIOLENT = turns((1.0, 0.3, 3.0), (8.0, 2.2, 0.5))


def motion(model: Model, bench: Bench, values: Mapping[str, float] = VALUES) -> np.ndarray:
    problem = Problem(model, bench, UNITS, {})
    return problem.predict(problem.start(values))[0]


@pytest.fixture(scope="module")
def paced() -> Bench:
    """The bench of the violent arm."""
    experiment, model = arm(VIOLENT)
    return unequal_bench(model, EFFECTS, [experiment], UNITS, VALUES, TOLERANCE)


def test_a_violent_moment_alone_has_short_steps(paced: Bench) -> None:
    experiment, model = arm(VIOLENT)
    equal = Bench("elastica_calm", EFFECTS, [experiment], choose_step(model, [experiment], UNITS, VALUES, TOLERANCE))
    assert paced.cost < 0.4 * equal.cost
    # Against steps that are everywhere shorter than the shortest there.
    exact = Bench.like(equal, paced.shortest / 4)
    error = np.linalg.norm(motion(model, paced) - motion(model, exact), axis=1)
    assert 0.01 * TOLERANCE < error.max() < TOLERANCE
    grid = paced.simulators[0].grid
    assert paced.shortest == pytest.approx(grid.steps.min(), rel=0.05)
    assert 7.5 < grid.times[np.argmin(grid.steps)] < 10.0
    assert paced.step == pytest.approx(grid.steps.max(), rel=0.05)


def test_half_as_long_steps_keep_the_pace(paced: Bench) -> None:
    half = Bench.like(paced, paced.step / 2)
    assert half.cost == pytest.approx(2 * paced.cost, rel=0.01)
    assert half.shortest == paced.shortest / 2
    part = Bench(paced.base, paced.effects, [e.first(300) for e in paced.experiments], paced.step)
    np.testing.assert_allclose(part.simulators[0].grid.times[:100], paced.simulators[0].grid.times[:100], atol=1e-12)


def test_each_recording_has_its_pace() -> None:
    """One that begins late is short and violent, the other slow."""
    slow, model = arm(turns((1.0, 0.3, 3.0), (8.0, 0.3, 3.0)))
    experiment, _ = arm(VIOLENT)
    r = experiment.recording
    late = replace(experiment, recording=replace(
        r, name="late", time=r.time[300:651], input=r.input[300:651], output=r.output[300:651]
    ))  # fmt: skip
    values = {**VALUES, "delta_0_init[late]": 0.0, "rate_0_init[late]": 0.0}
    bench = unequal_bench(model, EFFECTS, [slow, late], UNITS, values, TOLERANCE)
    assert bench.cost < 0.4 * 10.0 / choose_step(model, [slow, late], UNITS, values, TOLERANCE)
    first, second = (s.grid for s in bench.simulators)
    assert (second.times[0], second.times[-1] + second.steps[-1]) == (6.0, 13.0)
    assert 7.5 < second.times[np.argmin(second.steps)] < 10.0
    assert second.steps.min() < 0.2 * first.steps.min()
    problem = Problem(model, bench, UNITS, {})
    exact = Problem(model, Bench(bench.base, bench.effects, [slow, late], bench.shortest / 4), UNITS, {})
    both = zip(problem.predict(problem.start(values)), exact.predict(exact.start(values)), strict=True)
    assert all(np.linalg.norm(a - b, axis=1).max() < TOLERANCE for a, b in both)


def test_a_slow_arm_has_equal_steps() -> None:
    experiment, model = arm(turns((1.0, 0.3, 3.0), (8.0, 0.3, 3.0)))
    bench = unequal_bench(model, EFFECTS, [experiment], UNITS, VALUES, TOLERANCE)
    assert [e.pace for e in bench.experiments] == [None]
    assert bench.step == bench.shortest == choose_step(model, [experiment], UNITS, VALUES, TOLERANCE)


def test_a_pace_that_misses_the_tolerance_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    experiment, model = arm(VIOLENT)
    measured = step_control._measured

    def blind(*given: object) -> object:
        parts = measured(*given)  # type: ignore[arg-type]
        return replace(parts, errors=parts.errors[::-1].copy())

    # Short steps where none are needed.
    monkeypatch.setattr("discovery.estimation.step_control._measured", blind)
    bench = unequal_bench(model, EFFECTS, [experiment], UNITS, VALUES, TOLERANCE)
    assert [e.pace for e in bench.experiments] == [None]
    exact = Bench.like(bench, bench.step / 4)
    assert np.linalg.norm(motion(model, bench) - motion(model, exact), axis=1).max() < TOLERANCE


def test_the_fewest_steps_of_a_given_error() -> None:
    experiment, _ = arm(VIOLENT)
    edges = [np.array([0.0, 2.0, 12.0, 16.0])]
    e = np.array([1.0, 1e-6, 1e-2])
    parts = step_control._Parts([experiment], edges, 7 * e)
    shares, lasting = parts.shares(0.1), np.diff(edges[0])
    assert shares.max() <= 1.0
    # As large a sum of errors as that of equal steps,
    np.testing.assert_allclose(np.sum(lasting * e * shares**4), np.sum(lasting * e * 0.1**4), rtol=1e-6)
    steps = np.sum(lasting / shares)
    assert steps < 0.5 * np.sum(lasting / 0.1)
    # and no other lengths that err as much are fewer.
    rng = np.random.default_rng(0)
    for _ in range(200):
        other = np.minimum(1.0, shares * np.exp(0.1 * rng.standard_normal(3)))
        scale = (np.sum(lasting * e * 0.1**4) / np.sum(lasting * e * other**4)) ** 0.25
        if (scale * other).max() <= 1.0:
            assert np.sum(lasting / (scale * other)) > (1 - 1e-9) * steps


def test_a_fit_is_the_same_on_unequal_steps(paced: Bench) -> None:
    experiment, model = arm(VIOLENT)
    equal = Bench("elastica_calm", EFFECTS, [experiment], paced.shortest / 2)
    rng = np.random.default_rng(1)
    seen = motion(model, equal) + 3e-4 * rng.standard_normal((801, 2))
    fits = []
    for bench in (equal, paced):
        own = [replace(e, recording=replace(e.recording, output=seen)) for e in bench.experiments]
        fits.append(fit(model, own, start=VALUES, units=UNITS, bench=Bench(bench.base, bench.effects, own, bench.step)))
    assert fits[1].chi2 == pytest.approx(fits[0].chi2, abs=1.0)
    for name in ("xi", "alpha"):
        # What the tolerance allows, and what is left of it once the answer is polished.
        for found, most in ((fits[1], 0.5), (refined(fits[1]), 0.1)):
            assert found.values[name] == pytest.approx(fits[0].values[name], abs=most * fits[0].sd[name])
            assert found.sd[name] == pytest.approx(fits[0].sd[name], rel=0.02)
    # Whoever simulates another motion from this answer knows of no pace.
    assert fits[1].summary()["solver_step_s"] == paced.shortest
    start = np.array([[fits[1].values[f"{n}[arm]"] for n in ("delta_0_init", "rate_0_init")]])
    (alone,) = fits[1].predict([experiment], start)
    exact = motion(model, Bench.like(equal, paced.shortest / 4), fits[1].values)
    for found in (alone, fits[1].predict()[0]):
        assert np.linalg.norm(found - exact, axis=1).max() < TOLERANCE


def test_other_recordings_are_predicted_on_steps_as_short_as_the_shortest(paced: Bench) -> None:
    experiment, model = arm(VIOLENT)
    # Even where it could do with longer ones, as it is judged here.
    values = {n: VALUES[n] for n in ("xi", "alpha")}
    exact = motion(model, Bench.like(paced, paced.step / 4))
    seen = replace(experiment, recording=replace(experiment.recording, output=exact))
    judge = HoldOut([seen], [seen], UNITS, 1e-2)
    ((predicted,),) = judge.predictions(paced, [(model, values, [])])
    assert np.linalg.norm(predicted - exact, axis=1).max() < TOLERANCE


def test_the_steps_of_other_systems_are_equal() -> None:
    time = np.arange(801) / 50
    push = Drive(
        np.array([0.0, 8.0, 8.2, 16.0]), np.array([[0, 0, 0], [0, 0, 0], [0.0, 500.0, 0.0]]), np.array([8.0, 8.2])
    )
    columns = Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V"))
    output = np.linspace(-0.3, 0.3, time.size)[:, None]
    given = push.evaluate(time)[0]
    recording = Recording("y", time, given, output, ("output",), ("V",), np.full(1, 1e-4), "", "")
    experiment = Experiment(recording, push, Rig("test", "oscillator", columns=columns))
    effects = ("cubic_stiffness", "linear_stiffness", "viscous_damping")
    values = {"g": 1.0, "xi": 0.3, "alpha": 9.0, "beta": 400.0, "delta_0_init[y]": 0.0, "rate_0_init[y]": 0.0}
    bench = unequal_bench(Model("oscillator", effects), effects, [experiment], UNITS, values, 1e-6)
    assert [e.pace for e in bench.experiments] == [None]
