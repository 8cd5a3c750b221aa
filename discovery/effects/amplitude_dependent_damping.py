"""Damping that grows with the deflection."""

from discovery.declarations.effect import Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import delta, v2


class AmplitudeDependentDamping(Dissipation):
    r"""Viscous friction that grows with the square of the deflection.

    .. math:: D = \tfrac12\, \xi_2\, \delta^2 v_t^2

    It acts on the speed, as `viscous_damping` does: on an arm with a constant radius this is the term
    :math:`\xi_2\, \delta^2 \dot\theta_t` of the equation of motion. Losses inside a rod that grow with its bending are
    `nonlinear_structural_damping`.
    """

    anchored = True
    cite = "van der Pol (1926); Nayfeh and Mook, Nonlinear Oscillations (1979), section 3.3"
    xi_2 = Parameter(
        "s^-1 q^-2", "amplitude-dependent damping", (0.0, 20.0), HalfStudent(0.5), starts=(0.005, 0.05), latex=r"\xi_2"
    )

    def expression(self):
        """Return D."""
        return self.xi_2 * delta**2 * v2 / 2
