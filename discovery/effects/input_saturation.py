"""A drive that cannot give as much as it is asked for."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Drive
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import u


class InputSaturation(Drive):
    r"""A drive gives no more than its limit, 1/s_u in the unit of the input, whatever is asked for.

    .. math:: u \to \frac{u}{\max(1,\, s_u |u|)}

    An amplifier at its supply, a motor at its largest current, a valve that is open. The parameter is the inverse of
    the limit, because without a limit it is zero; inputs that never reach the limit say nothing of it. It is offered
    where the input is a force or a voltage, not a motion.
    """

    systems = frozenset({OSCILLATOR})
    cite = "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996), chapter 1"
    s_u = Parameter(
        "u^-1", "inverse of the largest input that passes", (0.0, 20.0), HalfStudent(6.0),
        starts=(1.1, 1.3, 1.6, 2.5, 5.0), threshold=True, latex="s_u",
    )  # fmt: skip

    def expression(self):
        """Return what passes."""
        asked = self.s_u * sp.Abs(u)
        return 2 * u / (1 + asked + sp.Abs(asked - 1))
