"""A clamp that gives way."""

from discovery.declarations.effect import Shape
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent


class BaseCompliance(Shape):
    r"""A torsional spring between the hub, where the encoder is, and the root of the rod.

    .. math:: \theta(s) = \theta_m + c_b\, \kappa(0) + \int_0^s \kappa\, d\sigma,\qquad
              U = \tfrac16 \int_0^1 \kappa^2\, ds + \tfrac16\, c_b\, \kappa(0)^2,\qquad c_b = \frac{EI}{k\, l}

    k is the stiffness of the spring; its moment is that of the rod at its root, so the root turns by c_b times the
    curvature there. A small motion is only slower, alpha by 1 + 3 c_b; what remains is geometry: the part
    1 / (1 + 3 c_b) of the deflection bends the rod and shortens the radius, the rest turns it as a whole.
    """

    imitative = True  # a rod that is not uniform shortens the radius alike
    cite = "Batista, Large deflections and stability of spring-hinged cantilever beam (2018), arXiv:1812.09164"
    c_b = Parameter(
        "1", "compliance of the clamp over l / EI of the rod", (0.0, 2.0), HalfStudent(0.1),
        starts=(0.01, 0.1), latex="c_b",
    )  # fmt: skip

    def root_turn(self):
        """Return the turn of the root per curvature."""
        return self.c_b
