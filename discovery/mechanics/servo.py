"""A drive in its position loop."""

from __future__ import annotations

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import ROTOR
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal, Student
from discovery.mechanics.one_coordinate import OneCoordinate


class Servo(OneCoordinate):
    r"""A body of unit inertia under a known controller that follows the recorded reference u(t).

    .. math:: \ddot q = g\, c + \text{effects},\qquad c = k_v \left(k_p (u - q) - \dot q\right)

    The command c is cut off at the controller's limit. The loop is simulated, not its recorded command: what the body
    does feeds back into the force in the model as in the machine (Forssell and Ljung, Automatica 35 (1999) 1215).
    """

    name = "servo"
    has = frozenset({ROTOR})
    input_word = "reference"
    gain = "g"
    provides = frozenset()

    g = Parameter("s^-2 q", "acceleration per unit of command", (0.0, 1e4), Student(10.0), starts=(1.0,), latex="g")
    k_p = Parameter("s^-1", "position gain", (0.0, 1e6), Normal(0.0, 1e3), default=1.0, fixed=True, latex="k_p")
    k_v = Parameter("q^-1 s", "velocity gain", (0.0, 1e6), Normal(0.0, 1e3), default=1.0, fixed=True, latex="k_v")
    c_max = Parameter(
        "1", "largest command", (0.0, 1e6), Normal(0.0, 1e6), default=1e6, fixed=True, latex=r"c_\mathrm{max}"
    )

    def pull(self):
        """Return g c."""
        q, rate = self.position
        command = self.k_v * (self.k_p * (s.u - q) - rate)
        return self.g * (sp.Abs(command + self.c_max) - sp.Abs(command - self.c_max)) / 2

    def idle(self, q, rate, values):
        """Return the reference at which the controller asks for nothing."""
        return q + rate / values["k_p"]


BASE = Servo()
