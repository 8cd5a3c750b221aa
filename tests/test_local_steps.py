"""Steps that are short where dry friction changes its sign, and long elsewhere, err as little as short ones do."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.held_simulators import HeldSimulators
from discovery.estimation.held_states import known_problem
from discovery.estimation.local_steps import bends, halved_where_bent
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.step_control import solver_errors
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.simulation.grid import DriveLike

EFFECTS = ("viscous_damping", "linear_stiffness", "coulomb_friction")
UNITS = NaturalUnits(1 / 15.0, 0.02, 1.0)
VALUES = {"xi": 0.2, "alpha": 240.0, "f_c": 0.35, "v_c": 2e-4, "g": 1.0}
KNOWN = dict(VALUES)
NOISE, STEP = 2e-6, 8e-3


class Sines:
    """A smooth input of four sines."""

    kinks = np.empty(0)

    def evaluate(self, time, side="right"):
        """Return the input and two derivatives."""
        t = np.asarray(time, float)
        w, a, p = np.array([[3.0, 9.0, 14.0, 26.0], [0.9, 1.2, 0.8, 1.0], [0.3, 1.9, 4.0, 5.1]])
        angle = np.multiply.outer(t, w) + p
        return np.array([np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w * w)])


def held(*, close: bool = False) -> Drive:
    """Return an input that is held between its samples, of which each is a kink; two of them may be close."""
    knots = np.arange(0.0, 6.01, 0.01)
    if close:
        knots = np.insert(knots, 301, knots[300] + 5e-6)
    values = Sines().evaluate(knots[:-1])[0]
    return Drive(knots, np.array([np.zeros_like(values), np.zeros_like(values), values]), knots[1:-1])


def recorded(drive: DriveLike, name: str = "one", end: float = 6.0) -> Experiment:
    """Return a recording without readings of use."""
    time = np.arange(int(100 * end)) / 100.0
    columns = Columns(TimeColumn("t", "s"), InputColumn("u", "N", "spline"), OutputColumn("y", "m"))
    recording = Recording(
        name, time, drive.evaluate(time)[0], np.zeros((time.size, 1)), ("output",), ("m",), np.array([NOISE]), name, ""
    )
    rig = Rig("oscillator", "oscillator", declared=("viscous_damping", "linear_stiffness"), columns=columns)
    return Experiment(recording, drive, rig)


@cache
def problem(kind: str) -> tuple[Problem, np.ndarray]:
    """Return a body with dry friction on long steps, all of it known but where it begins, and its start."""
    experiment = recorded(Sines() if kind == "smooth" else held(close=kind == "close"))
    model = Model("oscillator", EFFECTS, {n: v for n, v in KNOWN.items() if n != "xi"})
    bench = Bench("oscillator", EFFECTS, [experiment], STEP)
    made = Problem(model, bench, UNITS, {})
    return made, made.start({"xi": VALUES["xi"]})


def error_on(bench: Bench, kind: str) -> float:
    """Return the squared error on a bench, beside a bench of very short steps."""
    made, x = problem(kind)
    exact = Bench.like(Bench("oscillator", EFFECTS, [replace(e, pace=None) for e in bench.experiments], STEP), 2e-5)
    return float(solver_errors([(replace(made, bench=bench), x)], exact)[0])


@pytest.mark.parametrize("kind", ["smooth", "held", "close"])
def test_a_kink_costs_short_steps_where_it_is(kind: str) -> None:
    made, x = problem(kind)
    bench = made.bench
    for _ in range(6):
        bench = halved_where_bent(bench, [(replace(made, bench=bench), x)])
    even = Bench.like(made.bench, STEP / 64)
    assert bench.shortest == pytest.approx(STEP / 64, rel=1e-6)
    # Held inputs ask for a step a sample in any case.
    assert bench.cost < (0.2 if kind == "smooth" else 0.4) * even.cost
    assert error_on(bench, kind) < 10.0 * error_on(even, kind)
    assert error_on(bench, kind) < 1e-2 * error_on(made.bench, kind)


def test_where_a_motion_is_smooth_nothing_bends_more_than_elsewhere() -> None:
    made, x = problem("smooth")
    smooth = replace(made, model=Model("oscillator", EFFECTS, {**made.model.known, "f_c": 0.0}))
    (calm,) = bends(made.bench.simulators, made.bench.motions(*smooth.expand(x[:, None])))
    (rough,) = bends(made.bench.simulators, made.bench.motions(*made.expand(x[:, None])))
    assert calm.max() < 0.1 * rough.max()


def test_a_motion_that_blows_up_has_all_its_steps_halved() -> None:
    made, x = problem("smooth")
    wild = replace(made, model=Model("oscillator", EFFECTS, {**made.model.known, "alpha": 1e9}))
    halved = halved_where_bent(made.bench, [(wild, x)])
    assert halved.step == STEP / 2
    assert halved.experiments[0].pace is None


def test_what_is_held_out_follows_its_own_motion() -> None:
    made, x = problem("smooth")
    bench = made.bench
    for _ in range(6):
        bench = halved_where_bent(bench, [(replace(made, bench=bench), x)])
    blank = recorded(Sines(), "two", 9.0)
    exact = known_problem(made.model, made.named(x), Bench("oscillator", EFFECTS, [blank], 5e-5), UNITS)
    (read,) = exact.predict(exact.start({}))
    # One that the model does not follow need not be simulated so well.
    other = replace(blank, recording=replace(blank.recording, output=read))
    simulators = HeldSimulators([other], UNITS, 1e-3)
    held_out = simulators.of(bench, [(made.model, made.named(x))], [other])
    assert simulators.of(bench, [(made.model, made.named(x))], [other]) is held_out
    assert held_out.experiments[0].pace is not None
    assert held_out.charge > 4 * held_out.cost
    assert held_out.cost < 0.2 * 9.0 / held_out.shortest
    # Whichever bench asks first, steps are as short as the recording needs.
    fine = HeldSimulators([other], UNITS, 1e-7)
    first = fine.of(bench, [(made.model, made.named(x))], [other])
    assert first.step == pytest.approx(fine.of(made.bench, [(made.model, made.named(x))], [other]).step)
    assert first.step < 0.7 * STEP
