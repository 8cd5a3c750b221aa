"""The part of the shortening radius in the square of the deflection's rate."""

from discovery.declarations.effect import ARM, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import alpha_m, delta, delta_dot, omega


class RadialInertia(Load):
    r"""Moving the tip inwards and outwards takes force as well.

    .. math:: F_\theta = -c_3\, \delta\, (\dot\delta^2 - \delta\, \ddot\theta_m)

    Both terms come from the kinetic energy :math:`c_3 (\delta \dot\delta)^2 / 2` of the radial motion; first principles
    give :math:`c_3 = 1/25` to third order.
    """

    systems = frozenset({ARM})
    on = omega
    cite = "Meirovitch, Methods of Analytical Dynamics (1970), chapter 2; radius law of the elastica"
    c_rad = Parameter(
        "q^-2", "inertia of the radial motion", (-2.0, 2.0), Normal(0.0, 0.3), starts=(0.04, -0.2), latex="c_3"
    )

    def expression(self):
        """Return the force on theta_t."""
        return -self.c_rad * delta * (delta_dot**2 - delta * alpha_m)
