"""An oscillator driven by a sine, whose reading is known in closed form, with any errors on it."""

from __future__ import annotations

import numpy as np

from discovery.equations.model import Model
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

XI, ALPHA, GAIN, START = 0.3, 9.0, 1.7, (0.4, -0.2)
NOISE = 0.02
DRIVE = 2.1  # rad/s
TIME = np.linspace(0.0, 24.0, 401)
EFFECTS = ("viscous_damping", "linear_stiffness")


class Sine:
    """The input sin(DRIVE t) and its derivatives."""

    kinks = np.empty(0)

    def evaluate(self, t, side="right"):
        phase = DRIVE * np.asarray(t, float)
        return np.array([np.sin(phase), DRIVE * np.cos(phase), -(DRIVE**2) * np.sin(phase)])


def responses(time=TIME, xi=XI, alpha=ALPHA):
    """Responses of q'' + xi q' + alpha q = g u to a unit gain, deflection and rate, in closed form, shape (n, 3)."""
    omega = np.sqrt(alpha - xi**2 / 4)
    decay = np.exp(-xi * time / 2)
    rate = decay * np.sin(omega * time) / omega
    deflection = decay * np.cos(omega * time) + xi / 2 * rate
    transfer = 1 / (alpha - DRIVE**2 + 1j * xi * DRIVE)
    steady = (transfer * np.exp(1j * DRIVE * time)).imag
    forced = steady - transfer.imag * deflection - DRIVE * transfer.real * rate
    return np.column_stack([forced, deflection, rate])


def clean(time=TIME):
    """What an instrument without errors would read."""
    return responses(time) @ [GAIN, *START]


def experiment(errors, time=TIME, name="sine", driven=True):
    """The recording with these errors; NaN are gaps."""
    output = (clean(time) + errors)[:, None]
    recording = Recording(
        name, time, Sine().evaluate(time)[0], output, ("output",), ("V",), np.array([NOISE]), name, "made here"
    )
    return Experiment(recording, Sine() if driven else None, Rig("oscillator", "oscillator", declared=EFFECTS))


def linear_model():
    """With damping and stiffness known, readings are linear in the gain and the initial state."""
    return Model("oscillator", EFFECTS, {"xi": XI, "alpha": ALPHA})


def exponential_covariance(time, share, tau):
    """Covariance of unit variance, a share of which is forgotten exponentially."""
    apart = np.abs(time[:, None] - time)
    return share * np.exp(-apart / tau) + (1 - share) * np.eye(time.size)


def oscillating_covariance(time, omega, xi):
    """Stationary covariance of unit variance of q'' + xi q' + omega^2 q = white noise, from its roots."""
    apart = np.abs(time[:, None] - time)
    a, b = np.roots([1.0, xi, omega**2]).astype(complex)
    return ((b * np.exp(a * apart) - a * np.exp(b * apart)) / (b - a)).real
