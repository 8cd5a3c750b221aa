"""Hub manoeuvres within the limits of a motor: trapezoidal moves with rests, from points of a unit cube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from discovery.foundation.errors import InputError
from discovery.recordings.drive import Drive

__all__ = ["NUMBERS", "MotorLimits", "Move", "hub_drive", "moves_from_unit", "reach"]

FloatArray = NDArray[np.float64]

#: Slowest and gentlest move, as a part of the limit.
_GENTLE = 0.25
#: Numbers that describe a move: where to, how fast, how hard, how long to wait before.
NUMBERS = 4


@dataclass(frozen=True)
class MotorLimits:
    """What the motor, the arm and the recording allow.

    Parameters
    ----------
    angle : float
        Largest angle of the hub to either side of where it starts [rad].
    speed, acceleration : float
        Largest speed [rad/s] and acceleration [rad/s^2] of the hub.
    duration : float
        Length of the recording [s].
    deflection : float
        Largest deflection of the arm that a model may predict [rad].
    moves : int
        Largest number of moves, 1 to 3.

    Raises
    ------
    InputError
        If a limit is not positive, or the number of moves is not 1, 2 or 3.
    """

    angle: float
    speed: float
    acceleration: float
    duration: float
    deflection: float = 1.0
    moves: int = 3

    def __post_init__(self) -> None:
        sizes = (self.angle, self.speed, self.acceleration, self.duration, self.deflection)
        if not (all(np.isfinite(v) and v > 0 for v in sizes) and self.moves in (1, 2, 3)):
            raise InputError(f"Limits of a motor must be positive and finite, with 1 to 3 moves; got {self}.")


@dataclass(frozen=True)
class Move:
    """One move of the hub with a trapezoidal speed.

    Parameters
    ----------
    start : float
        When it begins [s].
    angle : float
        How far it turns, signed [rad].
    speed : float
        Of its plateau, positive [rad/s].
    ramp : float
        Duration of each of its two ramps over its own, at most 0.5.
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

    Parameters
    ----------
    unit : ndarray, shape (4 k,)
        For each of k moves, all in [0, 1]: where it goes, its speed, its acceleration, the rest before it.
    limits : MotorLimits
        Limits that hold for every point.

    Returns
    -------
    tuple of Move
        At most k: one that would go nowhere, or that there is no time for, is left out.
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
        plan.append((angle, speed, rise / length, wait))
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

    Parameters
    ----------
    moves : sequence of Move
        In the order of time, at least one; none may begin before the one before has ended.
    initial : float
        Angle before the first [rad].

    Raises
    ------
    InputError
        If there is no move, or two overlap.
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
