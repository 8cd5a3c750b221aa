"""Whether a motion runs on and on in one direction, as what is driven by a constant does, or comes back by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.units import si_symbol
from discovery.foundation.arrays import FloatArray

#: What to do about a motion that does.
DRIVEN = (
    'Declare what drives it as the input of kind = "drive", or, where that was not recorded, a constant force in a '
    "table [system], as `discovery init --kind system` drafts it (docs/YOUR_SYSTEM.md)."
)
#: What runs on goes back over less than so much of its way. An angle goes through more than two turns, or through one
#: and on; anything else is at the end, in so much of the time, no slower than so much of its mean speed.
_TURN, _BACK, _END, _SLOWER = 2.0 * np.pi, 0.1, 0.25, 0.5
#: What comes back does so over more than this part of the way on which it was pushed.
_RETURNS = 0.5
#: Readings of which the means tell which way it goes.
_LOOKED = 50
#: Counts of a counter, at least.
_COUNTS = 20
#: Share of gravity from which a motion that grows is a fall counted downwards.
_UPWARDS = 0.02


def runs_on(output: FloatArray, unit: str = "rad") -> bool:
    """Return whether an output runs on and on, nearly all of the way in one direction.

    An angle does that which goes through more than two turns, or is beyond one and still on its way, as what has
    another unit must be.

    `output` (n,): in the SI unit of `unit`; NaN marks gaps.

    Examples
    --------
    >>> t = np.linspace(0, 5, 1001)
    >>> runs_on(6.0 * t), runs_on(20.0 * np.sin(t)), runs_on(2.0 * t)
    (True, False, True)
    >>> runs_on(1.0 * t), runs_on(2.0 * t, "m"), runs_on(1.0 - np.exp(-t), "m")
    (False, True, False)
    """
    steps = _steps(output)
    way, back = _ways(steps)
    if back >= _BACK * way:
        return False
    if si_symbol(unit) == "rad" and not _TURN < way <= 2 * _TURN:
        return bool(way > _TURN)
    last = steps[-max(1, round(_END * steps.size)) :]
    return bool(last.mean() / steps.mean() > _SLOWER)


def goes_back(output: FloatArray) -> bool:
    """Return whether readings (n,), NaN in gaps, go back by a tenth of the way that they go in the other direction.

    Examples
    --------
    >>> t = np.linspace(0, 5, 1001)
    >>> goes_back(np.sin(t)), goes_back(t**2)
    (True, False)
    """
    way, back = _ways(_steps(output))
    return back >= _BACK * way


def comes_back(output: FloatArray, given: FloatArray) -> bool:
    """Return whether readings go back, and come to rest, while an input of one sign rests that had moved them.

    What nothing pulls back to a place runs on there until it stands still.

    `output`, `given` (n,): motion, NaN in gaps, and the input.

    Examples
    --------
    >>> t = np.linspace(0, 5, 1001)
    >>> push = np.where(t < 1, 1.0, 0.0)
    >>> comes_back(np.minimum(t, 1) * np.exp(-2 * np.maximum(t - 1, 0)), push), comes_back(np.minimum(t, 2), push)
    (True, False)
    """
    good = np.isfinite(output) & np.isfinite(given)
    pushed = given[good] != 0.0
    if pushed.all() or not pushed.any() or given[good].min() < 0.0 < given[good].max():
        return False
    steps = _steps(output[good])
    moved = np.array([part.any() for part in _parts(pushed)])[1:]
    begun = int(np.argmax(moved))
    forward, back = float(steps[moved].sum()), -steps[begun:][~moved[begun:]]
    returned = np.sign(forward) * back
    rests = returned.size > 1 and abs(returned[-1]) < _SLOWER * returned.max()
    return bool(rests and returned.sum() > _RETURNS * abs(forward))


def _steps(output: FloatArray) -> FloatArray:
    """Return how far a motion goes from part to part; single readings tell their noise, too."""
    return np.diff([part.mean() for part in _parts(output[np.isfinite(output)])])


def _parts(values: NDArray[Any]) -> list[NDArray[Any]]:
    return np.array_split(values, min(values.size, _LOOKED))


def _ways(steps: FloatArray) -> tuple[float, float]:
    """Return how far steps go in the direction in which they go farther, and in the other one."""
    ways = float(steps[steps > 0.0].sum()), float(-steps[steps < 0.0].sum())
    return max(ways), min(ways)


def counts_up(output: FloatArray) -> bool:
    """Return whether readings (n,) are those of a counter: whole numbers that never go back, or never forward.

    Examples
    --------
    >>> counts_up(np.arange(4264.0, 4432.0)), counts_up(np.round(9.0 * np.sin(np.arange(99.0))))
    (True, False)
    """
    read = output[np.isfinite(output)]
    steps = np.diff(read)
    one_way = (steps >= 0.0).all() or (steps <= 0.0).all()
    return bool(one_way and (read == np.round(read)).all() and np.unique(read).size > _COUNTS)


def falls_upwards(gravity: float, t: FloatArray, height: FloatArray) -> bool:
    """Return whether what falls gains height the faster the later, as where a depth is read.

    `gravity`: its acceleration [m/s^2]. `t`, `height` (n,): times [s] and readings [m], without gaps.

    Examples
    --------
    >>> t = np.linspace(0, 1, 50)
    >>> [falls_upwards(9.81, t, h) for h in (4.9 * t**2, -4.9 * t**2, np.exp(-t) - t)]
    [True, False, False]
    """
    parabola = np.polynomial.Polynomial.fit(t, height, 2)
    faster = float(parabola.deriv(2)(t[0])) > _UPWARDS * gravity and parabola.deriv()(t[-1]) > 0.0
    return bool(faster and way_of(height) > 0.0)


def way_of(height: FloatArray) -> float:
    """Return how far a motion goes from its first tenth to its last."""
    tenth = max(height.size // 10, 1)
    return float(np.median(height[-tenth:]) - np.median(height[:tenth]))
