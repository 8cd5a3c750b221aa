"""An instrument whose clock is wrong."""

import math

import sympy as sp

from discovery.declarations.effect import Sensor
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Flat, LogNormal, Normal
from discovery.declarations.symbols import t

#: Least squares of a sharp sawtooth on the smooth one: Li_2(0.99) / Li_2(0.99^2).
_SHARP = 1.0274391


class TimeBaseError(Sensor):
    r"""The clock of the instrument drifts against that of the input, and its stamps lag in a sawtooth.

    .. math:: y_\mathrm{read}(t) = y\left(t - d_t\, t - j\, S(\Omega_j t - \varphi_j)\right),\qquad
              S(x) = \tfrac12 - \tfrac{c}{\pi} \arctan\frac{\varrho \sin x}{1 - \varrho \cos x}

    S grows from 0 to 1 within each period and falls back, as where frames wait for a packet to be sent, or a slow clock
    is set right again and again; as :math:`\varrho = 0.99`, it falls back within a twentieth of a period, and c = 1.027
    makes j the height of the sharp sawtooth that it is nearest to. A lag that falls while samples wait has j < 0 and
    the constant lag of a `sensor_delay`. The period is looked for above the system's own frequency, where no force
    imitates it.
    """

    cite = "Allan, IEEE Trans. Ultrason. 34 (1987) 647; Mills, Computer Network Time Synchronization (2011), chapter 2"
    d_t = Parameter(
        "1", "drift of the clock", (-0.05, 0.05), Normal(0.0, 0.002), starts=(1e-4, -1e-4, 1e-3, -1e-3), latex="d_t"
    )
    j_t = Parameter("s", "height of the sawtooth", (-0.5, 0.5), Normal(0.0, 0.03), starts=(0.003, -0.003), latex="j")
    Omega_j = Parameter(
        "s^-1", "angular frequency of the sawtooth", (1.2, 60.0), LogNormal(6.0, 0.7), default=4.0, shape=True,
        starts=(*(1.3 + 0.1 * k for k in range(17)), *(3.0 + 0.15 * k for k in range(61))), latex=r"\Omega_j",
    )  # fmt: skip
    phi_j = Parameter(
        "rad", "phase of the sawtooth", (-math.pi, 3 * math.pi), Flat(), default=math.pi, shape=True,
        starts=(0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi), latex=r"\varphi_j",
    )  # fmt: skip

    def lateness(self):
        """Return the age of the reported state [s]."""
        angle = self.Omega_j * t - self.phi_j
        part = sp.atan(99 * sp.sin(angle) / (100 - 99 * sp.cos(angle))) / sp.pi
        return self.d_t * t + self.j_t * (sp.Rational(1, 2) - _SHARP * part)
