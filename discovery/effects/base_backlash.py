"""Play between hub and rod."""

import sympy as sp

from discovery.declarations.effect import Joint
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import root


class BaseBacklash(Joint):
    r"""Play of a half width w_p between the hub, where the encoder is, and the root of the rod.

    .. math:: p = \frac{w_p\, b}{\sqrt[4]{b^4 + b_p^4}} + 3\, c_p\, b

    p is the angle of the root beyond the hub's, b the bending of the rod at its root. In the play the rod is free to
    turn; at either end it leans on a contact, which gives way by c_p of the rod's own compliance l / EI. The passage is
    made smooth within a small bending b_p.
    """

    imitative = True  # a rod that is not uniform shortens the radius alike
    reduces_to = frozenset({"base_compliance"})
    cite = "Nordin and Gutman, Automatica 38 (2002) 1633"
    w_p = Parameter("q", "half width of the play", (0.0, 0.3), HalfStudent(0.04), starts=(0.002, 0.01), latex="w_p")
    c_p = Parameter(
        "1", "compliance of the contact over l / EI of the rod", (0.0, 1.0), HalfStudent(0.03), starts=(0.005,),
        latex="c_p",
    )  # fmt: skip
    b_p = Parameter(
        "q", "bending within which the play is crossed", (0.002, 0.1), LogNormal(0.04, 1.0), default=0.05,
        starts=(0.04, 0.08), shape=True, latex="b_p",
    )  # fmt: skip

    def expression(self):
        """Return p."""
        return self.w_p * root / sp.sqrt(sp.sqrt(root**4 + self.b_p**4)) + 3 * self.c_p * root
