"""Kinds of systems: what a rig file may describe, and what its recordings then hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from discovery.declarations.system import System


@dataclass(frozen=True)
class Kind:
    """A kind of system with one degree of freedom."""

    name: str  # the word for it in rig files
    base: str  # name of the mechanics of the bare system
    declared: tuple[str, ...]  # effect ids of the model that is declared where the rig file names none
    needs_input: bool | None  # whether recordings have an input; None where they may
    #: input, output: what they are, for messages.
    input: str
    output: str
    unit: str | None = None  # unit whose dimension the output must have; None for any
    may_be_bare: bool = False  # whether a model without any effect describes a motion worth fitting
    fewest: int = 30  # samples that a recording needs at least
    #: How the input runs between samples where the rig file does not say it.
    interpolation: Literal["motion", "spline"] = "spline"
    returns: bool = False  # whether it has a rest position, about which it swings where nothing drives it
    #: hangs, falls, shaken: whether gravity turns it, gravity moves it, or what it hangs on is moved.
    hangs: bool = False
    falls: bool = False
    shaken: bool = False
    #: Names of the mechanics on which effects are searched, as a rig file may declare the signals; none where it states
    #: the equations.
    searched: tuple[str, ...] = ()
    general: bool = False  # whether it may be any such system: a reader is then told of its input and its output

    @property
    def words(self) -> tuple[str, str]:
        """Input and output in the words of a reader."""
        return ("input", "output") if self.general else (self.input, self.output)

    @property
    def has_rod(self) -> bool:
        """Whether a rod bends between a hub that turns and the tip that is read."""
        return System.of(self.name).has_rod

    @property
    def has_own_equations(self) -> bool:
        """Whether the rig file states the equations."""
        return not self.base

    @property
    def rests_anywhere(self) -> bool:
        """Whether it may rest at any reading: neither gravity nor a base tells where zero is."""
        return self.returns and not (self.hangs or self.shaken)


PAPER_MODEL = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law")
LINEAR_MODEL = ("viscous_damping", "linear_stiffness")

KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "flexible_arm",
            "constant_radius",
            PAPER_MODEL,
            True,
            "motor angle",
            "tip position",
            interpolation="motion",
            searched=("elastica_calm",),
        ),
        Kind(
            "oscillator",
            "oscillator",
            LINEAR_MODEL,
            None,
            "force",
            "deflection from rest",
            returns=True,
            searched=("oscillator", "accelerometer", "inverse_dynamics"),
            general=True,
        ),
        Kind(
            "pendulum",
            "oscillator",
            declared=("viscous_damping", "gravity_torque"),
            needs_input=None,
            input="torque",
            output="angle from hanging",
            unit="rad",
            returns=True,
            hangs=True,
            searched=("oscillator", "accelerometer"),
        ),
        Kind(
            "base_excited",
            "base_excited",
            LINEAR_MODEL,
            True,
            "motion of the base or hub",
            "deflection relative to the base",
            interpolation="motion",
            returns=True,
            shaken=True,
            searched=("base_excited", "moving_pivot"),
        ),
        Kind(
            "drive",
            "oscillator",
            ("viscous_damping",),
            True,
            "force",
            "position",
            may_be_bare=True,
            searched=("oscillator", "accelerometer", "servo", "inverse_dynamics"),
        ),
        Kind("system", "", (), None, "input", "output", may_be_bare=True),
        Kind(
            "falling_body",
            "falling_body",
            declared=(),
            needs_input=False,
            input="none",
            output="height",
            unit="m",
            may_be_bare=True,
            fewest=20,
            falls=True,
            searched=("falling_body",),
        ),
    )
}
"""Every kind by its name."""
