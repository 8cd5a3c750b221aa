"""Losses that are declared where the motion has another: one law takes the place of the other, or it does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from test_search import begun, context

from discovery.declarations.system import Constant, SystemDeclaration
from discovery.equations.declared_terms import declared_lines
from discovery.equations.losses import is_passive, same_losses, without_losses
from discovery.equations.model import Model
from discovery.estimation.holdout import HoldOut
from discovery.mechanics.place_sizes import place_sizes
from discovery.mechanics.systems import declared_base, system_base
from discovery.report.results import Run
from discovery.report.sentences import decision_sentence
from discovery.report.story import searches
from discovery.rigs.rig_system import ready_made
from discovery.selection.contender import Contender
from discovery.selection.search import Search
from discovery.selection.verdict import named


def searched(**effects: float) -> Search:
    """Search recordings with a slow wander that no catalogue holds, eight times the noise."""
    shared = context(**effects)
    bell = np.exp(-0.5 * (np.arange(-60, 61) / 20) ** 2)
    for seed, e in enumerate((*shared.train, *shared.judge.separate)):
        wander = np.convolve(np.random.default_rng(seed).normal(size=e.recording.time.size), bell, mode="same")
        e.recording.output[:, 0] += 8 * e.recording.noise[0] * wander / wander.std()
    search = begun(shared)
    search.run()
    return search


def test_a_law_takes_the_place_of_a_loss_that_is_not_there() -> None:
    search = searched(xi=0.0, c_2=0.12)
    assert (search.offers.given_up, search.best.added) == ({"viscous_damping"}, ("quadratic_drag",))
    assert search.neighbours.root.model.effects == ("linear_stiffness",)
    assert "viscous_damping" in search.root.model.effects  # what was declared stays the measure
    assert search.best.model.effects == ("linear_stiffness", "quadratic_drag")
    (step,) = (d for d in search.decisions if d.action == "exchange")
    assert step.effects == ("viscous_damping", "quadratic_drag")
    assert step.numbers["odds"] > search.context.settings.nats
    assert search.best.refit.values["c_2"] == pytest.approx(0.12, rel=0.1)
    # What was declared, and what was offered beside it, stay rivals: one that is as likely shares the probability.
    rivals = search.neighbours.rivals(search.best, "quadratic_drag")
    assert () in [c.added for c in rivals]
    assert not any("quadratic_drag" in c.added for c in rivals)
    (alone,) = named(search)
    assert alone.probability > 0.9
    other = next(c for c in search.neighbours.kept["quadratic_drag"] if c.added not in ((), ("quadratic_drag",)))
    as_likely = replace(other, evidence=search.best.evidence, sampled=search.best.sampled)
    search.neighbours.kept = {"quadratic_drag": [as_likely]}
    (shared,) = named(search)
    assert shared.probability < 0.51
    assert shared.group == other.added


def test_no_loss_is_given_up_for_what_cannot_be_told_from_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Contender, "is_enough", lambda *_: True)
    search = searched(xi=0.0, c_2=0.12)
    assert search.offers.given_up == frozenset()
    assert not any(d.action == "exchange" and "viscous_damping" in d.effects for d in search.decisions)


@pytest.mark.parametrize("effects", [{"xi": 0.08}, {"xi": 0.08, "c_2": 0.3}])
def test_a_loss_that_is_there_stays(effects: dict[str, float]) -> None:
    search = searched(**effects)
    assert search.offers.given_up == frozenset()
    assert "viscous_damping" in search.best.model.effects
    assert search.best.refit.values["xi"] == pytest.approx(0.08, rel=0.2)


def test_a_declared_law_gives_way_to_one_that_contains_it() -> None:
    shared = context(xi=0.05, f_k=0.1, f_b=0.2, v_s=0.3)
    model = Model("oscillator", ("viscous_damping", "linear_stiffness", "coulomb_friction"))
    parts = (shared.train, shared.judge.separate)
    train, held = ([replace(e, rig=replace(e.rig, declared=model.effects)) for e in part] for part in parts)
    shared = replace(shared, train=train, judge=HoldOut(train, held, shared.units, shared.settings.tolerance))
    search = Search(shared.fit(model, {"xi": 0.05, "alpha": 9.0, "f_c": 0.03}, {}), shared)
    search.run()
    assert (search.offers.given_up, search.best.added) == ({"coulomb_friction"}, ("stribeck_friction",))
    (step,) = (d for d in search.decisions if d.action == "exchange")
    assert (step.code, step.effects) == ("contained", ("coulomb_friction", "stribeck_friction"))
    assert decision_sentence(step.summary()) == "Stribeck friction contains Coulomb friction"
    assert search.best.refit.values["f_k"] == pytest.approx(0.1, rel=0.05)  # held twice, neither would be told


def test_losses_that_are_stated_are_not_in_question() -> None:
    assert without_losses(Model("oscillator", ("viscous_damping",), known={"xi": 0.1})) == {}


def test_of_a_declared_system_the_factors_of_its_losses_are_in_question() -> None:
    for name, declaration in ready_made().items():
        base = system_base(declaration)
        read = base.equations
        for loss, other in without_losses(Model(base.name, ())).items():
            assert other.known[loss] == 0.0, name
            assert loss in {x.name for x in read.dissipation.free_symbols}, name
            left = [line for line in declared_lines(declared_base(base.name), other.known) if line.name == "D"]
            assert all(loss not in {x.name for x in line.value.free_symbols} for line in left), name
    motor = system_base(ready_made()["dc_motor"])
    assert [*without_losses(Model(motor.name, ()))]


@pytest.mark.parametrize(
    ("system", "constant", "passive"),
    [
        ("two_mass_drive", "stiffness", True),
        ("two_mass_drive", "joint_loss", True),
        ("two_mass_drive", "load_inertia", False),
        ("dc_motor", "inertia", False),
    ],
)
def test_what_stores_or_takes_energy_has_one_sign(system: str, constant: str, passive: bool) -> None:
    base = system_base(ready_made()[system])
    names = {p.name for p in base.parameters()}
    assert constant in names, names
    assert is_passive(Model(base.name, (), known={}), constant) == passive


LOSS = {1: "N s m^-1", 2: "N s^2 m^-2"}


def declared(potential: str, dissipation: str) -> Model:
    """Return the model of a body on one coordinate."""
    units = {"mass": "kg", "spring": "N m^-1", "curl": "N m^-3", "loss": LOSS[1 + dissipation.count("abs")]}
    constants = {n: Constant(unit, 1.0, free=n != "mass") for n, unit in units.items()}
    system = SystemDeclaration(
        name="a body", coordinates={"x": "m"}, constants=constants, kinetic="mass*dot(x)^2/2", potential=potential,
        dissipation=dissipation, output="x", places={"body": "x", "half": "x/2"},
    )  # fmt: skip
    return Model(system_base(system).name, ())


def test_a_spring_beside_others_and_what_feeds_energy_may_have_either_sign() -> None:
    only = declared("spring*x^2/2", "loss*dot(x)^2/2")
    assert is_passive(only, "spring")
    beside = declared("spring*x^2/2 + curl*x^4/4", "-loss*dot(x)^2/2")
    assert not any(is_passive(beside, name) for name in ("spring", "curl", "loss"))
    assert without_losses(beside) == {}


def test_a_loss_of_a_system_is_viscous_damping_at_its_places() -> None:
    plain = declared("spring*x^2/2 + curl*x^4/4", "loss*dot(x)^2/2")
    assert same_losses(plain, "loss") == {"viscous_damping_at_body", "viscous_damping_at_half"}
    drag = declared("spring*x^2/2 + curl*x^4/4", "loss*dot(x)^2*abs(dot(x))/3")
    assert same_losses(drag, "loss") == frozenset()


def test_drag_along_a_way_in_a_plane_has_no_size_at_rest() -> None:
    """Its slope there is 0 over 0."""
    constants = {"mass": Constant("kg", 1.0), "g": Constant("m s^-2", 9.81)}
    constants["drag"] = Constant("kg m^-1", 0.1, free=True)
    speed = "sqrt(dot(x)^2 + dot(y)^2)"
    system = SystemDeclaration(
        name="a ball in the air", coordinates={"x": "m", "y": "m"}, constants=constants,
        kinetic="mass*(dot(x)^2 + dot(y)^2)/2", potential="mass*g*y", dissipation="0",
        forces={"x": f"-drag*{speed}*dot(x)", "y": f"-drag*{speed}*dot(y)"}, output="y", places={"air": "y"},
    )  # fmt: skip
    moved, time = place_sizes(system_base(system), 1.0, 1.0, 2.0)["air"]
    assert np.isfinite([moved, time]).all()


def test_the_page_tells_the_search_that_goes_on_from_a_law_in_the_place_of_a_loss() -> None:
    """What was added beside the loss goes with it."""

    def step(action: str, effects: list[str], *, candidates: Sequence[str] = ()) -> dict[str, Any]:
        told = [{"effects": [e]} for e in candidates]
        return {"action": action, "effects": effects, "accepted": True, "code": "accepted", "candidates": told}

    steps = [
        step("add", ["hysteresis"], candidates=["hysteresis"]),
        step("exchange", ["viscous_damping", "quadratic_drag"]),
        step("add", ["sensor_delay"], candidates=["sensor_delay"]),
    ]
    run = cast(Run, SimpleNamespace(loop={"steps": steps}))
    assert [found.beside for found in searches(run)] == [(), ("quadratic_drag",)]
