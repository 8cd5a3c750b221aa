"""A unit inertia with a measured force-like input or none."""

from __future__ import annotations

from discovery.declarations.effect import ROTOR
from discovery.mechanics.one_coordinate import ForceDriven


class Oscillator(ForceDriven):
    r"""One coordinate q with unit inertia: q'' = g u(t) + effects, with the recorded input u (none in a free decay)."""

    name = "oscillator"
    has = frozenset({ROTOR})
    provides = frozenset({"friction_through_play"})
    # A spring rests elsewhere under a constant force: that is `equilibrium_offset`.
    provides_tied = frozenset({"constant_force"})
    in_library = True


BASE = Oscillator()
