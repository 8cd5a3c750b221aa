"""A periodic force on the tip."""

import numpy as np
import sympy as sp

from discovery.declarations.effect import Load
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import LogNormal, Normal
from discovery.declarations.symbols import t, v_x, v_y, x, y

#: Share of the system's own frequency within which a force imitates a change of a free decay. Frequencies change by as
#: much with the amplitude.
_NEAR = 0.15
#: Cycles in a recording below which a force imitates whatever drifts.
_CYCLES = 3.0
#: Distance from the hub, in lengths of the arm, that keeps the direction across the arm defined there.
_HUB = sp.Float(1e-6)


def _circles(amplitudes):
    """Return each pair of a sine and a cosine as a complex number."""
    return amplitudes[0::2] + 1j * amplitudes[1::2]


def _pairs(circles):
    """Return complex numbers as pairs of a sine and a cosine."""
    return np.column_stack([circles.real, circles.imag]).ravel()


class PeriodicDisturbance(Load):
    r"""A periodic force, for example of a fan, of a vibrating floor, or of a hum of the motor.

    .. math:: P = (a_s \sin\tau + a_c \cos\tau)\, v_x + (b_s \sin\tau + b_c \cos\tau)\, v_y
              + (n_s \sin\tau + n_c \cos\tau)\, \frac{x v_y - y v_x}{\sqrt{x^2 + y^2}}, \qquad \tau = \Omega t + \psi

    The first force keeps its direction in the plane while the arm turns under it; it swings along a line or an
    ellipse. The second one turns with the arm and pushes across it. An oscillator has one direction, and the first pair
    acts on it. Recordings begin at any moment, so each has a phase :math:`\psi` of its own, counted from that of the
    first; that of a held-out one is fitted with its start, and a prediction from inputs alone takes that of the first.
    Near the arm's own frequency the force imitates any slow change of a free decay; between two readings it repeats
    unseen.
    """

    cite = "forced vibration; Den Hartog, Mechanical Vibrations (1956), chapter 2"
    pliable = True
    a_s = Parameter(
        "s^-2 q", "sine amplitude, of an arm along x", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), latex="a_s"
    )
    a_c = Parameter(
        "s^-2 q", "cosine amplitude, of an arm along x", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), latex="a_c"
    )
    b_s = Parameter(
        "s^-2 q", "sine amplitude along y", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), planar=True, latex="b_s"
    )
    b_c = Parameter(
        "s^-2 q", "cosine amplitude along y", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), planar=True, latex="b_c"
    )
    n_s = Parameter(
        "s^-2 q", "sine amplitude across the arm", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), planar=True,
        latex="n_s",
    )  # fmt: skip
    n_c = Parameter(
        "s^-2 q", "cosine amplitude across the arm", (-1.0, 1.0), Normal(0.0, 0.05), starts=(0.002,), planar=True,
        latex="n_c",
    )  # fmt: skip
    Omega = Parameter(
        "s^-1", "angular frequency", (0.1, 20.0), LogNormal(2.0, 1.0), default=2.0, shape=True, latex=r"\Omega",
        starts=(*np.arange(0.3, 1.5, 0.03).tolist(), *np.geomspace(1.5, 15.0, 110).tolist()),
    )  # fmt: skip

    psi = Parameter(
        "rad", "phase of a recording, beside that of the first", prior=Normal(0.0, float(np.sqrt(2 * np.pi))),
        starts=(0.0, np.pi / 2, np.pi, 3 * np.pi / 2), fixed=True, own=True, latex=r"\psi",
    )  # fmt: skip

    @classmethod
    def turned(cls, amplitudes, own):
        """Return sines and cosines of a force that begins at another phase."""
        return _pairs(_circles(amplitudes) * np.exp(1j * own))

    @classmethod
    def gathered(cls, amplitudes):
        """Return the force whose phases suit the recordings best, all of one size."""
        each = np.array([_circles(own) for own in amplitudes])
        phases = np.angle(np.linalg.svd(each, full_matrices=False)[0][:, 0])
        phases = (phases - phases[0] + np.pi) % (2 * np.pi) - np.pi
        return _pairs((each * np.exp(-1j * phases)[:, None]).mean(axis=0)), phases

    @classmethod
    def imitates(cls, values, time, duration, step, reach, passes):
        """Return whether the force repeats as the motion may, or hardly; or not once, or within two readings."""
        Omega = values["Omega"]
        near, cycles = abs(Omega * time - 1) < _NEAR, Omega * duration / (2 * np.pi)
        return np.inf if cycles < 1 or Omega * step > np.pi else near or cycles < _CYCLES

    def expression(self):
        """Return P."""
        sine, cosine = sp.sin(self.Omega * t + self.psi), sp.cos(self.Omega * t + self.psi)
        fixed = (self.a_s * sine + self.a_c * cosine) * v_x + (self.b_s * sine + self.b_c * cosine) * v_y
        across = (x * v_y - y * v_x) / sp.sqrt(x**2 + y**2 + _HUB**2)
        return fixed + (self.n_s * sine + self.n_c * cosine) * across
