"""Dry friction whose contact gives way before it slips."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Memory
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import bend_dot

_GIVEN = sp.Symbol("z_p", real=True)


class PreslidingFriction(Memory):
    r"""Dry friction whose contact gives way like a spring before it slips, after every reversal: Dahl's law.

    .. math:: P = -f_p\, \frac{z}{s_p}\, \dot b,\qquad \dot z = \dot b - |\dot b|\, \frac{z}{s_p}

    z is how far the contact has given way, from -s_p to s_p. A turn at rest begins as a spring of stiffness f_p / s_p;
    once the body has moved by a few times s_p, it is the friction f_p, whatever the speed: with a narrow s_p that of
    `coulomb_friction`. It is offered where the recorded motion turns back twice.
    """

    systems = frozenset({OSCILLATOR})
    anchored = False
    remembers = True
    cite = "Dahl, The Aerospace Corporation TOR-0158 (1968); Armstrong-Helouvry et al., Automatica 30 (1994) 1083"
    f_p = Parameter("s^-2 q", "sliding friction", (0.0, 3.0), HalfStudent(0.05), starts=(0.001, 0.01), latex="f_p")
    s_p = Parameter(
        "q", "reach of the presliding", (0.001, 1.0), LogNormal(0.05, 1.5), default=0.05,
        starts=(0.005, 0.02, 0.08, 0.3), shape=True, latex="s_p",
    )  # fmt: skip

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return whether the contact gives way by more than half of the way: a spring that forgets."""
        return values["s_p"] > reach

    def states(self):
        """Return how far the contact has given way, with its rate."""
        return {_GIVEN: bend_dot - sp.Abs(bend_dot) * _GIVEN / self.s_p}

    def relaxation(self):
        """Return how fast it slips: once in its reach."""
        return {_GIVEN: sp.Abs(bend_dot) / self.s_p}

    def expression(self):
        """Return P."""
        return -self.f_p * _GIVEN / self.s_p * bend_dot
