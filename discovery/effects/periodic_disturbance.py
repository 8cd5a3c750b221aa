"""A periodic force on the tip."""

import numpy as np
import sympy as sp

from discovery.effect import Load
from discovery.parameters import LogNormal, Normal, Parameter
from discovery.symbols import t, v_x, v_y


class PeriodicDisturbance(Load):
    r"""A periodic force of fixed direction on the tip, for example a fan or a vibrating floor.

    .. math:: P = (a_s \sin\Omega t + a_c \cos\Omega t)\, v_x + (b_s \sin\Omega t + b_c \cos\Omega t)\, v_y

    The force keeps its direction in the plane while the arm turns under it; it swings along a line or an ellipse. An
    oscillator has one direction, and the first pair acts on it. Near the arm's own frequency it imitates any slow
    change of a free decay.
    """

    cite = "forced vibration; Den Hartog, Mechanical Vibrations (1956), chapter 2"
    pliable = True
    a_s = Parameter("s^-2 q", "sine amplitude along x", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), latex="a_s")
    a_c = Parameter("s^-2 q", "cosine amplitude along x", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), latex="a_c")
    b_s = Parameter(
        "s^-2 q", "sine amplitude along y", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), planar=True, latex="b_s"
    )
    b_c = Parameter(
        "s^-2 q", "cosine amplitude along y", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), planar=True, latex="b_c"
    )
    Omega = Parameter(
        "s^-1", "angular frequency", (0.1, 20.0), LogNormal(2.0, 1.0), default=2.0, shape=True, latex=r"\Omega",
        starts=(*np.arange(0.3, 1.5, 0.03).tolist(), *np.geomspace(1.5, 15.0, 110).tolist()),
    )  # fmt: skip

    def expression(self):
        """Return P."""
        sine, cosine = sp.sin(self.Omega * t), sp.cos(self.Omega * t)
        return (self.a_s * sine + self.a_c * cosine) * v_x + (self.b_s * sine + self.b_c * cosine) * v_y
