"""The kinds of system, and what the rest of the package asks of them."""

from __future__ import annotations

from enum import StrEnum


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
