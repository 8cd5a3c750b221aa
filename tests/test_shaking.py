from __future__ import annotations

import pytest
from test_search import DECLARED, TRUTH, UNITS, pushes, recorded

from discovery.bench import Bench
from discovery.fit import fit_near
from discovery.model import Model
from discovery.problem import Problem
from discovery.refits import Refit
from discovery.shaking import shaken

FORCE = {"a_s": 0.2, "a_c": 0.1, "Omega": 4.6}


def pulsed(start: dict[str, float]) -> Refit:
    """Return the fit of a spring with a periodic force, which has a minimum for every beat, from a start."""
    train = recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0, **FORCE)
    model = Model("oscillator", (*DECLARED, "periodic_disturbance"))
    problem = Problem(model, Bench("oscillator", model.effects, [train], 0.01), UNITS, {})
    return Refit("periodic_disturbance", problem, fit_near(problem, {**TRUTH, **FORCE, **start}).minimum)


def test_a_shape_a_few_beats_away_is_found() -> None:
    wrong = pulsed({"Omega": 6.6})
    assert abs(wrong.values["Omega"] - FORCE["Omega"]) > 1.0
    found = shaken(wrong, ["periodic_disturbance"])
    assert found.chi2 < 0.01 * wrong.chi2
    assert found.values["Omega"] == pytest.approx(FORCE["Omega"], rel=1e-3)


def test_the_best_shape_stays() -> None:
    right = pulsed({})
    assert shaken(right, ["periodic_disturbance"]).chi2 == pytest.approx(right.chi2, rel=1e-3)


def test_a_law_without_shape_has_no_other() -> None:
    train = recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)
    model = Model("oscillator", DECLARED)
    problem = Problem(model, Bench("oscillator", model.effects, [train], 0.01), UNITS, {})
    plain = Refit("linear_stiffness", problem, fit_near(problem, TRUTH).minimum)
    assert shaken(plain, DECLARED) is plain
