"""Damping that grows with the deflection."""

from discovery.declarations.effect import Dissipation
from discovery.declarations.parameters import HalfNormal, Parameter
from discovery.declarations.symbols import delta, delta_dot


class AmplitudeDependentDamping(Dissipation):
    r"""Losses that grow with the square of the deflection.

    .. math:: D = \tfrac12\, \xi_2\, \delta^2 \dot\delta^2
    """

    anchored = True
    cite = "van der Pol (1926); Nayfeh and Mook, Nonlinear Oscillations (1979), section 3.3"
    xi_2 = Parameter(
        "s^-1 q^-2", "amplitude-dependent damping", (0.0, 20.0), HalfNormal(0.5), starts=(0.005, 0.05), latex=r"\xi_2"
    )

    def expression(self):
        """Return D."""
        return self.xi_2 * delta**2 * delta_dot**2 / 2
