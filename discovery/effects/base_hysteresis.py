"""A clamp that slips."""

import sympy as sp

from discovery.declarations.effect import Joint
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import root, root_dot

_SLIP = sp.Symbol("z_c", real=True)
#: Compliance that keeps a clamp defined which sticks without giving way at all.
_LEAST = sp.Float(1e-4)


class BaseHysteresis(Joint):
    r"""A clamp that gives way and in which surfaces slip: a spring beside friction by the Bouc-Wen law of exponent two.

    .. math:: p = 3\,\left((c_c + e_c)\, b - e_c\, w_c\, z\right),\qquad
              w_c\, \dot z = \frac{(c_c + e_c)\, g}{c_c + e_c\, g}\, \dot b,\qquad
              g = 1 - \tfrac12 \left(z^2 + |z|\, z\, \frac{\dot b}{\sqrt{\dot b^2 + v_d^2}}\right)

    p is the angle of the root beyond the hub's, b the bending of the rod at its root, whose moment the clamp holds.
    Around every turning point the surfaces stick, and the clamp gives way by c_c of the rod's own compliance l / EI;
    from a bending of about w_c on they slip, and it gives way by c_c + e_c. The turning points are made smooth within
    the small rate v_d. In terms of a spring k beside surfaces that hold h k per angle, up to the torque h k a,
    c_c = EI / (k l (1 + h)), e_c = h c_c and w_c = k a (1 + h) l / 3 EI.
    """

    imitative = True  # a rod that is not uniform shortens the radius alike
    reduces_to = frozenset({"base_compliance"})
    cite = "Wen, Journal of the Engineering Mechanics Division 102 (1976) 249; Ibrahim and Pettit (2005)"
    c_c = Parameter(
        "1", "compliance of the sticking clamp over l / EI of the rod", (0.0, 1.0), HalfStudent(0.05), starts=(0.002,),
        latex="c_c",
    )  # fmt: skip
    e_c = Parameter("1", "compliance that slipping adds", (0.0, 1.0), HalfStudent(0.02), starts=(0.001,), latex="e_c")
    w_c = Parameter(
        "q", "bending at which it slips", (0.01, 3.0), LogNormal(0.15, 1.0), default=0.15,
        starts=(0.02, 0.06, 0.2, 0.6), shape=True, latex="w_c",
    )  # fmt: skip
    v_d = Parameter(
        "s^-1 q", "rate at a turning point", (1e-3, 0.1), LogNormal(0.02, 1.0), default=0.02, shape=True, fixed=True,
        latex="v_d",
    )  # fmt: skip

    def states(self):
        """Return the friction over its largest value, with its rate."""
        way = root_dot / sp.sqrt(root_dot**2 + self.v_d**2)
        stuck = 1 - (_SLIP**2 + sp.Abs(_SLIP) * _SLIP * way) / 2
        # Never negative but for the round-off of a step.
        share = (self.c_c + self.e_c + _LEAST) / (self.c_c + self.e_c * sp.Abs(stuck) + _LEAST)
        return {_SLIP: share * stuck * root_dot / self.w_c}

    def expression(self):
        """Return p."""
        return 3 * ((self.c_c + self.e_c) * root - self.e_c * self.w_c * _SLIP)
