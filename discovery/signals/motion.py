"""A recording as motion: the coordinate with its derivatives, the smooth input, and the radius of an arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from discovery.declarations.system import System
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.signals.differentiate import Trajectory, smooth

if TYPE_CHECKING:
    from discovery.recordings.recording import Recording
    from discovery.rigs.rig import Rig
    from discovery.simulation.grid import DriveLike


class State(NamedTuple):
    """Kinematic state at some times, each of shape (n,): SI units, radians."""

    q: FloatArray  # theta_t of an arm, the output of an oscillator
    q_dot: FloatArray
    q_ddot: FloatArray
    delta: FloatArray  # theta_t - theta_m of an arm, q itself of an oscillator
    delta_dot: FloatArray
    input: FloatArray | None  # input of an oscillator; None for an arm or a free decay


@dataclass(frozen=True)
class Motion:
    """A recording as motion: the coordinate, what drives it, and for an arm the radius over its length."""

    name: str  # name of the recording
    kind: str  # that of the rig
    coordinate: Trajectory  # theta_t [rad] of an arm, the output of an oscillator
    drive: DriveLike | None  # theta_m [rad] of an arm, the input of an oscillator
    radius: Trajectory | None = None  # rho_t / l of an arm whose tip was recorded in x and y

    @property
    def system(self) -> System:
        """What the kind of rig is to the equations."""
        return System.of(self.kind)

    def state(self, t: FloatArray) -> State:
        """Return the state at the times ``t`` [s]."""
        q, q_dot, q_ddot = self.coordinate.evaluate(t)
        driven = None if self.drive is None else self.drive.evaluate(t)
        if not self.system.has_rod:
            return State(q, q_dot, q_ddot, q, q_dot, None if driven is None else driven[0])
        base, base_rate = (np.zeros_like(q), np.zeros_like(q)) if driven is None else (driven[0], driven[1])
        return State(q, q_dot, q_ddot, q - base, q_dot - base_rate, None)


def _angle_of_deflection(deflection: FloatArray) -> FloatArray:
    """Invert y'/l = cos(delta / sqrt 5) sin(delta), the elastica's radius law for small angles (equation 16)."""
    delta = np.linspace(-1.3, 1.3, 2001)  # monotone here
    return np.interp(deflection, np.cos(delta / np.sqrt(5.0)) * np.sin(delta), delta, left=np.nan, right=np.nan)


def motion_of(recording: Recording, rig: Rig, drive: DriveLike | None) -> Motion:
    """Smooth a recording.

    Parameters
    ----------
    recording : Recording
        Samples; gaps are NaN.
    rig : Rig
        Kind and, for an arm, the length [m].
    drive : DriveLike or None
        The smooth input, as `discovery.recordings.smooth_input.build_drive` makes it.

    Returns
    -------
    Motion
        theta_t = atan2(y, x), unwrapped, and rho_t / l for an arm; the output itself for an oscillator.

    Raises
    ------
    InputError
        If an arm has no length, or its tip deflection comes without a motor angle.
    """
    time, output, noise = recording.time, recording.output, recording.noise
    if not System.of(rig.kind).has_rod:
        return Motion(recording.name, rig.kind, smooth(time, output[:, 0], noise[0]), drive)
    if rig.length is None:
        raise InputError(f"{recording.name}: the rig file gives no length; add `length_m`.")
    length, radius = rig.length.value, None
    if recording.channels == ("tip_x", "tip_y"):
        seen = np.isfinite(output).all(axis=1)
        x, y = output[seen].T
        rho, sd = np.hypot(x, y), float(np.sqrt(np.mean(noise**2)))
        angle = smooth(time[seen], np.unwrap(np.arctan2(y, x)), sd / rho)
        radius = smooth(time[seen], rho / length, sd / length)
    elif recording.channels == ("tip_angle",):
        angle = smooth(time, output[:, 0], noise[0])
    elif drive is None:
        raise InputError(f"{recording.name}: a tip deflection needs the motor angle; add a column `motor_angle_rad`.")
    else:
        delta = _angle_of_deflection(output[:, 0] / length)
        angle = smooth(time, delta + drive.evaluate(time)[0], noise[0] / length)
    return Motion(recording.name, rig.kind, angle, drive, radius)
