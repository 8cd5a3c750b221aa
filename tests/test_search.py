"""The search and its verdict on an oscillator: what is there is found, what is not is not, and how sure it is."""

from __future__ import annotations

import dataclasses
from copy import copy
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pushed_oscillator import DECLARED, UNITS, pushes, recorded

from discovery.declarations.registry import get_effect, simplicity
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.holdout import HoldOut
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment
from discovery.report.sentences import decision_sentence
from discovery.runs.lead import leads
from discovery.runs.loop import _searching
from discovery.screening.refits import Refit, finish, settle
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context
from discovery.selection.decision import Decision
from discovery.selection.final import finished, settled
from discovery.selection.neighbours import Neighbours
from discovery.selection.odds import Odds, _against, odds_of
from discovery.selection.offers import Offers, simplest_first
from discovery.selection.search import Search
from discovery.selection.settings import Budget, LoopSettings
from discovery.selection.verdict import is_complete, named, verdict_of


def context(seed: int = 0, settings: LoopSettings | None = None, **effects: float) -> Context:
    settings = settings or LoopSettings()
    train = recorded("train", pushes(1.0, -1.5, 0.7, 0.0), seed, **effects)
    held = recorded("held", pushes(-0.8, 1.2, 0.3, 0.0), seed + 100, **effects)
    judge = HoldOut([train], [held], UNITS, settings.tolerance)
    return Context([train], judge, settings, UNITS, lambda _: None)


def begun(shared: Context) -> Search:
    model = Model("oscillator", DECLARED)
    return Search(shared.fit(model, {"g": 0.9, "xi": 0.05, "alpha": 8.8}, {}), shared)


@cache
def searched(seed: int = 0, **effects: float) -> Search:
    search = begun(context(seed, **effects))
    search.run()
    return search


@cache
def _offered(**effects: float) -> Search:
    search = begun(context(**effects))
    search.offers.beside(search.root)
    return search


def offered(**effects: float) -> Search:
    """Return a search that has begun and knows what is offered first, which is worked out once for all tests."""
    search = copy(_offered(**effects))
    search.decisions = []
    return search


OWNERS = {"beta": "cubic_stiffness", "f_c": "coulomb_friction", "c_2": "quadratic_drag", "tau": "sensor_delay"}


def test_a_clean_recording_gets_nothing() -> None:
    search = searched()
    assert search.best.added == ()
    assert [d.code for d in search.decisions] == ["complete"]
    assert is_complete(search.best, search.root, search.context)
    assert verdict_of((), (), complete=True) == "nothing_missing"


@pytest.mark.parametrize(
    "effects",
    [{"beta": 1.0, "f_c": 0.02}, pytest.param({"c_2": 0.3, "tau": 0.04}, marks=pytest.mark.slow)],
    ids=lambda e: " and ".join(e),
)
def test_two_effects_are_both_found_and_nothing_else(effects: dict[str, float]) -> None:
    """A delay of a quarter of this one is as well a lag of the input."""
    search = searched(**effects)
    assert set(search.best.added) == {OWNERS[n] for n in effects}
    for name, value in effects.items():
        assert search.best.refit.values[name] == pytest.approx(value, rel=0.1)
    assert is_complete(search.best, search.root, search.context)


@pytest.mark.parametrize(
    ("change", "size"),
    [({"white": 5.0, "alone": 5.0}, np.sqrt(24)), ({"white": 1.5, "alone": 1.5}, 0.0), ({"chi2_ahead": 16.0}, 4.0)],
    ids=["scatters", "noisy", "misses"],
)
def test_far_more_than_noise_is_a_model_error_even_without_memory(change: dict[str, float], size: float) -> None:
    search = searched(beta=1.0, f_c=0.02)
    own = search.best.evidence
    assert own.left == max(own.error, own.error_held)
    change = {name: value * own.count_held if name == "chi2_ahead" else value for name, value in change.items()}
    other = dataclasses.replace(search.best, evidence=dataclasses.replace(own, **change))
    assert is_complete(other, search.root, search.context) == (size == 0.0)
    assert other.evidence.left == pytest.approx(np.hypot(size, 0.0 if "chi2_ahead" in change else own.left), abs=1e-9)


def test_a_set_that_blows_up_held_out_predicts_as_well_as_a_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    search = begun(context())
    known, read = search.root.evidence, Bench.predict
    held = [e.recording.name for e in search.context.judge.separate]

    def blown(self: Bench, *given: Any) -> list[Any]:
        gone = [e.recording.name for e in self.experiments] == held
        return [np.full_like(c, np.inf) if gone else c for c in read(self, *given)]

    monkeypatch.setattr(Bench, "predict", blown)
    (again,) = contenders(search.context, [((), search.root.refit)])
    assert again.evidence.train == pytest.approx(known.train, abs=1e-6)
    assert again.evidence.held == pytest.approx(sum(search.context.constant_scores), abs=1e-6)
    assert again.evidence.held < known.held - 100


def test_each_named_effect_has_odds_and_a_probability() -> None:
    search = searched(beta=1.0, f_c=0.02)
    for found in named(search):
        assert found.odds.total > search.context.settings.nats
        assert 0 < found.probability <= found.group_probability <= 1
        assert found.probability > 0.95 or found.group
        rivals = [c.joint for c in found.rivals]
        assert all(search.best.joint - joint < search.context.settings.nats for joint in rivals)


def test_a_set_that_contains_a_rival_is_no_rival_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(beta=1.0, f_c=0.02)
    effect = search.best.added[-1]
    smaller = search.neighbours.without(search.best, effect)
    alike = dataclasses.replace(search.best, added=(*smaller.added, "stribeck_friction"))
    both = dataclasses.replace(search.best, added=(*alike.added, "table_tilt"))
    apart = dataclasses.replace(search.best, added=(*smaller.added, "quadratic_drag", "table_tilt"))
    monkeypatch.setattr(search.neighbours, "instead_of", lambda found, effect: [alike, both, apart])
    found = next(n for n in named(search) if n.effect == effect)
    assert found.rivals == (alike, apart)
    assert found.group == ("stribeck_friction", "table_tilt")
    assert found.group_probability == pytest.approx(1.0, abs=1e-6)


def test_every_decision_says_what_it_compared() -> None:
    search = searched(beta=1.0, f_c=0.02)
    accepted = [d for d in search.decisions if d.action == "add" and d.accepted]
    assert accepted
    for decision in accepted:
        assert decision.code == "accepted"
        assert decision.numbers["odds"] >= search.context.settings.nats
        assert decision.effects in [c.effects for c in decision.candidates]
        gains = [c.train + c.held for c in decision.candidates]
        assert gains == sorted(gains, reverse=True)
        assert decision.summary()["candidates"][0]["parameters"] > 0


@pytest.mark.slow
def test_an_effect_beside_a_smooth_model_error_is_named_and_the_error_is_kept() -> None:
    """Dry friction beside a slow wander that no catalogue holds, far smaller."""
    shared = context(f_c=0.05)
    noise = float(shared.train[0].recording.noise[0])
    bell = np.exp(-0.5 * (np.arange(-60, 61) / 20) ** 2)
    for seed, e in enumerate((*shared.train, *shared.judge.separate)):
        wander = np.convolve(np.random.default_rng(seed).normal(size=e.recording.time.size), bell, mode="same")
        e.recording.output[:, 0] += 3 * noise * wander / wander.std()
    search = begun(shared)
    search.run()
    assert "coulomb_friction" in {*search.best.added, *(g for n in named(search) for g in n.group)}
    assert not is_complete(search.best, search.root, shared)
    assert verdict_of(search.best.added, (), complete=False) == "partly_explained"
    assert 0.5 < search.best.evidence.error < 10.0


def test_what_nothing_explains_stays_unexplained_with_its_strongest_lead() -> None:
    shared = context()
    rng = np.random.default_rng(5)
    for e in (*shared.train, *shared.judge.separate):
        steps = np.repeat(rng.normal(size=20), 41)[: e.recording.time.size]
        wander = 0.02 * np.cumsum(steps) / 20
        # Its mean is an offset, which an effect explains.
        e.recording.output[:, 0] += wander - wander.mean()
    search = begun(shared)
    search.run()
    assert search.best.added == ()
    assert verdict_of((), (), complete=is_complete(search.best, search.root, shared)) == "unexplained"
    lead, _ = leads(search, {n.effect: n for n in named(search)})
    assert lead is None or lead.code in ("training", "held_out", "size", "chance", "finite", "unknown")


@pytest.mark.parametrize("beside", ["table_tilt", None])
def test_what_was_refused_and_is_named_since_is_no_lead(monkeypatch: pytest.MonkeyPatch, beside: str | None) -> None:
    search = searched(beta=1.0, f_c=0.02)
    effects, numbers = tuple(e for e in (search.best.added[0], beside) if e), {"train": 60.0, "held": 40.0, "odds": 3.0}
    monkeypatch.setattr(search, "decisions", [Decision("add", effects, False, "chance", numbers)])
    lead, _ = leads(search, {n.effect: n for n in named(search)})
    assert (lead and lead.effects) == (effects if beside else None)


def test_a_lead_is_no_rival_of_what_is_named_and_has_odds_above_even(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(beta=1.0, f_c=0.02)
    found = {search.best.added[0]: SimpleNamespace(group=("quintic_stiffness",))}
    numbers = {"train": 60.0, "held": 40.0, "odds": 9.0}
    rivals = [("quintic_stiffness",), ("quintic_stiffness", "table_tilt")]
    told = [Decision("add", effects, False, "size", numbers) for effects in rivals]
    told += [Decision("add", ("sensor_delay",), False, "held_out", {**numbers, "odds": -6.0})]
    monkeypatch.setattr(search, "decisions", told)
    assert leads(search, found) == (None, None)
    monkeypatch.setattr(search, "decisions", [*told, Decision("add", ("table_tilt",), False, "size", numbers)])
    lead, _ = leads(search, found)
    assert lead is not None
    assert lead.effects == ("table_tilt",)


def test_the_strongest_lead_has_the_highest_odds_beside_the_set_found(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(beta=1.0, f_c=0.02)

    def told(action: str, *effects: str | float, accepted: bool = False) -> Decision:
        *names, odds = effects
        return Decision(action, tuple(map(str, names)), accepted, "size", {"train": 90.0, "held": 90.0, "odds": odds})

    added = told("add", search.best.added[-1], 60.0, accepted=True)
    before, weak, strong = (told("add", f"effect {odds}", odds) for odds in (50.0, 0.1, 2.0))
    for decisions, expected in (
        ([before, added, strong, weak, told("stop", "", 70.0, accepted=True)], strong),
        ([before, added, weak, out := told("remove", "taken out", 1.0, accepted=True)], out),
        ([before, added], before),
        # A pair that is as likely as one of its members says nothing of the other.
        ([added, one := told("add", "one", 1.5), told("add", "two", 0.3), told("add", "one", "two", 1.6)], one),
        ([added, told("add", "one", 1.5), told("add", "two", 0.3), both := told("add", "one", "two", 9.0)], both),
        ([one, added, pair := told("add", "one", "two", 1.6)], pair),
    ):
        monkeypatch.setattr(search, "decisions", decisions)
        lead, _ = leads(search, {n.effect: n for n in named(search)})
        assert lead is not None
        assert lead.effects == expected.effects
    monkeypatch.setattr(search, "decisions", [added])
    assert leads(search, {n.effect: n for n in named(search)}) == (None, None)


def test_a_force_of_no_law_leads_with_the_law_of_the_highest_odds(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(beta=1.0, f_c=0.02)

    def told(name: str, train: float, held: float, odds: float, code: str) -> Decision:
        return Decision("add", (name,), False, code, {"train": train, "held": held, "odds": odds})

    force = told("smooth_force", 90.0, 60.0, 40.0, "unknown")
    lost, small = told("hysteresis", 70.0, -9.0, 9.0, "held_out"), told("wind", 20.0, 9.0, 2.0, "size")
    worse, better = told("wind", 20.0, -30.0, -30.0, "held_out"), told("wind", 95.0, 9.0, 2.0, "size")
    stale = told("hysteresis", 99.0, 9.0, 9.0, "size")
    change = Decision("add", (search.best.added[-1],), True, "accepted", {"train": 9.0, "held": 9.0, "odds": 9.0})
    for laws, expected in (
        ((small, lost), (force, lost)),
        # Of what was refused beside another set nothing is known.
        ((stale, change, small), (force, small)),
        ((stale, change), (force, None)),
        ((worse,), (force, None)),
        ((), (force, None)),
        ((better, lost), (force, lost)),
        ((better,), (better, None)),
    ):
        monkeypatch.setattr(search, "decisions", [*laws, force])
        assert leads(search, {}) == expected


def test_estimates_have_the_truth_within_their_intervals() -> None:
    search = searched(beta=1.0, f_c=0.02)
    fitted, again = finished(settled(search.best, search.context), search.context)
    for name, value in (("beta", 1.0), ("f_c", 0.02), ("alpha", 9.0), ("xi", 0.08)):
        assert abs(fitted.values[name] - value) < 4 * fitted.sd[name]
    assert again.joint == pytest.approx(search.best.joint, abs=20)
    # What friction holds by convention is free in the answer, and the recordings hardly know it.
    assert "v_c" in fitted.problem.gaussian


def test_the_evidence_does_not_depend_on_the_order_or_the_company() -> None:
    search = searched(beta=1.0, f_c=0.02)
    refits = [(search.best.added, search.best.refit), ((), search.root.refit)]
    together = {c.added: c.joint for c in contenders(search.context, refits)}
    alone = {added: contenders(search.context, [(added, r)])[0].joint for added, r in refits}
    assert together[()] == pytest.approx(alone[()], abs=1e-6)
    assert together[search.best.added] == pytest.approx(alone[search.best.added], abs=1.0)


def test_the_budget_ends_a_search() -> None:
    search = begun(context(settings=LoopSettings(budget=Budget(most_effects=1)), beta=1.0, f_c=0.004))
    search.run()
    assert len(search.best.added) == 1
    assert [d.code for d in search.decisions if d.action == "stop"] == ["budget"]


@pytest.mark.parametrize(("effects", "left"), [({"f_c": 0.02}, "coulomb_friction"), ({"beta": 1.0}, "cubic_stiffness")])
def test_a_law_that_its_last_fit_reduces_gives_way_to_what_it_contains(effects: dict[str, float], left: str) -> None:
    shared = context(**effects)
    search = begun(shared)
    larger = {"coulomb_friction": "stribeck_friction"}.get(left, left)
    search.best = next(c for c in search.offers.beside(search.root) if c.added == (larger,))
    _, last = finished(settled(search.best, shared), shared)
    found = search.confirmed(last, search.root)
    assert found.added == (left,)
    assert (found is last) == (larger == left)
    # What the search ends with follows where a law was given up, and only there.
    assert search.best.added == found.added


def test_what_predicts_worse_than_the_declared_model_is_taken_out() -> None:
    shared = context(beta=1.0)
    search = begun(shared)
    search.best = next(c for c in search.offers.beside(search.root) if c.added == ("cubic_stiffness",))
    last = settled(search.best, shared)
    assert search.confirmed(last, search.root) is last
    # By a declared model whose own fit predicts far better than the search knew.
    evidence = dataclasses.replace(
        search.root.evidence, held=last.evidence.held + 50.0, ahead=last.evidence.ahead + 50.0
    )
    found = search.confirmed(last, dataclasses.replace(search.root, evidence=evidence))
    assert found.added == search.best.added == ()
    (removed,) = [d for d in search.decisions if d.action == "remove"]
    assert (removed.effects, removed.code, removed.accepted) == (("cubic_stiffness",), "predicts_worse", True)


# The one rule.


def odds(**changed: float) -> Odds:
    scores = {"train": 50.0, "held": 20.0, "ahead": 20.0, "size": 9.0, "against_error": 40.0, "gain": 200.0}
    return Odds(**{**scores, **changed})


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({}, "accepted"),
        ({"train": 2.0}, "training"),
        ({"held": -1.0}, "accepted"),
        ({"held": -2.0}, "held_out"),
        ({"train": 4.0, "held": -1.4}, "held_out"),
        ({"ahead": 1.0}, "held_out"),
        ({"against_error": 1.0}, "size"),
        ({"train": -np.inf}, "finite"),
    ],
)
def test_an_effect_is_refused_for_what_it_lacks(changed: dict[str, float], code: str) -> None:
    assert odds(**changed).code(LoopSettings(), 0.5) == code


def test_what_was_accepted_stays_until_the_held_out_part_speaks_against_it() -> None:
    settings = LoopSettings()
    lost = [{n: -x * settings.nats} for n in ("held", "ahead") for x in (0.4, 0.6)]
    assert [odds(**each).code(settings, -0.5) for each in lost] == ["accepted", "held_out"] * 2


@pytest.mark.parametrize(
    ("train", "held", "ahead", "chance"), [(9.0, -9.0, 9.0, True), (9.0, 9.0, 9.0, False), (0.5, 99.0, 99.0, True)]
)
def test_what_a_set_predicts_counts_against_chance_as_much_as_training(
    train: float, held: float, ahead: float, *, chance: bool
) -> None:
    # Of a friction that removes as much of chi-square as the best of the catalogue would of noise.
    search = offered(f_c=0.002)
    (found,) = (c for c in search.offers.beside(search.root) if c.added == ("coulomb_friction",))
    assert search.offers.is_chance(found, search.root, odds(train=train, held=held, ahead=ahead)) == chance


def test_what_is_no_more_than_chance_is_refused_as_that() -> None:
    search = begun(context(settings=LoopSettings(nats=0.5), f_c=0.0018))
    (found,) = (c for c in search.offers.beside(search.root) if c.added == ("coulomb_friction",))
    assert search._judged(found, search.root)[1] == "chance"


def test_an_effect_that_shows_in_the_held_out_motion_is_as_large_as_there() -> None:
    search = searched(beta=1.0, f_c=0.02)
    smaller = search.neighbours.without(search.best, "coulomb_friction")

    def size(held: float) -> float:
        """Return the size of friction where it leaves so many noise variances more of each held-out reading."""
        changed = {"chi2_ahead": search.best.evidence.chi2_ahead + held * search.best.evidence.count_held}
        without = dataclasses.replace(smaller, evidence=dataclasses.replace(smaller.evidence, **changed))
        return odds_of(search.best, without, search.root, search.context.settings).size

    # No motion held out takes from what training shows.
    assert size(-1.0) == size(0.0) <= size(1e6)
    assert size(1e6) > 100 * size(0.0)


def test_sets_that_give_way_to_each_other_in_turn_end_with_the_likeliest(monkeypatch: pytest.MonkeyPatch) -> None:
    search = offered(beta=1.0, f_c=0.02)
    sets = search.offers.beside(search.root)
    likely, unlikely = sets[0], sets[-1]
    turns = []

    def turn() -> bool:
        turns.append(search.best)
        search.best = unlikely if search.best is likely else likely
        return True

    monkeypatch.setattr(search, "_forward", turn)
    monkeypatch.setattr(search, "_backward", lambda before: None)
    monkeypatch.setattr(search, "_is_complete", lambda: False)
    search._grow()
    assert len(turns) == 3
    assert search.best is likely
    assert search.decisions[-1].code == "exhausted"


@pytest.mark.parametrize("lost", [False, True])
def test_a_law_that_contains_a_member_takes_its_place_where_it_is_as_likely(
    monkeypatch: pytest.MonkeyPatch, *, lost: bool
) -> None:
    search = offered(beta=1.0, f_c=0.02)
    sets = {c.added: c for c in search.offers.beside(search.root)}
    search.best = before = sets[("coulomb_friction",)]
    grown = next(c for c in search.offers.beside(before) if c.added[-1] == "stribeck_friction")
    others = sorted(sets.values(), key=lambda c: c.joint)
    ends = next(c for c in others if c.added[-1] != "stribeck_friction") if lost else grown
    turns = iter([grown])

    def forward() -> bool:
        search.best = next(turns, search.best)
        search.decisions.append(Decision("add", ("stribeck_friction",), True, "accepted"))
        return search.best is grown

    monkeypatch.setattr(search, "_forward", forward)
    monkeypatch.setattr(search, "_backward", lambda before: setattr(search, "best", ends))
    monkeypatch.setattr(search, "_change_mechanics", lambda: False)
    monkeypatch.setattr(search, "_is_complete", lambda: False)
    search._grow()
    assert ends.joint < before.joint or not lost
    assert search.best is (before if lost or grown.joint < before.joint else grown)


def test_no_member_is_exchanged_where_evidence_tells_no_more_than_last_digits() -> None:
    search = offered(beta=1.0, f_c=0.02)
    near = search.offers.beside(search.root)[-1]
    for error, exchanged in ((5.0, False), (1.0, True)):
        search.best = found = dataclasses.replace(near, evidence=dataclasses.replace(near.evidence, error=error))
        assert search._exchange(found.added[-1]) is exchanged
        assert (search.best is not found) is exchanged


def test_a_member_that_hides_two_others_gives_its_place_to_both() -> None:
    search = offered(beta=1.0, f_c=0.02)
    search.best = found = next(c for c in search.offers.beside(search.root) if c.added == ("stiffness_drift",))
    assert search._judged(found, search.root)[1] == "accepted"
    assert search._exchange("stiffness_drift", two=True)
    assert {*search.best.added} == {"cubic_stiffness", "coulomb_friction"}
    (told,) = search.decisions
    assert (told.action, told.effects) == ("exchange", ("stiffness_drift", *search.best.added))
    assert told.numbers["odds"] == pytest.approx(search.best.joint - found.joint)
    assert not any("stiffness_drift" in c.effects for c in told.candidates)
    assert decision_sentence(dataclasses.asdict(told)).startswith("with ")
    # Two that gain nothing beside it do not.
    assert not search._exchange(search.best.added[0], two=True)


def test_what_is_taken_out_gives_its_place_to_what_serves() -> None:
    search = offered(f_c=0.02)
    beside = search.offers.beside(search.root)
    search.best = next(c for c in beside[::-1] if search._judged(c, search.root, stays=True)[1] != "accepted")
    (weak,) = search.best.added
    search._prune()
    assert search.best.added == ("coulomb_friction",)
    assert [(d.action, d.effects) for d in search.decisions] == [("remove", (weak,)), ("add", search.best.added)]


@pytest.mark.parametrize("lost", [False, True])
def test_an_exchange_stays_where_the_set_it_leads_to_is_as_likely(
    monkeypatch: pytest.MonkeyPatch, *, lost: bool
) -> None:
    search = offered(beta=1.0, f_c=0.02)
    likely, *_, unlikely = [c for c in search.offers.beside(search.root) if np.isfinite(c.joint)]
    grown, ends = (likely, unlikely) if lost else (unlikely, likely)

    def forward() -> bool:
        if search.best is search.root:
            search.best = grown
            return True
        return False

    def backward(before: Contender) -> None:
        search.decisions.append(Decision("exchange", ("wind", "table_tilt"), True, "accepted"))
        search.best = ends

    monkeypatch.setattr(search, "_forward", forward)
    monkeypatch.setattr(search, "_backward", backward)
    monkeypatch.setattr(search, "_change_mechanics", lambda: False)
    monkeypatch.setattr(search, "_is_complete", lambda: False)
    search._grow()
    assert search.best is likely
    assert ("exchange" in [d.action for d in search.decisions]) != lost


@pytest.mark.parametrize("strays", [False, True])
def test_a_minimum_where_a_member_imitates_others_is_no_neighbour(
    monkeypatch: pytest.MonkeyPatch, *, strays: bool
) -> None:
    search = offered(beta=1.0, f_c=0.02)
    (first,) = (c for c in search.offers.beside(search.root) if c.added == ("cubic_stiffness",))
    pair = next(c for c in search.offers.beside(first) if np.isfinite(c.joint))
    deeper = dataclasses.replace(first, evidence=dataclasses.replace(first.evidence, train=first.evidence.train + 99))
    monkeypatch.setattr(search.offers, "known", lambda *_: [deeper])
    monkeypatch.setattr(Contender, "imitation", lambda c, effect: float(strays and c is deeper))
    smaller = Neighbours(search.context, search.offers, search.root).without(pair, pair.added[-1])
    assert (smaller is deeper) is not strays
    assert smaller.added == first.added


@pytest.mark.parametrize("gain", [5.0, -5.0])
def test_a_search_goes_on_from_a_set_that_is_fitted_to_its_end(monkeypatch: pytest.MonkeyPatch, gain: float) -> None:
    search = offered(beta=1.0, f_c=0.02)

    def ended(rough: Contender, _: Context) -> Contender:
        return dataclasses.replace(
            rough, evidence=dataclasses.replace(rough.evidence, train=rough.evidence.train + gain)
        )

    sets = search.offers.beside(search.root)
    monkeypatch.setattr("discovery.selection.search.settled", ended)
    assert search._take(sets)
    # A last fit that is less likely is none.
    assert (search.best in sets) == (gain < 0)


def test_what_leaves_more_than_before_is_no_half_of_a_pair() -> None:
    search = offered(beta=1.0, f_c=0.02)
    gains = {c: c.evidence.train - search.root.evidence.train for c in search.offers.beside(search.root)}
    half = max(gains, key=lambda c: gains[c])
    worse = dataclasses.replace(half, refit=search.root.refit)
    assert search._leading([half]) == [half]
    assert search._leading([worse]) == []


@pytest.mark.parametrize(("nil", "expected"), [(50.0, 2.0), (0.0, 2.0), (-3.0, 5.0), (-60.0, 62.0)])
def test_an_error_that_is_rather_none_counts_with_its_odds(nil: float, expected: float) -> None:
    # An effect moves twice as much as an error would of 0.1 noise sds, beside laws that idealise next to nothing.
    assert _against(0.2, 0.1, 1e-12, nil) == pytest.approx(expected, rel=1e-6)
    assert _against(0.0, 0.1, 1e-12, nil) == pytest.approx(0.0, abs=1e-12)


def test_what_laws_idealise_is_there_whatever_the_error() -> None:
    assert _against(0.2, 0.0, 0.1, -60.0) == pytest.approx(2.0)


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_beside_laws_an_effect_moves_more_than_they_may_leave(share: float) -> None:
    search = searched(beta=1.0, f_c=0.02)
    smaller = search.neighbours.without(search.best, "coulomb_friction")
    # Nothing is held out, and no model error is left.
    sets = [
        dataclasses.replace(
            c, evidence=dataclasses.replace(c.evidence, error=0.0, chi2_held=0.0, count_held=0, nil=-99.0)
        )
        for c in (search.best, smaller, search.root)
    ]
    moved = np.sqrt((sets[1].chi2 - sets[0].chi2) / (sets[2].chi2 - sets[1].chi2))
    settings = LoopSettings(law=float(moved / share))
    assert odds_of(*sets, settings).against_error == pytest.approx(share**2 * settings.nats)


@pytest.mark.parametrize(("dry", "code"), [(0.02, "accepted"), (0.0, "training")])
def test_a_pair_is_accepted_only_if_neither_is_needless(dry: float, code: str) -> None:
    search = offered(beta=1.0, f_c=dry)
    (first,) = (c for c in search.offers.beside(search.root) if c.added == ("cubic_stiffness",))
    # The best set of both, or of the cubic spring with what does least harm beside it.
    pair = search.offers.beside(first)[0]
    told = odds_of(pair, search.root, search.root, search.context.settings)
    assert told.code(search.context.settings, 0.5) == "accepted"
    assert search._judged(pair, search.root)[1] == code


@pytest.mark.parametrize("imitative", [False, True])
def test_a_size_is_judged_beside_what_an_error_of_the_mechanics_looks_like(monkeypatch, imitative: bool) -> None:
    """Beside the spring that it lacks the model leaves little, and friction is far more than that."""
    monkeypatch.setattr(get_effect("cubic_stiffness"), "imitative", imitative)
    search = begun(context(settings=LoopSettings(form=8.0), beta=0.3, f_c=0.02))
    (dry,) = (c for c in search.offers.beside(search.root) if c.added == ("coulomb_friction",))
    alone, nats = odds_of(dry, search.root, search.root, search.context.settings), search.context.settings.nats
    assert alone.code(search.context.settings, 0.5) == "size"
    odds, code = search._judged(dry, search.root)
    assert (code, odds.beside) == (("accepted", True) if imitative else ("size", False))
    assert (odds.against_error > nats) == imitative
    # What it gains is what it gained.
    assert (odds.train, odds.held, odds.gain) == (alone.train, alone.held, alone.gain)
    if imitative:  # and the spring itself stays a part of the error
        (spring,) = search.offers.imitators(search.root)
        assert not search._judged(spring, search.root)[0].beside


def test_of_sets_that_serve_as_well_the_simplest_comes_first() -> None:
    search = begun(context(f_c=0.02))
    offered = search.offers.beside(search.root)
    first = simplest_first(offered, search.root, search.context.settings)
    best = max(c.joint for c in offered)
    nats = search.context.settings.nats
    tied = [c for c in first if best - c.joint < nats]
    assert tied == first[: len(tied)]
    assert "coulomb_friction" in tied[0].added
    # Among equally simple ones, what predicts best.
    keys = [(simplicity(c.added[0], c.model.mechanics.system), -c.evidence.held) for c in tied]
    assert keys == sorted(keys)
    rest = [c.joint for c in first[len(tied) :]]
    assert rest == sorted(rest, reverse=True)


def test_the_odds_that_decide_are_the_smallest() -> None:
    assert odds().total == 40.0
    assert odds(against_error=1e9).total == 50.0
    assert odds(held=-45.0).total == 5.0


def test_a_set_against_itself_has_no_odds() -> None:
    search = searched(beta=1.0, f_c=0.02)
    best: Contender = search.best
    found = odds_of(best, best, search.root, LoopSettings())
    assert (found.train, found.held, found.ahead, found.gain, found.size) == (0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("added", "geometry", "complete", "verdict"),
    [
        ((), (), True, "nothing_missing"),
        (("a",), (), True, "explained"),
        ((), ("g",), True, "explained"),
        (("a",), ("g",), False, "partly_explained"),
        ((), ("g",), False, "unexplained"),
    ],
)
def test_the_verdict_follows_from_what_is_named_and_what_is_left(added, geometry, complete, verdict) -> None:
    assert verdict_of(added, geometry, complete=complete) == verdict


@pytest.mark.parametrize(("alone", "complete"), [(1.5, True), (4.0, False)])
def test_noise_far_beyond_what_is_stated_is_no_complete_model(alone: float, complete: bool) -> None:
    """A model error that forgets within a step cannot be told from such noise."""
    search = offered()
    evidence = dataclasses.replace(search.root.evidence, error=alone, error_held=alone, nil=0.0, alone=alone)
    contender = dataclasses.replace(search.root, evidence=evidence)
    assert is_complete(contender, contender, search.context) == complete


def test_a_fit_on_other_units_of_the_output_gives_the_same_odds() -> None:
    """Nothing may depend on the unit in which the output is written."""
    from dataclasses import replace

    found = []
    for factor in (1.0, 1e-5):
        shared = context(beta=1.0)
        units = replace(UNITS, coordinate=UNITS.coordinate * factor)

        def scaled(e, factor=factor):
            r = e.recording
            return replace(e, recording=replace(r, output=r.output * factor, noise=r.noise * factor))

        train, held = [[scaled(e) for e in group] for group in (shared.train, shared.judge.separate)]
        judge = HoldOut(train, held, units, shared.settings.tolerance)
        other = Context(train, judge, shared.settings, units, lambda _: None)
        start = fit(Model("oscillator", DECLARED), train, start={"g": factor, "xi": 0.05, "alpha": 8.8}, units=units)
        search = Search(other.fit(start.model, start.values, {}), other)
        search.run()
        found.append((search.best.added, search.best.joint - search.root.joint))
    assert len({added for added, _ in found}) == 1
    assert [gain for _, gain in found] == pytest.approx([found[0][1]] * 2, rel=1e-3)


def test_a_set_is_refitted_from_the_declared_guesses_where_its_fit_went_astray() -> None:
    shared = context(beta=1.0)
    root = begun(shared).root
    (found,) = (c.refit for c in Offers(shared).beside(root) if c.added == ("cubic_stiffness",))
    x = found.minimum.x.copy()
    x[found.problem.names.index("alpha")] = 400.0
    lost = dataclasses.replace(found, minimum=dataclasses.replace(found.minimum, x=x))
    (stuck,), (afresh,) = (finish(root.refit.problem, [lost], afresh=a) for a in (False, True))
    assert afresh.chi2 == pytest.approx(found.chi2, rel=1e-3)
    assert stuck.chi2 > 10 * found.chi2


def test_a_lower_minimum_that_blows_up_on_its_own_steps_leads_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    shared = context(beta=1.0)
    start = shared.fit(Model("oscillator", DECLARED), {"g": 0.9, "xi": 0.05, "alpha": 8.8}, {})

    def blown(*_: object) -> Fit:
        raise ComputationError("the motion blows up")

    monkeypatch.setattr(Neighbours, "lower", lambda neighbours: copy(neighbours.root))
    monkeypatch.setattr(Context, "fit", blown)
    before, search = _searching(start, shared, led=True)
    assert before is start
    assert search.best.added == ()


def test_a_candidate_that_leads_the_start_to_a_lower_minimum_is_none() -> None:
    """A start that its guesses left in a wrong place: whatever is beside it gains, and leads it to the right one."""
    shared = context()
    good = begun(shared)
    assert good.neighbours.lower() is good.root
    problem = good.root.refit.problem
    wrong = problem.start({"g": 0.1, "xi": 3.0, "alpha": 30.0})
    (minimum,) = settle([problem], [wrong], iterations=0)
    bad = begun(shared)
    (bad.root,) = contenders(shared, [((), dataclasses.replace(good.root.refit, minimum=minimum))])
    bad.neighbours = Neighbours(shared, bad.offers, bad.root)
    led = bad.neighbours.lower()
    assert led.joint > bad.root.joint + 100
    assert led.added == ()
    assert led.refit.values["alpha"] == pytest.approx(9.0, rel=0.02)


def test_a_flexible_law_is_tried_beside_a_refused_plain_one_after_all_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of the two is refused alone, and no pair of plain laws serves."""
    search = copy(offered())
    alone, flexible = (SimpleNamespace(added=(e,)) for e in ("quadratic_drag", "periodic_disturbance"))
    pairs = [SimpleNamespace(added=("quadratic_drag", e)) for e in ("coulomb_friction", "periodic_disturbance")]
    beside = {search.best: [alone, flexible], alone.added: pairs}
    tried: list[list[tuple[str, ...]]] = []

    def take(some: list[Any]) -> bool:
        tried.append([c.added for c in some])
        return pairs[1].added in tried[-1]

    monkeypatch.setattr(search, "_take", take)
    monkeypatch.setattr(Contender, "leaves_noise", lambda *_: False)
    monkeypatch.setattr(search, "_leading", lambda some, *, ahead=False: [] if ahead else some)
    offers = SimpleNamespace(
        beside=lambda node: beside[node.added if node is alone else node], pairs=lambda _, pliable=False: []
    )
    monkeypatch.setattr(search, "offers", offers)
    assert search._forward()
    assert tried == [[alone.added], [], [pairs[0].added], [flexible.added], [], [p.added for p in pairs]]


def test_kernels_hold_what_comes_into_question_once_an_added_law_is_taken_out() -> None:
    """On other mechanics a search went on without a law that the one found contains, and broke off."""
    shared, model = context(), Model("oscillator", DECLARED)
    with_more = shared.kernel_effects(model.with_effect("stribeck_friction"))
    assert "coulomb_friction" not in shared.candidates(model.with_effect("stribeck_friction"))
    assert {"coulomb_friction", *shared.kernel_effects(model)} <= {*with_more}


def test_an_end_that_does_not_move_forgives_chance() -> None:
    """A recording of its own judges, however little it moves."""
    shared = context(beta=1.0)
    (whole,), settings = shared.train, shared.settings
    count, noise = whole.recording.time.size, float(whole.recording.noise[0])
    still = whole.recording.output.copy()
    still[-99:] = noise * np.random.default_rng(1).standard_normal((99, 1))
    ended = dataclasses.replace(whole, fitted_samples=count - 99)
    quiet = dataclasses.replace(ended, recording=dataclasses.replace(whole.recording, output=still))

    def code(judge: HoldOut, train: Experiment, loss: float = 2.0) -> str:
        search = begun(Context([train], judge, settings, UNITS, lambda _: None))
        offer = search.offers.beside(search.root)[0]
        loses = dataclasses.replace(offer.evidence, held=search.root.evidence.held - loss)
        return search._judged(dataclasses.replace(offer, evidence=loses), search.root)[1]

    assert code(HoldOut([quiet], [], UNITS, settings.tolerance), quiet) == "accepted"
    assert code(HoldOut([ended], [], UNITS, settings.tolerance), ended) == "held_out"
    assert code(HoldOut([quiet], [], UNITS, settings.tolerance), quiet, 4.0) == "held_out"
    assert HoldOut([whole], [quiet], UNITS, settings.tolerance).asked(0.5) == 0.5
    assert HoldOut([whole], [], UNITS, settings.tolerance).asked(0.5) == -np.inf


def test_what_predicts_worse_than_nothing_in_its_place_is_no_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(f_c=0.02)
    (effect,) = search.best.added
    as_likely = dataclasses.replace(search.best, added=("hysteresis",))
    evidence = as_likely.evidence
    # What it gains in training it loses held out.
    moved = dataclasses.replace(
        evidence, train=evidence.train + 2e3, held=evidence.held - 2e3, ahead=evidence.ahead - 2e3
    )
    misses = dataclasses.replace(as_likely, evidence=moved)
    assert misses.joint == pytest.approx(as_likely.joint)
    for rival, group in ((as_likely, ("hysteresis",)), (misses, ())):
        monkeypatch.setattr(search.neighbours, "instead_of", lambda *_, rival=rival: [rival])
        (found,) = named(search)
        assert (found.effect, found.group) == (effect, group)
        assert (found.probability > 0.9) == (not group)


@pytest.mark.parametrize("effect", ["position_scale", "zero_drift", "stiffness_drift"])
def test_an_estimate_ends_where_its_evidence_is_taken(effect: str) -> None:
    """What the catalogue believes of a size holds it in the last fit as in the evidence, or one is told, one scored."""
    search = begun(context(beta=2.0, f_c=0.05))
    fitted = search.context.fit(search.root.model.with_effect(effect), search.root.refit.values, {})
    (found,) = contenders(search.context, [((effect,), Refit(effect, fitted.problem, fitted.minimum))])
    assert found.evidence.error > 4.0
    evidence = settled(found, search.context).evidence
    sd = np.sqrt(np.diag(evidence.covariance)[: evidence.step.size])
    assert np.abs(evidence.step / sd).max() < 0.02
