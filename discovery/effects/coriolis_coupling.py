"""The part of the shortening radius in the product of both rates."""

from discovery.declarations.effect import ARM, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import delta, delta_dot, omega


class CoriolisCoupling(Load):
    r"""A tip that moves inwards while the arm turns is driven forward.

    .. math:: F_\theta = -c_2\, \delta\, \dot\delta\, \dot\theta_t

    First principles give :math:`c_2 = -2/5` to third order.
    """

    systems = frozenset({ARM})
    on = omega
    called = "Coriolis coupling"
    cite = "Meirovitch, Methods of Analytical Dynamics (1970), chapter 2; radius law of the elastica"
    c_cor = Parameter("q^-2", "Coriolis coupling", (-3.0, 3.0), Normal(0.0, 0.5), starts=(-0.4, 0.4), latex="c_2")

    def expression(self):
        """Return the force on theta_t."""
        return -self.c_cor * delta * delta_dot * omega
