r"""The end of the rod turns further than a few shapes of bending show, where it bears a moment.

The shapes of a base end without curvature; a moment at the end bends the rod there. What is missing of the turn, r, is
a residual flexibility (MacNeal) with a residual inertia (Rubin): a spring k_r, its damping d_r and an inertia j_r
between the slope of the shapes, s, and the inertia J that turns with the end, :math:`T = \tfrac12 J (\dot s + \dot
r)^2`. With

.. math:: p = r + g\, s,\qquad g = \frac{J}{J + j_r}

the inertias part: :math:`T = \tfrac12 (J + j_r)\, \dot p^2 + \tfrac12\, g\, j_r\, \dot s^2`, so

.. math:: \ddot r = -\frac{k_r r + d_r \dot r}{J + j_r} - g\, \ddot s,

and the end of the shapes feels the moment :math:`g\, (k_r r + d_r \dot r)`. All of it is gone where J is zero.

References
----------
R. H. MacNeal, Computers & Structures 1 (1971) 581; S. Rubin, AIAA Journal 13 (1975) 995.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Kinetic
from discovery.mechanics.base import Mechanics

#: The turn r beyond the slope of the shapes [rad], and its rate.
TURN, TURN_RATE = sp.symbols("r_e rd_e", real=True)


@dataclass(frozen=True)
class LoadedEnd:
    """The end of the rod with an inertia that turns with it."""

    share: sp.Expr  # share of that inertia which turns as the shapes do, j_r / (J + j_r)
    moment: sp.Expr  # moment on the slope of the shapes [s^-2]
    drop: sp.Expr  # acceleration of r at zero acceleration of that slope [rad/s^2]
    gain: sp.Expr  # change of r per change of that slope, where nothing resists, -g
    energy: sp.Expr  # what is stored in r and p beside the kinetic energy of the shapes [s^-2]

    def kinetic(self, energy: sp.Expr) -> sp.Expr:
        """Return the part of a kinetic energy that moves as the shapes do."""
        return self.share * energy if energy.has(s.slope_dot) else energy

    def states(self, slope_acceleration: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        """Return r and its rate with their time derivatives, given the acceleration of the slope of the shapes."""
        return {TURN: TURN_RATE, TURN_RATE: self.drop + self.gain * slope_acceleration}


def loaded_end(mechanics: Mechanics, effects: Sequence[Effect]) -> LoadedEnd | None:
    """Return what an inertia at the end of the rod asks of a base; None without one, or where the shapes show all."""
    kinetic = [e.expression() for e in effects if isinstance(e, Kinetic)]
    inertia = sp.Add(*[sp.diff(energy, s.slope_dot, 2) for energy in kinetic])
    if inertia == 0 or mechanics.end is None:
        return None
    end = mechanics.end
    whole = inertia + end.inertia
    gain = inertia / whole
    spring = end.stiffness * TURN + end.damping * TURN_RATE
    energy = (end.stiffness * TURN**2 + whole * (TURN_RATE + gain * s.slope_dot) ** 2) / 2
    return LoadedEnd(end.inertia / whole, gain * spring, -spring / whole, -gain, energy)
