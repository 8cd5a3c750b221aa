"""A camera whose origin is not the hub."""

from discovery.declarations.effect import ARM, Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal


class CameraOriginOffset(Sensor):
    r"""The origin of the camera's frame lies beside the axis of the motor.

    .. math:: x_\mathrm{read} = x + x_0,\qquad y_\mathrm{read} = y + y_0
    """

    systems = frozenset({ARM})
    cite = "Hartley and Zisserman, Multiple View Geometry (2004), section 2.4"
    x_0 = Parameter("m", "camera origin along x", (-0.2, 0.2), Normal(0.0, 0.005), starts=(0.001,), latex="x_0")
    y_0 = Parameter("m", "camera origin along y", (-0.2, 0.2), Normal(0.0, 0.005), starts=(0.001,), latex="y_0")

    def arm_reading(self, tip_x, tip_y):
        """Return the shifted position."""
        return tip_x + self.x_0, tip_y + self.y_0
