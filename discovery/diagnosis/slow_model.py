"""The slow motion of a model under an external force: one coordinate without memory.

What an extra force changes of a motion is slow, so one coordinate follows it: the model's own, or for the exact arm
that of `elastica_1`, the static shape. Effects with a memory and joints at the root are left out of it: along a fitted
run they act as they did there. So are further modes, which the input alone moves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Closure, Joint, Mode
from discovery.declarations.forces import ExternalForce
from discovery.declarations.registry import get_effect
from discovery.equations.contributions import radius_of
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, Program, build_program
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import values_of
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.simulation.kernel.compile import numpy_derivative

#: Base that follows the slow motion of a base with several coordinates.
_SLOW = "elastica_1"
#: Speed within which dry friction is smooth, at least, in natural ones.
_CREEP = 0.05
#: A moment, in natural times.
_MOMENT = 1e-6


@dataclass(frozen=True)
class Law:
    """A force that depends on the motion."""

    names: tuple[str, ...]  # variables that it depends on, see `Chain.variables`
    #: The force [s^-2 q], shape (k,), for a mapping of these to arrays (k,).
    force: Callable[[Mapping[str, FloatArray]], FloatArray]

    def scaled(self, share: float) -> Law:
        """Return this share of the law."""
        return Law(self.names, lambda variables: share * self.force(variables))


@lru_cache(maxsize=32)
def _mathematics(base: str, effects: tuple[str, ...]) -> tuple[Program, Callable[..., list], tuple[Callable, ...]]:
    """Return the program of a model under an external force, its slopes, and functions of what is seen of it.

    These are reading, (tip, motor angle) or (coordinate, rate, input), and lateness, of (t, recorded, states,
    parameters).
    """
    model = Model(base, (*effects, ExternalForce.id()))
    program = build_program(base, model.effects)
    closures = [e for e in model.terms if isinstance(e, Closure)]
    channels = model.mechanics.mechanics(program.rod).channels
    received = dict(program.drive)
    inputs = received.get(s.theta_m, received.get(s.u, sp.Integer(0)))
    known = [s.t, *RECORDED, *program.states, *(sp.Symbol(p, real=True) for p in program.parameters)]
    if model.mechanics.system.has_rod:
        law = radius_of(closures, channels) if closures else None
        output = [*model.mechanics.reading(law, program.rod), inputs]
    else:
        output = [channels[s.delta].value, channels[s.delta_dot].value, inputs]
    functions = tuple(
        sp.lambdify(known, [sp.sympify(e).xreplace(received) for e in expressions], "numpy", cse=True)
        for expressions in (program.reading, output, [program.lateness])
    )
    return program, numpy_derivative(program), functions


def _smoothed(effects: Sequence[str], units: NaturalUnits, known: Mapping[str, float]) -> dict[str, float]:
    """Return the creep speeds of dry friction, so large that a step resolves what they smooth.

    Without a force a chain leads along the fitted run all the same.
    """
    creeps = [p for e in effects for p in get_effect(e).parameters() if p.shape and p.fixed and p.unit == "s^-1 q"]
    return {p.name: max(known[p.name], _CREEP * units.scale(p)) for p in creeps if p.name in known}


class SlowModel:
    """The mathematics of a model's slow motion; the external force is its last parameter.

    Known parameters have their values, missing ones are absent. `reduced` says whether it is less than the model
    itself.
    """

    def __init__(self, model: Model, units: NaturalUnits, known: Mapping[str, float]) -> None:
        several = model.mechanics.n_coordinates > 1
        remembering = [e for e in model.terms if e.states() or isinstance(e, Joint)]
        effects = tuple(e.id() for e in model.terms if e not in remembering)
        self.reduced = several or any(not isinstance(e, Mode) for e in remembering)
        base = _SLOW if several else model.base
        self.program, self.slopes, functions = _mathematics(base, effects)
        self._reading, self._output, self._late = functions
        self.base, self.units = get_base(base), units
        effects = (*effects, ExternalForce.id())
        smooth = {**known, **_smoothed(effects, units, known)}
        self.parameters = values_of(self.program.parameters, base, effects, units, smooth)

    def lateness(self, time: FloatArray) -> FloatArray:
        """Return the age of what is reported at times (k,) [s]."""
        unseen = [np.zeros_like(time)] * (len(RECORDED) + 2)
        return np.broadcast_to(self._late(time, *unseen, *self.parameters)[0], time.shape)

    def reading(self, time: FloatArray, recorded: FloatArray, states: FloatArray) -> FloatArray:
        """Return what the instrument reports at times (k,) with input (3, k) and states (2, k), shape (k, r)."""
        found = self._reading(time, *recorded, *states, *self.parameters)
        return np.stack([np.broadcast_to(f, time.shape) for f in found], axis=1)

    def coordinates(self, motion: FloatArray, recorded: FloatArray) -> FloatArray:
        """Return coordinate and rate (2, k) for the angle of the tip, or the output, and its rate (2, k)."""
        hub = recorded[:2] if self.base.system.has_rod else np.zeros_like(motion)
        form = self.program.form(self.parameters)
        return np.concatenate(self.base.initial_coordinates(motion[0] - hub[0], motion[1] - hub[1], hub, form))

    def variables(
        self, time: FloatArray, recorded: FloatArray, states: FloatArray, names: Sequence[str] = ("rate",)
    ) -> dict[str, FloatArray]:
        """Return what a force may depend on, at times (k,) with input (3, k) and states (2, k).

        Returned (k,): an arm: ``time`` [s], ``deflection``, ``angle`` and ``motor_angle`` [rad], ``rate`` of the angle
        [rad/s] where `names` asks for it, true position ``x``, ``y`` [lengths]. An oscillator: ``time``, ``output``
        (the coordinate), ``rate`` and ``input``.
        """

        def output(q: FloatArray, drive: FloatArray) -> list[FloatArray]:
            found = self._output(time, *drive, q, states[1], *self.parameters)
            return [np.broadcast_to(np.asarray(f, float), time.shape) for f in found]

        here = output(states[0], recorded)
        if not self.base.system.has_rod:
            return {"time": time, **dict(zip(("output", "rate", "input"), here, strict=True))}
        x, y, motor = here
        deflection = np.angle((x + 1j * y) * np.exp(-1j * motor))
        found = {
            "time": time,
            "deflection": deflection,
            "angle": motor + deflection,
            "motor_angle": motor,
            "x": x,
            "y": y,
        }
        if "rate" in names:
            # Along the motion: the angle a moment later, less the angle a moment before.
            moment = _MOMENT * self.units.time
            shift = np.array([recorded[1], recorded[2], np.zeros_like(time)])
            later, before = (output(states[0] + d * states[1], recorded + d * shift) for d in (moment, -moment))
            found["rate"] = np.angle((later[0] + 1j * later[1]) * (before[0] - 1j * before[1])) / (2 * moment)
        return found
