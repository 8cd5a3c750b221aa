"""A law in the place of one that contains it: where that stands, and where what was found would be lost."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache

import pytest
from pushed_oscillator import DECLARED, UNITS, pushes, recorded

from discovery.equations.model import Model
from discovery.estimation.holdout import HoldOut
from discovery.selection.context import Context
from discovery.selection.search import Search
from discovery.selection.settings import LoopSettings


def context(**effects: float) -> Context:
    settings = LoopSettings()
    train = recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0, **effects)
    held = recorded("held", pushes(-0.8, 1.2, 0.3, 0.0), 100, **effects)
    return Context([train], HoldOut([train], [held], UNITS, settings.tolerance), settings, UNITS, lambda _: None)


def test_a_declared_law_does_not_take_the_place_of_one_that_contains_it() -> None:
    shared = context(f_c=0.02)
    model = Model("oscillator", (*DECLARED, "coulomb_friction"))
    search = Search(shared.fit(model, {"g": 1.0, "xi": 0.08, "alpha": 9.0, "f_c": 0.02}, {}), shared)
    (larger,) = (c for c in search.offers.beside(search.root) if c.added == ("stribeck_friction",))
    search.best = larger
    search._simplify()
    assert search.best is larger


@cache
def begun() -> Search:
    shared = context(f_k=0.02, f_b=0.06, v_s=0.1)
    return Search(shared.fit(Model("oscillator", DECLARED), {"g": 1.0, "xi": 0.08, "alpha": 9.0}, {}), shared)


@pytest.mark.parametrize("share", [0.5, 1.5], ids=["accepted itself", "not accepted itself"])
def test_a_simpler_law_takes_the_place_only_where_it_is_accepted_itself(share: float) -> None:
    search = copy(begun())
    shared = search.context
    offered = {c.added: c for c in search.offers.beside(search.root)}
    larger, simpler = offered["stribeck_friction",], offered["coulomb_friction",]
    asked = [search._judged(larger, simpler)[0], search._judged(simpler, search.root)[0]]
    whole = search._judged(larger, search.root)[0]
    between, alone = (min(o.train, 2 * o.held, o.against_error) for o in asked)
    least, most = between, min(whole.train, 2 * whole.held, whole.against_error)
    assert least < alone < most
    # What an effect must gain lies where the difference of the two laws is refused, and the larger one is accepted.
    nats = least + 0.5 * (alone - least) if share < 1 else alone + 0.5 * (most - alone)
    search.context = replace(shared, settings=replace(shared.settings, nats=nats))
    search.best = larger
    search._simplify()
    assert search.best.added == (("coulomb_friction",) if share < 1 else ("stribeck_friction",))
