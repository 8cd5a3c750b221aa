"""Fibres that rub against each other."""

import sympy as sp

from discovery.declarations.effect import Memory
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import alpha, bend_dot

_SLIP = sp.Symbol("z_h", real=True)


class Hysteresis(Memory):
    r"""Internal friction of the material, as in a fibre composite: the Bouc-Wen law of exponent two.

    .. math:: P = -\alpha\, h_b\, z\, \dot b,\qquad
              \dot z = \dot b - \frac{|\dot b|\,|z|\, z + \dot b\, z^2}{2 w_h^2}

    b is the bending at a place of the rod, a third of the curvature there, or the deflection of a linear spring. Around
    every turning point the material is stiffer by the share h_b; beyond a bending of about w_h the fibres slip and the
    share is gone. Unlike a viscous loss, the loss of a cycle does not depend on how fast it is run. It is offered where
    the recorded motion turns back twice.
    """

    cite = "Wen, Journal of the Engineering Mechanics Division 102 (1976) 249; Ismail et al. (2009)"
    local = True
    remembers = True
    h_b = Parameter(
        "1", "stiffness that slips, over that of the spring", (0.0, 3.0), HalfStudent(0.1), starts=(0.01,), latex="h_b"
    )
    w_h = Parameter(
        "q", "bending at which it slips", (0.003, 3.0), LogNormal(0.2, 1.0), default=0.2,
        starts=(0.03, 0.08, 0.2, 0.5, 1.2), shape=True, latex="w_h",
    )  # fmt: skip

    def states(self):
        """Return the slipping bending with its rate."""
        held = (sp.Abs(bend_dot) * sp.Abs(_SLIP) * _SLIP + bend_dot * _SLIP**2) / (2 * self.w_h**2)
        return {_SLIP: bend_dot - held}

    def relaxation(self):
        """Return how fast it slips: once in half of its reach at most."""
        return {_SLIP: 2 * sp.Abs(bend_dot) / self.w_h}

    def expression(self):
        """Return P."""
        return -alpha * self.h_b * _SLIP * bend_dot
