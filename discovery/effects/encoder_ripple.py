"""An encoder whose scale is not even."""

import sympy as sp

from discovery.declarations.effect import ARM, Drive
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import LogNormal, Normal
from discovery.declarations.symbols import theta_m

#: Cycles in one turn of the hub that the arm can follow.
_FOLLOWED = 30.0


class EncoderRipple(Drive):
    r"""The hub leads and lags the angle that the encoder reads, periodically in that angle.

    .. math:: \theta_m \to \theta_m + r_s \sin N\theta_m + r_c\, (\cos N\theta_m - 1)

    N counts the cycles in one turn of the hub: 1 for an eccentric encoder, 2n for the wave generator of a harmonic
    drive of ratio n. The encoder's zero is set where the hub is at zero; if it is not, that is an `angle_offset`. Above
    about 30 cycles the arm is too slow to follow: what is left is the constant error after a move, which tells no N,
    and which a gain of the hub leaves as well.
    """

    systems = frozenset({ARM})
    pliable = True
    cite = "Tuttle and Seering, IEEE Transactions on Robotics and Automation 12 (1996) 368"
    r_s = Parameter("q", "sine amplitude of the ripple", (-0.2, 0.2), Normal(0.0, 0.01), starts=(0.001,), latex="r_s")
    r_c = Parameter("q", "cosine amplitude of the ripple", (-0.2, 0.2), Normal(0.0, 0.01), starts=(0.001,), latex="r_c")
    N_e = Parameter(
        "1", "cycles in one turn of the hub", (1.0, 300.0), LogNormal(8.0, 1.5), default=8.0, shape=True, latex="N",
        starts=(*[0.5 * k for k in range(2, 17)], *range(9, 33), *range(34, 61, 2), 70, 80, 100, 120, 150, 200),
    )  # fmt: skip

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return whether there are too many cycles to be followed: the rest does what an offset does."""
        return values["N_e"] > _FOLLOWED

    def expression(self):
        """Return the angle of the hub."""
        return theta_m + self.r_s * sp.sin(self.N_e * theta_m) + self.r_c * (sp.cos(self.N_e * theta_m) - 1)
