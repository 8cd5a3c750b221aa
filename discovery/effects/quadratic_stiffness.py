"""Asymmetric spring."""

from discovery.declarations.effect import Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import delta


class QuadraticStiffness(Potential):
    r"""Asymmetry of the spring: stiffer on one side than on the other.

    .. math:: V = \tfrac13\, k_2\, \delta^3
    """

    cite = "Nayfeh and Mook, Nonlinear Oscillations (1979), section 2.1"
    k_2 = Parameter("s^-2 q^-1", "quadratic stiffness", (-30.0, 30.0), Student(2.0), starts=(0.03, -0.03), latex="k_2")

    def expression(self):
        """Return V."""
        return self.k_2 * delta**3 / 3
