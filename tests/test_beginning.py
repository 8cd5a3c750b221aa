"""Fits that are led from the beginning of recordings to the whole of them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import driven_oscillator as bench
import numpy as np
import pytest

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.beginning import beginning, from_declared, from_the_beginning, lead, missed
from discovery.estimation.bench import Bench
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn

TIME, NOISE, ALPHA, XI = np.arange(0.0, 60.0, 0.05), 1e-3, 16.0, 0.01


def swung(angle: float, seed: int) -> Experiment:
    """Return a free oscillation over forty swings."""
    rate = np.sqrt(ALPHA - XI**2 / 4)
    read = angle * np.exp(-XI * TIME / 2) * np.cos(rate * TIME)
    read = (read + NOISE * np.random.default_rng(seed).standard_normal(TIME.size))[:, None]
    rig = Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "m")))
    recorded = Recording("r", TIME, None, read, ("output",), ("m",), np.array([NOISE]), sha256="", source="")
    return make_experiment(recorded, rig)


def problem_of(*experiments: Experiment) -> Problem:
    model = Model("oscillator", ("viscous_damping", "linear_stiffness"), {"g": 1.0})
    step = Bench(model.base, model.effects, experiments, 0.02)
    return Problem(model, step, natural_units(experiments), {})


def test_a_start_whose_phase_runs_away_over_the_whole_is_led_there() -> None:
    free = problem_of(swung(0.1, 1))
    # With its damping free a fit may let the motion die away on its way.
    problem = replace(free, model=Model("oscillator", free.model.effects, {"g": 1.0, "xi": XI}))
    wrong = problem.start({"alpha": 1.3 * ALPHA})
    (stuck,) = fit_problems([problem], [wrong])
    assert 2 * stuck.cost > 100 * problem.bench.n_data
    (found,) = fit_problems([problem], lead([problem], [wrong]))
    assert 2 * found.cost < 1.2 * problem.bench.n_data
    assert problem.named(found.x)["alpha"] == pytest.approx(ALPHA, rel=1e-3)


def test_what_is_known_of_a_start_holds_where_the_beginning_tells_little() -> None:
    problem = problem_of(swung(0.1, 1))
    start = problem.start({"alpha": ALPHA, "xi": XI})
    (held,) = lead([problem], [start], [{"xi": (0.5, 1e-3)}])
    assert problem.named(held)["xi"] == pytest.approx(0.5, abs=0.02)


def test_values_of_what_was_added_are_kept_and_others_begin_as_declared() -> None:
    model = Model("oscillator", bench.EFFECTS, {"g": bench.GAIN})
    experiment = bench.experiment(bench.NOISE * np.random.default_rng(1).standard_normal(bench.TIME.size))
    problem = Problem(model, Bench(model.base, model.effects, [experiment], 0.01), natural_units([experiment]), {})
    found = from_declared(problem, {"xi": 1e3, "alpha": 1e6}, ())
    (minimum,) = fit_problems([problem], [found])
    assert 2 * minimum.cost < 1.2 * problem.bench.n_data


def test_a_part_holds_readings_where_the_recording_begins_with_a_gap() -> None:
    experiment = swung(0.1, 1)
    experiment.recording.output[: TIME.size // 8] = np.nan
    assert beginning(problem_of(experiment), 1 / 16).bench.n_data >= 16


def test_a_recording_is_missed_where_all_fits_miss_it_whatever_the_others_leave() -> None:
    size, rows = 10, [slice(10 * i, 10 * i + 10) for i in range(5)]
    of_five: Any = SimpleNamespace(
        experiments=[None] * 5, blocks=lambda: iter([(own, np.ones(size, bool)) for own in rows])
    )

    def left(*sizes: float) -> Any:
        return SimpleNamespace(residual=np.repeat(sizes, size))

    # In the mean over all recordings less than nine noise variances.
    assert missed(of_five, [left(1, 1, 1, 1, 6)]).tolist() == [False] * 4 + [True]
    assert missed(of_five, [left(1, 6, 1, 1, 6), left(1, 1, 1, 1, 6)]).tolist() == [False] * 4 + [True]
    assert missed(of_five, [left(1, 1, 1, 1, np.nan)]).tolist() == [False] * 4 + [True]
    assert missed(of_five, []).all()


def test_starts_are_led_as_long_as_one_explains_a_beginning() -> None:
    """Of two starts both are led, each from where it is; of a model that misses the beginning none is."""
    problem = problem_of(swung(0.1, 1))
    known = Problem(Model("oscillator", problem.model.effects, {"g": 1.0, "alpha": ALPHA, "xi": XI}), problem.bench,
                    problem.units, {}, reference="")  # fmt: skip
    starts = [known.start({}), 1.5 * known.start({})]
    off = [np.ones(1, bool)] * 2
    led = from_the_beginning([known, known], starts, off)
    assert sorted(led) == [0, 1]
    assert from_the_beginning([known, known], starts, [np.zeros(1, bool), off[0]]).keys() == {1}
    soft = Problem(Model("oscillator", problem.model.effects, {"g": 1.0, "alpha": 0.2 * ALPHA, "xi": XI}),
                   problem.bench, problem.units, {}, reference="")  # fmt: skip
    assert from_the_beginning([soft], starts[:1], off[:1]) == {}
