"""The bases: the mechanics of the bare system, one file each.

Here belong bases and how joints and ends change them. What an effect adds does not.
"""

from __future__ import annotations

from discovery.foundation.arguments import expect
from discovery.foundation.errors import InputError
from discovery.mechanics.base import Base

__all__ = ["Base", "base_names", "get_base"]


def _bases() -> dict[str, Base]:
    from discovery.mechanics import (
        accelerometer,
        base_excited,
        constant_radius,
        elastica,
        falling_body,
        inverse_dynamics,
        moving_pivot,
        oscillator,
        reduced,
        servo,
    )

    rods = (elastica.BASE, elastica.FOUR_MODES, elastica.CALM, elastica.TWO_MODES, elastica.ONE_MODE)
    lines = (oscillator, accelerometer, base_excited, moving_pivot, servo, inverse_dynamics, falling_body)
    bases = (constant_radius.BASE, reduced.BASE, *rods, *(module.BASE for module in lines))
    return {base.name: base for base in bases}


def base_names() -> tuple[str, ...]:
    """Return the names of all bases."""
    return tuple(_bases())


def get_base(name: str) -> Base:
    """Return one base.

    Raises InputError for an unknown name.
    """
    from discovery.mechanics.systems import declared_base

    expect(name, str, "base", "Give its name; `discovery.mechanics.base_names()` lists all.")
    if (declared := declared_base(name)) is not None:
        return declared
    bases = _bases()
    if name not in bases:
        raise InputError(f"There is no base called {name!r}; known are {', '.join(bases)}.")
    return bases[name]
