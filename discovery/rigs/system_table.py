"""The table ``[system]`` of a rig file."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

__all__ = ["ConstantTable", "SystemTable"]

_Text = Annotated[str, Field(min_length=1)]
_One = Annotated[dict[str, _Text], Field(min_length=1, max_length=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ConstantTable(_Table):
    """A constant: its value, perhaps within a standard deviation, or a guess from which it is fitted."""

    unit: _Text
    value: FiniteFloat | None = None
    sd: Annotated[FiniteFloat, Field(gt=0)] | None = None
    guess: FiniteFloat | None = None

    @model_validator(mode="after")
    def _one_of_two(self) -> ConstantTable:
        if (self.value is None) == (self.guess is None):
            raise ValueError("needs either a value (it is known) or a guess (it is fitted)")
        if self.guess is not None and (self.sd is not None or self.guess == 0.0):
            raise ValueError("a guess has no sd and is not zero: it gives sign and size")
        return self


class SystemTable(_Table):
    """A system in its own equations, or a ready-made one under ``like`` of which some of these are stated anew."""

    like: _Text | None = None
    coordinates: Annotated[dict[str, _Text], Field(min_length=1, max_length=3)] | None = None
    input: _One | None = None
    constants: dict[str, ConstantTable] = {}
    kinetic: _Text | None = None
    potential: _Text | None = None
    dissipation: _Text | None = None
    forces: dict[str, _Text] | None = None
    output: _Text | None = None
    places: Annotated[dict[str, _Text], Field(min_length=1, max_length=6)] | None = None
