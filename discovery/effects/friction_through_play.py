"""Dry friction behind play."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Memory
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal
from discovery.declarations.symbols import bend_dot

_SLACK = sp.Symbol("z_d", real=True)


class FrictionThroughPlay(Memory):
    r"""Dry friction that is felt only when the play in front of it is taken up, after every reversal.

    .. math:: P = -f_d \left(\frac{z}{w_d}\right)^3 \dot b,\qquad
              \dot z = \dot b - \frac{|\dot b|\,|z|\, z + \dot b\, z^2}{2 w_d^2}

    z is the slack that is taken up, from -w_d to w_d. Near the middle the cube is flat: hardly a force where the parts
    do not touch. Once they do, it is the friction f_d, whatever the speed. It is offered for drives and at
    places of declared systems, where the recorded motion turns back twice: else it is told by nothing from a friction
    that changes along the way. A narrow play is presliding: friction whose contact gives way before it slips.
    """

    systems = frozenset({OSCILLATOR})
    anchored = False
    remembers = True
    cite = "Coble et al., Mechanical Systems and Signal Processing (2024), friction damper with backlash; Wen (1976)"
    f_d = Parameter("s^-2 q", "Coulomb friction", (0.0, 3.0), HalfStudent(0.05), starts=(0.001, 0.01), latex="f_d")
    w_d = Parameter(
        "q", "half width of the play", (0.003, 1.0), LogNormal(0.1, 1.0), default=0.1, starts=(0.03, 0.1, 0.3),
        shape=True, latex="w_d",
    )  # fmt: skip

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return whether the play is wider than the way: a friction that changes along it."""
        return values["w_d"] > reach

    def states(self):
        """Return the slack with its rate."""
        held = (sp.Abs(bend_dot) * sp.Abs(_SLACK) * _SLACK + bend_dot * _SLACK**2) / (2 * self.w_d**2)
        return {_SLACK: bend_dot - held}

    def relaxation(self):
        """Return how fast it slips: once in half of its reach at most."""
        return {_SLACK: 2 * sp.Abs(bend_dot) / self.w_d}

    def expression(self):
        """Return P."""
        return -self.f_d * (_SLACK / self.w_d) ** 3 * bend_dot
