"""A driven body on a spring with dry friction, from event to event: it slides or sticks, and nothing is smoothed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

FloatArray = NDArray[np.float64]
Force = Callable[[FloatArray], FloatArray]

#: Tolerances of the integrator, and how finely the end of a stick is looked for [s].
_RTOL, _ATOL, _LOOK = 1e-10, 1e-13, 1e-4


def stick_slip(force: Force, time: FloatArray, *, mass: float, stiffness: float, loss: float, dry: float) -> FloatArray:
    """Return where the body is, from rest at zero.

    Parameters
    ----------
    force : callable
        Force on it at given times [N].
    time : ndarray, shape (n,)
        When it is read [s].
    mass, stiffness, loss, dry : float
        Its mass [kg], spring [N/m], viscous loss [N s/m] and dry friction [N], the same at rest.
    """
    place = np.zeros(time.size)
    now, x, v, end = float(time[0]), 0.0, 0.0, float(time[-1])
    while now < end:
        pull = float(force(np.array([now]))[0]) - stiffness * x
        if v == 0.0 and abs(pull) <= dry:
            held = partial(_excess, force, stiffness * x, dry)
            later = _slips(held, now, end)
            place[(time >= now) & (time <= later)] = x
            now = later
            if now >= end:
                break
            pull = float(force(np.array([now]))[0]) - stiffness * x
        moved, stops = _sliding(force, now, float(np.sign(v or pull)), mass, stiffness, loss, dry)
        here = np.flatnonzero(time > now)
        found = solve_ivp(
            moved, (now, end), [x, v], "DOP853", time[here], events=stops, rtol=_RTOL, atol=_ATOL, max_step=0.02
        )
        place[here[: found.t.size]] = found.y[0]
        if found.t_events[0].size == 0:
            break
        now, x, v = float(found.t_events[0][0]), float(found.y_events[0][0][0]), 0.0
    return place


def _sliding(force: Force, begin: float, way: float, mass: float, stiffness: float, loss: float, dry: float):
    """Return the motion while a body slides one way, and the event that ends it."""

    def moved(t: float, state: FloatArray) -> list[float]:
        rest = float(force(np.array([t]))[0]) - stiffness * state[0] - loss * state[1] - way * dry
        return [state[1], rest / mass]

    def stops(t: float, state: FloatArray) -> float:
        return way * float(state[1]) if t > begin + 1e-9 else 1.0

    stops.terminal, stops.direction = True, -1.0
    return moved, stops


def _excess(force: Force, spring: float, dry: float, time: FloatArray) -> FloatArray:
    """Return by how much what pulls at a resting body exceeds its friction [N]."""
    return np.abs(force(time) - spring) - dry


def _slips(beyond: Force, now: float, end: float) -> float:
    """Return when a body at rest is moved: where a function of time first rises above zero."""
    for first in np.arange(now, end, 100 * _LOOK):
        times = np.minimum(first + _LOOK * np.arange(1, 101), end)
        over = np.flatnonzero(beyond(times) > 0)
        if over.size:
            last = float(times[over[0]])
            start = max(now, last - _LOOK)
            if beyond(np.array([start]))[0] >= 0:
                return last
            return float(brentq(lambda t: float(beyond(np.array([t]))[0]), start, last, xtol=1e-12))
    return end
