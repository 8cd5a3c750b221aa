"""The rod's own mass under motor acceleration."""

from discovery.declarations.effect import ARM, Kinetic
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import omega, omega_m


class DistributedMass(Kinetic):
    r"""The rod's own mass feels the acceleration of the motor.

    .. math:: T = A\, \dot\theta_t \dot\theta_m,\qquad A = \frac{11\, m_r}{2\,(140\, m + 33\, m_r)}

    from the static cubic shape of the rod; the equation of motion gains :math:`A\,\ddot\theta_m`.
    """

    systems = frozenset({ARM})
    cite = "Rayleigh, The Theory of Sound (1877), section 88"
    A = Parameter("1", "inertial coupling of the rod", (-0.2, 0.3), Normal(0.0, 0.02), starts=(0.01,), latex="A")

    def expression(self):
        """Return T."""
        return self.A * omega * omega_m
