"""The static radius law of the tip."""

import sympy as sp

from discovery.declarations.effect import ARM, Closure
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import delta


class RadiusLaw(Closure):
    r"""The tip comes nearer to the hub as the rod bends.

    .. math:: \rho_t = l \cos(\gamma\, \delta)

    The paper's equation (16). The small-deflection elastica gives :math:`\gamma = 1/\sqrt5`.
    """

    systems = frozenset({ARM})
    cite = "source paper, equation (16)"
    gamma = Parameter("q^-1", "radius law", (0.0, 1.5), Normal(0.45, 0.3), starts=(0.45,), latex=r"\gamma")

    def expression(self):
        """Return rho/l."""
        return sp.cos(self.gamma * delta)
