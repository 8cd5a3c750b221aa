"""Viscous friction that differs between the two directions of motion."""

import sympy as sp

from discovery.declarations.effect import Load
from discovery.declarations.parameters import Normal, Parameter
from discovery.declarations.symbols import omega, rho


class AsymmetricViscousDamping(Load):
    r"""Viscous friction that is stronger one way than the other.

    .. math:: F_\theta = -\xi_a\, \rho^2 |\dot\theta_t|

    Beside `viscous_damping` the coefficient is :math:`\xi + \xi_a` forward and :math:`\xi - \xi_a` backward; alone it
    would feed the motion on the way back, so that :math:`|\xi_a| \le \xi` in a passive system.
    """

    on = omega
    cite = "Dixon, The Shock Absorber Handbook (2007)"
    xi_a = Parameter(
        "s^-1",
        "asymmetry of the viscous damping",
        (-5.0, 5.0),
        Normal(0.0, 0.2),
        starts=(0.003, -0.003, 0.03, -0.03),
        latex=r"\xi_a",
    )

    def expression(self):
        """Return the force on theta_t."""
        return -self.xi_a * rho**2 * sp.Abs(omega)
