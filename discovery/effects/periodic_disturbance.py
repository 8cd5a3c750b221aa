"""A periodic force on the tip."""

import sympy as sp

from discovery.effect import Load
from discovery.parameters import LogNormal, Normal, Parameter
from discovery.symbols import omega, rho, t


class PeriodicDisturbance(Load):
    r"""A periodic force across the tip, for example a fan or a vibrating floor.

    .. math:: P = \rho\,(a_s \sin\Omega t + a_c \cos\Omega t)\, \dot\theta_t
    """

    cite = "forced vibration; Den Hartog, Mechanical Vibrations (1956), chapter 2"
    pliable = True
    a_s = Parameter("s^-2 q", "sine amplitude", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), latex="a_s")
    a_c = Parameter("s^-2 q", "cosine amplitude", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), latex="a_c")
    Omega = Parameter(
        "s^-1", "angular frequency", (0.1, 20.0), LogNormal(2.0, 1.0), default=2.0, shape=True, latex=r"\Omega"
    )

    def expression(self):
        """Return P."""
        return rho * (self.a_s * sp.sin(self.Omega * t) + self.a_c * sp.cos(self.Omega * t)) * omega
