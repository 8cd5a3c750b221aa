"""The limits within which a manoeuvre is designed: what the rig file states, and what recordings show to be safe.

The input of any other system has the limits of a motor: it goes as far, as fast and as hard as it went in recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discovery.diagnosis.manoeuvre_design import MotorLimits, reach
from discovery.foundation.errors import InputError
from discovery.recordings.experiment import Experiment, largest_deflection

__all__ = ["allowed_limits", "demonstrated_limits", "known_part"]


def demonstrated_limits(experiments: Sequence[Experiment]) -> MotorLimits:
    """Return what the input and the system have done in recordings: limits that are known to be safe.

    Raises
    ------
    InputError
        If the recordings have no input.
    """
    if not all(e.drive is not None for e in experiments):
        raise InputError("A course of the input can only be designed where an input is recorded.")
    sizes = []
    for e in experiments:
        assert e.drive is not None
        time = e.recording.time
        angle, rate, acceleration = e.drive.evaluate(np.linspace(time[0], time[-1], 4000))
        sizes.append([np.abs(angle - angle[0]).max(), np.abs(rate).max(), np.abs(acceleration).max(), np.ptp(time)])
    angle, speed, acceleration, duration = np.max(sizes, axis=0).tolist()
    return MotorLimits(angle, speed, acceleration, duration, 1.1 * largest_deflection(experiments))


def allowed_limits(experiments: Sequence[Experiment]) -> MotorLimits:
    """Return what the rig file states of the motor and the arm, and for the rest what they have done in recordings.

    Raises
    ------
    InputError
        If the recordings have no input.
    """
    shown, rig = demonstrated_limits(experiments), experiments[0].rig
    given: dict[str, Any] = {
        "angle": rig.motor_angle_limit,
        "speed": rig.motor_speed_limit,
        "acceleration": rig.motor_acceleration_limit,
        "deflection": rig.deflection_limit,
    }
    stated = {name: value for name, value in given.items() if value is not None}
    limits = replace(shown, **stated)
    if stated.keys() <= {"deflection"}:
        return limits
    # What the motor has done it can do again.
    again = limits.speed >= shown.speed and limits.acceleration >= shown.acceleration
    known = min(limits.angle, shown.angle) if again else 0.0
    return replace(limits, angle=max(known, _in_time(limits).angle))


def _in_time(limits: MotorLimits) -> MotorLimits:
    """Return limits whose angle can be reached in half the time: a longer turn leaves none for what follows from it."""
    return replace(limits, angle=min(limits.angle, reach(limits.speed, limits.acceleration, limits.duration / 2)))


def known_part(limits: MotorLimits, shown: MotorLimits) -> MotorLimits:
    """Return the part of limits in which the recordings show that the tip is deflected by no more than is allowed."""
    # In proportion to the speed after a short ramp, to the acceleration on a long one.
    mild = min(1.0, limits.deflection / shown.deflection)
    part = replace(
        limits,
        angle=min(limits.angle, shown.angle),
        speed=min(limits.speed, mild * shown.speed),
        acceleration=min(limits.acceleration, mild * shown.acceleration),
        deflection=min(limits.deflection, shown.deflection),
    )
    return part if mild == 1.0 else _in_time(part)
