"""The part of the radius that the tension of the turning rod adds."""

from discovery.declarations.effect import ARM, Closure
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import alpha, delta, omega


class RadiusTension(Closure):
    r"""The centrifugal pull of the tip straightens the bent rod a little, which lengthens the radius.

    .. math:: \rho_t = l\left(1 + r_T\, \frac{\delta^2\, \dot\theta_t^2}{\alpha}\right)

    Beside `radius_law` both changes of the radius add up. The elastica's radial compliance gives
    :math:`r_T \approx 0.017`, and more where the rod has mass; the exact arm has it of itself.
    """

    systems = frozenset({ARM})
    cite = "elastica under a force along the radius, see docs/MECHANICS.md"
    r_T = Parameter(
        "q^-4",
        "lengthening of the radius under tension",
        (-0.5, 0.5),
        Normal(0.0, 0.05),
        starts=(0.01, -0.01),
        latex="r_T",
    )

    def expression(self):
        """Return rho/l."""
        return 1 + self.r_T * delta**2 * omega**2 / alpha
