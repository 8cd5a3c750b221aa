"""A spring that changes during the recording."""

from discovery.declarations.effect import Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import U, alpha, t


class StiffnessDrift(Potential):
    r"""The stiffness changes slowly with time, as with temperature.

    .. math:: V = \alpha\, r\, t\, U
    """

    cite = "linear parameter drift; Ljung, System Identification (1999), section 11.2"
    r = Parameter(
        "s^-1",
        "relative stiffness drift",
        (-0.05, 0.05),
        Normal(0.0, 0.002),
        starts=(3e-5, -3e-5, 3e-4, -3e-4),
        latex="r",
    )

    def expression(self):
        """Return V."""
        return alpha * self.r * t * U
