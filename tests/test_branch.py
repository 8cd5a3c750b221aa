"""What the catalogue offers beside a set on finer mechanics than those on which the search began."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from discovery import branch, refits
from discovery.bench import Bench
from discovery.branch import Branches
from discovery.case import Case, LoopSettings
from discovery.dataset import load_dataset
from discovery.fit import declared_model, rig_uncertainty
from discovery.holdout import HoldOut
from discovery.node import Node
from discovery.pace import Pace
from discovery.problem import natural_units
from discovery.refits import Refit, resettled

DELAYED = Path(__file__).parents[1] / "datasets" / "arm_delay"
AMONG = frozenset({"sensor_delay", "coulomb_friction", "table_tilt"})


@cache
def on_both_mechanics() -> tuple[Case, Node, Node]:
    """Return a case of a late camera, and the exact arm without that effect on quick and on finer mechanics."""
    train = load_dataset(DELAYED / "rig.toml", [DELAYED / "train_paper.csv"]).train
    units, settings = natural_units(train), LoopSettings()
    case = Case(train, HoldOut(train, [], units, settings.tolerance), settings, units, lambda _: None)
    model = declared_model(train[0]).on_base("elastica_calm")
    found = case.fit(model, {"xi": 0.045, "alpha": 8.1}, rig_uncertainty(train[0]))
    quick = Node.of((), Refit("", found.problem, found.minimum), case)
    finer = next(case._on_finer(quick.refit))
    return case, quick, Node.of((), resettled(quick.refit, finer.bench), case)


def test_candidates_are_compared_on_quick_mechanics_and_the_best_go_on_upon_the_finer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case, quick, fine = on_both_mechanics()
    bases: list[str] = []
    real = branch.refit

    def watched(model, minimum, problem, *rest, **more):  # type: ignore[no-untyped-def]
        bases.append(problem.bench.base)
        return real(model, minimum, problem, *rest, **more)

    monkeypatch.setattr(branch, "refit", watched)
    branches = Branches(case, quick.refit.problem.bench)
    made = branches.of(fine, AMONG, grows=False)
    assert bases == ["elastica_calm"]
    assert {r.problem.bench.base for r in made.best} == {fine.refit.problem.bench.base} != {"elastica_calm"}
    # Those that are far behind stay where they are, with what the rig knows held.
    assert {r.problem.bench.base for r in made.rest} == {"elastica_calm"}
    assert made.best[0].effect == "sensor_delay"
    assert made.best[0].values["tau"] == pytest.approx(0.01, rel=0.05)
    # A set on the quick mechanics needs no other.
    assert branches.quick(quick) is quick
    assert branches.quick(fine).chi2 == pytest.approx(quick.chi2, rel=1e-3)


def test_what_a_further_effect_promises_is_of_what_the_finer_mechanics_leave() -> None:
    case, quick, fine = on_both_mechanics()
    branches = Branches(case, quick.refit.problem.bench)
    assert branches.promise(fine) == pytest.approx(branches.promise(quick), rel=0.05)
    nothing = replace(fine.refit.minimum, residual=0.0 * fine.refit.minimum.residual)
    assert branches.promise(replace(fine, refit=replace(fine.refit, minimum=nothing))) == pytest.approx(0.0, abs=1e-6)


def test_what_blows_up_on_the_quick_steps_is_compared_on_finer_ones() -> None:
    case, quick, fine = on_both_mechanics()
    coarse = Bench.like(quick.refit.problem.bench, 16 * quick.refit.problem.bench.step)
    again = Branches(case, coarse).quick(fine).refit.problem.bench
    assert again.base == "elastica_calm"
    assert again.step < coarse.step


@pytest.mark.parametrize(("limit", "value"), [("MOST_STEPS", 100), ("_MORE", 0.02)])
def test_finer_mechanics_that_would_take_too_many_steps_are_not_tried(
    monkeypatch: pytest.MonkeyPatch, limit: str, value: float
) -> None:
    known, quick, _ = on_both_mechanics()
    # The same case, which has not made any mechanics yet.
    case = replace(known)
    monkeypatch.setattr(f"discovery.case.{limit}", value)
    assert list(case._on_finer(quick.refit)) == []
    assert case.finer(quick.refit, 0.0) is quick.refit
    assert case.finest(quick.refit).model.base == "elastica_calm"


def test_only_what_is_near_the_best_is_finished() -> None:
    case, quick, _ = on_both_mechanics()
    made = Branches(case, quick.refit.problem.bench).of(quick, AMONG, grows=False)
    assert 0 < len(made.best) < len(AMONG) == len(made.refits)
    assert [added for added, _ in made.children(())] == [(r.effect,) for r in made.best]
    assert made.best[0].problem.gaussian
    assert all(not r.problem.gaussian and r.chi2 > 5 * made.best[0].chi2 for r in made.rest)


@pytest.mark.parametrize(
    ("excess", "finished", "gone_on"),
    [(0.0, [], []), (1e3, ["table_tilt"], []), (1e4, ["table_tilt", "coulomb_friction"], ["table_tilt"])],
)
def test_what_is_far_behind_a_known_set_is_neither_finished_nor_goes_on(
    monkeypatch: pytest.MonkeyPatch, excess: float, finished: list[str], gone_on: list[str]
) -> None:
    """Beside nothing a tilted table leaves 86 thousand more than noise, friction 214 thousand."""
    case, quick, fine = on_both_mechanics()
    others = AMONG - {"sensor_delay"}
    done: list[str] = []
    real = branch.finish
    monkeypatch.setattr(branch, "finish", lambda p, m, r: done.extend(e.effect for e in r) or real(p, m, r))
    minimum = replace(quick.refit.minimum, cost=0.5 * (case.n_data + excess))
    known = replace(quick, refit=replace(quick.refit, minimum=minimum))
    made = Branches(case, quick.refit.problem.bench).of(fine, others, grows=False, known=known)
    assert done == finished
    assert [r.effect for r in made.refits if r.problem.bench.base == fine.refit.problem.bench.base] == gone_on
    assert {r.effect for r in made.refits} == others


def test_a_refit_goes_on_upon_the_same_mechanics_once(monkeypatch: pytest.MonkeyPatch) -> None:
    case, quick, fine = on_both_mechanics()
    branches = Branches(case, quick.refit.problem.bench)
    first = branches.of(fine, AMONG, grows=False)
    monkeypatch.setattr(branch, "resettled_together", lambda *_: pytest.fail("it has gone on already"))
    again = branches.of(fine, AMONG, grows=False)
    assert [id(r) for r in again.best] == [id(r) for r in first.best]
    # On the quick mechanics it is what it was.
    assert {r.problem.bench.base for r in branches.of(quick, AMONG, grows=False).best} == {"elastica_calm"}


def faked(monkeypatch: pytest.MonkeyPatch, left: dict[float, float]) -> tuple[Refit, Bench, list[float]]:
    """Return a fit on finer mechanics, the quick bench, and the steps asked for; what it leaves is given by step."""
    case, quick, fine = on_both_mechanics()
    bench, asked = quick.refit.problem.bench, []

    def resettled_(fitted: Refit, other: Bench) -> Refit:
        asked.append(round(bench.step / other.step))
        minimum = replace(fitted.minimum, cost=0.5 * case.n_data * left[asked[-1]])
        return Refit("", replace(fitted.problem, bench=other), minimum)

    monkeypatch.setattr(refits, "resettled", resettled_)
    finest = replace(fine.refit.problem, bench=Bench.like(fine.refit.problem.bench, bench.step / 40))
    minimum = replace(fine.refit.minimum, cost=0.5 * case.n_data)
    return Refit("", finest, minimum), bench, asked


@pytest.mark.parametrize(
    ("left", "steps"),
    [
        # Quick enough at once; on shorter steps only; lost to the mechanics, not to the steps; a blow-up, then lost.
        ({1: 1.5}, 1),
        ({1: 1e5, 2: 9e4, 4: 1.1}, 4),
        ({1: 2.5, 2: 2.4}, 1),
        ({1: np.inf, 2: 2.5, 4: 2.4}, 2),
    ],
)
def test_quick_mechanics_take_shorter_steps_only_where_these_help(
    monkeypatch: pytest.MonkeyPatch, left: dict[float, float], steps: int
) -> None:
    fine, bench, asked = faked(monkeypatch, left)
    again = refits.quickened(fine, bench)
    assert asked == list(left)
    assert again.problem.bench.step == pytest.approx(bench.step / steps)
    assert again.chi2 == pytest.approx(on_both_mechanics()[0].n_data * left[steps])


def test_what_blows_up_on_quick_mechanics_however_short_the_steps_stays_where_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fine, bench, _ = faked(monkeypatch, dict.fromkeys([1, 2, 4, 8, 16, 32], np.inf))
    assert refits.quickened(fine, bench) is fine


def test_what_is_near_a_known_set_is_so_on_the_mechanics_on_which_candidates_are_compared() -> None:
    case, quick, fine = on_both_mechanics()
    branches = Branches(case, quick.refit.problem.bench)
    known = Node.of(("sensor_delay",), branches.of(fine, AMONG, grows=False).best[0], case)
    assert branches._limit(known) == branches.quick(known).chi2 != known.chi2
    assert branches._limit(None) == np.inf
    # A set that is lost on quick mechanics says nothing of others there.
    branches._begun[known] = known
    assert branches._limit(known) == np.inf


def test_a_branch_of_which_part_was_not_finished_is_made_anew_when_no_set_is_known() -> None:
    case, quick, _ = on_both_mechanics()
    branches = Branches(case, quick.refit.problem.bench)
    minimum = replace(quick.refit.minimum, cost=0.5 * case.n_data)
    known = replace(quick, refit=replace(quick.refit, minimum=minimum))
    others = AMONG - {"sensor_delay"}
    part = branches.of(quick, others, grows=False, known=known)
    assert not part.best
    assert branches.of(quick, others, grows=False, known=known) is part
    whole = branches.of(quick, others, grows=False)
    assert whole.best
    assert branches.of(quick, others, grows=False, known=known) is whole


def test_finer_mechanics_keep_no_pace_that_costs_steps() -> None:
    known, quick, _ = on_both_mechanics()
    case, own = replace(known), quick.refit.problem.bench
    equal = next(case._on_finer(quick.refit)).bench
    (experiment,) = own.experiments
    # Short steps where nothing asks for them.
    edges = np.linspace(*experiment.recording.time[[0, -1]], 5)
    paced = [replace(experiment, pace=Pace.of(edges, np.array([1.0, 1.0, 1.0, 0.2])))]
    bench = Bench(own.base, own.effects, paced, 0.99 * own.step)
    found = replace(quick.refit, problem=replace(quick.refit.problem, bench=bench))
    again = next(case._on_finer(found)).bench
    assert again.most_steps == equal.most_steps
    assert [e.pace for e in again.experiments] == [None]
