"""Hub manoeuvres: trapezoidal moves with rests, and the limits within which they are designed.

The limits are what the rig file states, and what recordings show to be safe. The input of any other system has the
limits of a motor: it goes as far, as fast and as hard as it went in recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment, largest_deflection

#: Slowest and gentlest move, as a part of the limit.
_GENTLE = 0.25
#: Numbers that describe a move: where to, how fast, how hard, how long to wait before.
NUMBERS = 4


@dataclass(frozen=True)
class MotorLimits:
    """What the motor, the arm and the recording allow.

    Raises InputError if a limit is not positive, or the number of moves is not 1, 2 or 3.
    """

    angle: float  # largest angle of the hub to either side of where it starts [rad]
    #: speed, acceleration: largest speed [rad/s] and acceleration [rad/s^2] of the hub.
    speed: float
    acceleration: float
    duration: float  # length of the recording [s]
    deflection: float = 1.0  # largest deflection of the arm that a model may predict [rad]
    moves: int = 3  # largest number of moves, 1 to 3

    def __post_init__(self) -> None:
        sizes = (self.angle, self.speed, self.acceleration, self.duration, self.deflection)
        if not (all(np.isfinite(v) and v > 0 for v in sizes) and self.moves in (1, 2, 3)):
            raise InputError(f"Limits of a motor must be positive and finite, with 1 to 3 moves; got {self}.")


@dataclass(frozen=True)
class Move:
    """One move of the hub with a trapezoidal speed.

    It begins at `start` [s] and turns by a signed angle [rad]. The speed is that of its plateau, positive [rad/s];
    `ramp` is the duration of each of its two ramps over its own, at most 0.5.
    """

    start: float
    angle: float
    speed: float
    ramp: float

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return abs(self.angle) / self.speed / (1 - self.ramp)

    @property
    def acceleration(self) -> float:
        """Of its ramps, positive [rad/s^2]."""
        return self.speed / (self.ramp * self.duration)


def reach(speed: float, acceleration: float, duration: float) -> float:
    """Return how far a hub can turn from rest to rest [rad] within a duration [s]."""
    rise = min(speed / acceleration, duration / 2)
    return acceleration * rise * (duration - rise)


def moves_from_unit(unit: FloatArray, limits: MotorLimits) -> tuple[Move, ...]:
    """Return the moves that a point of the unit cube stands for, all within the limits.

    The point (4 k,) says for each of k moves, all in [0, 1]: where it goes, its speed, its acceleration, the rest
    before it. A move that would go nowhere, or that there is no time for, is left out.
    """
    plan: list[tuple[float, float, float, float]] = []
    here, busy, waits = 0.0, 0.0, 0.0
    for place, quick, hard, wait in np.clip(unit, 0.0, 1.0).reshape(-1, NUMBERS).tolist():
        there = limits.angle * (2 * place - 1)
        angle = there - here
        acceleration = limits.acceleration * (_GENTLE + (1 - _GENTLE) * hard)
        # A short move never reaches its plateau's speed.
        speed = min(limits.speed * (_GENTLE + (1 - _GENTLE) * quick), float(np.sqrt(abs(angle) * acceleration)))
        if abs(angle) < 0.02 * limits.angle:
            continue
        rise = speed / acceleration
        length = abs(angle) / speed + rise
        if busy + length > 0.75 * limits.duration:
            continue
        plan.append((angle, speed, min(rise / length, 0.5), wait))  # rounding may pass the half
        here, busy, waits = there, busy + length, waits + wait
    free = limits.duration - busy
    moves: list[Move] = []
    time = 0.0
    for angle, speed, ramp, wait in plan:
        # The last rest counts as one more, of full length; a little rest comes before every move.
        time += free * (0.02 + 0.94 * wait / (waits + 1.0))
        moves.append(Move(time, angle, speed, ramp))
        time += moves[-1].duration
    return tuple(moves)


def hub_drive(moves: Sequence[Move], initial: float = 0.0) -> Drive:
    """Return the hub's angle during moves that follow each other, at rest between, before and after them.

    No move at all, and two that overlap, are refused.
    """
    if not moves or any(b.start < a.start + a.duration - 1e-9 for a, b in pairwise(moves)):
        raise InputError("A manoeuvre needs at least one move, each to begin after the one before has ended.")
    breaks: list[float] = []
    pieces: list[tuple[float, float, float]] = []
    angle = initial
    for move in moves:
        if breaks:
            pieces.append((0.0, 0.0, angle))
        rise, speed = move.ramp * move.duration, float(np.copysign(move.speed, move.angle))
        half, corner, final = speed / rise / 2, angle + speed * rise / 2, angle + move.angle
        corners = [move.start, move.start + rise, move.start + move.duration - rise]
        shape = [(half, 0.0, angle), (0.0, speed, corner), (-half, speed, final - speed * rise / 2)]
        for time, piece in zip(corners, shape, strict=True):
            # Without a plateau, or right after the move before, two breaks fall together.
            if breaks and time - breaks[-1] < 1e-9:
                pieces[-1] = piece
            else:
                breaks.append(time)
                pieces.append(piece)
        breaks.append(move.start + move.duration)
        angle = final
    times = np.array(breaks)
    return Drive(times, np.array(pieces).T, times)


def demonstrated_limits(experiments: Sequence[Experiment]) -> MotorLimits:
    """Return what the input and the system have done in recordings: limits that are known to be safe.

    Recordings without an input are refused.
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
    return MotorLimits(angle, speed, acceleration, duration, 1.1 * largest_deflection(experiments, whole=True))


def allowed_limits(experiments: Sequence[Experiment]) -> MotorLimits:
    """Return what the rig file states of the motor and the arm, and for the rest what they have done in recordings.

    Recordings without an input are refused.
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
