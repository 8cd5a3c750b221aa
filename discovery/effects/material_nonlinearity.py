"""A material that hardens or softens as it bends."""

from discovery.declarations.effect import ARM, Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.symbols import U_4, alpha


class MaterialNonlinearity(Potential):
    r"""The bending moment is not proportional to the curvature of the rod.

    .. math:: M = EI\,(\kappa + b_3\, \kappa^3),\qquad V = \alpha\, b_3\, U_4,\qquad
              U_4 = \tfrac1{12} \int_0^1 \kappa^4\, ds

    kappa is the curvature times the length of the arm. In the static shape of a small force,
    :math:`\kappa = 3 (1 - s)\, \delta`, this is a cubic spring of :math:`\beta = \tfrac{27}{5}\, \alpha\, b_3`.
    """

    systems = frozenset({ARM})
    cite = "Lo and Gupta, Journal of Applied Mechanics 45 (1978) 213"
    b_3 = Parameter(
        "q^-2", "cubic part of the bending moment", (-0.1, 1.0), Normal(0.0, 0.02),
        starts=(0.003, -0.003, 0.03), latex="b_3",
    )  # fmt: skip

    def expression(self):
        """Return V."""
        return alpha * self.b_3 * U_4
