"""A joint with play."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, SPRING, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import LEAST, alpha, delta, delta_dot, xi

_EDGE = sp.Float(0.05)  # of the half width, within which the contact is made


class Play(Load):
    r"""Play, or a dead zone, of a half width w_b: spring and damper of a joint do nothing before it is taken up.

    .. math:: F = \alpha\, \operatorname{clip}(q, -w_b, w_b) + \xi\, \dot q\, [\,|q| < w_b\,]

    This takes away what the declared joint does in the gap: the parts do not touch there, and beyond it they give way
    as declared. The whole play is 2 w_b, often far more than the spring gives way. Its edges are made a little smooth.
    """

    systems = frozenset({OSCILLATOR})
    anchored = True
    needs = SPRING
    on = delta_dot
    cite = "Nordin and Gutman, Automatica 38 (2002) 1633, the dead-zone model"
    w_b = Parameter(
        "q", "half width of the play", (0.0, 100.0), HalfStudent(1.0), starts=(0.03, 0.3, 1.0, 3.0, 10.0), latex="w_b"
    )

    def expression(self):
        """Return the force on the deflection."""
        ends = delta + self.w_b, delta - self.w_b
        clipped = (sp.Abs(ends[0]) - sp.Abs(ends[1])) / 2
        ahead, behind = (x / sp.sqrt(x**2 + (_EDGE * self.w_b) ** 2 + LEAST) for x in ends)
        return alpha * clipped + xi * (ahead - behind) / 2 * delta_dot
