"""A spring whose rest position is not zero."""

from discovery.declarations.effect import Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import alpha, delta


class EquilibriumOffset(Potential):
    r"""The spring rests at a deflection that is not zero.

    .. math:: V = -\alpha\, \delta_0\, \delta
    """

    cite = "a constant generalised force; Nayfeh and Mook, Nonlinear Oscillations (1979), section 2.1"
    delta_0 = Parameter("q", "rest deflection", (-0.5, 0.5), Student(0.05), starts=(0.003, -0.003), latex=r"\delta_0")

    def expression(self):
        """Return V."""
        return -alpha * self.delta_0 * delta
