"""An unknown smooth force: it finds what no law declares, and a law that is right is cheaper than it."""

from __future__ import annotations

import numpy as np
import pytest
from pushed_oscillator import DECLARED, UNITS, pushes, recorded

from discovery.declarations.forces import SmoothForce
from discovery.declarations.registry import catalogue, get_effect
from discovery.equations.model import Model
from discovery.estimation.holdout import HoldOut
from discovery.foundation.errors import InputError
from discovery.screening.refits import Refit
from discovery.selection import unknown
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context
from discovery.selection.settings import LoopSettings
from discovery.selection.unknown import unknown_force

LAW = "amplitude_dependent_damping"


@pytest.fixture(scope="module")
def shared() -> Context:
    train = [
        recorded(n, pushes(*p), k, xi_2=2.0)
        for k, (n, p) in enumerate({"a": (1, -2, 0.5, 0), "b": (2, 0, -1, 1)}.items())
    ]
    return Context(train, HoldOut(train, [], UNITS, 2e-5), LoopSettings(), UNITS, lambda _: None)


def weighed(shared: Context, *effects: str) -> Contender:
    model = Model("oscillator", (*DECLARED, *effects))
    found = shared.fit(model, {}, {})
    return contenders(shared, [(effects, Refit("", found.problem, found.minimum))])[0]


def test_it_explains_what_the_model_lacks(shared: Context) -> None:
    found = unknown_force(shared, weighed(shared))
    assert found.train > 100
    assert not found.kept


def test_a_law_that_is_right_is_cheaper(shared: Context) -> None:
    found = unknown_force(shared, weighed(shared, LAW))
    assert found.kept[LAW] > 3
    assert found.instead[LAW] < 0
    assert found.train < 3


def test_a_wrong_law_is_told(shared: Context) -> None:
    found = unknown_force(shared, weighed(shared, "quadratic_drag"))
    assert found.instead["quadratic_drag"] > 3 > found.kept["quadratic_drag"]


def test_what_moves_nothing_finite_without_a_law_is_not_weighed(
    shared: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    weigh = unknown._integrated

    def blown_up(context: Context, refits: list[Refit]) -> tuple[float, float]:
        with_law = LAW in refits[0].problem.model.effects
        return weigh(context, refits) if with_law else (-np.inf, -np.inf)

    monkeypatch.setattr(unknown, "_integrated", blown_up)
    found = unknown_force(shared, weighed(shared, LAW))
    assert np.isfinite(found.train)
    assert not found.kept
    assert not found.instead


def test_it_is_in_no_catalogue() -> None:
    assert SmoothForce.id() not in catalogue()
    assert get_effect(SmoothForce.id()).parameters() == SmoothForce.parameters()
    with pytest.raises(InputError):
        get_effect("smoothed_force")


def test_its_powers_are_those_of_position_and_rate() -> None:
    at = {s.name: v for s, v in zip(sorted(SmoothForce().expression().free_symbols, key=str), range(99), strict=False)}
    force = SmoothForce().expression()
    values = {s: float(at[s.name]) for s in force.free_symbols}
    q, rate = at["delta"], at["delta_dot"]
    expected = sum(v * q ** int(n[-2]) * rate ** int(n[-1]) for n, v in at.items() if n.startswith("smooth"))
    assert float(force.subs(values)) == pytest.approx(expected)
    assert np.isfinite(expected)
