"""The compiled kernel: one program, many parameter sets side by side, cached on disk across processes.

Every lane of a block is one parameter set; the loops over lanes have a constant length, all numbers of a block live in
one flat array at constant offsets, and the mathematics is branch-free, so the compiler vectorises across lanes. Time
stepping is the classical Runge-Kutta method of order four on a grid that respects the kinks of the drive, or where a
few smooth terms are all there is, on demand, that of Dormand and Prince of order eight with far longer steps; states
that forget fast take the exponential method of Cox and Matthews (`forgetting`). Outputs at arbitrary times come from
quintic Hermite interpolation of the coordinates (positions, rates and accelerations at both ends of a step).
"""

from __future__ import annotations

import hashlib
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from inspect import getsource
from types import ModuleType
from typing import Any

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.equations.program import RECORDED, Program, build_program
from discovery.foundation.arrays import FloatArray
from discovery.foundation.compiled_function import keep_compiled
from discovery.foundation.disk_cache import compiler_versions, kept, source_hash
from discovery.mechanics import get_base
from discovery.simulation.kernel.source import kernel_source
from discovery.simulation.kernel.text import assignments, printed
from discovery.simulation.runge_kutta import CLASSICAL, Method, dormand_prince

#: No thread may use a module that another is still importing.
_LOADING = threading.Lock()
#: Begin of the names of generated modules.
_GENERATED = "discovery_kernel_"
#: What the text of a kernel follows from: an edit elsewhere leaves what is kept.
ROOMS = ("declarations", "effects", "equations", "foundation", "mechanics", "simulation")
#: What is called where a kernel begins and ends to be compiled.
_LISTENING: list[tuple[Callable[[], object], Callable[[], object]]] = []


@dataclass(frozen=True)
class Kernel:
    """A compiled simulator of one base with a set of effects."""

    run: Any  # the compiled loop, see ``template.txt`` for its arguments
    program: Program  # what it computes
    lanes: int  # parameter sets in one block
    #: (e, p): one where a parameter is an amplitude of an effect; an effect is absent where all of its amplitudes are
    #: zero.
    switches: FloatArray
    method: Method  # by which it takes its steps

    @property
    def is_compiled(self) -> bool:
        """Whether it has been called before."""
        return bool(self.run.signatures)


def _switches(effect_ids: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the amplitudes of every effect that can be absent, which it is where they are all zero."""
    found = {}
    for effect in map(get_effect, effect_ids):
        sizes = [p for p in effect.parameters() if not p.shape]
        if sizes and all(p.default == 0.0 and p.bounds[0] <= 0.0 for p in sizes):
            found[effect.id()] = tuple(p.name for p in sizes)
    return found


def _load(source: str) -> ModuleType:
    """Return the module of generated source, whose compiled code is kept on disk; its text itself is not."""
    from discovery.simulation.kernel import lanes, straight_line, vectormath

    used = (getsource(module) for module in (lanes, straight_line, vectormath))
    stamp = f"{source}{''.join(used)}{compiler_versions()}"
    key = hashlib.sha256(stamp.encode()).hexdigest()
    name = f"{_GENERATED}{key[:20]}"
    if name in sys.modules:
        return sys.modules[name]
    _listen()
    module = ModuleType(name)
    # What is loaded from disk looks its module up by name.
    sys.modules[name] = module
    exec(compile(source, f"<{name}>", "exec"), vars(module))
    keep_compiled(module.run, key)
    return module


@cache
def _listen() -> None:
    """Hear of the compiler where it works on a kernel, not where it loads one from its disk cache."""
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event) -> None:
            self._call(event, 0)

        def on_end(self, event) -> None:
            self._call(event, 1)

        def _call(self, event, which: int) -> None:
            function = event.data["dispatcher"].py_func
            # The module of a function that others made from text is None.
            if (function.__module__ or "").startswith(_GENERATED) and function.__name__ == "run":
                for calls in _LISTENING:
                    calls[which]()

    event.register("numba:compile", Listener())


@contextmanager
def heard_compiling(began: Callable[[], object], ended: Callable[[], object] = lambda: None) -> Iterator[None]:
    """Call functions in this context whenever a kernel begins and ends to be compiled, which may take a minute."""
    calls = (began, ended)
    _LISTENING.append(calls)
    try:
        yield
    finally:
        _LISTENING.remove(calls)


def _written(base_name: str, effect_ids: tuple[str, ...], method: Method) -> tuple[Program, str]:
    """Return a program and the text of its kernel."""
    program = build_program(base_name, effect_ids)
    # A copy: functions made on demand, which the original may hold, cannot be kept on disk.
    return replace(program), kernel_source(program, get_base(base_name).lanes, _switches(effect_ids), method)


def _kept(base_name: str, effect_ids: tuple[str, ...], method: Method) -> tuple[Program, str]:
    """Return the same from disk where it was written before: symbolic algebra takes a second or so."""
    if any(not type(get_effect(e)).__module__.startswith("discovery.") for e in effect_ids):
        # What effects of other packages follow from is not known.
        return _written(base_name, effect_ids, method)
    key = repr(("kernel", base_name, effect_ids, method, source_hash(*ROOMS)))
    return kept(key, lambda: _written(base_name, effect_ids, method))


@lru_cache(maxsize=128)
def compile_kernel(base_name: str, effect_ids: tuple[str, ...], method: Method = CLASSICAL) -> Kernel:
    """Return the compiled kernel of a base with a set of effects, from disk where it was compiled before.

    `base_name`: name of the base. `effect_ids`: effects; the order sets the order of the parameters. `method`: of the
    steps, where it suits the terms; `Kernel.method` says. Returned: compiled on its first call.
    """
    switches = _switches(effect_ids)
    with _LOADING:
        program, source = _kept(base_name, effect_ids, method)
        module = _load(source)
    rows = np.array([np.isin(program.parameters, names) for names in switches.values()], float)
    rows = rows.reshape(len(switches), len(program.parameters))
    taken = method if method.order == module.ORDER else CLASSICAL
    return Kernel(module.run, program, get_base(base_name).lanes, rows, taken)


def leaps(base_name: str, effect_ids: tuple[str, ...]) -> bool:
    """Return whether the terms of a base with some effects suit the method of order eight."""
    return compile_kernel(base_name, effect_ids, dormand_prince()).method.order > CLASSICAL.order


def numpy_derivative(program: Program) -> Callable[..., list]:
    """Return ``f(t, recorded, state, parameters) -> slopes`` evaluated by numpy from the same printed text.

    `recorded` holds the input and its two derivatives, `state` and `parameters` are sequences in the program's order;
    any of them may be arrays. It serves as the reference for the kernel and for static equilibria.
    """
    lines = [f"    {', '.join(program.parameters)}, = parameters"] if program.parameters else []
    lines += [f"    {', '.join(y.name for y in program.states)}, = state"]
    lines += [f"    {', '.join(r.name for r in RECORDED)}, = recorded"]
    lines += assignments((*program.drive, *program.derivative))
    lines.append(f"    return [{', '.join(printed(e) for e in program.slopes)}]")
    functions = {"_sin": np.sin, "_cos": np.cos, "_atan2": np.arctan2, "_exp": np.exp, "_sqrt": np.sqrt, "abs": np.abs}
    namespace: dict[str, Any] = {**functions, "math": np}
    exec("def derivative(t, recorded, state, parameters):\n" + "\n".join(lines), namespace)
    return namespace["derivative"]
