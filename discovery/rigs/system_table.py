"""The table ``[system]`` of a rig file."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

Text = Annotated[str, Field(min_length=1)]
_One = Annotated[dict[str, Text], Field(min_length=1, max_length=1)]


class Table(BaseModel):
    """A table of a rig file: no other keys, nothing converted."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ConstantTable(Table):
    """A constant of the equations: known by a ``value``, known within an ``sd``, or fitted from a ``guess``."""

    unit: Text = Field(description="Unit of the numbers here, any that measures the constant.")
    value: FiniteFloat | None = Field(
        default=None, description="What it is. Without an `sd` it is not fitted. Left out, a `guess` is needed."
    )
    sd: Annotated[FiniteFloat, Field(gt=0)] | None = Field(
        default=None, description="Standard deviation of the value: the constant is fitted, with both as its prior."
    )
    guess: FiniteFloat | None = Field(
        default=None, description="Where its fit begins. It is not zero, and the constant keeps its sign."
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> ConstantTable:
        if (self.value is None) == (self.guess is None):
            raise ValueError("needs either a value (it is known) or a guess (it is fitted)")
        if self.guess is not None and (self.sd is not None or self.guess == 0.0):
            raise ValueError("a guess has no sd and is not zero: it gives sign and size")
        return self


class SystemTable(Table):
    """A system in its own equations, or a ready-made one under ``like``: what is left out is then as it is there."""

    like: Text | None = Field(
        default=None,
        description="A ready-made system to begin with. Every other key replaces its own, and constants those of the "
        "same name. Left out, `coordinates`, `kinetic`, `output` and `places` are needed.",
    )
    coordinates: Annotated[dict[str, Text], Field(min_length=1, max_length=3)] | None = Field(
        default=None, description="Names of the coordinates, each with its SI unit."
    )
    input: _One | None = Field(
        default=None,
        description="Name of the recorded input, with its SI unit. Left out, there is none, and `[columns]` has none.",
    )
    constants: dict[str, ConstantTable] = Field(
        default={}, description="The constants of the equations, each a table of its own."
    )
    kinetic: Text | None = Field(default=None, description="Kinetic energy, in J.")
    potential: Text | None = Field(default=None, description="Potential energy, in J. Left out, it is zero.")
    dissipation: Text | None = Field(
        default=None, description="Rayleigh's function, half the power of linear losses, in W. Left out, it is zero."
    )
    forces: dict[str, Text] | None = Field(
        default=None,
        description="Generalised forces by coordinate, in J over the coordinate's unit. Left out, there are none.",
    )
    output: Text | None = Field(
        default=None,
        description="What the instrument reads: a coordinate, `dot(x)`, `ddot(x)`, or an expression of them.",
    )
    also: Annotated[dict[str, Text], Field(min_length=1, max_length=3)] | None = Field(
        default=None,
        description="What is read beside the output, by name: an expression as `output` is one. The column of each is "
        "declared under the same name in `[columns.also]`. Errors are told of the output, and fitted of all.",
    )
    places: Annotated[dict[str, Text], Field(min_length=1, max_length=6)] | None = Field(
        default=None,
        description="Where effects may act: names, each with the coordinate or expression that moves there.",
    )
