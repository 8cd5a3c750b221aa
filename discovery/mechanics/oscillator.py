"""A unit inertia with a measured force-like input or none."""

from __future__ import annotations

from discovery.mechanics.one_coordinate import ForceDriven

__all__ = ["BASE", "Oscillator"]


class Oscillator(ForceDriven):
    r"""One coordinate q with unit inertia: q'' = g u(t) + effects, with the recorded input u (none in a free decay)."""

    name = "oscillator"
    in_library = True


BASE = Oscillator()
