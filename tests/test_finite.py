from __future__ import annotations

import numpy as np
import pytest
from pushed_oscillator import DECLARED, EFFECTS, TRUTH, UNITS, pushes, recorded

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import fit
from discovery.screening.attribution import screen
from discovery.screening.finite import finite_starts
from discovery.screening.refits import refit

STEP = 0.02


@pytest.mark.parametrize(("effect", "values"), [("viscoelastic_relaxation", {"v": 0.3, "tau_v": 0.13})])
def test_a_large_effect_on_the_frequency_is_reached(effect: str, values: dict[str, float]) -> None:
    e = recorded("large", pushes(1.0, -1.5, 0.7, 0.0), 4, **values)
    bench = Bench("oscillator", EFFECTS, [e], STEP)
    start = {"g": 1.0, "xi": 0.3, "alpha": 9.6}
    found = fit(Model("oscillator", DECLARED), [e], start=start, bench=bench, units=UNITS)
    far = finite_starts(found.minimum, found.problem, [effect])
    assert {name for name, _, _ in far} == {effect}
    assert len(far) <= 2
    scored = screen(found.minimum, found.problem, [effect])
    (with_far,) = refit(found.minimum, found.problem, scored, finite=far)
    assert with_far.chi2 < 1.3 * bench.n_data
    assert with_far.values["alpha"] == pytest.approx(TRUTH["alpha"], rel=0.02)


def test_only_what_moves_the_frequency_is_scanned() -> None:
    e = recorded("clean", pushes(1.0, -1.5, 0.7, 0.0), 5)
    bench = Bench("oscillator", EFFECTS, [e], STEP)
    found = fit(Model("oscillator", DECLARED), [e], start=TRUTH, bench=bench, units=UNITS)
    names = ["coulomb_friction", "sensor_delay", "periodic_disturbance", "cubic_stiffness"]
    far = finite_starts(found.minimum, found.problem, names)
    assert {name for name, _, _ in far} == {"cubic_stiffness"}
    # Of a clean recording the smallest size is the best; what it stiffens goes off the stiffness.
    _, vector, others = far[0]
    assert abs(vector[0]) <= 0.2 / UNITS.time**2 / UNITS.coordinate**2
    assert others["alpha"] == pytest.approx(0.948 * found.values["alpha"], rel=0.02)


def test_without_a_fitted_stiffness_there_is_nothing_to_scan() -> None:
    e = recorded("clean", pushes(1.0, -1.5, 0.7, 0.0), 5)
    bench = Bench("oscillator", EFFECTS, [e], STEP)
    model = Model("oscillator", DECLARED, {"alpha": 9.0})
    found = fit(model, [e], start=TRUTH, bench=bench, units=UNITS)
    assert finite_starts(found.minimum, found.problem, ["cubic_stiffness"]) == []
    assert np.isfinite(found.chi2)
