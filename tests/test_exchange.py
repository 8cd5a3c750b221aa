"""What may take the place of a member of a set begins where the set with that member is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pushed_oscillator import DECLARED
from scipy.optimize import minimize
from test_search import begun, context

from discovery.equations.model import Model
from discovery.estimation.problem import Problem
from discovery.screening.exchange import _to_first_order, exchange_starts
from discovery.screening.refits import settle
from discovery.selection.contender import Contender
from discovery.selection.search import Search
from discovery.selection.settings import Budget, LoopSettings


@given(seed=st.integers(0, 10_000), alike=st.booleans())
def test_a_step_is_the_least_within_bounds(seed: int, *, alike: bool) -> None:
    rng = np.random.default_rng(seed)
    columns, residual = rng.standard_normal((40, 3)), 20.0 * rng.standard_normal(40)
    if alike:  # two numbers that do the same: neither runs away
        columns[:, 1] = columns[:, 0]
    scale, x = np.array([1.0, 10.0, 0.1]), rng.standard_normal(3)
    bounds = x - rng.uniform(0.0, 2.0, 3), x + rng.uniform(0.0, 2.0, 3)
    problem: Any = SimpleNamespace(names=["a", "b", "c"], scale=scale, bounds=bounds)
    slopes = dict(zip("abc", columns.T, strict=True))
    left, moved = _to_first_order(problem, dict(zip("abc", x.tolist(), strict=True)), slopes, residual)

    def cost(step: np.ndarray) -> float:
        return float(np.square(residual + columns @ step).sum() + np.square(step / scale).sum())

    step = np.array([moved[n] for n in "abc"]) - x
    assert left == pytest.approx(np.square(residual + columns @ step).sum(), rel=1e-6)
    assert (step >= bounds[0] - x - 1e-9).all()
    assert (step <= bounds[1] - x + 1e-9).all()
    free = [*zip(bounds[0] - x, bounds[1] - x, strict=True)]
    assert cost(step) <= minimize(cost, np.zeros(3), bounds=free).fun * (1 + 1e-6)


def settled_on(search: Search, effect: str) -> Contender:
    """Return the set with one effect, at its minimum."""
    (found,) = (c for c in search.offers.beside(search.root) if c.added == (effect,))
    return found


def test_what_serves_as_well_begins_at_its_minimum() -> None:
    """A large offset of the rest is one of the sensor where no gravity tells them apart: the start is all but there."""
    search = begun(context(delta_0=0.1))
    found = settled_on(search, "equilibrium_offset")
    starts = exchange_starts(found.refit, "equilibrium_offset", search.offers.scored(found))
    name, _, others = next(s for s in starts if s[0] == "angle_offset")
    problem = found.refit.problem
    model = Model("oscillator", (*DECLARED, name), problem.model.known)
    other = Problem(model, problem.bench, problem.units, problem.gaussian)
    x = other.start(others)
    (minimum,) = settle([other], [x])
    begins = float(np.square(other.bench.residuals(*other.expand(x[:, None]))).sum())
    assert begins < 1.5 * 2 * minimum.cost
    assert begins < 1e-3 * search.root.chi2


def test_rivals_are_asked_for_where_the_catalogue_is_not_tried_again() -> None:
    search = begun(context(settings=LoopSettings(budget=Budget(offers=1)), delta_0=0.1))
    found = settled_on(search, "equilibrium_offset")
    # As beside a set that cannot be extended any more.
    search.neighbours.affords = lambda _: False  # type: ignore[method-assign]
    instead = search.neighbours.instead_of(found, "equilibrium_offset")
    assert ("angle_offset",) in [c.added for c in instead]
