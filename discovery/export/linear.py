"""A model linearised at an operating point, with what its parameters' uncertainty leaves of that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp
from scipy.optimize import root

from discovery.declarations.effect import Closure, Drive, Effect, Memory, Sensor, Shape
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, build_program
from discovery.export.fitted import FittedModel, deviations, fitted_model
from discovery.export.symbolic import SymbolicModel, program_of
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.simulation.kernel.compile import numpy_derivative

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

#: Relative step of the central differences: their error is about its square.
_STEP = 1e-5
#: Points of a cycle over which a describing function is averaged.
_CYCLE = 4096
#: Draws of a posterior that are looked at, evenly chosen.
_DRAWS = 200


@dataclass(frozen=True)
class LinearModel:
    """State-space matrices of a model near an operating point: x' = A x + B u, y = C x + D u in deviations from it.

    `a` (n, n), `b` (n, m), `c` (r, n) and `d` (r, m) have rows and columns in the order of the names; with a
    `sample_time` [s], of a zero-order hold, they are of the next sample. `sd` holds their standard deviations from
    those of the parameters, by letter; empty where there are none. At the operating `point`, state and input by name,
    the instrument reports `reading`, and `drift` is x': zero at an equilibrium. `delay` is the age of the reading [s],
    which is part of the matrices where there is a sample time. `warnings` say where the matrices mislead.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    sd: Mapping[str, FloatArray]
    point: Mapping[str, float]
    reading: tuple[float, ...]
    drift: tuple[float, ...]
    delay: float = 0.0
    sample_time: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Numbers:
    """Slopes and readings of a model as functions of time, recorded input, state and parameters."""

    program: SymbolicModel
    slopes: Callable[..., list]
    readings: Callable[..., list]

    def both(self, recorded: FloatArray, state: FloatArray, values: FloatArray) -> FloatArray:
        """Return slopes and readings, shape (n + r, k), of states (n, k) and inputs (3, k)."""
        found = (*self.slopes(0.0, recorded, state, values), *self.readings(0.0, *recorded, *state, *values))
        return np.array(np.broadcast_arrays(*found, state[0])[:-1], float)


@lru_cache(maxsize=16)
def _numbers(base: str, effects: tuple[str, ...]) -> _Numbers:
    program = program_of(Model(base, effects))
    drive = dict(program.drive)
    names = [sp.Symbol("t", real=True), *RECORDED, *program.states, *program.parameters]
    readings = sp.lambdify(names, [e.xreplace(drive) for e in program.reading])
    return _Numbers(program, numpy_derivative(build_program(base, effects)), readings)


def _jacobian(numbers: _Numbers, state: FloatArray, recorded: FloatArray, values: FloatArray) -> FloatArray:
    """Return the derivative of slopes and readings with respect to state and input, by central differences."""
    point = np.concatenate([state, recorded])
    steps = _STEP * np.maximum(np.abs(point), 0.01)
    around = point[:, None, None] + np.eye(point.size)[:, :, None] * steps[None, :, None] * np.array([1.0, -1.0])
    flat = around.reshape(point.size, -1)
    found = numbers.both(flat[state.size :], flat[: state.size], values).reshape(-1, point.size, 2)
    return np.asarray((found[..., 0] - found[..., 1]) / (2.0 * steps))


def _averaged(
    numbers: _Numbers, state: FloatArray, recorded: FloatArray, values: FloatArray, cycle: tuple[float, float] | None
) -> FloatArray:
    """Return `_jacobian`, the columns of coordinate and rate averaged over a cycle, if any: its describing function."""
    found = _jacobian(numbers, state, recorded, values)
    if cycle is None:
        return found
    amplitude, frequency = cycle
    phase = 2.0 * np.pi * (np.arange(_CYCLE) + 0.5) / _CYCLE
    swing = np.repeat(state[:, None], _CYCLE, axis=1)
    swing[0] += amplitude * np.sin(phase)
    swing[1] += amplitude * frequency * np.cos(phase)
    n = state.size
    around = numbers.both(np.repeat(recorded[:, None], _CYCLE, axis=1), swing, values)
    # Readings stay tangents; the slope of the coordinate is its rate.
    found[:n, 0] = 2.0 * (around[:n] * np.sin(phase)).mean(axis=1) / amplitude
    found[:n, 1] = 2.0 * (around[:n] * np.cos(phase)).mean(axis=1) / (amplitude * frequency)
    return found


def _state_at(
    numbers: _Numbers, found: FittedModel, deflection: float | None, rate: float, recorded: FloatArray
) -> FloatArray:
    """Return the state of the operating point: given, or the equilibrium that is nearest to rest."""
    program, n = numbers.program, numbers.program.n_coordinates
    values = [found.values[p.name] for p in program.parameters]
    names = [sp.Symbol("deflection", real=True), sp.Symbol("rate", real=True), *RECORDED[:2], *program.parameters]
    start = sp.lambdify(names, program.initial, cse=True)(deflection or 0.0, rate, *recorded[:2], *values)
    state = np.array([float(v) for v in start])
    if deflection is not None or rate != 0 or found.model.mechanics.prescribed:
        return state
    still = [*range(n), *range(2 * n, state.size)]

    def unrest(part: FloatArray) -> FloatArray:
        whole = state.copy()
        whole[still] = part
        return np.asarray(numbers.slopes(0.0, recorded, whole, values), float)[n:]

    settled = root(unrest, state[still])
    if not settled.success:
        raise InputError("The model has no equilibrium near rest at this input; name the deflection to linearise at.")
    state[still] = settled.x
    return state


def _with_motion(found: FloatArray, n: int, moving: bool) -> tuple[FloatArray, ...]:
    """Return A, B, C, D; a moving input is driven by its acceleration, and angle and rate are states."""
    a, b, c, d = found[:n, :n], found[:n, n:], found[n:, :n], found[n:, n:]
    if not moving:
        return a, b[:, :1], c, d[:, :1]
    carried = np.zeros((n + 2, n + 2))
    carried[:n, :n], carried[:n, n:], carried[n, n + 1] = a, b[:, :2], 1.0
    pushed = np.zeros((n + 2, 1))
    pushed[:n, 0], pushed[n + 1, 0] = b[:, 2], 1.0
    return carried, pushed, np.hstack([c, d[:, :2]]), d[:, 2:]


def _spread(
    matrices: Callable[[Mapping[str, float]], tuple[FloatArray, ...]], found: FittedModel,
    draws: Mapping[str, FloatArray] | None,
) -> dict[str, FloatArray]:  # fmt: skip
    """Return standard deviations of the matrices, from draws of the parameters or the covariance of the fit."""
    if draws is not None:
        own = {n: np.asarray(v, float).ravel() for n, v in draws.items() if n in found.values}
        if not own:
            return {}
        size = min(v.size for v in own.values())
        chosen = np.unique(np.linspace(0, size - 1, min(size, _DRAWS)).astype(int))
        sets = [matrices({**found.values, **{n: float(v[k]) for n, v in own.items()}}) for k in chosen]
        together = zip(*sets, strict=True)
        return {key: np.std(np.array(s), axis=0, ddof=1) for key, s in zip("abcd", together, strict=False)}
    return dict(zip("abcd", deviations(found, matrices), strict=False))


def _refuse_cycle(model: Model, amplitude: float | None, frequency: float | None) -> None:
    if (amplitude is None) != (frequency is None) or not ((amplitude or 1.0) > 0 and (frequency or 1.0) > 0):
        raise InputError("A describing function needs an amplitude and a frequency, both positive.")
    base = model.mechanics
    if amplitude and base.n_coordinates > 1:
        raise InputError(f"A describing function is of one coordinate; {base.name!r} has {base.n_coordinates}.")


def _there(
    numbers: _Numbers, state: FloatArray, recorded: FloatArray, values: FloatArray
) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Return slopes and readings at a point, and the age of the readings [s]."""
    found = numbers.both(recorded[:, None], state[:, None], values)[:, 0].tolist()
    names = [sp.Symbol("t", real=True), *numbers.program.parameters]
    late = sp.lambdify(names, numbers.program.lateness)(0.0, *values[:, 0])
    return tuple(found[: state.size]), tuple(found[state.size :]), float(late)


def linearise(
    source: FittedModel | Fit | Model,
    values: Mapping[str, float] | None = None,
    *,
    deflection: float | None = None,
    speed: float = 0.0,
    held: float = 0.0,
    amplitude: float | None = None,
    frequency: float | None = None,
    draws: Mapping[str, FloatArray] | None = None,
) -> LinearModel:
    """Return a model linearised at an operating point.

    The input of an arm, and every other input that is a motion, is its acceleration; its angle and rate are states. The
    point has a `deflection` [q], that of the equilibrium at the held input otherwise, a `speed` [q/s], at which
    friction is taken, and the input `held`: the angle of the motor [rad], or the force. `values` replace numbers of
    `source` [SI, radians]. Standard deviations follow from the covariance of a fit, or from `draws` (k,) of a
    posterior, by parameter.

    Of a harmonic motion with an `amplitude` [q] and a `frequency` [rad/s], in a system with one coordinate, forces are
    replaced by their describing functions, in phase with the motion and with its rate (A. Gelb and W. E. Vander Velde,
    Multiple-Input Describing Functions, 1968, section 2.2).

    InputError if a parameter has no value, there is no equilibrium, an amplitude comes without a frequency, or a
    describing function is asked of a system with more than one coordinate.
    """
    found = fitted_model(source, values)
    _refuse_cycle(found.model, amplitude, frequency)
    base, numbers = found.model.mechanics, _numbers(found.model.base, found.model.effects)
    recorded = np.array([held, 0.0, 0.0])
    state = _state_at(numbers, found, deflection, speed, recorded)
    cycle = (amplitude, frequency) if amplitude and frequency else None

    def column(given: Mapping[str, float]) -> FloatArray:
        return np.array([given[p.name] for p in numbers.program.parameters])[:, None]

    def matrices(given: Mapping[str, float]) -> tuple[FloatArray, ...]:
        tangent = _averaged(numbers, state, recorded, column(given), cycle)
        return _with_motion(tangent, state.size, base.input_moves)

    slopes, reading, late = _there(numbers, state, recorded, column(found.values))
    tangent: dict[str, Any] = dict(zip("abcd", matrices(found.values), strict=True))
    names, moved = [y.name for y in numbers.program.states], base.system.moved_input
    motion = [moved, f"{moved}_dot"] if base.input_moves else []
    return LinearModel(
        states=(*names, *motion),
        inputs=(f"{motion[0]}_ddot",) if motion else ("u",),
        outputs=base.channels,
        **tangent,
        sd=_spread(matrices, found, draws),
        point=dict(zip((*names, motion[0] if motion else "u"), (*state.tolist(), held), strict=True)),
        reading=reading,
        drift=(*slopes, *[0.0] * len(motion)),
        delay=max(late, 0.0),
        warnings=tangent_warnings(found.model, bool(amplitude), speed, late),
    )


def _sharp(effect: Effect) -> bool:
    """Return whether a law is no smooth function of the motion: friction, drag, play, whose tangent says little."""
    if isinstance(effect, Closure | Drive | Sensor | Shape):
        return False
    laws: list[sp.Expr] = [sp.sympify(effect.expression())]  # type: ignore[attr-defined]
    if isinstance(effect, Memory):
        laws += list(effect.states().values())
    return any(
        e.has(sp.Abs, sp.sign, sp.Min, sp.Max, sp.Piecewise)
        or any(not p.exp.is_Integer for p in e.atoms(sp.Pow) if not p.exp.free_symbols and not p.base.is_number)
        for e in laws
    )


def tangent_warnings(model: Model, averaged: bool, rate: float, late: float) -> tuple[str, ...]:
    """Return where a tangent misleads."""
    sharp = [e for e in model.terms if _sharp(e)]
    remembered = [e.id() for e in sharp if isinstance(e, Memory)]
    others = [e.id() for e in sharp if not isinstance(e, Memory)]
    said = []
    if others and not averaged and rate == 0:
        said.append(
            f"At rest the slope of {', '.join(others)} is that of its smoothed law, and holds for the smallest motions "
            "only; state a speed, or an amplitude and a frequency."
        )
    if remembered:
        said.append(f"{', '.join(remembered)} is linearised at its present memory; it depends on the motion before.")
    if late < 0:
        said.append(f"The instrument is {-late:g} s ahead, which no state-space model is; this is left out.")
    return tuple(said)
