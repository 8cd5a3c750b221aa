"""The score of a held-out recording whose likeliest parameters lie beyond where a linear model of its motion holds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from pushed_oscillator import UNITS
from scipy.special import logsumexp
from test_evidence_of_sets import NATURAL, TIME, problem
from test_search import DECLARED, context

from discovery.equations.model import Model
from discovery.estimation.laplace import Belief
from discovery.estimation.linear_problem import ErrorSizes, Linearised
from discovery.estimation.log_evidence import evidence_of
from discovery.estimation.model_error import Channel
from discovery.foundation.arrays import FloatArray
from discovery.selection.contender import contenders
from discovery.selection.linearise import linearised
from discovery.selection.search import Search

_SD = 0.02  # with which training tells the detuning


class Swing:
    """A sine of 40 noise sds whose detuning is the parameter: over the recording its phase runs away."""

    def __init__(self, detuning: float) -> None:
        self.read = self.at(detuning) + np.random.default_rng(1).normal(size=TIME.size)

    def at(self, detuning: float) -> FloatArray:
        return 40.0 * np.sin(1.3 * (1 + detuning) * TIME)

    def residuals(self, number: int, steps: FloatArray) -> list[FloatArray]:
        assert number == 0
        return [np.column_stack([self.at(x) - self.read for x in steps[0]])]

    def channels(self, number: int, step: FloatArray) -> list[Channel]:
        assert number == 0
        slope = 40.0 * 1.3 * TIME * np.cos(1.3 * (1 + step[0]) * TIME)
        return [Channel(TIME, np.column_stack([slope, self.at(float(step[0])) - self.read]))]


def told(swing: Swing, *, motion: bool) -> Linearised:
    """Return a problem whose training readings tell a detuning of zero with its sd; held out is a swing."""
    slope = np.full(TIME.size, 1 / (_SD * np.sqrt(TIME.size)))
    whole = problem(slope[:, None], np.zeros(TIME.size), width=10.0)
    held = [swing.channels(0, np.zeros(1))]
    return replace(whole, held=held, motion=cast(Any, swing) if motion else None)


def exact(swing: Swing) -> float:
    """Integrate the score over the detuning on a grid."""
    none = np.empty(0)
    nothing = Linearised([], [], Belief(none, none, none, none, none, np.empty(0, bool)), 0, NATURAL, 0.15)
    grid = np.linspace(-6 * _SD, 6 * _SD, 481)
    scores = [
        ErrorSizes(nothing, [Channel(TIME, r[:, None])], nothing.prior).integrated
        for r in (swing.at(x) - swing.read for x in grid)
    ]
    prior = -0.5 * (grid / _SD) ** 2 - np.log(_SD * np.sqrt(2 * np.pi))
    return float(logsumexp(scores + prior) + np.log(grid[1] - grid[0]))


@pytest.mark.parametrize("detuning", [0.0, 0.01, 0.04, -0.05])
def test_it_is_that_of_the_motion(detuning: float) -> None:
    swing = Swing(detuning)
    score = evidence_of(told(swing, motion=True)).held
    # Where none is likely, sizes of the model error are integrated roughly.
    assert score == pytest.approx(exact(swing), abs=3.0)
    if abs(detuning) > 2 * _SD:
        assert evidence_of(told(swing, motion=False)).held < score - 100


def test_where_no_linear_model_holds_what_the_motion_leaves_counts() -> None:
    swing = Swing(0.6)  # beyond all of the intervals, and many turns away
    found = evidence_of(told(swing, motion=True))
    assert np.isfinite(found.held)
    assert found.held < exact(Swing(0.0)) - 300
    assert found.error_held > 5


@pytest.mark.parametrize("continued", [False, True])
def test_the_motion_is_that_of_the_simulators(continued: bool) -> None:
    shared = context(c_2=0.2)
    if continued:
        train = [replace(e, fitted_samples=500) for e in shared.train]
        shared = replace(shared, train=train, judge=type(shared.judge)(train, [], UNITS, 2e-5))
    start = shared.fit(Model("oscillator", DECLARED), {"g": 0.9, "xi": 0.05, "alpha": 8.8}, {})
    found = Search(start, shared).best
    (slopes,) = linearised(shared, found.refit.problem.bench, [found.refit])
    assert slopes is not None
    motion = slopes.problem.motion
    assert motion is not None
    nothing = np.zeros(slopes.problem.held[0][0].columns.shape[1] - 1)
    (own,), (there,) = slopes.problem.held[0], motion.channels(0, nothing)
    assert there.columns == pytest.approx(own.columns, rel=1e-6, abs=1e-6)
    # Along a little step the residuals go as the derivatives say.
    little = 1e-3 * found.refit.problem.scale[0] * np.eye(nothing.size)[:1].T
    (moved,) = motion.residuals(0, little)
    assert moved[:, 0] - own.columns[:, -1] == pytest.approx(own.columns[:, 0] * little[0, 0], rel=0.02, abs=1e-2)
    assert contenders(shared, [((), found.refit)])[0].joint == pytest.approx(found.joint, abs=1e-6)
