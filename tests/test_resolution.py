"""Steps that do not resolve a law make its interval worthless, and are told by it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pushed_oscillator as pushed
import pytest

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import half_step, solver_shift
from discovery.estimation.fit import SHIFT, Fit, fit

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
    assert half_step(fine.problem, fine.minimum, np.sqrt(np.diag(fine.covariance))).resolves_slopes
    assert fine.solver_shift < SHIFT


def test_steps_on_which_friction_chatters_are_told_by_the_shift() -> None:
    coarse, fine = fitted(0.02), fitted(2.5e-4)
    assert coarse.sd["f_c"] < 0.5 * fine.sd["f_c"]
    assert not half_step(coarse.problem, coarse.minimum, np.sqrt(np.diag(coarse.covariance))).resolves_slopes
    assert coarse.solver_shift > 10 * SHIFT
    assert "still shifts" in coarse.status


def test_what_has_no_interval_is_not_judged() -> None:
    coarse = fitted(0.02)
    assert half_step(coarse.problem, coarse.minimum, np.full(coarse.minimum.x.size, np.nan)).resolves_slopes


def test_the_minimum_is_simulated_once_on_half_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """What that changes is what two simulations of the residuals differ by."""
    coarse, finer, made = fitted(0.02), Bench.finer, []
    fine = coarse.problem.bench.finer(2)
    monkeypatch.setattr(Bench, "finer", lambda self, times: made.append(times) or finer(self, times))
    halved = half_step(coarse.problem, coarse.minimum, np.sqrt(np.diag(coarse.covariance)))
    assert solver_shift(coarse.problem, coarse.minimum, coarse.covariance) == coarse.solver_shift
    assert made == [2, 2]
    apart = fine.residuals(*coarse.problem.expand(coarse.minimum.x[:, None]))[:, 0] - coarse.minimum.residual
    np.testing.assert_allclose(halved.change, apart, atol=1e-8)
    assert np.abs(apart).max() > 1.0
