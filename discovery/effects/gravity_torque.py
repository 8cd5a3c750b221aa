"""Gravity on a link that swings in a vertical plane."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import theta


class GravityTorque(Potential):
    r"""Gravity pulls a link in a vertical plane towards the direction in which it hangs.

    .. math:: V = -k_g \cos(\theta - \theta_g) = -g_c \cos\theta - g_s \sin\theta

    :math:`k_g = m g_0 r / J = \sqrt{g_c^2 + g_s^2}` with the distance r of the centre of mass from the axis and the
    inertia J about it, and :math:`\theta_g = \operatorname{atan2}(g_s, g_c)` is where the link hangs. The coordinate is
    an angle; for the arm on its table see `table_tilt`.
    """

    systems = frozenset({OSCILLATOR})
    angular = True
    ties = True
    cite = "Huygens, Horologium Oscillatorium (1673); Baker and Blackburn, The Pendulum (2005)"
    # In units of the swing, what pulls is the larger the smaller the swing.
    g_c = Parameter(
        "s^-2 q",
        "gravity torque across the zero of the angle",
        (-3e3, 3e3),
        Student(2.0),
        starts=(0.1, -0.1),
        latex="g_c",
    )
    g_s = Parameter(
        "s^-2 q",
        "gravity torque along the zero of the angle",
        (-3e3, 3e3),
        Student(2.0),
        starts=(0.1, -0.1),
        latex="g_s",
    )

    def expression(self):
        """Return V."""
        return -self.g_c * sp.cos(theta) - self.g_s * sp.sin(theta)
