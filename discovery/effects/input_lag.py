"""A drive that answers late."""

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, Drive
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, Normal
from discovery.declarations.symbols import LEAST, u

_ARRIVED = sp.Symbol("u_l", real=True)


class InputLag(Drive):
    r"""A first-order lag of the input: what arrives follows what is asked for with a time constant tau_u.

    .. math:: u \to u_l,\qquad \tau_u\, \dot u_l = u - u_l,\qquad u_l(0) = u_a

    The current of a coil behind its voltage (L/R), the thrust of a fan that spins up, a valve, a heater. What had
    arrived when a recording starts, u_a, is fitted with its start; of one that begins `at_rest` nothing had. A lag much
    shorter than the motion looks like the `sensor_delay` of an instrument; a swing that no input drives tells them
    apart. It is offered where the input is a force or a voltage, not a motion.
    """

    systems = frozenset({OSCILLATOR})
    cite = "Ljung, System Identification (1999), section 4.3; Seborg et al., Process Dynamics and Control (2016)"
    tau_u = Parameter(
        "s", "time constant of the input", (0.0, 100.0), HalfStudent(0.3), starts=(0.02, 0.1, 0.4, 1.5, 6.0),
        latex=r"\tau_u",
    )  # fmt: skip
    u_a = Parameter(
        "u",
        "what had arrived when a recording began",
        prior=Normal(0.0, 1.0),
        fixed=True,
        begins=_ARRIVED.name,
        latex="u_a",
    )

    def states(self):
        """Return what has arrived with its rate."""
        return {_ARRIVED: (u - _ARRIVED) / (self.tau_u + LEAST)}

    def relaxation(self):
        """Return how fast the past is forgotten."""
        return {_ARRIVED: 1 / (self.tau_u + LEAST)}

    def expression(self):
        """Return what has arrived."""
        return u + (_ARRIVED - u) * self.tau_u / (self.tau_u + LEAST)
