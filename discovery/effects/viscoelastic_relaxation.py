"""A spring that relaxes."""

import sympy as sp

from discovery.declarations.effect import Memory
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import alpha, bend_dot

_STRAIN = sp.Symbol("e_v", real=True)


class ViscoelasticRelaxation(Memory):
    r"""A Maxwell branch beside the spring: the standard linear solid.

    .. math:: P = -\alpha\, v\, e\, \dot b,\qquad \dot e = \dot b - e/\tau_v

    b is a component of the bending (the deflection of a linear spring), e the part of it that the branch has not yet
    relaxed. A recording starts relaxed.
    """

    cite = "Zener, Elasticity and Anelasticity of Metals (1948), chapter 5"
    v = Parameter("1", "relaxing share of the stiffness", (0.0, 2.0), HalfStudent(0.1), starts=(0.01,), latex="v")
    tau_v = Parameter(
        "s", "relaxation time", (0.05, 300.0), LogNormal(2.0, 1.5), default=2.0, starts=(0.1, 0.4, 1.5, 6.0, 25.0),
        shape=True, latex=r"\tau_v",
    )  # fmt: skip

    def states(self):
        """Return the strain of the branch with its rate."""
        return {_STRAIN: bend_dot - _STRAIN / self.tau_v}

    def expression(self):
        """Return P."""
        return -alpha * self.v * _STRAIN * bend_dot
