"""A tip that turns with the end of the rod."""

from discovery.effect import ARM, Kinetic
from discovery.parameters import HalfNormal, Parameter
from discovery.symbols import slope_dot


class TipRotaryInertia(Kinetic):
    r"""The disc at the tip does not spin freely: it turns with the slope of the rod's end.

    .. math:: T = \tfrac12\, J\, \dot\theta(1)^2

    J is the disc's moment of inertia about its own centre over m_eff l^2, theta(1) the slope of the end in the fixed
    frame: theta_m + (3/2) delta for a small deflection. The shapes of the exact arm end without curvature. Its first
    mode is exact to 3 parts in 100000 up to J = 0.01, but its second one is slowed too little, on the paper's arm by
    0.5 % at J = 0.001 (its disc, stuck) and by 3 % at 0.003, where ringing is no longer predicted to the noise.
    """

    systems = frozenset({ARM})
    cite = "Bhat and Wagner, Journal of Sound and Vibration 45 (1976) 304"
    J = Parameter(
        "1", "rotary inertia of the tip", (0.0, 0.3), HalfNormal(0.005),
        starts=(0.0003, 0.001, 0.003, 0.01), latex="J",
    )  # fmt: skip

    def expression(self):
        """Return T."""
        return self.J * slope_dot**2 / 2
