"""Viscous friction that differs between the two directions of motion."""

import sympy as sp

from discovery.declarations.effect import Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import omega, rho, xi


class AsymmetricViscousDamping(Load):
    r"""Viscous friction that is stronger one way than the other.

    .. math:: F_\theta = -a_v\, \xi\, \rho^2 |\dot\theta_t|

    The coefficient is :math:`(1 + a_v)\, \xi` forward and :math:`(1 - a_v)\, \xi` backward, where :math:`\xi` is the
    linear damping. Neither is negative, because a passive damper never feeds the motion: :math:`|a_v| \le 1`.
    """

    on = omega
    cite = "Dixon, The Shock Absorber Handbook (2007)"
    a_v = Parameter(
        "1", "asymmetry of the viscous damping, a share of it", (-1.0, 1.0), Normal(0.0, 0.5),
        starts=(0.1, -0.1, 0.5, -0.5), natural=True, latex="a_v",
    )  # fmt: skip

    def expression(self):
        """Return the force on theta_t."""
        return -self.a_v * xi * rho**2 * sp.Abs(omega)
