"""Sizes that keep the package readable: modules, functions and calls, in every room."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

import discovery

ROOT = Path(discovery.__file__).parent
LONGEST_MODULE, LONGEST_FUNCTION, MOST_POSITIONAL = 300, 40, 6

#: What is longer still, each to be shortened when it is next changed.
LONG_MODULES: set[str] = set()
LONG_FUNCTIONS = {
    "export/source.py:to_numpy",
    "screening/refits.py:_raced",
    "simulation/kernel/source.py:kernel_source",
}
LONG_CALLS = {
    "estimation/laplace.py:Prior",
    "estimation/laplace.py:cls",
    "screening/refits.py:Minimum",
    "estimation/log_evidence.py:cls",
    "selection/linearise.py:Linearised",
    "selection/odds.py:Candidacy",
    "selection/verdict.py:Named",
    "simulation/grid.py:cls",
}


@cache
def _sources() -> dict[str, list[str]]:
    """Return the lines of every module, by its path in the package."""
    files = sorted(ROOT.rglob("*.py"))
    return {p.relative_to(ROOT).as_posix(): p.read_text(encoding="utf-8").splitlines() for p in files}


@cache
def _long() -> tuple[set[str], set[str]]:
    """Return the long functions and the long calls, each module being read once and its tree let go."""
    functions, calls = set(), set()
    for name, lines in _sources().items():
        for node in ast.walk(ast.parse("\n".join(lines))):
            if (
                isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
                and _lines_of_code(node, lines) > LONGEST_FUNCTION
            ):
                functions.add(f"{name}:{node.name}")
            elif isinstance(node, ast.Call) and len(node.args) > MOST_POSITIONAL:
                calls.add(f"{name}:{ast.unparse(node.func)}")
    return functions, calls


def _lines_of_code(function: ast.AST, lines: list[str]) -> int:
    """Return the lines of a function without blank ones, comments and docstrings."""
    told: set[int] = set()
    for node in ast.walk(function):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and ast.get_docstring(node):
            told |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    first, last = function.lineno, function.end_lineno  # type: ignore[attr-defined]
    code = (i for i in range(first, last + 1) if i not in told)
    return sum(bool(line) and not line.startswith("#") for i in code if (line := lines[i - 1].strip()) is not None)


def _long_modules() -> set[str]:
    return {name for name, lines in _sources().items() if len(lines) > LONGEST_MODULE}


def _long_functions() -> set[str]:
    return _long()[0]


def _long_calls() -> set[str]:
    return _long()[1]


@pytest.mark.parametrize(
    ("found", "allowed"),
    [(_long_modules, LONG_MODULES), (_long_functions, LONG_FUNCTIONS), (_long_calls, LONG_CALLS)],
    ids=["modules", "functions", "positional arguments"],
)
def test_nothing_is_longer_than_agreed_and_no_exception_is_left_over(found, allowed):
    assert found() == allowed


def test_code_is_counted_without_words():
    text = 'def f(a):\n    """One.\n\n    Two.\n    """\n    # Three.\n\n    return a\n'
    (function,) = ast.parse(text).body
    assert _lines_of_code(function, text.splitlines()) == 2
