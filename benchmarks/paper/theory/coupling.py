"""Coupling torque: what the arm asks of its motor, for any base and any effects.

The motor of eq. (10) of the paper feels the arm through one torque, which eq. (11) gives for a massless rod and a force
F at its tip, ``Gamma_c = -F rho_t sin(phi - theta_t)``. With the rod's mass, friction and other forces it is the
balance of angular momentum about the hub: ``Gamma_c = dh/dt`` minus the torques from outside. Inner forces, the rod's
elasticity and its losses, do not appear; a force on a channel does as much as it would do in a turn of the whole arm.

Signs are those of (10): Gamma_c is the torque of the motor on the arm, negative where the bent arm pulls ahead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from discovery.declarations import symbols as s
from discovery.declarations.effect import Joint, Kinetic
from discovery.declarations.registry import get_effect
from discovery.equations.contributions import radius_of
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, Program, build_program
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.mechanics.base import SHORTENING_RADIUS, Channel
from discovery.mechanics.joint import TURN, hinged, root_of
from discovery.mechanics.rod_end import loaded_end
from discovery.mechanics.rod_shapes import AT_THE_TIP
from discovery.rigs.rig import Rig
from discovery.simulation.kernel.compile import numpy_derivative


def _kinetic_torque(energy: sp.Expr, second: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return d/dt dT/d(rate of turn) - dT/d(turn) of an effect's kinetic energy; `second` holds accelerations."""
    momentum = sp.diff(energy, s.omega_m) + sp.Add(*[sp.diff(energy, c) * TURN.get(c, 0) for c in s.RATES.values()])
    change = [sp.diff(momentum, s.theta_m) * s.omega_m, sp.diff(momentum, s.omega_m) * s.alpha_m]
    for position, rate in s.RATES.items():
        change += [sp.diff(momentum, position) * rate, sp.diff(momentum, rate) * second[rate]]
    turned = {s.theta_m: sp.Integer(1), s.v_x: -s.v_y, s.v_y: s.v_x}
    turned |= {c: TURN.get(c, sp.Integer(0)) for c in s.RATES}
    return sp.Add(*change) - sp.Add(*[sp.diff(energy, c) * by for c, by in turned.items()])


@lru_cache(maxsize=64)
def _program(base_name: str, effect_ids: tuple[str, ...]) -> Program:
    """Return the program of a model whose slopes go on with Gamma_c / (m_eff l^2), theta_t, and the tip's x, y [m]."""
    base, effects = get_base(base_name), [get_effect(e) for e in effect_ids]
    if not base.system.has_rod:
        raise InputError(f"The base {base_name!r} has no hub, so no coupling torque; use a base of the flexible arm.")
    stand_in = sorted(SHORTENING_RADIUS.intersection(effect_ids))
    if stand_in:
        raise InputError(
            f"{', '.join(stand_in)} {'imitates' if len(stand_in) == 1 else 'imitate'} the inertia of a shortening "
            "radius, without a reaction on the hub; "
            "take the base 'reduced' or 'elastica', where it is part of the mechanics."
        )
    program, n = build_program(base_name, effect_ids), base.n_coordinates
    mechanics = base.mechanics(program.rod)
    channels = hinged(mechanics, root_of(mechanics, [e for e in effects if isinstance(e, Joint)])).channels
    accelerations = sp.symbols(f"acc_1:{n + 1}", real=True)

    def second(channel: Channel) -> sp.Expr:
        return channel.bias + sp.Add(*[j * a for j, a in zip(channel.jacobian, accelerations, strict=True)])

    torque = second(channels[s.h])
    # The program names the sum of all forces on a channel after it.
    pushed = {symbol.name for symbol, _ in program.derivative}
    torque -= sp.Add(*[sp.Symbol(f"F_{c.name}", real=True) * by for c, by in TURN.items() if f"F_{c.name}" in pushed])
    rates = {rate: second(channels[rate]) for rate in s.RATES.values()}
    end = loaded_end(mechanics, effects)
    energies = [e.expression() for e in effects if isinstance(e, Kinetic)]
    torque += sp.Add(*[_kinetic_torque(t if end is None else end.kinetic(t), rates) for t in energies])
    # On the shaft of the encoder, where a drive effect turns the hub by another angle: virtual work.
    torque *= sp.diff(program.drive[0][1], RECORDED[0])
    tip = base.reading(radius_of(effects, channels), program.rod)
    shown = (torque, channels[s.theta].value, *(s.length * position for position in tip))
    wanted = set().union(*[sp.sympify(row).free_symbols for row in shown])
    named = [(c, sp.sympify(channel.value)) for c, channel in channels.items() if c in wanted and c.name not in pushed]
    solved = list(zip(accelerations, program.slopes[n : 2 * n], strict=True))
    return replace(
        program,
        derivative=(*program.derivative, *named, *solved),
        slopes=(*program.slopes[:n], *accelerations, *program.slopes[2 * n :], *shown),
    )


@dataclass(frozen=True)
class Arm:
    """A model of the arm with its numbers: slopes of its state, coupling torque and tip, by numpy.

    Raises InputError if there is no model or no mapping, a free parameter has no value, or the inertia is not positive.
    """

    model: Model  # any base of the arm with any effects; those of the instrument change nothing here
    #: Parameters by name [SI], at least all that the model leaves free; further names are passed over.
    values: Mapping[str, float]
    inertia: float  # effective inertia m_eff l^2 [kg m^2], see `effective_inertia`

    def __post_init__(self) -> None:
        if not (isinstance(self.model, Model) and isinstance(self.values, Mapping)):
            raise InputError(
                "An arm needs a Model and its numbers by name; of a fit or an exported model these are `.model` and "
                f"`.values`. Got a {type(self.model).__name__} and a {type(self.values).__name__}."
            )
        missing = [n for n in self.model.free if n not in self.values]
        if missing:
            raise InputError(f"The model needs values of {', '.join(missing)}.")
        if not self.inertia > 0:
            raise InputError(f"The effective inertia m_eff l^2 must be positive, not {self.inertia} kg m^2.")

    @cached_property
    def program(self) -> Program:
        """Slopes of the state, then Gamma_c / (m_eff l^2) [s^-2], theta_t [rad], x and y of the tip [m]."""
        return _program(self.model.base, self.model.effects)

    @cached_property
    def parameters(self) -> tuple[float, ...]:
        """Parameters in the order of the program."""
        known = {**{n: p.default for n, p in self.model.parameters.items()}, **self.model.known, **self.values}
        return tuple(float(known[n]) for n in self.program.parameters)

    @cached_property
    def _rows(self) -> Callable[..., list]:
        return numpy_derivative(self.program)

    def rows(self, time: ArrayLike, motor: ArrayLike, state: ArrayLike) -> list:
        """Return slopes, torque per inertia and tip, as `program` lists them.

        Times (k,) or () [s]; motor's angle [rad] and its first two derivatives, (3, k) or (3,); states (n, k) or (n,)
        in the order of the program: coordinates, rates, memory.
        """
        return self._rows(time, motor, state, self.parameters)

    def start(self, deflection: float, rate: float, motor: FloatArray) -> FloatArray:
        """Return the state (n,) for a deflection [rad], its rate [rad/s] and the motor's angle and rate (2,)."""
        form = self.program.form(self.parameters)
        q, q_rate = self.model.mechanics.initial_coordinates(np.array([deflection]), np.array([rate]), motor, form)
        state = np.zeros(len(self.program.states))
        state[: 2 * len(q)] = np.concatenate([q, q_rate])[:, 0]
        return state


def effective_inertia(rig: Rig) -> float:
    """Return m_eff l^2 = (m + 33 m_r / 140) l^2 of a rig [kg m^2]; a rod of unstated mass counts as massless.

    A rig without length or tip mass is refused.
    """
    if not isinstance(rig, Rig):
        raise InputError(f"The inertia is that of a Rig, not of a {type(rig).__name__}; `read_rig(path)` returns one.")
    if rig.length is None or rig.tip_mass is None:
        raise InputError(f"The coupling torque of {rig.name} needs the arm's length and its tip mass in the rig file.")
    rod = rig.beam_mass.value if rig.beam_mass is not None else 0.0
    return (rig.tip_mass.value + AT_THE_TIP * rod) * rig.length.value**2
