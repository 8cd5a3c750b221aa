"""The cubic spring."""

from discovery.declarations.effect import Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import delta


class CubicStiffness(Potential):
    r"""Symmetric hardening (or softening) of the spring.

    .. math:: V = \tfrac14\, \beta\, \delta^4

    The restoring force is :math:`\beta \delta^3`, the paper's equation (15).
    """

    cite = "source paper, equation (15); Duffing (1918)"
    beta = Parameter("s^-2 q^-2", "cubic stiffness", (-30.0, 30.0), Student(2.0), starts=(0.1, -0.1), latex=r"\beta")

    def expression(self):
        """Return V."""
        return self.beta * delta**4 / 4
