"""The linear spring."""

from discovery.declarations.effect import Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import LogNormal
from discovery.declarations.symbols import U


class LinearStiffness(Potential):
    r"""Elastic energy, scaled by one stiffness.

    .. math:: V = \alpha\, U,\qquad U = \tfrac12 \delta^2 \text{ for a linear spring}

    On the exact arm U is the bending energy of the whole rod; then :math:`\alpha = 3EI/(m_\mathrm{eff}\, l^3)`.
    """

    ties = True
    cite = "source paper, equations (13) and (15)"
    alpha = Parameter("s^-2", "linear stiffness", (1e-3, 1e3), LogNormal(1.0, 2.0), starts=(1.0, 0.01), latex=r"\alpha")

    def expression(self):
        """Return V."""
        return self.alpha * U
