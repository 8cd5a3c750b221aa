"""A pull away from a place."""

from discovery.declarations.effect import OSCILLATOR, ROTOR, Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import delta


class NegativeStiffness(Potential):
    r"""A pull away from the zero of the coordinate that grows with the distance: a bowed track, magnets.

    .. math:: V = -\tfrac12\, \kappa\, q^2

    It is offered where nothing ties the body. A place of its own is that of a `constant_force` beside it.
    """

    systems = frozenset({OSCILLATOR})
    anchored = False
    needs = ROTOR
    cite = "Carrella, Brennan and Waters, Journal of Sound and Vibration 301 (2007) 678"
    kappa = Parameter(
        "s^-2", "stiffness away from the middle", (0.0, 10.0), HalfStudent(1.0), starts=(0.01, 0.1, 0.5),
        latex=r"\kappa",
    )  # fmt: skip

    def expression(self):
        """Return V."""
        return -self.kappa * delta**2 / 2
