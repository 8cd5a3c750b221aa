"""Steps that do not resolve a law make its interval worthless, and are told by it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pushed_oscillator as pushed

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import SHIFT, Fit, fit
from discovery.estimation.resolution import resolves_slopes

FRICTION = Model("oscillator", (*pushed.DECLARED, "coulomb_friction"), {"v_c": 3e-4})


@cache
def fitted(step: float) -> Fit:
    """Fit dry friction, whose force turns within a tenth of a millisecond, on steps of a given length [s]."""
    train = [pushed.recorded("train", pushed.pushes(1.0, -1.5, 0.7, 0.0), 3, f_c=0.3, v_c=3e-4)]
    start = {**pushed.TRUTH, "f_c": 0.3}
    bench = Bench("oscillator", FRICTION.effects, train, step)
    return fit(FRICTION, train, start=start, bench=bench, units=pushed.UNITS)


def test_fine_steps_resolve_dry_friction() -> None:
    fine = fitted(2.5e-4)
    assert resolves_slopes(fine.problem, fine.minimum.x, np.sqrt(np.diag(fine.covariance)))
    assert fine.solver_shift < SHIFT


def test_steps_on_which_friction_chatters_are_told_by_the_shift() -> None:
    coarse, fine = fitted(0.02), fitted(2.5e-4)
    assert coarse.sd["f_c"] < 0.5 * fine.sd["f_c"]
    assert not resolves_slopes(coarse.problem, coarse.minimum.x, np.sqrt(np.diag(coarse.covariance)))
    assert coarse.solver_shift > 10 * SHIFT
    assert "still shifts" in coarse.status


def test_what_has_no_interval_is_not_judged() -> None:
    coarse = fitted(0.02)
    assert resolves_slopes(coarse.problem, coarse.minimum.x, np.full(coarse.minimum.x.size, np.nan))
