"""Steps no finer than a fit needs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discovery import stiff
from discovery.attribution import screen
from discovery.bench import Bench
from discovery.dataset import load_dataset
from discovery.fit import fit
from discovery.model import Model
from discovery.problem import Problem, known_values, natural_units
from discovery.refits import Refit, refit
from discovery.stiff import coarsened, unstiffened

ARM = Path(__file__).parents[1] / "datasets" / "arm"
EFFECTS = ("linear_stiffness", "structural_damping", "viscous_damping")


def fitted(step: float) -> Refit:
    """Return the exact arm fitted to a short recording on steps of a given length [s]."""
    train = load_dataset(ARM / "rig.toml", [ARM / "train_large.csv"]).train
    short = [e.first(400) for e in train]
    model = Model("elastica", ("viscous_damping", "linear_stiffness"), known_values(train[0]))
    bench = Bench("elastica", EFFECTS, short, step)
    found = fit(model, short, start={"xi": 0.045, "alpha": 8.1}, units=natural_units(train), bench=bench)
    return Refit("", found.problem, found.minimum)


def test_a_fit_returns_to_the_longest_steps_on_which_it_is_the_same() -> None:
    fine = fitted(0.001)
    bench = fine.problem.bench
    again = coarsened(fine, Bench.like(bench, 0.004))
    assert again.problem.bench.step == 0.004
    assert abs(again.chi2 - fine.chi2) < 5
    assert abs(again.values["alpha"] / fine.values["alpha"] - 1) < 1e-4


def test_steps_on_which_it_all_but_blows_up_are_halved() -> None:
    fine = fitted(0.001)
    # At this length the bare arm is stable, at a quarter more no more.
    longest, bench = 0.016, fine.problem.bench
    where = fine.problem.expand(fine.minimum.x[:, None])
    assert np.isfinite(Bench.like(bench, longest).residuals(*where)).all()
    assert not np.isfinite(Bench.like(bench, 1.25 * longest).residuals(*where)).any()
    again = coarsened(fine, Bench.like(bench, longest))
    assert 0.001 < again.problem.bench.step < longest
    assert again.chi2 < fine.chi2 + 5


def test_what_is_stable_on_fine_steps_only_stays_there() -> None:
    fine = fitted(0.001)
    model = fine.problem.model.with_effect("structural_damping")
    problem = Problem(model, fine.problem.bench, fine.problem.units, fine.problem.gaussian)
    # So strong that the rod's ringing decays within a step.
    name = next(p for p in problem.names if p not in fine.problem.names)
    values = {**fine.values, name: 1.0}
    residual = problem.bench.residuals(*problem.expand(problem.start(values)[:, None]))[:, 0]
    assert np.isfinite(residual).all()
    minimum = replace(fine.minimum, x=problem.start(values), cost=0.5 * float(residual @ residual), residual=residual)
    stiff = Refit("structural_damping", problem, minimum)
    assert coarsened(stiff, Bench.like(problem.bench, 0.008)) is stiff


def test_what_the_solver_errs_without_an_effect_asks_for_no_finer_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("sensor_delay", "table_tilt")
    train = load_dataset(ARM / "rig.toml", [ARM / "train_large.csv"]).train
    short = [e.first(400) for e in train]
    model = Model("elastica_calm", ("viscous_damping", "linear_stiffness"), known_values(train[0]))
    # So coarse that the solver moves every prediction by far more than a difference is worth.
    bench = Bench("elastica_calm", (*model.effects, *names), short, 0.0165)
    found = fit(model, short, start={"xi": 0.045, "alpha": 8.1}, units=natural_units(train), bench=bench)
    scored = screen(model, found.minimum, found.problem, names)
    quick = refit(model, found.minimum, found.problem, scored)
    errors = stiff._solver_errors(quick, Bench.like(bench, bench.step / 2))
    assert min(errors.values()) > 10 * stiff._WORTH
    asked: list[str] = []
    monkeypatch.setattr(stiff, "refit", lambda *_, **__: asked.append("finer") or [])
    again = unstiffened(model, found.minimum, found.problem, scored, quick)
    assert [r.effect for r in again] == [r.effect for r in quick]
    assert not asked
    # Were it theirs, they would be fitted on finer steps.
    monkeypatch.setattr(stiff, "_OWN", 0.0)
    unstiffened(model, found.minimum, found.problem, scored, quick)
    assert asked
