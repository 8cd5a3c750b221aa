"""A force that never changes."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.declarations.symbols import delta_dot


class ConstantForce(Load):
    r"""A constant force on the body: a tilt of the table, an imbalance, the bias of an amplifier or of a load cell.

    .. math:: P = f_0\, \dot q

    It is offered where nothing ties the body, its force is what is read, or a controller holds it. A body on a spring
    only rests elsewhere (`equilibrium_offset`), one that falls weighs more: there it is not.
    """

    systems = frozenset({OSCILLATOR})
    cite = "the offset of a drive: Janot, Gautier and Brunot, nonlinear system identification benchmarks (2019)"
    f_0 = Parameter("s^-2 q", "constant force", (-10.0, 10.0), Student(0.05), starts=(0.003, -0.003), latex="f_0")

    def expression(self):
        """Return P."""
        return self.f_0 * sp.sympify(delta_dot)
