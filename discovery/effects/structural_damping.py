"""Damping inside the spring."""

from discovery.declarations.effect import ARM, Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import w2


class StructuralDamping(Dissipation):
    r"""Viscous losses inside the rod: they act on the rate of the deflection, not on the speed of the tip.

    .. math:: D = \tfrac12\, c_s\, w^2,\qquad w^2 = \dot\delta^2 \text{ for a linear spring}

    On the exact arm w^2 is the bending energy's form in the curvature rates (Kelvin-Voigt), so that the rod's higher
    modes are damped too.
    """

    systems = frozenset({ARM})
    cite = "Banks and Inman, Journal of Applied Mechanics 58 (1991) 716"
    c_s = Parameter("s^-1", "structural damping", (0.0, 5.0), HalfStudent(0.1), starts=(0.003, 0.03), latex="c_s")

    def expression(self):
        """Return D."""
        return self.c_s * w2 / 2
