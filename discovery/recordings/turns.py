"""Angles that are counted within one turn: full turns are joined, and what no pendulum does is left out."""

from __future__ import annotations

import numpy as np

from discovery.declarations.units import si_symbol
from discovery.foundation.arrays import BoolArray, FloatArray, IntArray, within_half_a_turn
from discovery.foundation.sampling import median_step
from discovery.mechanics import get_base
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag
from discovery.rigs.rig import Rig

_FULL_TURN = 2.0 * np.pi
_JUMP, _NEAR = 2.0, 1.0  # a single bad reading jumps so far from neighbours that lie so near each other [rad]
_LOST = 1.5 * _FULL_TURN  # a sensor that counts within a turn jumps by less
_FEW = 0.1  # share of readings off the others up to which these are the recording
_RARE = 0.01  # share of such readings up to which they are no motion
_INSIDE = (0.01, 0.99)  # quantiles between which a turn holds all readings that are counted within one
_EXACT = 1e-6  # of a turn, by which a column that is rounded may exceed it
_LIKE = 0.1 * _FULL_TURN  # by which a jump less its turn may differ from the steps beside it


def join_turns(rig: Rig, found: Signals) -> list[Flag]:
    """Join the turns of all angles that were measured, and tell it; one that hangs is counted from there."""
    flags: list[Flag] = []
    for channel, values in found.outputs.items():
        name, unit = found.names[channel], found.units[channel]
        if si_symbol(unit) != "rad":
            continue
        if rig.traits.hangs:
            found.outputs[channel], told = near_hanging(values, name, unit)
        else:
            found.outputs[channel], told = joined_turns(values, found.time, name)
        flags += told
    # An angle that is commanded may jump.
    moved = rig.view is not None or not get_base(rig.base).is_pushed
    if found.inputs is not None and moved and si_symbol(found.units[found.given]) == "rad":
        found.inputs, told = joined_turns(found.inputs, found.time, found.names[found.given])
        flags += told
    return flags


def near_hanging(angle: FloatArray, column: str = "", unit: str = "rad") -> tuple[FloatArray, list[Flag]]:
    """Join the turns of an angle that was recorded modulo 2 pi, and count it from the nearest full turn.

    `angle` (n,): angle of a pendulum [rad]; NaN are gaps. `column`, `unit`: its name and unit in the file, for the
    flags. Returned: `angle` (n,): the same array where it neither jumps nor lies a turn away; NaN where a single
    reading jumps away from its neighbours and back, unless many do; `flags`: what was joined and left out.
    """
    alone = _alone(angle)
    flags = []
    if alone.any() and alone.mean() < _RARE:
        angle = np.where(alone, np.nan, angle)
        rows = np.flatnonzero(alone)
        sizes = {"count": int(rows.size), "first": int(rows[0]), "jump": _JUMP}
        flags.append(Flag("angle_spikes", unit=unit, numbers=sizes))
    off = _turns_away(angle)
    if off.any() and off.mean() < _FEW:
        rows = np.flatnonzero(off)
        sizes = {"count": int(rows.size), "first": int(rows[0]), "value": float(angle[rows[0]])}
        angle = np.where(off, np.nan, angle)
        flags.append(Flag("angle_turned", unit=unit, numbers=sizes))
    good = np.flatnonzero(np.isfinite(angle))
    joined, told = _joined(angle, good, np.round(np.diff(angle[good]) / _FULL_TURN), column)
    turns = round(float(np.median(joined[good])) / _FULL_TURN) if good.size else 0
    if not turns:
        return joined, flags + told
    away = Flag("turns_away", column, numbers={"count": abs(turns)})
    return joined - _FULL_TURN * turns, [*flags, *told, away]


def joined_turns(angle: FloatArray, time: FloatArray, column: str = "") -> tuple[FloatArray, list[Flag]]:
    """Join the turns of an angle that an instrument counts within one of them, from its first reading on.

    All readings then lie within a turn, and where it begins again they jump by one, beside steps that are far smaller.
    A jump of another size is kept.

    `angle`, `time` (n,): angle [rad], NaN in gaps, and times in any unit. `column`: its name in the file, for the flag.
    Returned: the same array where nothing is joined, and a flag where turns were joined.

    Examples
    --------
    >>> time = np.arange(100.0)
    >>> joined, flags = joined_turns(0.1 * time % (2 * np.pi), time, "shaft")
    >>> bool(np.allclose(joined, 0.1 * time)), [flag.code for flag in flags]
    (True, ['turns_joined'])
    """
    good = np.flatnonzero(np.isfinite(angle))
    read = angle[good]
    if good.size < 2 or np.ptp(np.quantile(read, _INSIDE)) > (1.0 + _EXACT) * _FULL_TURN:
        return angle, []
    turns = np.round(np.diff(read) / _FULL_TURN)
    return _joined(angle, good, np.where(_like_beside(read, time[good], turns), turns, 0.0), column)


def _joined(angle: FloatArray, good: IntArray, turns: FloatArray, column: str) -> tuple[FloatArray, list[Flag]]:
    """Return an angle less the full turns that it gains from each good reading to the next, and tell where."""
    places = np.flatnonzero(turns)
    if not places.size:
        return angle, []
    joined = angle.copy()
    joined[good[1:]] -= _FULL_TURN * np.cumsum(turns)
    numbers = {"count": int(places.size), "first": int(good[places[0] + 1])}
    return joined, [Flag("turns_joined", column, numbers=numbers)]


def _like_beside(angle: FloatArray, time: FloatArray, turns: FloatArray) -> BoolArray:
    """Return which steps, less their `turns`, are like the nearest steps without a turn before or after them."""
    steps, plain, usual = np.diff(angle), np.flatnonzero(turns == 0.0), median_step(time)
    if not plain.size or not usual > 0.0:
        return np.zeros(steps.size, bool)
    # A step over samples that are missing is longer by as much.
    lasts = np.maximum(np.round(np.diff(time) / usual), 1.0)
    after = np.searchsorted(plain, np.arange(steps.size))
    beside = plain[np.clip(np.stack([after - 1, after]), 0, plain.size - 1)]
    due = steps[beside] / lasts[beside] * lasts
    left = steps - _FULL_TURN * turns
    return np.asarray((left > due.min(axis=0) - _LIKE) & (left < due.max(axis=0) + _LIKE))


def _turns_away(angle: FloatArray) -> BoolArray:
    """Return readings that lie off the others and are entered and left by more than the turn that a sensor may lose."""
    good = np.flatnonzero(np.isfinite(angle))
    found = np.zeros(angle.size, bool)
    if good.size:
        usual = float(np.median(angle[good]))
        for part in np.split(good, np.flatnonzero(np.abs(np.diff(angle[good])) > _LOST) + 1):
            found[part] = abs(float(np.median(angle[part])) - usual) > _LOST
    return found


def _alone(angle: FloatArray) -> BoolArray:
    """Return which readings jump by what is no full turn away from two neighbours that agree."""
    found = np.zeros(angle.size, bool)
    jump = np.diff(angle)
    turned = np.abs(within_half_a_turn(jump))
    there, back = jump[:-1], jump[1:]
    away = (np.abs(there) > _JUMP) & (np.abs(back) > _JUMP) & (np.sign(there) != np.sign(back))
    found[1:-1] = away & (np.maximum(turned[:-1], turned[1:]) > 0.5 * _JUMP) & (np.abs(angle[2:] - angle[:-2]) < _NEAR)
    return found
