"""Rows of the sparse regression from all recordings: candidate terms on smoothed motion against the measured motion.

The equation is theta_t'' + sum_j c_j f_j = 0 for an arm (the paper's form, equation 15) and q'' + sum_j c_j f_j = b u
for an oscillator. It is seen through the linear oscillator that is nearest to it: the coordinate itself on the left,
the oscillator's response to each candidate on the right. No derivative of a measured signal is needed beyond the rate,
and the noise of the rows is the white noise of the camera.

While the base of an arm moves, inertial forces act that depend on its rate and acceleration and that no candidate in
delta and theta_t' describes; they would be spread over those that are there. Rows of an arm are therefore taken where
the base rests, if it does for long enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pysindy
from scipy.linalg import solve_banded

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import median_step
from discovery.signals.motion import Motion, State

#: Samples after which rows start from a new initial state.
_WINDOW = 4000
#: Highest degree of the polynomials in the deflection and the rate.
_DEGREE = 5
Family = Literal["polynomial", "trigonometric", "dissipative", "input"]


@dataclass(frozen=True)
class Library:
    """Whitened regression rows: ``target = columns @ coefficients + unit noise``.

    Columns (n, p), sign included, and target (n,) are in standard deviations of the row. Blocks (n,) are the contiguous
    stretches of a recording to which the rows belong; stretches are resampled whole. `at_rest` says that only rows
    where an arm's base rests were taken.
    """

    terms: tuple[Term, ...]
    columns: FloatArray
    target: FloatArray
    blocks: np.ndarray
    at_rest: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the terms."""
        return tuple(term.name for term in self.terms)


def _runs(motion: Motion, at_rest: bool, shortest: float) -> list[np.ndarray]:
    """Return the samples to use in contiguous runs; where the base rests, of at least ``shortest`` seconds."""
    time = motion.coordinate.time
    if not at_rest or motion.drive is None:
        return [np.arange(time.size)]
    rate = np.abs(motion.drive.evaluate(time)[1])
    rests = rate < 2e-3 * rate.max() if rate.max() > 0.0 else np.ones(time.size, bool)
    runs = np.split(np.arange(time.size), np.flatnonzero(np.diff(rests.astype(int))) + 1)
    return [run for run in runs if rests[run[0]] and run.size >= 20 and time[run[-1]] - time[run[0]] >= shortest]


def _rests_half_the_time(motions: Sequence[Motion]) -> bool:
    at_rest = sum(run.size for motion in motions for run in _runs(motion, True, 0.0))
    return 2 * at_rest >= sum(motion.coordinate.time.size for motion in motions)


def build_library(motions: Sequence[Motion]) -> Library:
    """Evaluate the candidate terms on smoothed recordings of one system, one below the other.

    Rows of an arm are taken only where its base rests, if that leaves half of the samples.

    Raises InputError without recordings, with recordings of different kinds, or if no row is left.
    """
    arm = bool(motions) and motions[0].system.has_rod
    at_rest = arm and _rests_half_the_time(motions)
    candidates = Candidates(motions, at_rest=at_rest)
    oscillator = candidates.nearest_oscillator(motions)
    longest = max(float(motion.coordinate.time[-1] - motion.coordinate.time[0]) for motion in motions)
    period = 2.0 * np.pi / np.sqrt(oscillator[0]) if oscillator[0] > 0.0 else longest
    parts = [
        response_rows(motion, cut, candidates, oscillator)
        for motion in motions
        for run in _runs(motion, at_rest, min(period / 2.0, longest / 5.0))
        for cut in np.array_split(run, -(-run.size // _WINDOW))
    ]
    if not parts:
        raise InputError(
            "The base never rests for half a period. Use `discovery loop`, which compares free-run predictions."
        )
    # Stretches that are resampled whole last about a period.
    stretch = float(np.clip(period, longest / 50.0, longest / 5.0))
    return Library(
        terms=candidates.terms,
        columns=np.vstack([part[1] for part in parts]),
        target=np.concatenate([part[2] for part in parts]),
        blocks=stretches([part[0] for part in parts], stretch),
        at_rest=at_rest,
    )


def stretches(times: Sequence[FloatArray], length: float) -> np.ndarray:
    """Return the number of the stretch, of about ``length`` seconds, in which each time of each recording lies."""
    labels, start = [], 0
    for t in times:
        count = max(round((t[-1] - t[0]) / length), 1)
        index = np.minimum((count * (t - t[0]) / (t[-1] - t[0])).astype(int), count - 1)
        labels.append(start + index)
        start += count
    return np.concatenate(labels)


def propagate(t: FloatArray, stiffness: float, damping: float, load: FloatArray) -> FloatArray:
    """Return responses (n, p + 2) of q'' + damping q' + stiffness q = load, for many loads at once.

    Hermite-Simpson steps (fourth order) on any time grid (n,) [s], written as one banded system. Loads (2 n - 1, p) are
    those on the grid and, at odd rows, half-way between. Responses are from rest; the last two columns are the free
    motions from unit position and from unit rate.
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


def _effects(position: str, rate: str) -> dict[str, str]:
    """Ids of the effects that single terms stand for."""
    return {
        "1": "equilibrium_offset",
        position: "linear_stiffness",
        f"{position}^2": "quadratic_stiffness",
        f"{position}^3": "cubic_stiffness",
        f"{position}^5": "quintic_stiffness",
        rate: "viscous_damping",
        f"{rate}|{rate}|": "quadratic_drag",
        f"sign({rate})": "coulomb_friction",
        f"{position}^2 {rate}": "amplitude_dependent_damping",
        "delta'": "structural_damping",
    }


@dataclass(frozen=True)
class Term:
    """One candidate f_j of the equation."""

    name: str  # as a reader writes it, such as ``delta^2 theta_t'``
    effect: str | None  # id of the effect that it stands for, where there is one
    family: Family  # "polynomial", "trigonometric", "dissipative" (not smooth in the rate) or "input"
    #: Degree of a polynomial, two for a term that is not smooth or an input; a trigonometric term counts more than any
    #: polynomial of the library.
    complexity: int


def _family(name: str, position: str) -> Family:
    if name == "u":
        return "input"
    if "|" in name or name.startswith("sign"):
        return "dissipative"
    return "trigonometric" if f"({position})" in name or f"(2 {position})" in name else "polynomial"


class Candidates:
    """The candidate terms of one kind of system, built from pysindy's feature libraries.

    An arm's coordinate is an angle: sin and cos of it and of twice as much are offered, too. Where its base rests, its
    delta' is theta_t' and is not offered beside it.

    Raises InputError without recordings, or with recordings of different kinds.
    """

    def __init__(self, motions: Sequence[Motion], *, at_rest: bool) -> None:
        if len({motion.kind for motion in motions}) != 1:
            raise InputError("SINDy needs one or more recordings of one kind of system.")
        arm = motions[0].system.has_rod
        driven = all(motion.drive is not None for motion in motions) and not (arm and at_rest)
        position, rate = ("delta", "theta_t'") if arm else ("q", "q'")
        # The sign of a rate is graded where the rate is not known better than that.
        width = 3.0 * float(np.median(np.concatenate([motion.coordinate.sd[1] for motion in motions])))
        parts = [
            (pysindy.PolynomialLibrary(degree=_DEGREE), [0, 1]),
            (
                pysindy.CustomLibrary(
                    [lambda v: v * np.abs(v), lambda v: np.tanh(v / width)],
                    [lambda v: f"{v}|{v}|", lambda v: f"sign({v})"],
                ),
                [1],
            ),
        ]
        if arm:
            functions = [lambda x: np.sin(x), lambda x: np.sin(2.0 * x), lambda x: np.cos(x), lambda x: np.cos(2.0 * x)]
            labels = [lambda x: f"sin({x})", lambda x: f"sin(2 {x})", lambda x: f"cos({x})", lambda x: f"cos(2 {x})"]
            parts.append((pysindy.CustomLibrary(functions, labels), [0]))
        self.inputs = [position, rate]
        if driven:  # the base moves an arm's delta' away from theta_t'; an oscillator's input is a term by itself
            parts.append((pysindy.IdentityLibrary(), [2]))
            self.inputs.append("delta'" if arm else "u")
        self.features = pysindy.GeneralizedLibrary([p for p, _ in parts], inputs_per_library=[i for _, i in parts])
        self.features.fit(np.zeros((2, len(self.inputs))))
        effects = _effects(position, rate)
        terms = []
        for name in self.features.get_feature_names(self.inputs):
            family = _family(name, position)
            complexity = _DEGREE + 1 if family == "trigonometric" else 2
            if family == "polynomial":
                complexity = 0 if name == "1" else sum(int(f.partition("^")[2] or 1) for f in name.split())
            terms.append(Term(name, effects.get(name), family, complexity))
        self.terms = tuple(terms)

    def inputs_of(self, state: State) -> FloatArray:
        """Columns (n, 2 or 3) that the feature library takes."""
        columns = [state.delta, state.q_dot]
        if len(self.inputs) == 3:
            columns.append(state.delta_dot if state.input is None else state.input)
        return np.column_stack(columns)

    def evaluate(self, state: State) -> FloatArray:
        """Candidates at a state, shape (n, p), with the sign that they have beside the acceleration."""
        columns = np.asarray(self.features.transform(self.inputs_of(state)))
        return columns * np.array([1.0 if term.family == "input" else -1.0 for term in self.terms])

    def nearest_oscillator(self, motions: Sequence[Motion]) -> tuple[float, float]:
        """Stiffness [1/s^2] and damping [1/s], none negative, of the linear oscillator nearest to the motion."""
        states = [motion.state(motion.coordinate.time) for motion in motions]
        design = np.vstack([np.column_stack([-self.inputs_of(s)[:, :2], np.ones(s.q.size)]) for s in states])
        if self.inputs[-1] == "u":
            design = np.column_stack([design, np.concatenate([self.inputs_of(s)[:, 2] for s in states])])
        solution = np.linalg.lstsq(design, np.concatenate([s.q_ddot for s in states]), rcond=None)[0]
        return max(float(solution[0]), 0.0), max(float(solution[1]), 0.0)
