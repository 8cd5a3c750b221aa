"""Rows of the sparse regression on one run of samples, each divided by its own standard deviation.

They are the equation, theta_t'' + sum_j c_j f_j = 0 of an arm or q'' + sum_j c_j f_j = b u of an oscillator, seen
through the linear oscillator that is nearest to it: the coordinate itself on the left, the oscillator's response to
each candidate on the right. No derivative of a measured signal is needed beyond the rate, and the noise of the rows is
the white noise of the camera.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

from discovery.foundation.sampling import median_step
from discovery.signals.differentiate import FloatArray
from discovery.signals.motion import Motion
from discovery.sindy.candidates import Candidates

__all__ = ["Rows", "propagate", "response_rows"]


def propagate(t: FloatArray, stiffness: float, damping: float, load: FloatArray) -> FloatArray:
    """Response of q'' + damping q' + stiffness q = load, for many loads at once.

    Hermite-Simpson steps (fourth order) on any time grid, written as one banded system.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Grid [s].
    stiffness, damping : float
        [1/s^2], [1/s].
    load : ndarray, shape (2 n - 1, p)
        Loads on the grid and, at odd rows, half-way between.

    Returns
    -------
    ndarray, shape (n, p + 2)
        Responses from rest; the last two columns are the free motions from unit position and from unit rate.
    """
    h, n, p = np.diff(t), t.size, load.shape[1]
    a = np.array([[0.0, 1.0], [-stiffness, -damping]])
    e = np.array([0.0, 1.0])
    step, eye = h[:, None, None], np.eye(2)
    implicit = np.linalg.inv(eye - step / 6.0 * (a + 4.0 * a @ (eye / 2.0) - step / 2.0 * (a @ a)))
    phi = implicit @ (eye + step / 6.0 * (a + 4.0 * a @ (eye / 2.0) + step / 2.0 * (a @ a)))
    weights = (
        h[:, None] / 6.0 * (e + h[:, None] / 2.0 * (a @ e)),
        h[:, None] / 6.0 * 4.0 * e,
        h[:, None] / 6.0 * (e - h[:, None] / 2.0 * (a @ e)),
    )
    right = np.zeros((n, 2, p + 2))
    for weight, value in zip(weights, (load[:-1:2], load[1::2], load[2::2]), strict=True):
        right[1:, :, :p] += (implicit @ weight[:, :, None]) * value[:, None, :]
    right[0, 0, p] = right[0, 1, p + 1] = 1.0
    band = np.zeros((4, 2 * n))
    band[0] = 1.0
    for i in range(2):
        for j in range(2):
            band[2 + i - j, j : 2 * n - 2 : 2] = -phi[:, i, j]
    return np.asarray(solve_banded((3, 0), band, right.reshape(2 * n, p + 2))).reshape(n, 2, p + 2)[:, 0]


def _refine(t: FloatArray, longest: float) -> tuple[FloatArray, np.ndarray]:
    """Insert points until no step is longer than ``longest``; also return where the old ones are."""
    parts = np.maximum(np.ceil(np.diff(t) / longest).astype(int), 1)
    where = np.concatenate([[0], np.cumsum(parts)])
    return np.interp(np.arange(where[-1] + 1), where, t), where


Rows = tuple[FloatArray, FloatArray, FloatArray]  # times (n,), columns (n, p), target (n,), both over the noise


def response_rows(motion: Motion, run: np.ndarray, candidates: Candidates, oscillator: tuple[float, float]) -> Rows:
    """Rows of the equation seen through an oscillator of this stiffness [1/s^2] and damping [1/s]."""
    track, (stiffness, damping) = motion.coordinate, oscillator
    # Short recordings can afford steps that follow the jumps of a dry friction, too.
    longest = median_step(track.time) * (0.251 if track.time.size <= 10_000 else 2.0)
    if stiffness > 0.0:
        longest = min(longest, 0.2 / np.sqrt(stiffness))
    grid, where = _refine(track.time[run], longest)
    state = motion.state(np.interp(np.arange(2 * grid.size - 1) / 2.0, np.arange(grid.size), grid))
    load = np.column_stack([candidates.evaluate(state), damping * state.q_dot + stiffness * state.q])
    answer = propagate(grid, stiffness, damping, load)[where] / track.noise[run, None]
    free = np.linalg.qr(answer[:, -2:])[0]  # the initial state of a run is whatever it was
    rows = np.column_stack([answer[:, :-3], track.observed[run] / track.noise[run] - answer[:, -3]])
    rows -= free @ (free.T @ rows)
    return track.time[run], rows[:, :-1], rows[:, -1]
