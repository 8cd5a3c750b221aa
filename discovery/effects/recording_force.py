"""A constant force that is another one in every recording."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal, Student
from discovery.declarations.symbols import delta_dot


class RecordingForce(Load):
    r"""A constant force differs from recording to recording: a grade driven both ways, a load or a bias set anew.

    .. math:: P = (f_1 + f_r)\, \dot q

    The first recording has :math:`f_1` alone, each other one an :math:`f_r` of its own beside it; that of a held-out
    one is fitted with its start, and a prediction from inputs alone takes that of the first. One recording does not
    tell it from a constant force (`constant_force`), and it is offered where there are more, and where that is.
    """

    systems = frozenset({OSCILLATOR})
    called = "constant force that differs between recordings"
    cite = "the offset of a drive: Janot, Gautier and Brunot, nonlinear system identification benchmarks (2019)"
    reduces_to = frozenset({"constant_force"})
    f_1 = Parameter(
        "s^-2 q", "constant force in the first recording", (-10.0, 10.0), Student(0.05), starts=(0.003, -0.003)
    )
    f_r = Parameter(
        "s^-2 q", "constant force in a recording, beside that in the first", prior=Normal(0.0, 0.05), fixed=True,
        own=True,
    )  # fmt: skip

    def expression(self):
        """Return P."""
        return (self.f_1 + self.f_r) * sp.sympify(delta_dot)
