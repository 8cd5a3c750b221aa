"""What moves rubs against the ground, not against its base."""

from discovery.declarations.effect import OSCILLATOR, SHAKEN, Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import slope_dot


class GroundDamping(Dissipation):
    r"""Viscous friction on a guide that stands still, or in still air, beside a base that moves.

    .. math:: D = \tfrac12\, c_g\, \dot q_0^2,\qquad q_0 = q + u

    The force is :math:`c_g (\dot q + \dot u)`: it damps as `viscous_damping` does, and holds the body back where its
    base moves by u.
    """

    systems = frozenset({OSCILLATOR})
    needs = SHAKEN
    cite = "Den Hartog, Mechanical Vibrations (1956), section 2.9"
    c_g = Parameter(
        "s^-1", "viscous damping against the ground", (0.0, 20.0), HalfStudent(1.0), starts=(0.01,), latex="c_g"
    )

    def expression(self):
        """Return D."""
        return self.c_g * slope_dot**2 / 2
