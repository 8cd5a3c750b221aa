"""A recorded input whose zero is wrong."""

from discovery.declarations.effect import ARM, Drive
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import theta_m


class InputOffset(Drive):
    r"""The hub's true angle differs from the recorded one by a constant.

    .. math:: \theta_m \to \theta_m + \theta_h

    Nothing in the arm itself knows where the angle of the hub begins: in a level plane this is the same as
    `angle_offset` to every sample, and both are reported as one ambiguous group. Gravity, or a force of fixed
    direction, tells them apart; `equilibrium_offset` and `camera_origin_offset` change the radius as well. For an
    oscillator, whose input is a force, a constant error of it is `equilibrium_offset`.
    """

    systems = frozenset({ARM})
    cite = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration (1991)"
    theta_h = Parameter(
        "q", "zero of the hub", (-0.5, 0.5), Normal(0.0, 0.02), starts=(0.003, -0.003), latex=r"\theta_h"
    )

    def expression(self):
        """Return the angle of the hub."""
        return theta_m + self.theta_h
