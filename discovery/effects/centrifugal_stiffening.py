"""The part of the shortening radius that grows with the square of the tip's rate."""

from discovery.declarations.effect import ARM, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import delta, omega


class CentrifugalStiffening(Load):
    r"""Turning faster pulls the tip outwards, which straightens the arm.

    .. math:: F_\theta = -c_1\, \delta\, \dot\theta_t^2

    First principles give :math:`c_1 = 1/5` to third order; alone, without `coriolis_coupling` and `radial_inertia`, it
    has no meaning of its own, and fits a false cubic stiffness.
    """

    systems = frozenset({ARM})
    on = omega
    cite = "Meirovitch, Methods of Analytical Dynamics (1970), chapter 2; radius law of the elastica"
    c_cen = Parameter("q^-2", "centrifugal stiffening", (-2.0, 2.0), Normal(0.0, 0.3), starts=(0.2, -0.2), latex="c_1")

    def expression(self):
        """Return the force on theta_t."""
        return -self.c_cen * delta * omega**2
