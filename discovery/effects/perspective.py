"""A camera that looks askew."""

from discovery.declarations.effect import OSCILLATOR, Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal


class Perspective(Sensor):
    r"""The picture of a path that comes nearer on one side, as a camera sees it that does not look straight at it.

    .. math:: y_\mathrm{read} = \frac{y}{1 - p\, y}

    Any other sensor of a position whose sensitivity changes along its range reads like it where p y is small.
    """

    systems = frozenset({OSCILLATOR})
    pictured = True
    cite = "Hartley and Zisserman, Multiple View Geometry (2004), section 2.2"
    p_y = Parameter(
        "q^-1",
        "relative change of scale per reading",
        (-0.6, 0.6),
        Normal(0.0, 0.05),
        starts=(0.005, -0.005),
        latex="p",
    )

    def oscillator_reading(self, output):
        """Return the projected output."""
        return output / (1 - self.p_y * output)
