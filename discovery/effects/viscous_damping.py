"""Viscous friction."""

from discovery.declarations.effect import Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import v2


class ViscousDamping(Dissipation):
    r"""Viscous friction, proportional to the speed.

    .. math:: D = \tfrac12\, \xi\, v_t^2

    With a constant radius this is the term :math:`\xi \dot\theta_t` of the paper's equation (15).
    """

    cite = "source paper, equation (15)"
    xi = Parameter("s^-1", "viscous damping", (0.0, 1e3), HalfStudent(2.0), starts=(0.01,), latex=r"\xi")

    def expression(self):
        """Return D."""
        return self.xi * v2 / 2
