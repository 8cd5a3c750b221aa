"""An instrument whose zero drifts."""

import sympy as sp

from discovery.declarations.effect import Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import t


class ZeroDrift(Sensor):
    r"""The zero of the instrument drifts steadily, as one that warms up.

    .. math:: y_\mathrm{read} = y + z_t\, t

    The frame of an arm's camera turns so. One rate holds for all recordings, from the zero of their times on. A body
    that nothing ties is not told from one that drifts.
    """

    cite = "Doebelin, Measurement Systems, 5th edition (2004), section 3.3"
    anchored = True
    z_t = Parameter("q s^-1", "drift of zero", (-0.05, 0.05), Student(3e-4), starts=(3e-5, -3e-5), latex="z_t")

    def arm_reading(self, tip_x, tip_y):
        """Return the position in the turning frame."""
        cosine, sine = sp.cos(self.z_t * t), sp.sin(self.z_t * t)
        return cosine * tip_x - sine * tip_y, sine * tip_x + cosine * tip_y

    def oscillator_reading(self, output):
        """Return the drifting output."""
        return output + self.z_t * t
