"""The shape of a law that holds on to a body, read along its recorded motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from benchmarks.systems import laws, machines
from benchmarks.systems.record import record
from discovery.estimation.bench import Bench
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.recordings.dataset import load_dataset
from discovery.screening.attribution import screen
from discovery.screening.finite import finite_starts
from discovery.screening.refits import refit

TEETH = 12


def without_teeth(directory: Path, rig: str, *effects: str) -> tuple[Problem, Minimum]:
    """Return the fit of a motor without the teeth that its rotor has, on simulators that know them."""
    (directory / "rig.toml").write_text(rig, encoding="utf-8")
    record(machines.motor(), "shaft", laws.cogging(0.02, TEETH), directory / "a.csv", 4)
    data = load_dataset(directory / "rig.toml", [directory / "a.csv"], keep_third=False)
    found = fit(declared_model(data), data)
    bare = found.problem
    bench = Bench(bare.bench.base, (*bare.bench.effects, *effects), bare.bench.experiments, bare.bench.step)
    return replace(bare, bench=bench), found.minimum


def test_teeth_that_a_linear_response_does_not_count_are_counted_along_the_motion(tmp_path: Path) -> None:
    problem, minimum = without_teeth(tmp_path, machines.motor().rig, "cogging_at_shaft", "coulomb_friction_at_shaft")
    (scored,) = screen(minimum, problem, ["cogging_at_shaft"])
    (linear,) = refit(minimum, problem, [scored])
    names = ["cogging_at_shaft", "coulomb_friction_at_shaft"]
    every = finite_starts(minimum, problem, names)
    assert {name for name, _, _ in every} == {*names}  # friction brakes what is driven
    starts = [start for start in every if start[0] == "cogging_at_shaft"]
    assert starts[0][1][-1] == TEETH
    (found,) = refit(minimum, problem, [scored], finite=starts)
    assert found.values["N_c_shaft"] == pytest.approx(TEETH, abs=0.05)
    assert found.chi2 < 1.2 * problem.bench.n_data < 0.1 * linear.chi2


def in_its_loop(directory: Path) -> Path:
    """Record a motor with a dead zone of 0.6 V that follows steps of its set point, and return its rig file."""
    state, rows, rng = np.zeros(2), [], np.random.default_rng(1)
    for k in range(201):
        volts = float(np.clip(6.0 * (0.5 * np.pi * (k // 50 % 4) - state[0]), -5.0, 5.0))
        rows.append((0.02 * k, volts, state[0] + rng.normal(0.0, 1e-3)))
        push = 57.0 * np.sign(volts) * max(abs(volts) - 0.6, 0.0)
        turn = solve_ivp(lambda _, s, push=push: (s[1], push - 13.0 * s[1]), (0.0, 0.02), state, rtol=1e-9, atol=1e-12)
        state = turn.y[:, -1]
    pd.DataFrame(rows, columns=["t", "u", "y"]).to_csv(directory / "a.csv", index=False)
    (directory / "rig.toml").write_text(
        'name = "motor"\nkind = "drive"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'input = { name = "u", unit = "V", interpolation = "hold" }\n'
        'output = { name = "y", unit = "rad", noise = 1e-3 }\n[model]\neffects = ["viscous_damping"]\n'
    )
    return directory / "rig.toml"


def test_what_holds_a_motor_is_read_along_its_motion_and_not_where_a_model_without_it_runs(tmp_path: Path) -> None:
    data, effects = load_dataset(in_its_loop(tmp_path), [tmp_path / "a.csv"], keep_third=False), ["input_dead_zone"]
    found = fit(declared_model(data), data)
    own = found.problem.bench
    problem = replace(found.problem, bench=Bench(own.base, (*own.effects, *effects), own.experiments, own.step))
    scored = screen(found.minimum, problem, effects)
    (linear,) = refit(found.minimum, problem, scored)
    (along,) = refit(found.minimum, problem, scored, finite=finite_starts(found.minimum, problem, effects))
    assert along.values["w_u"] == pytest.approx(0.6, abs=0.01)
    assert along.chi2 < 1.2 * problem.bench.n_data < 0.01 * linear.chi2


def test_nothing_is_read_along_a_motion_that_is_not_recorded(tmp_path: Path) -> None:
    """A reading of something else than the coordinate or its rate tells no force there."""
    rig = machines.motor().rig.replace('output = "dot(phi)"', 'output = "sin(phi)"').replace("rad / s", "1")
    problem, minimum = without_teeth(tmp_path, rig, "cogging_at_shaft")
    assert np.isfinite(minimum.cost)
    assert finite_starts(minimum, problem, ["cogging_at_shaft"]) == []
