"""An instrument whose zero is not the true one."""

import sympy as sp

from discovery.declarations.effect import Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student


class AngleOffset(Sensor):
    r"""The zero of the sensor is not the true one: the bias of a gyroscope or an accelerometer, the zero of an encoder.

    .. math:: \theta_\mathrm{read} = \theta_t + \theta_0

    Readings are shifted by it. Of an arm, the frame of the camera is turned against the encoder's zero.
    """

    called = "zero offset of the sensor"
    cite = "Hartley and Zisserman, Multiple View Geometry (2004), section 2.4"
    theta_0 = Parameter("q", "zero offset", (-0.5, 0.5), Student(0.02), starts=(0.003, -0.003), latex=r"\theta_0")

    def arm_reading(self, tip_x, tip_y):
        """Return the position in the turned frame."""
        cosine, sine = sp.cos(self.theta_0), sp.sin(self.theta_0)
        return cosine * tip_x - sine * tip_y, sine * tip_x + cosine * tip_y

    def oscillator_reading(self, output):
        """Return the shifted output."""
        return output + self.theta_0
