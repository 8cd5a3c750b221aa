"""Errors of the model of a body with one coordinate: laws that no effect of the catalogue holds."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.blind.rough.body_effects import SIGN
from benchmarks.blind.rough.ingredient import Action, Ingredient
from benchmarks.blind.rough.instruments import INSTRUMENT_ERRORS, instrument_error

if TYPE_CHECKING:
    from benchmarks.blind.rough.bodies import Body

Generator = np.random.Generator
Draw = Callable[["Body", Generator], Ingredient]
#: Laws of dry friction, which friction of another form resembles.
DRY = ("coulomb_friction", "presliding_friction", "stribeck_friction")


def _power(b: Body, rng: Generator) -> Ingredient:
    """Friction that grows with a fractional power of the speed."""
    low, high = ((0.35, 0.65), (1.35, 1.65), (2.4, 3.0))[rng.integers(3)]
    power = rng.uniform(low, high)
    unit = 0.005 * b.force / b.speed**power
    like = DRY if power < 1 else ("quadratic_drag", "amplitude_dependent_damping")
    return Ingredient(
        "power_friction",
        lambda s: Action({"power_loss": s * unit, "power": power, "dry_speed": SIGN * b.speed}),
        10.0 if power < 1 else 30.0,
        resembles=like,
        shape={"power": power},
    )


def _fading(b: Body, rng: Generator) -> Ingredient:
    """Dry friction that fades as the reciprocal of the speed."""
    slow = rng.uniform(0.1, 0.5) * b.speed
    return Ingredient(
        "fading_friction",
        lambda s: Action({"fading": 0.003 * s * b.force, "fading_speed": slow, "dry_speed": SIGN * b.speed}),
        5.0 if b.system in ("decay", "pendulum") else 20.0,
        resembles=DRY,
        shape={"speed": slow},
    )


def _kink(b: Body, rng: Generator) -> Ingredient:
    """Spring that is stiffer or softer beyond a deflection, on both sides."""
    at, sign = rng.uniform(0.3, 0.65) * b.reach, float(rng.choice([-1.0, 1.0]))
    return Ingredient(
        "kinked_spring",
        lambda s: Action({"kink": 0.02 * sign * s * b.force / b.reach, "kink_at": at}),
        15.0,
        resembles=("cubic_stiffness", "quintic_stiffness"),
        shape={"at": at, "sign": sign},
    )


def _appendage(b: Body, rng: Generator) -> Ingredient:
    """A slow body that hangs on the first one: a cable, or the table."""
    own, share = rng.uniform(0.45, 0.88) * b.frequency, 0.5
    loss = 2 * own * rng.uniform(0.02, 0.1)

    def act(s: float) -> Action:
        coupling = 0.01 * s * b.frequency**2
        ground = own**2 - coupling / share
        return Action({"coupling": coupling, "share": share, "ground": ground, "ground_loss": loss})

    return Ingredient("appendage", act, 40 * (own / b.frequency) ** 2, shape={"frequency": own})


#: Laws of the motion by their name.
LAWS: dict[str, Draw] = {
    "power_friction": _power,
    "fading_friction": _fading,
    "kinked_spring": _kink,
    "appendage": _appendage,
}
_MOTION: dict[str, tuple[str, ...]] = {
    # Under a recorded force an appendage is what the catalogue calls a second mode.
    "oscillator": ("power_friction", "fading_friction", "kinked_spring"),
    "decay": tuple(LAWS),
    "pendulum": tuple(LAWS),
    "bench": ("power_friction", "fading_friction", "kinked_spring"),
    "drive": ("power_friction", "fading_friction"),
    "servo": ("power_friction", "fading_friction"),
}


def names(system: str) -> tuple[str, ...]:
    """Errors that a kind of body may have, those of its motion first."""
    return (*_MOTION[system], *INSTRUMENT_ERRORS)


def draw(name: str, body: Body, rng: Generator) -> Ingredient:
    """Draw everything of an error but its strength."""
    if name in LAWS:
        return LAWS[name](body, rng)
    size = body.mass * body.force if body.system == "bench" else body.reach
    return instrument_error(name, rng, size=size, noise=body.noise, frequency=body.frequency)
