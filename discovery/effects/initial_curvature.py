"""A rod that is bent before anything pulls on it."""

from discovery.declarations.effect import Shape
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import arc


class InitialCurvature(Shape):
    r"""The unloaded rod is an arc of a circle instead of a straight line.

    .. math:: \theta(s) = \theta_m + \kappa_0\, s + \int_0^s \kappa\, d\sigma,\qquad U \text{ in } \kappa \text{ alone}

    s is the arc length in lengths of the arm. The arm then rests at a deflection of :math:`\kappa_0 / 2`, as with an
    offset of its equilibrium; what tells the two apart is the radius,
    :math:`\rho_t / l = 1 - e^2/10 - \kappa_0\, e/8 - \kappa_0^2/24` for a bending of e.
    """

    cite = "Antman, Nonlinear Problems of Elasticity, 2nd edition (2005), chapter 4"
    kappa_0 = Parameter(
        "q", "curvature of the unloaded rod, times its length", (-1.0, 1.0), Normal(0.0, 0.05),
        starts=(0.01, -0.01), latex=r"\kappa_0",
    )  # fmt: skip

    def rest_angle(self):
        """Return the slope of the unloaded rod."""
        return self.kappa_0 * arc
