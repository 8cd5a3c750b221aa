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
