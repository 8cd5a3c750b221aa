"""An instrument whose scale is wrong."""

from discovery.declarations.effect import Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal


class PositionScale(Sensor):
    r"""The instrument reads too much or too little by a constant factor.

    .. math:: y_\mathrm{read} = (1 + s)\, y
    """

    cite = "Hartley and Zisserman, Multiple View Geometry (2004), section 2.4"
    stands_for = "length"
    s = Parameter("1", "relative scale error", (-0.3, 0.3), Normal(0.0, 0.01), starts=(0.002, -0.002), latex="s")

    def arm_reading(self, tip_x, tip_y):
        """Return the scaled position."""
        return (1 + self.s) * tip_x, (1 + self.s) * tip_y

    def oscillator_reading(self, output):
        """Return the scaled output."""
        return (1 + self.s) * output
