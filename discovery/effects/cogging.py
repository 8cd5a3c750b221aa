"""A motor whose magnets hold on to its teeth."""

import numpy as np
import sympy as sp

from discovery.declarations.effect import OSCILLATOR, ROTOR, Potential
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import LogNormal, Student
from discovery.declarations.symbols import delta

#: Periods in the angle that is travelled below which the torque imitates springs and gravity.
_PERIODS = 3.0


class Cogging(Potential):
    r"""A torque that comes and goes with the angle of a rotor, as between the magnets and teeth of a motor.

    .. math:: V = -\frac{n_a \sin N_c\, q - n_b \cos N_c\, q}{N_c}

    The torque is :math:`n_a \cos N_c q + n_b \sin N_c q`; N_c counts its periods in one turn: for a motor the least
    common multiple of its slots and of its poles, of which there are at least two; what repeats once a turn is gravity
    on a mass off the axis. It is offered where nothing ties an angle. Within few of its periods it imitates springs; of
    one that goes by in less than two readings, these could tell anything. The angle is counted from where a recording
    begins if its speed is read: let recordings of a speed begin at one angle, or give one alone.
    """

    systems = frozenset({OSCILLATOR})
    angular = True
    anchored = False
    needs = ROTOR
    cite = "Hanselman, Brushless Permanent Magnet Motor Design (2006), chapter 4"
    n_a = Parameter(
        "s^-2 q", "cosine amplitude of the cogging", (-1.0, 1.0), Student(0.05), starts=(0.01,), latex="n_a"
    )
    n_b = Parameter("s^-2 q", "sine amplitude of the cogging", (-1.0, 1.0), Student(0.05), starts=(0.01,), latex="n_b")
    N_c = Parameter(
        "1", "periods in one turn", (1.5, 500.0), LogNormal(24.0, 1.0), default=24.0, shape=True, latex="N_c",
        starts=tuple(np.arange(2.0, 97.0)),
    )  # fmt: skip

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return whether the rotor travels through few periods, to both sides of zero, or half of one per reading."""
        way = values["N_c"] * 2 * reach
        return np.inf if way * passes * step > np.pi * duration else way < 2 * np.pi * _PERIODS

    def expression(self):
        """Return V."""
        return -(self.n_a * sp.sin(self.N_c * delta) - self.n_b * sp.cos(self.N_c * delta)) / self.N_c
