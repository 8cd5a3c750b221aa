"""Fifth-order spring."""

from discovery.declarations.effect import Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import delta


class QuinticStiffness(Potential):
    r"""Fifth-order restoring force, the next symmetric term after the cubic one.

    .. math:: V = \tfrac16\, k_5\, \delta^6
    """

    cite = "Nayfeh and Mook, Nonlinear Oscillations (1979), section 2.1"
    k_5 = Parameter("s^-2 q^-4", "quintic stiffness", (-30.0, 30.0), Student(2.0), starts=(0.05, -0.05), latex="k_5")

    def expression(self):
        """Return V."""
        return self.k_5 * delta**6 / 6
