"""How finite amplitudes of effects move the residual of a fit: what is simulated for a screen, and its outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import compress
from weakref import WeakKeyDictionary

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.linalg.blas import dgemm

from discovery.declarations.effect import Effect, Expressed, Joint, Memory, Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.registry import get_effect
from discovery.declarations.symbols import t
from discovery.declarations.system import System
from discovery.equations.model import Model
from discovery.equations.program import Program
from discovery.estimation.bench import Bench
from discovery.foundation.arrays import BoolArray, FloatArray, IntArray

#: Half of the difference of delays over which a residual is differentiated, in steps, the shortest ones.
_DIFFERENCE = 1e-3
#: The same changes are made around every fit of the same recordings.
_KNOWN: WeakKeyDictionary[Bench, tuple[Sequence[Mapping[str, float]], NDArray[np.float32]]] = WeakKeyDictionary()


@dataclass(frozen=True)
class Grid:
    """Finite values of one effect, and where each of its amplitudes lies among all parameter sets to be simulated."""

    fitted: tuple[Parameter, ...]  # what a refit estimates
    values: FloatArray  # (t, f), grid, a column for each of `fitted`
    sizes: IntArray  # (k,), which of them are amplitudes
    #: (t, k): which response is that of each amplitude, the others absent; where recordings have values of their own,
    #: of each amplitude in each recording.
    rows: IntArray


@cache
def _shapes_of(effect: Effect, system: str, amplitude: str) -> tuple[str, ...]:
    """Return the shapes that enter an effect where its other amplitudes are zero."""
    fitted = effect.fitted(system)
    shapes = tuple(p.name for p in fitted if p.shape)
    law: tuple = ()
    if isinstance(effect, Sensor):
        law = (effect.lateness(), *effect.read(*sp.symbols(" ".join(System.of(system).channels), seq=True)))
    elif isinstance(effect, Expressed) and not isinstance(effect, Joint | Memory):
        law = (effect.expression(),)
    else:
        return shapes
    absent = {sp.Symbol(p.name, real=True): 0 for p in fitted if not p.shape and p.name != amplitude}
    named = {s.name for s in sp.Tuple(*law).subs(absent).free_symbols}
    return tuple(n for n in shapes if n in named)


@dataclass(frozen=True)
class Responses:
    """How parameter sets move the residual, split by what the fitted parameters absorb."""

    known: FloatArray  # (n, p), orthonormal basis of what they absorb
    left: NDArray[np.float32]  # (k, n), what they leave of each response
    taken: FloatArray  # (k, p), what they take, in the basis

    def moved(self, rows: IntArray) -> FloatArray:
        """Return whole responses, shape (n, rows)."""
        return self.left[rows].T + self.known @ self.taken[rows].T


def plan(
    grids: Mapping[str, Sequence[Mapping[str, float]]], system: str, recordings: int = 1
) -> tuple[dict[str, Grid], list[dict[str, float]]]:
    """Return the grid of every effect, and in what each parameter set to be simulated differs from the fit.

    `grids`: finite values of each effect, in the problem's units. `system`: kind of the system. `recordings`: their
    number. An amplitude of an effect of which each has its own value is told apart in each of them.
    """
    count = 0
    found: dict[str, Grid] = {}
    settings: list[dict[str, float]] = []
    for name, grid in grids.items():
        effect = get_effect(name)
        fitted = effect.fitted(system)
        sizes = np.array([i for i, p in enumerate(fitted) if not p.shape], dtype=np.int64)
        parts = recordings if effect.own() is not None else 1
        rows = np.empty((len(grid), sizes.size, parts), dtype=np.int64)
        for k, i in enumerate(sizes):
            own = (*_shapes_of(effect, system, fitted[i].name), fitted[i].name)
            known: dict[tuple[float, ...], int] = {}
            for point, values in enumerate(grid):
                key = tuple(values[n] for n in own)
                if key not in known:
                    known[key], count = count, count + parts
                    settings.append(dict(zip(own, key, strict=True)))
                rows[point, k] = known[key] + np.arange(parts)
        table = np.array([[g[p.name] for p in fitted] for g in grid])
        found[name] = Grid(fitted, table, sizes, rows.reshape(len(grid), -1))
    return found, settings


def respond(
    pool: ThreadPoolExecutor,
    bench: Bench,
    fitted: tuple[FloatArray, FloatArray],
    settings: Sequence[Mapping[str, float]],
    reference: FloatArray,
    known: FloatArray,
) -> Responses:
    """Return how parameter sets move the residual, zero where the motion blows up.

    Blocks as wide as the kernel's stay in the processor's cache from the simulation to what is left. What the
    instrument alone does is read of one motion, and where it is only late, known to first order, see
    `discovery.screening.responses`.

    `pool`: threads among which the blocks are shared. `bench`: its simulators know every effect. `fitted`: kernel
    parameters (p, 1) and initial states (experiments, 2, 1) of the fit. `settings`: in what each set differs from the
    fit. `reference` (n,): residual of the fit. `known` (n, p): orthonormal basis of what the fitted parameters absorb.
    """
    base, initial = fitted
    sets = _sets(bench, base, settings)
    lanes = bench.simulators[0].kernel.lanes
    split = _split(bench, settings)
    first = np.cumsum([0, *np.where(split, len(bench.experiments), 1)])
    left, taken = np.empty((first[-1], reference.size), np.float32), np.empty((first[-1], known.shape[1]))

    alike = bench.moves_alike(np.column_stack([base, sets]))[1:]
    older = ages_only(bench, settings)
    late = list(compress(settings, older))
    place = np.cumsum(older) - 1

    def read_once() -> tuple[list[FloatArray] | None, FloatArray, NDArray[np.float32]]:
        motions = bench.motions(base, initial) if alike.any() else None
        if motions is None or not late:
            return motions, np.empty((reference.size, 1)), np.empty((reference.size, 0), dtype=np.float32)
        return motions, per_age(bench, fitted, motions), ages_of(bench, late)

    def simulate(part: IntArray) -> None:
        motions, slope, ages = once.result() if alike[part[0]] else (None, reference, reference)
        if older[part[0]]:
            moved = slope * np.take(ages, place[part], axis=1)
        else:
            moved = bench.residuals(sets[:, part], np.repeat(initial, part.size, axis=2), motions)
            moved -= reference[:, None]
        # A set that blows up is infinite throughout.
        moved[:, ~np.isfinite(moved[0])] = 0.0
        rows = np.concatenate([np.arange(first[i], first[i + 1]) for i in part])
        moved = _by_recording(bench, moved) if split[part[0]] else moved
        taken[rows] = moved.T @ known
        left[rows] = dgemm(-1.0, taken[rows], known, 1.0, moved.T, trans_b=True, overwrite_c=True)

    # Others are simulated meanwhile.
    once = pool.submit(read_once)
    read = alike & ~older
    groups = [np.flatnonzero(own) for own in (~alike & split, ~alike & ~split, older, read & split, read & ~split)]
    list(pool.map(simulate, [own[i : i + lanes] for own in groups for i in range(0, own.size, lanes)]))
    return Responses(known, left, taken)


def _sets(bench: Bench, base: FloatArray, settings: Sequence[Mapping[str, float]]) -> FloatArray:
    """Return kernel parameters (p, k) that differ from those of a fit (p, 1) as each setting says."""
    at = {name: i for i, name in enumerate(bench.names)}
    sets = np.repeat(base, len(settings), axis=1)
    where = [at[name] for changed in settings for name in changed]
    columns = np.repeat(np.arange(len(settings)), [len(changed) for changed in settings])
    sets[where, columns] = [value for changed in settings for value in changed.values()]
    return sets


def _split(bench: Bench, settings: Sequence[Mapping[str, float]]) -> BoolArray:
    """Return which parameter sets are of effects that have a value of each recording's own."""
    effects = [get_effect(e) for e in bench.effects] if len(bench.experiments) > 1 else []
    names = {p.name for effect in effects if effect.own() is not None for p in effect.parameters()}
    return np.array([not names.isdisjoint(changed) for changed in settings], dtype=bool)


def _by_recording(bench: Bench, moved: FloatArray) -> FloatArray:
    """Return responses (n, k) in each recording alone, shape (n, k * recordings), set by set."""
    found = np.zeros((len(moved), moved.shape[1], len(bench.experiments)))
    for i, (rows, _) in enumerate(bench.blocks()):
        found[rows, :, i] = moved[rows]
    return found.reshape(len(moved), -1)


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
