"""A recorded input whose scale is wrong."""

from discovery.declarations.effect import ARM, Drive
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import theta_m


class InputGain(Drive):
    r"""The hub turns more or less than recorded by a constant factor, as with a gear ratio that is not the stated one.

    .. math:: \theta_m \to (1 + k_h)\, \theta_m

    Between two positions of rest it moves the tip as `angle_offset` does, and only several positions tell them apart.
    For an oscillator a factor on the input is already the base's own gain g.
    """

    systems = frozenset({ARM})
    cite = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration (1991)"
    k_h = Parameter(
        "1", "relative error of the hub's scale", (-0.3, 0.3), Normal(0.0, 0.01), starts=(0.002, -0.002), latex="k_h"
    )

    def expression(self):
        """Return the angle of the hub."""
        return (1 + self.k_h) * theta_m
