"""Damping inside the spring."""

from discovery.effect import ARM, Dissipation
from discovery.parameters import HalfNormal, Parameter
from discovery.symbols import delta_dot


class StructuralDamping(Dissipation):
    r"""Viscous losses inside the rod: they act on the rate of the deflection, not on the speed of the tip.

    .. math:: D = \tfrac12\, c_s\, \dot\delta^2
    """

    systems = frozenset({ARM})
    cite = "Banks and Inman, Journal of Applied Mechanics 58 (1991) 716"
    c_s = Parameter("s^-1", "structural damping", (0.0, 5.0), HalfNormal(0.1), starts=(0.003, 0.03), latex="c_s")

    def expression(self):
        """Return D."""
        return self.c_s * delta_dot**2 / 2
