"""A tip that turns with the end of the rod."""

from discovery.declarations.effect import ARM, Kinetic
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import slope_dot


class TipRotaryInertia(Kinetic):
    r"""The disc at the tip does not spin freely: it turns with the slope of the rod's end.

    .. math:: T = \tfrac12\, J\, \dot\theta(1)^2

    J is the disc's moment of inertia about its own centre over m_eff l^2, theta(1) the slope of the end in the fixed
    frame: theta_m + (3/2) delta for a small deflection. The moment that turns the disc also bends the rod at its end,
    which the shapes of the exact arm do not show: what is missing is a residual flexibility, see
    `discovery.mechanics.rod_end`. With it the first frequency of a beam with such a disc is met to 2 parts in 100000
    and the second one, which J lowers most, to 0.1 %, up to J = 0.04; a base of one coordinate has no second one.
    """

    systems = frozenset({ARM})
    cite = "Bhat and Wagner, Journal of Sound and Vibration 45 (1976) 304"
    J = Parameter(
        "1", "rotary inertia of the tip", (0.0, 0.3), HalfStudent(0.005),
        starts=(0.0003, 0.001, 0.003, 0.01, 0.03), latex="J",
    )  # fmt: skip

    def expression(self):
        """Return T."""
        return self.J * slope_dot**2 / 2
