"""Quadratic drag of the tip."""

import sympy as sp

from discovery.declarations.effect import Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import v2


class QuadraticDrag(Dissipation):
    r"""Drag of a body in a still fluid, proportional to the square of its speed.

    .. math:: D = \tfrac13\, c_2\, v_t^3

    For a body of frontal area A and mass m, :math:`c_2 = \rho_f C_d A l / (2m)`.
    """

    cite = "Hoerner, Fluid-Dynamic Drag (1965), chapter 1"
    c_2 = Parameter("q^-1", "quadratic drag", (0.0, 1e3), HalfStudent(0.3), starts=(0.005, 0.05), latex="c_2")

    def expression(self):
        """Return D."""
        return self.c_2 * v2 * sp.sqrt(v2) / 3
