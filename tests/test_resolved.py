"""Simulators as accurate as a fit needs, and no dearer."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from discovery_datasets.arm import ArmRig
from discovery_datasets.disturbances import StructuralDamping
from discovery_datasets.instrument import record, write_csv
from discovery_datasets.quick import readings
from discovery_datasets.recordings import MANOEUVRES

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem, known_values
from discovery.estimation.step_control import cheapest, more_accurate, solver_errors
from discovery.recordings.dataset import load_dataset
from discovery.recordings.experiment import Experiment
from discovery.screening.attribution import Candidate, screen
from discovery.screening.refits import Refit, refit
from discovery.screening.resolved import resolved

ARM = Path(__file__).parents[1] / "datasets" / "arm"
DECLARED, NAMES = ("viscous_damping", "linear_stiffness"), ("sensor_delay", "structural_damping", "table_tilt")
#: What a difference of chi-square is worth.
WORTH = 5.0


@cache
def calm() -> tuple[Experiment, ...]:
    """Return a short recording of the paper's arm."""
    return tuple(e.first(400) for e in load_dataset(ARM / "rig.toml", [ARM / "train_large.csv"]).train)


def stiff(folder: Path) -> tuple[Experiment, ...]:
    """Return a recording of an arm whose rod damps itself so much that its ringing decays within a step."""
    rig = ArmRig(0.7152, 0.02561, 0.001367, 0.07044, disc_friction=7.1e-4, retardation=5.9e-5)
    hidden = StructuralDamping(time=0.0086)
    motion = readings(rig, MANOEUVRES["train_large"], np.arange(401) / 80, disturbances=[hidden])
    frame = record(motion, rng=np.random.default_rng(3), position_noise=3e-4, angle_noise=7e-5)
    write_csv(frame, folder / "train.csv")
    (folder / "rig.toml").write_text(
        f'name = "arm"\nlength_m = {rig.length}\ntip_mass_kg = {rig.tip_mass}\nbeam_mass_kg = {rig.beam_mass}\n'
        f"flexural_rigidity_N_m2 = {rig.flexural_rigidity}\nposition_noise_m = 3e-4\nangle_noise_rad = 7e-5\n"
    )
    return load_dataset(folder / "rig.toml", [folder / "train.csv"]).train


def declared(train: tuple[Experiment, ...], step: float, base: str = "elastica_calm") -> Fit:
    """Return the declared arm fitted on steps of a given length [s], its simulators with every candidate."""
    model = Model(base, DECLARED, known_values(train[0]))
    bench = Bench(base, (*DECLARED, *NAMES), train, step)
    return fit(model, train, start={"xi": 0.045, "alpha": 8.1}, units=natural_units(train), bench=bench)


def screened(found: Fit, names: tuple[str, ...]) -> tuple[list[Candidate], list[Refit]]:
    scored = screen(found.minimum, found.problem, names)
    return scored, refit(found.minimum, found.problem, scored)


def error_of(problem: Problem, minimum: Minimum, bench: Bench) -> float:
    return float(solver_errors([(problem, minimum.x)], bench)[0])


def test_every_simulator_is_more_accurate_than_the_last_until_one_takes_too_long() -> None:
    found = declared(calm(), 0.0165)
    benches, bench = list[Bench](), found.problem.bench
    while (bench := more_accurate(bench, found.problem.bench)) is not None:
        benches.append(bench)
    first = benches[0]
    assert first.step == 0.0165 / 2
    assert 2 < len(benches) < 12
    errors = [error_of(replace(found.problem, bench=b), found.minimum, benches[-1]) for b in benches[:3]]
    # Of order four: a squared error falls by 256, and by a tenth of that at the least.
    assert errors[0] > 25 * errors[1] > 625 * errors[2] > 0


def test_a_motion_that_blows_up_errs_without_limit() -> None:
    found = declared(calm(), 0.008)
    long = found.problem.bench.finer(1 / 4)
    assert error_of(found.problem, found.minimum, long) == np.inf


def test_a_fit_returns_to_the_longest_steps_on_which_it_is_the_same() -> None:
    fine = declared(calm(), 0.001, "elastica")
    problem, again = cheapest(fine.problem, fine.minimum, Bench.like(fine.problem.bench, 0.004), worth=WORTH)
    assert problem.bench.step == 0.004
    assert abs(2 * again.cost - 2 * fine.minimum.cost) < WORTH
    assert problem.named(again.x)["alpha"] == pytest.approx(fine.values["alpha"], rel=1e-4)


def test_steps_on_which_it_all_but_blows_up_are_halved() -> None:
    fine = declared(calm(), 0.001, "elastica")
    # At this length the bare arm is stable, at a quarter more no more.
    longest, bench = 0.016, fine.problem.bench
    assert np.isfinite(error_of(fine.problem, fine.minimum, Bench.like(bench, longest)))
    assert error_of(fine.problem, fine.minimum, Bench.like(bench, 1.25 * longest)) == np.inf
    problem, again = cheapest(fine.problem, fine.minimum, Bench.like(bench, longest), worth=WORTH)
    assert 0.001 < problem.bench.step < longest
    assert 2 * again.cost < 2 * fine.minimum.cost + WORTH


def test_what_is_stable_on_fine_steps_only_stays_there() -> None:
    fine = declared(calm(), 0.001, "elastica")
    problem = replace(fine.problem, model=fine.problem.model.with_effect("structural_damping"))
    # So strong that the rod's ringing decays within a step.
    (name,) = set(problem.names) - set(fine.problem.names)
    x = problem.start({**fine.values, name: 1.0})
    minimum = replace(fine.minimum, x=x)
    assert cheapest(problem, minimum, Bench.like(problem.bench, 0.008), worth=WORTH) == (problem, minimum)


def test_refits_on_poor_simulators_end_where_the_error_of_theirs_matters_no_more() -> None:
    found = declared(calm(), 0.0165)
    scored, quick = screened(found, ("sensor_delay", "table_tilt"))
    finest = Bench.like(found.problem.bench, 0.0165 / 8)
    assert min(error_of(r.problem, r.minimum, finest) for r in quick) > 10 * WORTH
    again = resolved(found.minimum, found.problem, scored, quick)
    assert {r.effect for r in again} == {r.effect for r in quick}
    assert max(error_of(r.problem, r.minimum, finest) for r in again) < WORTH


def test_refits_on_good_simulators_stay_as_they_are() -> None:
    found = declared(calm(), 0.004)
    scored, quick = screened(found, ("sensor_delay", "table_tilt"))
    again = resolved(found.minimum, found.problem, scored, quick)
    assert {r.effect: r for r in again} == {r.effect: r for r in quick}


@pytest.mark.parametrize("step", [0.0053, pytest.param(0.011, marks=pytest.mark.slow)])
def test_an_effect_that_makes_the_motion_stiff_is_found_on_better_simulators(tmp_path: Path, step: float) -> None:
    """A camera ahead of the encoder explains nearly as much: it would be named instead."""
    found = declared(stiff(tmp_path), step)
    scored, quick = screened(found, ("sensor_delay", "structural_damping"))
    # What steps on which the motion blows up offer, the last digits decide.
    assert step > 0.01 or [r.effect for r in quick] == ["sensor_delay", "structural_damping"]
    # A retardation time of 8.6 ms times the stiffness.
    damping = 0.0086 * 22.27
    assert all(r.values.get("c_s", 0.0) < 0.8 * damping for r in quick)
    first, second = resolved(found.minimum, found.problem, scored, quick)
    assert (first.effect, second.effect) == ("structural_damping", "sensor_delay")
    assert first.values["c_s"] == pytest.approx(damping, rel=0.05)
