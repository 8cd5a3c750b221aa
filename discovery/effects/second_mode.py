"""A second mode of vibration."""

import numpy as np
import sympy as sp

from discovery.declarations.effect import Mode
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import LogNormal, Student
from discovery.declarations.symbols import push

_Z, _RATE = sp.symbols("z_2 zd_2", real=True)


class SecondMode(Mode):
    r"""A second mode of vibration that the same input moves: what is read is q + z.

    .. math:: \ddot z + 2 \zeta_2 \omega_2 \dot z + \omega_2^2 z = g_2\, g u

    A flexible structure under one force is a sum of such modes; g_2 is how much this one takes part, over the first. On
    a moving base g u is -p u''. A recording starts with the mode at rest: of a free decay, which nothing excites, it
    explains nothing. Record the input that excites it, or begin where the mode has died. The exact arm contains its
    higher modes. Two inertias with a joint of its own losses are a system, such as the `two_mass_drive`.
    """

    cite = "Meirovitch, Fundamentals of Vibrations (2001), section 7.6; Gawronski, Advanced Structural Dynamics (2004)"
    g_2 = Parameter("1", "participation over that of the first mode", (-1e3, 1e3), Student(3.0), starts=(0.01,))
    omega_2 = Parameter(
        "s^-1", "angular frequency of the second mode", (0.02, 1e3), LogNormal(3.0, 1.5), default=3.0, shape=True,
        starts=(0.15, 0.25, 0.4, 0.6, 0.8, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.3, 8.0, 12.0, 18.0),
        latex=r"\omega_2",
    )  # fmt: skip
    zeta_2 = Parameter(
        "1", "damping ratio of the second mode", (0.0, 2.0), LogNormal(0.05, 1.0), default=0.05, shape=True,
        starts=(0.02, 0.1), latex=r"\zeta_2",
    )  # fmt: skip

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return whether it creeps in the place of vibrating, or for less than a cycle, as what drifts does."""
        return values["zeta_2"] > 1.0 or values["omega_2"] * duration < 2 * np.pi

    def displacement(self):
        """Return z."""
        return _Z

    def states(self):
        """Return z and its rate with their time derivatives."""
        loss = 2 * self.zeta_2 * self.omega_2 * _RATE
        return {_Z: _RATE, _RATE: self.g_2 * push - loss - self.omega_2**2 * _Z}
