"""Random states and parameters of a base with effects, and numerical derivatives along them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from discovery.declarations.effect import Effect
from discovery.declarations.registry import catalogue, get_effect
from discovery.equations.lacking import eventual_candidates
from discovery.equations.model import Model
from discovery.equations.program import Program, build_program
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import base_names, get_base

#: Of the differences: short against the turns of dry joints and the ringing of four shapes.
_STEP = 5e-4


@dataclass(frozen=True)
class Sample:
    """Random states of a program at one time: recorded input (3, k), state (n, k), parameters (p, k)."""

    time: float
    recorded: FloatArray
    state: FloatArray
    parameters: FloatArray

    def along(self, tau: float, acceleration: FloatArray, n: int, drift: FloatArray | float = 0.0) -> Sample:
        """Return the same motion a little later, memory moving at the rate `drift`; explicit time stands still."""
        q, rate, rest = self.state[:n], self.state[n : 2 * n], self.state[2 * n :]
        state = np.concatenate(
            [q + tau * rate + 0.5 * tau**2 * acceleration, rate + tau * acceleration, rest + tau * drift]
        )
        angle, speed, change = self.recorded
        return replace(
            self,
            recorded=np.stack([angle + tau * speed + 0.5 * tau**2 * change, speed + tau * change, change]),
            state=state,
        )

    def moved(self, row: int, by: float) -> Sample:
        """Return the sample with one state shifted."""
        state = self.state.copy()
        state[row] += by
        return replace(self, state=state)


def every_effect(base_name: str) -> tuple[str, ...]:
    """Return the ids of all effects that mean something on a base and that it does not contain already.

    What only places of declared systems have is tried on the oscillator.
    """
    return _every_effect(base_name, tuple(catalogue().items()), base_names())


@lru_cache(maxsize=256)
def _every_effect(base_name: str, _known: tuple[tuple[str, Effect], ...], _bases: tuple[str, ...]) -> tuple[str, ...]:
    """Return the same; what is registered decides."""
    # What only a base that moves has would be nothing of its own on one that rests.
    had = {"", *(need for base in map(get_base, base_names()) if base.input_moves for need in base.has)}
    joints = [e for e, effect in catalogue().items() if effect.needs not in had] if base_name == "oscillator" else []
    return (*eventual_candidates(Model(base_name, ())), *joints)


def derivative(f: Callable[[float], FloatArray]) -> FloatArray:
    """Slope of f at zero by the seven-point formula."""
    # At 1e-3, five points err by 1e-5 of dry friction near its turn, and by as much as round-off of a ringing rod.
    one, two, three = (f(k * _STEP) - f(-k * _STEP) for k in (1, 2, 3))
    return (45 * one - 9 * two + three) / (60 * _STEP)


def whole(base_name: str) -> Program:
    """Return the program of a base with every effect."""
    return build_program(base_name, every_effect(base_name))


def sample_states(base_name: str, active: Sequence[str], *, count: int = 8, static: bool = False) -> Sample:
    """Return random states of the program of every effect; parameters of effects that are not `active` are absent."""
    rng = np.random.default_rng(0)
    program, effects = whole(base_name), every_effect(base_name)
    declared = Model(base_name, effects).parameters
    on = {p.name for e in active for p in get_effect(e).parameters()}
    rows = []
    for name in program.parameters:
        p = declared[name]
        spread = rng.uniform(0.5, 1.5, count)
        if name == "alpha":
            rows.append(0.1 * spread)
        elif name in on:
            rows.append(np.clip((p.default if p.shape else p.prior.width) * spread, *p.bounds))
        elif name == "length":
            rows.append(1.2 * spread)
        elif name == "mu":
            rows.append(0.3 * spread)
        else:
            rows.append(np.full(count, p.default))
    n = program.n_coordinates
    size = np.full(len(program.states), 0.3)
    # Higher coordinates of a rod are small beside the first.
    size[1:n], size[n], size[n + 1 : 2 * n] = 0.05, 0.8, 0.2
    # Away from zero: a rate of zero is a kink of dry friction and of drag.
    state = size[:, None] * rng.uniform(0.3, 1, (size.size, count)) * rng.choice([-1, 1], (size.size, count))
    recorded = rng.uniform(-1, 1, (3, count)) * (np.array([[0.3], [0.0], [0.0]]) if static else 1.0)
    if static and not get_base(base_name).system.has_rod:
        recorded[:] = 0.0
    return Sample(float(rng.uniform(1, 2)), recorded, state, np.array(rows))


def without(sample: Sample, base_name: str, effect: str) -> Sample:
    """Return the sample with one effect's parameters at their defaults."""
    program = whole(base_name)
    parameters = sample.parameters.copy()
    for p in get_effect(effect).parameters():
        parameters[program.parameters.index(p.name)] = p.default
    return replace(sample, parameters=parameters)
