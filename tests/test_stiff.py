"""Steps no finer than a fit needs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.problem import Problem, known_values, natural_units
from discovery.recordings.dataset import load_dataset
from discovery.screening import stiff
from discovery.screening.attribution import Candidate, screen
from discovery.screening.refits import Refit, refit
from discovery.screening.stiff import coarsened, unstiffened

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


def screened(step: float) -> tuple[Fit, list[Candidate], list[Refit]]:
    """Return the declared arm on steps of a given length [s], two candidates, and their refits."""
    names = ("sensor_delay", "table_tilt")
    train = load_dataset(ARM / "rig.toml", [ARM / "train_large.csv"]).train
    short = [e.first(400) for e in train]
    model = Model("elastica_calm", ("viscous_damping", "linear_stiffness"), known_values(train[0]))
    bench = Bench("elastica_calm", (*model.effects, *names), short, step)
    found = fit(model, short, start={"xi": 0.045, "alpha": 8.1}, units=natural_units(train), bench=bench)
    scored = screen(model, found.minimum, found.problem, names)
    return found, scored, refit(model, found.minimum, found.problem, scored)


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
    # So coarse that the solver moves every prediction by far more than a difference is worth.
    found, scored, quick = screened(0.0165)
    model, bench = found.problem.model, found.problem.bench
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


@pytest.mark.parametrize(("itself", "asked"), [(1.3, ["finer"]), (1.2, ["finer"]), (1.1, []), (1.0, [])])
def test_where_the_set_itself_all_but_blows_up_a_candidate_must_do_so_sooner(
    monkeypatch: pytest.MonkeyPatch, itself: float, asked: list[str]
) -> None:
    """The candidates blow up on steps 1.1 times longer, the set without them on so many times longer ones."""
    found, scored, quick = screened(0.008)
    step, done = found.problem.bench.step, []
    longest = {"": itself, **{r.effect: 1.1 for r in quick}}

    def errors(refits: list[Refit], other: Bench) -> dict[str, float]:
        return {r.effect: np.inf if other.step > 1.0001 * longest[r.effect] * step else 0.0 for r in refits}

    monkeypatch.setattr(stiff, "_solver_errors", errors)
    monkeypatch.setattr(stiff, "refit", lambda *_, **__: done.append("finer") or [])
    quick = [replace(r, minimum=replace(r.minimum, blown=False, cost=1e9)) for r in quick]
    monkeypatch.setattr(stiff, "finer", lambda bench, times: bench.finer(times) if times < 4 else None)
    unstiffened(found.problem.model, found.minimum, found.problem, scored, quick)
    assert done == asked


def test_what_blows_up_from_its_linear_start_goes_on_from_where_longer_steps_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, scored, quick = screened(0.0165)
    for name in ("_OWN", "_LITTLE", "_NEARER"):
        monkeypatch.setattr(stiff, name, 0.0)
    monkeypatch.setattr(stiff, "refit", lambda *_, **__: [])
    began: list[tuple[float, str, bool]] = []
    real, ended = stiff.settled, {r.effect: r.minimum.x for r in quick}

    def watched(problems: list[Problem], starts: list[np.ndarray]) -> list[Refit]:
        for problem, x in zip(problems, starts, strict=True):
            effect = problem.model.effects[-1]
            began.append((problem.bench.step, effect, np.array_equal(x, ended[effect])))
        return real(problems, starts)

    monkeypatch.setattr(stiff, "settled", watched)
    again = unstiffened(found.problem.model, found.minimum, found.problem, scored, quick)
    step = found.problem.bench.step
    assert {(h / step, e, same) for h, e, same in began if h == step / 2} == {(0.5, r.effect, True) for r in quick}
    # What the solver erred is gone.
    left = {r.effect: r.chi2 for r in quick}
    assert all(r.chi2 < left[r.effect] - 5 and r.problem.bench.step <= step / 2 for r in again)


def test_what_gains_nothing_there_begins_small_on_steps_that_are_finer_still(monkeypatch: pytest.MonkeyPatch) -> None:
    found, scored, quick = screened(0.0165)
    for name in ("_OWN", "_LITTLE", "_NEARER"):
        monkeypatch.setattr(stiff, name, 0.0)
    asked: list[tuple[float, list[str]]] = []

    def small(problem: Problem, names: list[str], most: int) -> list[object]:
        asked.append((problem.bench.step, names))
        return []

    same = {r.effect: r.minimum for r in quick}
    monkeypatch.setattr(stiff, "declared_starts", small)
    monkeypatch.setattr(stiff, "refit", lambda *_, **__: [])
    monkeypatch.setattr(
        stiff, "settled",
        lambda problems, _: [Refit(p.model.effects[-1], p, same[p.model.effects[-1]]) for p in problems],
    )  # fmt: skip
    unstiffened(found.problem.model, found.minimum, found.problem, scored, quick)
    # What blew up at first only: the names of the first round are none.
    assert [names for _, names in asked[:2]] == [[], sorted(same)]
