"""Dry friction."""

import sympy as sp

from discovery.declarations.effect import Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import v2


class CoulombFriction(Dissipation):
    r"""Dry friction of constant size against the motion.

    .. math:: D = f_c \left(\sqrt{v_t^2 + v_c^2} - v_c\right)

    The force is :math:`f_c v_t / \sqrt{v_t^2 + v_c^2}`: sliding friction, made smooth within the creep speed v_c.
    A body that sticks away from its rest creeps, by up to v_c times how long it is held. Of a free motion the rest
    behind it is not fitted; where a driven one sticks for long, by more than the noise, `stribeck_friction` creeps
    less and may be named in its place.
    """

    called = "Coulomb friction"
    cite = "Coulomb (1785); regularised as in Armstrong-Helouvry et al., Automatica 30 (1994) 1083"
    f_c = Parameter("s^-2 q", "Coulomb friction", (0.0, 1.0), HalfStudent(0.05), starts=(0.001, 0.01), latex="f_c")
    v_c = Parameter(
        "s^-1 q", "creep speed", (1e-4, 0.1), LogNormal(7e-4, 1.0), default=7e-4, shape=True, fixed=True, latex="v_c"
    )

    def expression(self):
        """Return D."""
        return self.f_c * (sp.sqrt(v2 + self.v_c**2) - self.v_c)
