"""The next term of the static radius law."""

from discovery.declarations.effect import ARM, Closure
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import delta


class RadiusQuartic(Closure):
    r"""What the radius law of the elastica has beyond the cosine.

    .. math:: \rho_t = l\,(1 + r_4\, \delta^4)

    Beside `radius_law` both changes of the radius add up: :math:`\rho_t/l = \cos(\gamma\delta) + r_4\delta^4`. The
    elastica's own radius, which the exact arm has, leaves :math:`r_4 \approx 0.003`.
    """

    systems = frozenset({ARM})
    cite = "series of the elastica, see docs/MECHANICS.md; source paper, equation (16), for the cosine"
    r_4 = Parameter(
        "q^-4", "quartic term of the radius", (-0.2, 0.2), Normal(0.0, 0.02), starts=(0.003, -0.003), latex="r_4"
    )

    def expression(self):
        """Return rho/l."""
        return 1 + self.r_4 * delta**4
