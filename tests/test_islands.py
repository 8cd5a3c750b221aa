"""Loops of absent effects may be left out: checked by evaluating plans of random mathematics, step by step."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.equations.program import build_program
from discovery.simulation.kernel.islands import NOBODY, Plan, plan
from discovery.simulation.kernel.source import kernel_source

a, b, c, d, x, y, z = sp.symbols("a b c d x y z", real=True)
SWITCHES = {a: "first", b: "second", c: "second", d: "third"}
NAMES = sp.symbols("n_0:6", real=True)
OUT = sp.symbols("out_0:2", real=True)


def evaluated(found: Plan, known: dict[sp.Symbol, float], present: set[str]) -> dict[sp.Symbol, float]:
    """Run the loops of effects that are present; a symbol that nobody computed must not be read."""
    values = dict(known)
    for target, expression in found.once:
        values[target] = float(expression.xreplace(values))
    for loop in found.loops:
        if loop.effects is not None and not loop.effects & present:
            continue
        for piece in loop.pieces:
            assert piece.expression.free_symbols <= set(values), piece
            value = float(piece.expression.xreplace(values))
            values[piece.target] = values[piece.target] + value if piece.adds else value
    return values


@st.composite
def terms(draw: st.DrawFn, known: list[sp.Symbol]) -> sp.Expr:
    symbol = st.sampled_from(known)
    shape = draw(st.integers(0, 5))
    one, two, three = draw(symbol), draw(symbol), draw(symbol)
    return [
        one,
        one * two,
        sp.sin(one) * two,
        one * (two + three),
        one / (2 + sp.cos(two + three)),
        one * sp.sqrt(1 + two**2),
    ][shape]


@st.composite
def programs(draw: st.DrawFn) -> list[tuple[sp.Symbol, sp.Expr]]:
    found, known = [], [*SWITCHES, x, y, z]
    for name in NAMES:
        found.append((name, sp.Add(*draw(st.lists(terms(known), min_size=1, max_size=4)))))
        known.append(name)
    return found


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(programs(), st.sets(st.sampled_from(["first", "second", "third"])))
def test_what_is_left_out_changes_no_output(program: list[tuple[sp.Symbol, sp.Expr]], present: set[str]) -> None:
    outputs = [(OUT[0], NAMES[-1]), (OUT[1], NAMES[-2] * x + a)]
    found = plan(program, outputs, switches=SWITCHES, parameters=list(SWITCHES))
    rng = np.random.default_rng(0)
    known = {
        s: float(rng.uniform(0.3, 1.0)) * (SWITCHES.get(s, "") in present or s not in SWITCHES)
        for s in (a, b, c, d, x, y, z)
    }
    values = evaluated(found, known, present)
    for name, expression in (*program, *outputs):
        known[name] = float(expression.xreplace(known))
    for out, _ in outputs:
        assert values[out] == pytest.approx(known[out], rel=1e-12, abs=1e-12)


def test_what_only_an_effect_needs_runs_for_it_alone() -> None:
    found = plan(
        [(NAMES[0], sp.sin(x)), (NAMES[1], x + y * NAMES[0] * a)],
        [(OUT[0], NAMES[1])],
        switches={a: "first"},
        parameters=[a],
    )
    assert found.needs[NAMES[0]] == frozenset({"first"})
    assert found.needs[x] is None
    assert {loop.effects for loop in found.loops} == {None, frozenset({"first"})}


def test_a_memory_is_followed_where_its_force_acts_and_not_at_all_without() -> None:
    slope, idle = sp.symbols("slope idle", real=True)
    outputs = [(OUT[0], x + a * z), (slope, y - z), (idle, -y)]
    found = plan([], outputs, switches={a: "first"}, parameters=[a], rates={slope: z, idle: d})
    assert found.needs[z] == frozenset({"first"})
    assert found.needs[d] == NOBODY
    assert idle not in {piece.target for loop in found.loops for piece in loop.pieces}


def test_the_core_is_cut_once_where_one_effect_stands_in_its_middle() -> None:
    chain = [
        (NAMES[0], sp.sin(x)),
        (NAMES[1], NAMES[0] + y),
        (NAMES[2], NAMES[1] + a * sp.cos(y)),
        (NAMES[3], sp.cos(NAMES[2])),
    ]
    found = plan(chain, [(OUT[0], NAMES[3]), (OUT[1], NAMES[1])], switches={a: "first"}, parameters=[a])
    assert [loop.effects for loop in found.loops] == [None, frozenset({"first"}), None]


def test_numbers_of_parameters_alone_are_computed_once() -> None:
    found = plan([], [(OUT[0], x / (1 + a**2) ** 2)], switches={}, parameters=[a])
    assert len(found.once) == 1
    assert found.once[0][1].free_symbols == {a}


def test_the_same_program_gives_the_same_text() -> None:
    effects = ("linear_stiffness", "quadratic_drag", "table_tilt")
    switches = {"quadratic_drag": ("c_2",), "table_tilt": ("phi_x", "phi_y")}
    build_program.cache_clear()
    first = kernel_source(build_program("elastica_2", effects), 8, switches)
    build_program.cache_clear()
    assert kernel_source(build_program("elastica_2", effects), 8, switches) == first
