"""What an instrument that is late does to a residual, to first order: one motion need not be read at every age."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from weakref import WeakKeyDictionary

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from discovery.declarations.symbols import t
from discovery.equations.model import Model
from discovery.equations.program import Program
from discovery.estimation.bench import Bench
from discovery.foundation.arrays import BoolArray, FloatArray

#: Half of the difference of delays over which a residual is differentiated, in steps, the shortest ones.
_DIFFERENCE = 1e-3
#: The same changes are made around every fit of the same recordings.
_KNOWN: WeakKeyDictionary[Bench, tuple[Sequence[Mapping[str, float]], NDArray[np.float32]]] = WeakKeyDictionary()


def _delay(program: Program) -> str | None:
    """Return a parameter that is itself a constant delay of what is read, if there is one."""
    delays = (p for p in sorted(program.ageing) if sp.diff(program.lateness, sp.Symbol(p, real=True)) == 1)
    return next(delays, None)


def ages_only(bench: Bench, settings: Sequence[Mapping[str, float]]) -> BoolArray:
    """Return which changes of a parameter set alter the age of what is read and nothing else.

    None does so where readings pass a filter, which makes no product of an age that changes, or where an accelerometer
    reads the input, which may jump.

    `bench`: its simulators know every effect. `settings`: parameters that change.
    """
    program = bench.simulators[0].kernel.program
    if _delay(program) is None or any(e.rig.view is not None or e.reads_acceleration for e in bench.experiments):
        return np.zeros(len(settings), dtype=np.bool_)
    return np.array([changed.keys() <= program.ageing for changed in settings], dtype=np.bool_)


def per_age(bench: Bench, fitted: tuple[FloatArray, FloatArray], motions: Sequence[FloatArray]) -> FloatArray:
    """Return how fast a residual changes as what is read grows older, shape (n, 1) [1/s].

    `bench`: of the recordings. `fitted`: kernel parameters (p, 1) and initial states (experiments, 2, 1). `motions`:
    how these move.
    """
    parameters, initial = fitted
    difference = _DIFFERENCE * bench.shortest
    delayed = np.repeat(parameters, 2, axis=1)
    delayed[bench.names.index(_delay(bench.simulators[0].kernel.program))] += [difference, -difference]
    older, younger = bench.residuals(delayed, np.repeat(initial, 2, axis=2), motions).T
    if not np.isfinite([older, younger]).all():
        return np.zeros((older.size, 1))  # a motion that blows up
    return (older - younger)[:, None] / (2 * difference)


def ages_of(bench: Bench, settings: Sequence[Mapping[str, float]]) -> NDArray[np.float32]:
    """Return how much older effects that were absent make each reading [s], shape (n, sets).

    `bench`: of the recordings. `settings`: parameters of such effects, see `ages_only`.
    """
    known = _KNOWN.get(bench)
    if known is None or known[0] != settings:
        known = _KNOWN[bench] = settings, _ages(bench, settings)
    return known[1]


def _ages(bench: Bench, settings: Sequence[Mapping[str, float]]) -> NDArray[np.float32]:
    lateness = bench.simulators[0].kernel.program.lateness
    symbols = sorted(lateness.free_symbols - {t}, key=str)
    declared = Model(bench.base, bench.effects).parameters
    values = [np.array([changed.get(s.name, declared[s.name].default) for changed in settings]) for s in symbols]
    law = sp.lambdify([t, *symbols], lateness)
    ages = np.empty((bench.n_rows, len(settings)), dtype=np.float32)
    for simulator, (rows, fitted) in zip(bench.simulators, bench.blocks(), strict=True):
        found = np.broadcast_to(law(simulator.time[:, None], *values), (len(fitted), len(settings)))
        ages[rows] = np.repeat(found, fitted.shape[1], axis=0)
    return ages
