from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from discovery.batch import fit_problems
from discovery.bench import Bench
from discovery.branch import Branch, Branches
from discovery.case import Case, LoopSettings
from discovery.drive import Drive
from discovery.experiment import Experiment
from discovery.fit import fit, fit_near
from discovery.holdout import HoldOut
from discovery.model import Model
from discovery.node import Node
from discovery.ordering import better
from discovery.problem import NaturalUnits, Problem, conventions
from discovery.recording import Recording
from discovery.refits import Refit, relaxed, settled
from discovery.registry import catalogue
from discovery.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.search import Search
from discovery.simplicity import imitates
from discovery.testing.states import every_effect
from discovery.weighing import Verdict, weigh

TRUTH = {"g": 1.0, "xi": 0.08, "alpha": 9.0}
DECLARED = ("viscous_damping", "linear_stiffness")
EFFECTS = every_effect("oscillator")
UNITS = NaturalUnits(1 / 3, 0.3, 1.0)
NOISE = 1e-3
TIME = np.linspace(0.0, 20.0, 801)
RIG = Rig("o", "oscillator", columns=Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V")))
_EDGES = np.array([0.0, 1.0, 2.5, 6.0, 20.0])


def pushes(*sizes: float) -> Drive:
    return Drive(_EDGES, np.array([sizes]), _EDGES[1:-1])


def experiment(name: str, output: np.ndarray, drive: Drive) -> Experiment:
    recording = Recording(
        name, TIME, drive.evaluate(TIME)[0], output[:, None], ("output",), ("V",), np.array([NOISE]), "", ""
    )
    return Experiment(recording, drive, RIG)


def recorded(name: str, drive: Drive, seed: int, **effects: float) -> Experiment:
    """Simulate a recording with the given parameters of effects that the declared model lacks."""
    b = Bench("oscillator", EFFECTS, [experiment(name, np.zeros(TIME.size), drive)], 0.02)
    whole = Model("oscillator", EFFECTS)
    values = {n: p.default * UNITS.scale(p) for n, p in whole.parameters.items()} | TRUTH | effects
    (clean,) = b.predict(np.array([[values[n]] for n in b.names]), np.array([[[0.25], [0.0]]]))
    return experiment(name, clean[:, 0, 0] + NOISE * np.random.default_rng(seed).standard_normal(TIME.size), drive)


@cache
def searched(seed: int = 0, **effects: float) -> Search:
    train = recorded("train", pushes(1.0, -1.5, 0.7, 0.0), seed, **effects)
    held = recorded("held", pushes(-0.8, 1.2, 0.3, 0.0), seed + 100, **effects)
    settings = LoopSettings()
    case = Case([train], HoldOut([train], [held], UNITS, settings.tolerance), settings, UNITS, lambda _: None)
    start = fit(Model("oscillator", DECLARED), [train], start={"g": 0.9, "xi": 0.05, "alpha": 8.8}, units=UNITS)
    search = Search(start, case)
    search.run()
    return search


def test_a_clean_recording_gets_nothing() -> None:
    search = searched()
    assert search.added == ()
    assert [s.action for s in search.steps] == ["stop"]


@pytest.mark.parametrize(
    "effects", [{"beta": 1.0, "f_c": 0.02}, {"c_2": 0.3, "tau": 0.01}], ids=lambda e: " and ".join(e)
)
def test_two_effects_are_both_found_and_nothing_else(effects: dict[str, float]) -> None:
    search = searched(**effects)
    found = search.best.refit.values
    owners = {"beta": "cubic_stiffness", "f_c": "coulomb_friction", "c_2": "quadratic_drag", "tau": "sensor_delay"}
    assert set(search.added) == {owners[n] for n in effects}
    for name, value in effects.items():
        assert found[name] == pytest.approx(value, rel=0.1)


def test_what_friction_holds_by_convention_is_free_in_the_answer_and_moves_no_step() -> None:
    """Also where its speed in the unit of the coordinate is far from that in natural units."""
    search = searched(beta=1.0, f_c=0.02)
    fitted, _ = search.finest()
    # The recordings hardly know it: what finer steps change of it is little beside what it may be anyway.
    assert fitted.sd["v_c"] == pytest.approx(fitted.problem.gaussian["v_c"][1], rel=0.5)
    held = fit_near(replace(fitted.problem, gaussian={}), fitted.values)
    assert fitted.solver_shift == pytest.approx(held.solver_shift, rel=0.2)
    (_, mean, _) = within(fitted.problem, "v_c")
    for coordinate in (5e-3, 150.0):
        units = replace(UNITS, coordinate=coordinate)
        free = replace(fitted.problem, units=units, gaussian=conventions(search.added, units))
        lower, middle, upper = within(free, "v_c")
        assert lower < middle < upper
        assert middle == pytest.approx(mean * coordinate / UNITS.coordinate)


def within(problem: Problem, name: str) -> tuple[float, float, float]:
    """Return the lower bound, the convention and the upper bound of a parameter."""
    lower, upper = problem.bounds
    return lower[problem.free.index(name)], problem.gaussian[name][0], upper[problem.free.index(name)]


def test_laws_at_the_tip_of_an_arm_may_leave_more_for_others() -> None:
    case, settings = searched().case, LoopSettings()
    arm = replace(case, train=[SimpleNamespace(is_arm=True, rig=SimpleNamespace(declared=("cubic_stiffness",)))])
    for effects, lumped in ((("quadratic_stiffness",), True), (("cubic_stiffness", "coulomb_friction"), False)):
        model = Model("constant_radius", effects)
        assert arm.form(model) == (settings.form_lumped if lumped else settings.form)
        assert case.form(model) == settings.form


def test_what_the_recordings_do_not_determine_is_carried_by_what_shared_it() -> None:
    """A small swing knows the sum of gravity and a spring only: without the spring, gravity must take it all."""
    time = 0.02 * np.arange(1000)
    rig = Rig("p", kind="pendulum", columns=Columns(TimeColumn(), None, OutputColumn("a", "rad")))
    swing = 0.01 * np.exp(-0.03 * time) * np.cos(3.0 * time)
    noise = 1e-5
    readings = swing + noise * np.random.default_rng(1).standard_normal(time.size)
    recording = Recording("p", time, None, readings[:, None], ("output",), ("rad",), np.array([noise]), "", "")
    one = Experiment(recording, None, rig)
    model = Model("oscillator", ("viscous_damping", "gravity_torque", "linear_stiffness"), {"g": 0.0})
    whole = fit(model, [one], start={"g_c": 4.5, "alpha": 4.5})
    assert abs(whole.values["alpha"]) > 2.0
    start = Refit("linear_stiffness", whole.problem, whole.minimum)
    left, carried = (relaxed(start, ["linear_stiffness"], carried=c) for c in (False, True))
    assert carried.chi2 < whole.chi2 + 10 < left.chi2
    assert carried.values["g_c"] == pytest.approx(9.0, rel=1e-3)


def test_a_model_may_be_left_without_any_effect() -> None:
    """As a falling body, which may need none."""
    one = recorded("free", pushes(1.0, -1.5, 0.7, 0.0), 1)
    model = Model("oscillator", ("viscous_damping",))
    problem = Problem(model, Bench("oscillator", model.effects, [one], 0.02), UNITS, {})
    (damped,) = fit_problems([problem], [problem.start({"g": 1e-3, "xi": 1.0})])
    bare = relaxed(Refit("viscous_damping", problem, damped), ["viscous_damping"])
    assert bare.effect == ""
    assert bare.problem.model.effects == ()


def test_the_evidence_says_how_large_and_how_sure() -> None:
    evidence = searched(beta=1.0, f_c=0.02).evidence
    for numbers in evidence.values():
        # No replicate of 200 came near.
        assert numbers["p_value"] == pytest.approx(1 / 201)
        assert numbers["delta_chi2_train"] > 10 * numbers["chance_gain_99"]
        assert 0.5 < numbers["share_of_excess"] <= 1.01
        assert NOISE < numbers["effect_rms"] < 0.3
        # A law that contains the right one may gain a little more.
        assert 0 < numbers["runner_up_delta_chi2"] < numbers["delta_chi2_train"] + 20


@pytest.mark.parametrize(("gain", "held", "renewed"), [(50.0, -5.0, True), (50.0, 5.0, False), (5.0, -5.0, False)])
def test_a_better_minimum_of_the_same_set_takes_its_place(gain: float, held: float, renewed: bool) -> None:
    """It must gain more than the price of a parameter in training, and predict the held-out recordings better."""
    search = searched(beta=1.0, f_c=0.02)
    best, before = search.best, list(search.steps)
    minimum = replace(best.refit.minimum, cost=best.refit.minimum.cost - 0.5 * gain)
    again = replace(best, refit=replace(best.refit, minimum=minimum), held=best.held + held)
    try:
        search._renew("coulomb_friction", again)
        assert (search.best is again) == renewed
        assert [s.action for s in search.steps[len(before) :]] == ["renew"] * renewed
    finally:
        search.best, search.steps = best, before


def changed(node: Node, *, chi2: float, held: float) -> Node:
    """Return a node whose refit leaves so much more."""
    minimum = replace(node.refit.minimum, cost=node.refit.minimum.cost + 0.5 * chi2)
    return replace(node, refit=replace(node.refit, minimum=minimum), held=node.held + held)


@pytest.mark.parametrize(
    ("chi2", "held", "reason"),
    [(5.0, 5.0, "is simpler"), (15.0, 0.0, ""), (0.0, 15.0, ""), (-9.0, -1.0, "lowers chi-square")],
)
def test_a_law_with_fewer_parameters_that_leaves_no_more_takes_the_place_of_a_member(
    chi2: float, held: float, reason: str
) -> None:
    """A slow ripple leaves what a gain of the encoder does, and needs two parameters more for it."""
    search = copy(searched(c_2=0.3, tau=0.01))
    small = search.best
    problem = small.refit.problem
    richer = replace(problem, model=problem.model.with_effect("periodic_disturbance"))
    large = replace(small, refit=Refit("periodic_disturbance", richer, small.refit.minimum))
    other = changed(small, chi2=chi2, held=held)
    search.best = large
    assert reason in better(search.case, search.best, other)
    assert bool(reason) == bool(better(search.case, search.best, other))
    search.best = small
    assert not better(search.case, search.best, changed(large, chi2=-3.0, held=-1.0))


def contended(search: Search) -> tuple[str, frozenset[str], Branch]:
    """Return the first member of a pair, what may take its place, and what was offered beside none."""
    first, _ = search.added
    among = search._contenders(first)
    below = search._branches.below(first, ())
    assert among is not None
    assert below is not None
    return first, among, below


def test_what_left_far_more_beside_fewer_is_not_tried_in_the_place_of_a_member() -> None:
    search = searched(c_2=0.3, tau=0.01)
    first, among, below = contended(search)
    left = {r.effect: r.chi2 for r in below.refits}
    assert first in among
    assert {*among} < {*below.scored}
    assert min(left[e] for e in {*left} - {*among}) > left[first] + 9 * (left[first] - search.best.chi2)
    # Scored it is all the same: chance is that of the whole catalogue.
    beside = search._branches.of(search._without(first), among)
    assert {r.effect for r in beside.refits} <= among | {first}
    assert len(beside.scored) == len(below.scored) - 1
    assert not beside.whole


def test_the_simpler_law_that_a_member_may_have_become_is_tried_in_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(c_2=0.3, tau=0.01)
    first, among, below = contended(search)
    far = min({r.effect for r in below.refits} - among)
    monkeypatch.setattr(type(catalogue()[first]), "reduces_to", frozenset({far}))
    assert search._contenders(first) == among | {far}


def test_beside_what_a_member_has_replaced_others_did_what_they_do_beside_it() -> None:
    search = copy(searched(c_2=0.3, tau=0.01))
    first, among, _ = contended(search)
    second = search.added[1]
    # As if the second member had replaced one of those that are no rivals of the first beside none.
    replaced = min({r.effect for r in search._branches.of(search.root).refits} - among)
    search._stood_for = {second: replaced}
    assert search._contenders(first) == among
    branch = search._branches.of(search.root)
    alone = next(r for r in branch.refits if r.effect == replaced)
    search._branches = Branches(search.case, search.root.refit.problem.bench)
    beside = search._branches.of(Node.of((replaced,), alone, search.case))
    left = {r.effect: r.chi2 for r in beside.refits}
    contenders = search._contenders(first)
    assert contenders is not None
    # What has been replaced has not been tried beside itself.
    assert {first, replaced} <= contenders
    limit = search.best.chi2 + 10 * (left[first] - search.best.chi2)
    assert contenders - {replaced} == {e for e in beside.scored if left.get(e, 0.0) <= limit}


def test_where_the_training_residual_is_noise_no_candidate_is_refitted_that_promises_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = copy(searched(c_2=0.3, tau=0.01))
    least = search.case.settings.least_gain
    assert search._branches.promise(search.best) < least
    smaller = search._without(search.added[1])
    gain = smaller.chi2 - search.best.chi2
    assert search._branches.promise(smaller) == pytest.approx(gain, rel=0.2)
    # Not even where the held-out residual is not noise.
    monkeypatch.setattr(Search, "settled", property(lambda self: False))
    monkeypatch.setattr(Branches, "children", lambda self, nodes: pytest.fail("candidates were refitted"))
    search.steps = []
    search._extend()
    assert [s.action for s in search.steps] == ["stop"]
    assert "to first order" in search.steps[0].reason
    # Before any effect has joined, and where more than noise is left, everything is tried.
    for node in (search.root, replace(search.best, rough=1.0)):
        search.best = node
        assert not search._is_vain()


def test_what_a_refused_set_leaves_undetermined_is_dropped_and_the_rest_weighed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = searched(beta=1.0, f_c=0.02)
    search = copy(found)
    search.best, search.steps = found.root, []
    problem = found.best.refit.problem
    # The recordings know no quadratic force beside the cubic one and friction.
    larger = replace(problem, model=problem.model.with_effect("quadratic_stiffness"))
    (again,) = settled([larger], [larger.start(found.best.refit.values)])
    node = Node.of((*found.added, "quadratic_stiffness"), again, search.case)
    search._branches = Branches(search.case, search.root.refit.problem.bench)
    lean = search._without_idle(node)
    assert lean is not None
    assert lean.added == found.added
    assert lean.chi2 == pytest.approx(found.best.chi2, abs=0.1)
    assert search._without_idle(lean) is None
    # What is known to be no better is not weighed twice.
    search._branches.of(Node.of(found.added[:1], found._without(found.added[1]).refit, search.case))
    assert search._without_idle(node) is None
    # Where all that is new is undetermined, it may have led to another minimum of the set found so far.
    search.best = found.best
    assert search._without_idle(node) is None
    search.best = stuck = changed(found.best, chi2=500.0, held=500.0)
    monkeypatch.setattr("discovery.search.ordered", lambda case, best, children: [node])
    chosen = search._chosen([])
    assert chosen is search.best
    assert chosen is not stuck
    assert chosen.added == found.added
    assert chosen.chi2 == pytest.approx(found.best.chi2, abs=0.1)
    assert [(s.action, s.accepted) for s in search.steps] == [("add", False), ("renew", True)]


@pytest.mark.parametrize(
    ("left", "rough", "again"), [(0.02, 2.0, True), (0.08, 0.9, True), (0.08, 1.1, False), (0.2, 0.9, False)]
)
def test_what_imitates_is_given_up_unless_much_is_left(
    monkeypatch: pytest.MonkeyPatch, left: float, rough: float, again: bool
) -> None:
    found = searched(c_2=0.3, tau=0.01)
    search = copy(found)
    search.best, search.steps = replace(found.best, added=("quadratic_drag", "periodic_disturbance"), rough=rough), []
    monkeypatch.setattr(Search, "settled", property(lambda self: False))
    monkeypatch.setattr(search, "_left", lambda node: left)
    assert search._distrusts() is again
    assert (search.best is found.root) is again
    assert [(s.action, s.effect) for s in search.steps] == [("withdraw", "periodic_disturbance")] * again
    # The second search is one without such laws, and shares nothing with the first.
    assert search._branches.plain is again
    assert (search._branches is found._branches) is not again
    # Without such a law there is nothing to give up.
    search.best = found.best
    assert not search._distrusts()


@pytest.mark.parametrize(
    ("rough", "train", "unsure", "noise"),
    [
        (0.3, 0.0, 0.0, True),
        (0.3, 0.45, 0.0, False),
        (0.5, 0.0, 0.1, False),
        (0.5, 0.0, 0.2, True),
        (0.5, 0.38, 0.2, False),
        (0.5, 0.0, np.inf, False),
        (1.0, 0.0, 0.8, True),
        (1.1, 0.0, 0.8, False),
    ],
)
def test_what_uncertain_estimates_foretell_may_miss_by_as_much(
    monkeypatch: pytest.MonkeyPatch, rough: float, train: float, unsure: float, noise: bool
) -> None:
    search = copy(searched(beta=1.0, f_c=0.02))
    case = search.case
    fitted, held = search.finest()
    monkeypatch.setattr(case.judge, "score", lambda held: (0.0, 0, rough))
    monkeypatch.setattr(case.judge, "uncertainty", lambda fitted: unsure)
    monkeypatch.setattr(Case, "roughness", lambda self, predictions: train)
    # A tenth of what was there before may be left of the fitted part, too.
    found, test = case.is_noise(fitted, held, (4.0, 0.5))
    assert found is noise
    assert ("at most" if noise else "above") in test
    assert ("uncertain" in test) is (0.35 < rough <= 1 and train <= 0.35 and unsure < np.inf)
    assert ("held-out" in test) is (train <= 0.4)
    # The search asks the same.
    search.root, search._noise = replace(search.root, rough=4.0, held_rough=0.5), {}
    assert search.settled is noise


def test_a_law_that_imitates_must_leave_nothing_but_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    search = copy(searched(beta=1.0, f_c=0.02))
    case, model = search.case, search.best.refit.problem.model
    assert case.limits(model, (6.0, 30.0)) == (pytest.approx(0.6), 1.0)
    imitating = model.with_effect("periodic_disturbance")
    assert case.limits(imitating, (6.0, 30.0)) == (0.35, 0.35)
    fitted, held = search.finest()
    monkeypatch.setattr(case.judge, "score", lambda held: (0.0, 0, 0.5))
    monkeypatch.setattr(Case, "roughness", lambda self, predictions: 0.0)
    monkeypatch.setattr(case.judge, "uncertainty", lambda fitted: 0.0)
    assert case.is_noise(fitted, held, (6.0, 30.0))[0]
    noise, test = case.is_noise(SimpleNamespace(model=imitating, predict=list), held, (6.0, 30.0))
    assert not noise
    assert "periodic_disturbance may imitate others" in test
    # What the rig file declares imitates nothing.
    known = [replace(e, rig=replace(e.rig, declared=("periodic_disturbance",))) for e in case.train]
    assert replace(case, train=known).limits(imitating, (6.0, 30.0)) == (pytest.approx(0.6), 1.0)


@pytest.mark.parametrize(("gain", "joins"), [(450.0, False), (550.0, True)])
def test_an_effect_must_remove_more_than_the_laws_before_it_may_have_idealised(gain: float, joins: bool) -> None:
    search = searched(beta=1.0, f_c=0.02)
    larger = search.best
    smaller = replace(changed(larger, chi2=gain, held=gain), added=larger.added[:1])
    for removed, accepted in ((1e6, joins), (1e5, True)):
        root = replace(changed(larger, chi2=removed + gain, held=removed), added=())
        # Half a thousandth of what cubic stiffness has removed.
        verdict = weigh(search.case, root, smaller, larger, larger.added[1:], None)
        assert verdict.accepted is accepted, verdict.reason


def test_an_effect_without_which_the_motion_blows_up_on_the_held_out_recordings_joins() -> None:
    search = searched(beta=1.0, f_c=0.02)
    larger = search.best
    smaller = replace(changed(larger, chi2=1e6, held=0.0), added=larger.added[:1], held=np.inf)
    root = replace(changed(larger, chi2=2e6, held=0.0), added=(), held=np.inf)
    verdict = weigh(search.case, root, smaller, larger, larger.added[1:], None)
    assert verdict.accepted, verdict.reason
    assert "blows up" in verdict.reason
    still = replace(larger, held=np.inf)
    assert not weigh(search.case, root, smaller, still, larger.added[1:], None).accepted


def test_a_set_that_fails_on_the_held_out_recordings_is_not_extended(monkeypatch: pytest.MonkeyPatch) -> None:
    found = searched(beta=1.0, f_c=0.02)
    search = copy(found)
    search.best, search.steps = found.root, []
    better, worse = found.best, replace(found.best, added=("worse",), held=1.01 * found.root.held)
    extended: list[list[tuple[str, ...]]] = []
    paired: list[tuple[str, ...]] = []
    monkeypatch.setattr(search._branches, "children", lambda nodes: extended.append([n.added for n in nodes]) or [])
    monkeypatch.setattr(search._branches, "pairs", lambda node: paired.append(node.added) or [])
    for leading, beams in (([worse, better], [[()], [better.added]]), ([worse], [[()], []])):
        extended.clear()
        paired.clear()
        monkeypatch.setattr(search, "_leading", lambda children, besides, leading=leading: leading)
        search._extend()
        assert extended == beams
        # Two together may still be right.
        assert paired == [()]


def test_a_set_on_far_finer_steps_is_extended_only_if_it_explains_nearly_all(monkeypatch: pytest.MonkeyPatch) -> None:
    found = searched(beta=1.0, f_c=0.02)
    refit = found.best.refit
    fine = replace(refit.problem, bench=Bench.like(refit.problem.bench, refit.problem.bench.step / 10))
    right = replace(found.best, refit=replace(refit, problem=fine))
    much = 0.5 * sum(node.chi2 for node in (found.root, found.best))
    poor = replace(right, refit=replace(right.refit, minimum=replace(refit.minimum, cost=0.5 * much)))
    search = copy(found)
    extended: list[list[tuple[str, ...]]] = []
    monkeypatch.setattr(search._branches, "children", lambda nodes: extended.append([n.added for n in nodes]) or [])
    monkeypatch.setattr(search._branches, "pairs", lambda node: [])
    for node, beams in ((right, [[()], [right.added]]), (poor, [[()], []])):
        search.best, search.steps = found.root, []
        extended.clear()
        monkeypatch.setattr(search, "_leading", lambda children, besides, node=node: [node])
        search._extend()
        assert extended == beams


def test_a_search_without_laws_that_imitate_others_does_not_try_them() -> None:
    search = searched(beta=1.0, f_c=0.02)
    bench = search.root.refit.problem.bench
    made = [Branches(search.case, bench, plain=plain).of(search.root, grows=False) for plain in (False, True)]
    every, plain = ({*branch.scored} for branch in made)
    assert every - plain == {e for e in every if imitates(e)} == {"periodic_disturbance"}


def test_a_set_that_was_found_again_is_the_base_of_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    found = searched(beta=1.0, f_c=0.02)
    search = copy(found)
    search.best, search.steps = found._without(found.added[-1]), []
    again = replace(search.best)
    assert {*again.added} == {*search.best.added}
    chosen = iter([again, None, None])
    paired: list[Node] = []
    monkeypatch.setattr(search, "_chosen", lambda children: next(chosen))
    monkeypatch.setattr(search._branches, "children", lambda nodes: [])
    monkeypatch.setattr(search._branches, "pairs", lambda node: paired.append(node) or [])
    search._extend()
    assert paired == [again]


def test_a_branch_for_an_extension_is_whole() -> None:
    search = searched(beta=1.0, f_c=0.02)
    (first, _), node = search.added, search._without(search.added[0])
    branches = Branches(search.case, search.root.refit.problem.bench)
    part = branches.of(node, {first})
    assert [r.effect for r in part.refits] == [first]
    assert branches.of(node, {first}) is part
    whole = branches.of(node)
    assert len(whole.refits) > 5
    # What is whole serves both.
    assert branches.of(node, {first}) is whole


def test_what_had_left_more_is_not_extended_once_noise_is_left() -> None:
    search = searched(beta=1.0, f_c=0.02)
    # The best set lacks nothing but its last member; what leaves more beside it would find a pair of its own.
    *smaller, last = search.added
    ahead = search._without(last)
    assert ahead.chi2 < search.root.chi2
    branches = Branches(search.case, search.root.refit.problem.bench)
    children = branches.children([search.root, ahead])
    assert {frozenset(added) for added, _ in children} >= {frozenset(search.added)}
    assert branches.made(smaller) is not None
    assert branches.made(()) is None
    # Where what is left counts as more than noise, all are extended.
    stricter = replace(search.case, settings=replace(search.case.settings, floor=0.0))
    branches = Branches(stricter, search.root.refit.problem.bench)
    branches.children([search.root, ahead])
    assert branches.made(()) is not None


def test_a_search_ends_where_a_further_effect_leaves_far_more_than_another_search() -> None:
    found = searched(c_2=0.3, tau=0.01)
    search = copy(found)
    for rival, added in ((search.case.n_data, ()), (np.inf, found.added)):
        search.best, search.steps = found.root, []
        search.run(rival)
        assert search.added == added
        assert search.least == search.best.chi2


def test_what_was_not_tried_on_the_first_swings_is_when_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched(c_2=0.3, tau=0.01)
    tried: list[int] = []
    monkeypatch.setattr("discovery.branch.grown", lambda minimum, problem, names: tried.append(len(names)) or [])
    branches = Branches(search.case, search.root.refit.problem.bench)
    assert search.root.rough > search.case.settings.floor
    branches.of(search.root, {"quadratic_drag"}, grows=False)
    assert tried == []
    part = branches.of(search.root, {"quadratic_drag"})
    assert tried == [1]
    # What has been is not done again.
    assert branches.of(search.root, {"quadratic_drag"}, grows=False) is part


@pytest.mark.parametrize(("rival", "times"), [(np.inf, 2), (123.0, 1)])
def test_what_is_not_noise_is_judged_on_the_finest_and_searched_again_unless_there_is_a_rival(
    monkeypatch: pytest.MonkeyPatch, rival: float, times: int
) -> None:
    search = copy(searched(beta=1.0, f_c=0.02))
    asked: list[object] = []
    monkeypatch.setattr(Search, "settled", property(lambda self: False))
    monkeypatch.setattr(search, "_extend", lambda rival: asked.append(rival))
    monkeypatch.setattr(search, "_refine", lambda: None)
    monkeypatch.setattr(search, "finest", lambda: asked.append("finest"))
    monkeypatch.setattr(search, "_distrusts", lambda: True)
    monkeypatch.setattr(search, "_conclude", lambda: None)
    search.run(rival)
    assert asked == [rival, "finest"] * times
    assert search.least == search.best.chi2


def test_members_are_exchanged_on_the_first_swings_only_where_what_is_found_leaves_more_than_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = copy(searched(beta=1.0, f_c=0.02))
    tried: list[int] = []
    monkeypatch.setattr("discovery.branch.grown", lambda minimum, problem, names: tried.append(len(names)) or [])
    monkeypatch.setattr("discovery.branch._FAR", 0.0)
    for noise in (True, False):
        monkeypatch.setattr(Search, "settled", property(lambda self, noise=noise: noise))
        search._branches = Branches(search.case, search.root.refit.problem.bench)
        search._retry(search.added[0])
        assert bool(tried) is not noise


def test_what_removes_the_error_of_the_solver_only_is_taken_out_before_others_are_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = copy(searched(beta=1.0, f_c=0.02))
    first, second = search.added
    assert search._weighed(first)[0].accepted
    assert search._weighed(second)[0].accepted
    search.steps, search._verdicts = [], {}
    asked: list[float] = []
    left = 0.5 * search.best.chi2

    def on_shorter_steps(refit: Refit, least: float) -> Refit:
        """Leave as little without the second one as with it."""
        asked.append(least)
        return replace(refit, minimum=replace(refit.minimum, cost=left)) if refit.effect == first else refit

    monkeypatch.setattr("discovery.search.resolved", on_shorter_steps)
    monkeypatch.setattr(search, "_in_place_of", lambda effect: pytest.fail("others are tried beside what is idle"))
    gains = {search._without(e).chi2 - search.best.chi2 for e in (first, second)}
    search._refine()
    assert {*asked} == {max(search.case.settings.price, 0.1 * gain) for gain in gains}
    assert [(s.action, s.effect) for s in search.steps] == [("remove", second)]
    # The set on these steps is what remains.
    assert search.added == (first,)
    assert search.best.chi2 == 2 * left


@pytest.mark.parametrize("solver", [False, True])
def test_a_member_gives_way_only_to_what_is_better_on_equal_steps(
    monkeypatch: pytest.MonkeyPatch, solver: bool
) -> None:
    found = searched(beta=1.0, f_c=0.02)
    first, second = found.added
    offered = found._in_place_of(second).children((first,))
    worse = next((added, r) for added, r in offered if added[-1] == "quintic_stiffness")
    search = copy(found)
    search.steps, search._stood_for = [], {}
    search.best = changed(Node.of(*worse, search.case), chi2=worse[1].chi2, held=2 * found.best.held)
    needed = Verdict(True, "", {})
    monkeypatch.setattr(Search, "_weighed", lambda self, effect: (needed, self._without(effect), self.best))
    monkeypatch.setattr(Search, "_left", lambda self, node: 0.0)
    if solver:
        # On the steps of the better one the member serves as well.
        monkeypatch.setattr("discovery.search.shortened", lambda refit, bench: found.best.refit)
    search._retry(worse[0][-1])
    assert (search.added[-1] == second) is not solver


def test_where_a_pair_leaves_noise_no_single_effect_more_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    found = searched(beta=1.0, f_c=0.02)
    assert len(found.added) == 2
    search = copy(found)
    search.best, search.steps = found.root, []
    search._branches = Branches(search.case, search.root.refit.problem.bench)
    # Neither passes alone, both together do.
    monkeypatch.setattr(search, "_passes", lambda node: len(node.added) == 2)
    search._extend()
    assert set(search.added) == set(found.added)
    assert set(search._branches._made) == {frozenset()}


def test_a_start_that_had_stopped_short_is_fitted_again_and_needs_no_effect() -> None:
    clean = searched()
    good = clean.root
    short = replace(good.refit.minimum, cost=good.refit.minimum.cost + 500)
    search = copy(clean)
    search.root = search.best = replace(good, refit=replace(good.refit, minimum=short), held=good.held + 500)
    search.steps = []
    offered = Branches(search.case, search.root.refit.problem.bench).of(good).refits[0]
    node = Node.of((offered.effect,), offered, search.case)
    assert search._leads_back(node)
    assert search.added == ()
    assert search.root.chi2 == pytest.approx(good.chi2, abs=0.1)
    assert [(s.action, s.effect) for s in search.steps] == [("withdraw", offered.effect)]
    # From the best minimum it leads nowhere else.
    assert not search._leads_back(node)


def test_the_story_tells_every_decision() -> None:
    search = searched(beta=1.0, f_c=0.02)
    kept = [s.effect for s in search.steps if s.action == "add" and s.accepted]
    assert set(search.added) <= set(kept)
    assert all(s.reason for s in search.steps)


def test_the_same_seed_gives_the_same_answer() -> None:
    first = searched(beta=1.0, f_c=0.02)
    searched.cache_clear()
    again = searched(beta=1.0, f_c=0.02)
    assert first.evidence == again.evidence
    assert first.best.refit.values == again.best.refit.values


@pytest.mark.parametrize(("bump", "added"), [(0.0, "coulomb_friction"), (0.1, "stribeck_friction")])
def test_a_member_that_has_become_a_simpler_law_is_called_so(bump: float, added: str) -> None:
    search = copy(searched(beta=1.0, f_k=0.02, **({"f_b": bump, "v_s": 0.3} if bump else {})))
    problem = search.root.refit.problem
    model = problem.model.with_effect("cubic_stiffness", "stribeck_friction")
    richer = Problem(model, problem.bench, problem.units, problem.gaussian)
    values = {**search.root.refit.values, "beta": 1.0, "f_k": 0.02, "f_b": bump, "v_s": 0.3}
    (found,) = settled([richer], [richer.start(values)])
    search.best, search.steps = Node.of(("cubic_stiffness", "stribeck_friction"), found, search.case), []
    # From its own values: nothing is screened, and no other effect is tried.
    search._branches = None
    search._reduce("cubic_stiffness")
    search._reduce("stribeck_friction")
    assert search.added == ("cubic_stiffness", added)
    assert [(s.action, s.effect) for s in search.steps] == ([] if bump else [("exchange", "stribeck_friction")])
    if not bump:
        assert search.best.refit.values["f_c"] == pytest.approx(0.02, rel=0.1)


def test_a_member_gives_way_to_no_law_that_is_declared_or_blows_up(monkeypatch: pytest.MonkeyPatch) -> None:
    search = copy(searched(beta=1.0, f_k=0.02))
    problem = search.root.refit.problem
    for declared in (("coulomb_friction",), ()):
        model = problem.model.with_effect(*declared, "stribeck_friction")
        richer = Problem(model, problem.bench, problem.units, problem.gaussian)
        (found,) = settled([richer], [richer.start({**search.root.refit.values, "f_k": 0.02})])
        search.best = Node.of(("stribeck_friction",), found, search.case)
        assert len(search._simpler("stribeck_friction")) == (not declared)
    blown = replace(found, minimum=replace(found.minimum, cost=np.inf))
    monkeypatch.setattr("discovery.search.reduced", lambda *asked: blown)
    assert search._simpler("stribeck_friction") == []
