"""A drive that does not answer to small inputs."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Drive
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import u


class InputDeadZone(Drive):
    r"""A drive does nothing below an input of a half width w_u, and lacks that much above it.

    .. math:: u \to u - \operatorname{clip}(u, -w_u, w_u)

    As a valve with overlapping edges, an amplifier that crosses over, or a motor whose brushes need a voltage. Dry
    friction of a motor that always turns one way does the same; a motor that turns both ways, or is pushed by other
    forces too, tells them apart. It is offered where the input is a force or a voltage, not a motion.
    """

    systems = frozenset({OSCILLATOR})
    cite = "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996), chapter 2"
    w_u = Parameter(
        "u", "half width of the dead zone of the input", (0.0, 1.0), HalfStudent(0.1), starts=(0.01, 0.05, 0.2),
        latex="w_u",
    )  # fmt: skip

    def expression(self):
        """Return what passes."""
        return u - (sp.Abs(u + self.w_u) - sp.Abs(u - self.w_u)) / 2
