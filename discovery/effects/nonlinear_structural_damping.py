"""Damping inside the spring that grows with its deflection."""

from discovery.declarations.effect import ARM, Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import delta, delta_dot


class NonlinearStructuralDamping(Dissipation):
    r"""Losses inside the rod that grow with the square of the deflection, and act on its rate.

    .. math:: D = \tfrac12\, c_{s2}\, \delta^2 \dot\delta^2

    Friction on the speed of the tip that grows so is `amplitude_dependent_damping`; without a moving hub they are one.
    """

    systems = frozenset({ARM})
    anchored = True
    cite = "Nayfeh and Mook, Nonlinear Oscillations (1979), section 3.3; Banks and Inman (1991)"
    c_s2 = Parameter(
        "s^-1 q^-2", "nonlinear structural damping", (0.0, 20.0), HalfStudent(0.5), starts=(0.005, 0.05),
        latex="c_{s2}",
    )  # fmt: skip

    def expression(self):
        """Return D."""
        return self.c_s2 * delta**2 * delta_dot**2 / 2
