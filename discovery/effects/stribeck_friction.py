"""Dry friction that is largest at creep."""

import sympy as sp

from discovery.declarations.effect import Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import v2


class StribeckFriction(Dissipation):
    r"""Dry friction that falls from a larger value at creep to its sliding value as a film of lubricant builds up.

    .. math:: D = f_k\, w + \frac{\sqrt\pi}{2} f_b v_s \operatorname{erf}\frac{w}{v_s},\qquad w = \sqrt{v_t^2 + v_e^2}

    The force is :math:`\left(f_k + f_b\, e^{-(w/v_s)^2}\right) v_t / w`: sliding friction f_k with a bump f_b
    below the Stribeck speed v_s, made smooth within the speed v_e. Without the bump it is `coulomb_friction`, which it
    replaces.
    """

    reduces_to = frozenset({"coulomb_friction"})
    called = "Stribeck friction"
    cite = "Hess and Soom, Journal of Tribology 112 (1990) 147; Armstrong-Helouvry et al., Automatica 30 (1994) 1083"
    f_k = Parameter("s^-2 q", "sliding friction", (0.0, 1.0), HalfStudent(0.05), starts=(0.001, 0.01), latex="f_k")
    f_b = Parameter(
        "s^-2 q", "bump of the friction at creep", (0.0, 1.0), HalfStudent(0.05), starts=(0.001, 0.01), latex="f_b"
    )
    v_s = Parameter(
        "s^-1 q", "Stribeck speed", (2e-3, 2.0), LogNormal(0.05, 1.0), default=0.05, shape=True, latex="v_s",
        starts=(0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6),
    )  # fmt: skip
    v_e = Parameter(
        "s^-1 q",
        "smoothing speed",
        (1e-4, 0.1),
        LogNormal(7e-4, 1.0),
        default=7e-4,
        shape=True,
        fixed=True,
        latex="v_e",
    )

    def expression(self):
        """Return D, zero at rest."""
        speed = sp.sqrt(v2 + self.v_e**2)
        bump = sp.erf(speed / self.v_s) - sp.erf(self.v_e / self.v_s)
        return self.f_k * (speed - self.v_e) + self.f_b * self.v_s * sp.sqrt(sp.pi) / 2 * bump
