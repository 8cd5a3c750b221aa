"""The compiled kernel: one program, many parameter sets side by side, cached on disk across processes.

Every lane of a block is one parameter set; the loops over lanes have a constant length, all numbers of a block live in
one flat array at constant offsets, and the mathematics is branch-free, so the compiler vectorises across lanes. Time
stepping is the classical Runge-Kutta method of order four on a grid that respects the kinks of the drive; outputs at
arbitrary times come from quintic Hermite interpolation of the coordinates (positions, rates and accelerations at both
ends of a step), whose error is below that of the step.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from discovery.mechanics import get_base
from discovery.program import RECORDED, Program, build_program

__all__ = ["Kernel", "compile_kernel", "numpy_derivative"]

_TEMPLATE = Path(__file__).with_name("kernel_template.txt")


class _Printer(PythonCodePrinter):
    """Prints sympy as Python that both numpy and the compiler read; powers become products."""

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.as_base_exp()
        if exponent.is_Rational and exponent.q in (1, 2, 4) and 0 < abs(exponent.p) <= 12:
            factor = f"({self._print(base)})"
            for _ in range(exponent.q // 2):
                factor = f"_sqrt({factor})"
            product = "*".join([factor] * abs(exponent.p))
            return f"({product})" if exponent > 0 else f"(1.0/({product}))"
        return f"({self._print(base)})**({self._print(exponent)})"

    def _print_sin(self, expr):
        return f"_sin({self._print(expr.args[0])})"

    def _print_cos(self, expr):
        return f"_cos({self._print(expr.args[0])})"

    def _print_atan2(self, expr):
        return f"_atan2({self._print(expr.args[0])}, {self._print(expr.args[1])})"

    def _print_atan(self, expr):
        return f"_atan2({self._print(expr.args[0])}, 1.0)"

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Pi(self, expr):
        return repr(float(sp.pi))


_print = _Printer({"fully_qualified_modules": True}).doprint


@dataclass(frozen=True)
class Kernel:
    """A compiled simulator of one base with a set of effects.

    Parameters
    ----------
    run : callable
        The compiled loop, see ``kernel_template.txt`` for its arguments.
    program : Program
        What it computes.
    lanes : int
        Parameter sets in one block.
    """

    run: Callable[..., None]
    program: Program
    lanes: int


def _assignments(pairs, indent: str) -> list[str]:
    return [f"{indent}{symbol.name} = {_print(expression)}" for symbol, expression in pairs]


def _source(program: Program, lanes: int) -> str:
    """Return the text of the kernel's module."""
    n_parameters, n_states, n_q = len(program.parameters), len(program.states), program.n_coordinates
    seen = set().union(*[e.free_symbols for e in program.reading], program.lateness.free_symbols)
    drive_used = any(a in seen for a, _ in program.drive)
    if drive_used:
        seen |= set().union(*[e.free_symbols for _, e in program.drive[:1]])
    # Rates and memory are interpolated where the reading needs them.
    n_rates = max((k + 1 - n_q for k, y in enumerate(program.states) if k >= n_q and y in seen), default=0)
    offset = {}
    position = 0
    for label, rows in (
        ("P", n_parameters),
        ("Y", n_states),
        ("S", n_states),
        ("K", n_states),
        ("F", n_states),
        ("A", n_states),
        ("Q", n_q + n_rates),
        ("D", 3),
        ("R", len(program.reading)),
    ):
        offset[label] = position
        position += rows * lanes
    used = set().union(
        *[e.free_symbols for _, e in (*program.drive, *program.derivative)], *[e.free_symbols for e in program.slopes]
    )
    indent = " " * 8
    derivative = [
        f"{indent}{p} = w[{offset['P'] + k * lanes} + i]"
        for k, p in enumerate(program.parameters)
        if sp.Symbol(p, real=True) in used
    ]
    derivative += [f"{indent}{y.name} = w[{offset['S'] + k * lanes} + i]" for k, y in enumerate(program.states)]
    derivative += _assignments(program.drive, indent) + _assignments(program.derivative, indent)
    derivative += [f"{indent}w[{offset['K'] + k * lanes} + i] = {_print(e)}" for k, e in enumerate(program.slopes)]
    parameters = [
        f"{indent}{p} = w[{offset['P'] + k * lanes} + i]"
        for k, p in enumerate(program.parameters)
        if sp.Symbol(p, real=True) in seen
    ]
    observe = list(parameters)
    sampled = program.states[: n_q + n_rates]
    observe += [f"{indent}{y.name} = w[{offset['Q'] + k * lanes} + i]" for k, y in enumerate(sampled)]
    if drive_used:
        observe += [f"{indent}{r.name} = w[{offset['D'] + k * lanes} + i]" for k, r in enumerate(RECORDED)]
        observe += _assignments(program.drive[:1], indent)
    observe += [f"{indent}w[{offset['R'] + k * lanes} + i] = {_print(e)}" for k, e in enumerate(program.reading)]
    late = [line[4:] for line in parameters] + [f"    return {_print(program.lateness)} + 0.0 * t"]
    text = _TEMPLATE.read_text(encoding="utf-8")
    for key, value in {
        "@LANES@": str(lanes),
        "@N_PARAMETERS@": str(n_parameters),
        "@N_STATES@": str(n_states),
        "@N_Q@": str(n_q),
        "@N_V@": str(n_rates),
        "@N_READING@": str(len(program.reading)),
        "@SIZE@": str(position),
        "@LATE@": str(program.lateness != 0),
        "@DERIVATIVE@": "\n".join(derivative),
        "@OBSERVE@": "\n".join(observe),
        "@LATENESS@": "\n".join(late),
        **{f"@{label}@": str(value) for label, value in offset.items()},
    }.items():
        text = text.replace(key, value)
    return text


def _cache_folder() -> Path:
    """Return a writable folder for generated kernels: DISCOVERY_CACHE, the user's cache, else a temporary one."""
    from platformdirs import user_cache_path

    chosen = os.environ.get("DISCOVERY_CACHE")
    folder = Path(chosen) if chosen else user_cache_path("discovery") / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="discovery-kernels-"))
    return folder


def _load(source: str) -> ModuleType:
    """Import generated source from a file named by its hash, so that the compiler's disk cache applies."""
    from discovery import vectormath

    key = hashlib.sha256((source + Path(vectormath.__file__).read_text(encoding="utf-8")).encode()).hexdigest()[:20]
    name = f"discovery_kernel_{key}"
    if name in sys.modules:
        return sys.modules[name]
    path = _cache_folder() / f"{name}.py"
    if not path.exists():
        with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".tmp", delete=False, encoding="utf-8") as file:
            file.write(source)
        os.chmod(file.name, 0o644)
        os.replace(file.name, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # The compiler's cache looks the module up by its name.
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@lru_cache(maxsize=128)
def compile_kernel(base_name: str, effect_ids: tuple[str, ...]) -> Kernel:
    """Return the compiled kernel of a base with a set of effects, from disk where it was compiled before.

    Parameters
    ----------
    base_name : str
        Name of the base.
    effect_ids : tuple of str
        Effects; the order sets the order of the parameters.

    Returns
    -------
    Kernel
        Compiled on its first call.
    """
    program = build_program(base_name, effect_ids)
    lanes = get_base(base_name).lanes
    return Kernel(_load(_source(program, lanes)).run, program, lanes)


def numpy_derivative(program: Program) -> Callable[..., list]:
    """Return ``f(t, recorded, state, parameters) -> slopes`` evaluated by numpy from the same printed text.

    `recorded` holds the input and its two derivatives, `state` and `parameters` are sequences in the program's order;
    any of them may be arrays. It serves as the reference for the kernel and for static equilibria.
    """
    import numpy as np

    lines = [f"    {', '.join(program.parameters)}, = parameters"] if program.parameters else []
    lines += [f"    {', '.join(y.name for y in program.states)}, = state"]
    lines += [f"    {', '.join(r.name for r in RECORDED)}, = recorded"]
    lines += _assignments(program.drive, "    ") + _assignments(program.derivative, "    ")
    lines.append(f"    return [{', '.join(_print(e) for e in program.slopes)}]")
    functions = {"_sin": np.sin, "_cos": np.cos, "_atan2": np.arctan2, "_sqrt": np.sqrt, "abs": np.abs}
    namespace: dict[str, Any] = {**functions, "math": np}
    exec("def derivative(t, recorded, state, parameters):\n" + "\n".join(lines), namespace)
    return namespace["derivative"]
