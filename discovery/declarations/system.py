"""A system as its user declares it: coordinates, constants, energies, what drives it, what is read, where effects act.

>>> SystemDeclaration(
...     name="body on a spring",
...     coordinates={"x": "m"},
...     constants={"mass": Constant("kg", 2.0), "stiffness": Constant("N / m", 50.0, free=True)},
...     kinetic="mass*dot(x)^2/2",
...     potential="stiffness*x^2/2",
...     output="x",
...     places={"body": "x"},
... ).identity
'body_on_a_spring_f3bd6dbd'
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any


@dataclass(frozen=True)
class Constant:
    """One constant of a declared system, in SI units.

    Parameters
    ----------
    unit : str
        Coherent SI unit.
    value : float
        Value where it is known, else a guess.
    sd : float or None
        Standard deviation of a value that is known only within it.
    free : bool
        Whether it is fitted, and `value` a guess of its size and sign.
    """

    unit: str
    value: float
    sd: float | None = None
    free: bool = False


@dataclass(frozen=True)
class SystemDeclaration:
    """A mechanical system in its own equations, each a text for `discovery.declarations.formula.read_formula`.

    Parameters
    ----------
    name : str
        For people.
    coordinates : mapping of str to str
        One to three coordinates with their SI units.
    constants : mapping of str to Constant
        What stands in the equations beside coordinates and input.
    kinetic, potential, dissipation : str
        Energies [J], and Rayleigh's dissipation function [W].
    forces : mapping of str to str
        Generalised force on a coordinate that is none of these, such as the input's [J over the coordinate's unit].
    input : (str, str) or None
        Name and SI unit of what is recorded of the input.
    output : str
        What is read.
    places : mapping of str to str
        Where effects may act: a coordinate, or any length or angle that they make, such as the twist of a joint.
    also : mapping of str to str
        What is read beside the output, by name: another coordinate, or an expression as the output is one.
    """

    name: str
    coordinates: Mapping[str, str]
    constants: Mapping[str, Constant]
    kinetic: str
    output: str
    places: Mapping[str, str]
    potential: str = "0"
    dissipation: str = "0"
    forces: Mapping[str, str] = field(default_factory=dict)
    input: tuple[str, str] | None = None
    also: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def identity(self) -> str:
        """A word that no other declaration has: the name of its base."""
        content = json.dumps(self.to_dict(), sort_keys=True)
        word = re.sub(r"\W+", "_", self.name.lower()).strip("_")
        return f"{word}_{hashlib.sha256(content.encode()).hexdigest()[:8]}"

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return asdict(self)

    @classmethod
    def from_dict(cls, description: Mapping[str, Any]) -> SystemDeclaration:
        """Return the system that `to_dict` described."""
        constants = {name: Constant(**given) for name, given in description["constants"].items()}
        given = description["input"]
        return cls(**{**description, "constants": constants, "input": None if given is None else tuple(given)})


class System(StrEnum):
    """A kind of system on which effects act: equal to its name, and it answers what depends on it."""

    ARM = "flexible_arm"
    OSCILLATOR = "oscillator"

    @classmethod
    def of(cls, kind: str) -> System:
        """Return the system of a kind of rig: all but the arm move along one line or about one axis."""
        return cls.ARM if kind == cls.ARM.value else cls.OSCILLATOR

    @property
    def has_rod(self) -> bool:
        """Whether a rod bends between a hub that turns and the tip that is read."""
        return self is System.ARM

    @property
    def channels(self) -> tuple[str, ...]:
        """What a simulation reads: the tip [m], or the output."""
        return ("tip_x", "tip_y") if self.has_rod else ("output",)

    @property
    def coordinate(self) -> str:
        """Name of the coordinate in equations."""
        return "theta_t" if self.has_rod else "q"

    @property
    def moved_input(self) -> str:
        """Name of an input that is a motion: that of the hub, or of what the system hangs on."""
        return "theta_m" if self.has_rod else "u"

    def coordinate_unit(self, output: str) -> str:
        """Return the SI unit of the coordinate where the output has this one."""
        return "rad" if self.has_rod else output

    def still(self, at: float) -> tuple[float, float]:
        """Return angle and rate of what the coordinate is counted from, where the input stays at a value."""
        return (at, 0.0) if self.has_rod else (0.0, 0.0)


ARM, OSCILLATOR = System.ARM, System.OSCILLATOR
