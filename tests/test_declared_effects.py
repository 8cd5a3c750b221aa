"""Declared effects of many shapes: sought with all their starts, as candidates are."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pushed_oscillator import DECLARED, RIG, UNITS, pushes, recorded

from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.estimation.holdout import HoldOut
from discovery.runs.around_search import sought
from discovery.selection.context import Context
from discovery.selection.settings import LoopSettings


def test_a_declared_force_is_found_at_its_frequency() -> None:
    truth = {"a_s": 0.3, "a_c": 0.2, "Omega": 11.0}
    model = Model("oscillator", (*DECLARED, "periodic_disturbance"))
    rig = replace(RIG, declared=model.effects)
    train = replace(recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 1, **truth), rig=rig)
    shared = Context([train], HoldOut([train], [], UNITS, 1e-4), LoopSettings(), UNITS, lambda _: None)
    first = fit(model, [train], units=UNITS)
    found = sought(first, shared)
    assert first.values["Omega"] != pytest.approx(truth["Omega"], rel=0.05)
    assert found.chi2 < 0.5 * first.chi2
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 4 * found.sd[name]
    assert sought(found, shared) is found
