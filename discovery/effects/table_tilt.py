"""Gravity in a plane that is not level."""

from discovery.declarations.effect import ARM, Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import length, x_g, y_g

#: Standard gravity [m s^-2].
G = 9.80665


class TableTilt(Potential):
    r"""The air table is not level: gravity pulls the moving mass downhill.

    .. math:: V = -\frac{g}{l}\,(\phi_x\, x_g + \phi_y\, y_g)

    The tilts are the downhill slopes along the two axes of the camera; x_g and y_g are the
    first moments of the mass in lengths of the arm.
    """

    systems = frozenset({ARM})
    cite = "statics of a point mass on an inclined plane"
    phi_x = Parameter(
        "rad", "downhill slope along x", (-0.1, 0.1), Normal(0.0, 0.01), starts=(0.001, -0.001), latex=r"\phi_x"
    )
    phi_y = Parameter(
        "rad", "downhill slope along y", (-0.1, 0.1), Normal(0.0, 0.01), starts=(0.001, -0.001), latex=r"\phi_y"
    )

    def expression(self):
        """Return V."""
        return -G / length * (self.phi_x * x_g + self.phi_y * y_g)
