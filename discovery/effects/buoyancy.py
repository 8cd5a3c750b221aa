"""A body that weighs less than its mass."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, WEIGHT, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import delta_dot


class Buoyancy(Load):
    r"""The medium carries a part of a falling body, and moves along with it.

    .. math:: P = b_g\, \dot q,\qquad b_g = g_0 \left(1 - \frac{1 - m_f/m}{1 + m_a/m}\right)

    The body falls with g_0 - b_g: m_f is the mass of the medium in its place, m_a the mass that it sets in motion (half
    of m_f for a sphere). One fall tells the two only together. On a spring or a pendulum they change stiffness and
    inertia, which are free: there nothing tells them apart, but for a stated mass or length that the fit contradicts.
    It is offered to what falls; at a place of a declared system it is a `constant_force`.
    """

    systems = frozenset({OSCILLATOR})
    anchored = False
    needs = WEIGHT
    pliable = True
    cite = "Batchelor, An Introduction to Fluid Dynamics (1967), section 6.4"
    b_g = Parameter(
        "s^-2 q", "part of the gravitational acceleration that is carried", (0.0, 1.0), HalfStudent(0.05),
        starts=(0.001, 0.005), natural=True, latex="b_g",
    )  # fmt: skip

    def expression(self):
        """Return P."""
        return self.b_g * sp.sympify(delta_dot)
