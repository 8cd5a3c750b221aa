from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_oscillator import DECLARED, EFFECTS, UNITS, pushes, recorded

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import fit
from discovery.estimation.held_states import held_out
from discovery.estimation.holdout import HoldOut

HELD = recorded("held", pushes(-0.8, 1.2, 0.3, 0.0), 100)


def judge() -> HoldOut:
    return HoldOut([recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)], [HELD], UNITS, 2e-5)


def test_how_fine_the_steps_are_does_not_depend_on_which_set_is_judged_later() -> None:
    train = [recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)]
    found = fit(Model("oscillator", DECLARED), train, start={"xi": 0.08, "alpha": 9.0}, units=UNITS)
    models = [(found.model, values, []) for values in (found.values, {**found.values, "alpha": 900.0})]
    benches = [Bench("oscillator", EFFECTS, train, step) for step in (0.04, 0.01)]
    predicted = []
    for order in (models, models[::-1]):
        held = judge()
        held.predictions(benches[0], models[:1])
        predicted.append({m[1]["alpha"]: held.predictions(benches[1], [m])[0][0] for m in order})
    for alpha in predicted[0]:
        np.testing.assert_array_equal(predicted[0][alpha], predicted[1][alpha])


@pytest.mark.slow
def test_a_model_that_blows_up_beyond_the_fitted_motion_is_infinitely_wrong_and_no_error() -> None:
    train = [recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)]
    found = fit(Model("oscillator", DECLARED), train, start={"xi": 0.08, "alpha": 9.0}, units=UNITS)
    bench, held = Bench("oscillator", EFFECTS, train, 0.04), judge()
    # It pushes away from rest, so fast that no step is short enough.
    (wild,) = held.predictions(bench, [(found.model, {**found.values, "alpha": -1e3}, [])])
    assert held.errors(wild)["holdout"]["rms"] == np.inf
    # The next model is predicted as if nothing had been.
    (after,) = held.predictions(bench, [(found.model, found.values, [])])
    (fresh,) = judge().predictions(bench, [(found.model, found.values, [])])
    np.testing.assert_array_equal(after[0], fresh[0])


def test_a_blow_up_in_one_recording_spoils_no_start_in_another() -> None:
    train = [recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)]
    found = fit(Model("oscillator", DECLARED), train, start={"xi": 0.08, "alpha": 9.0}, units=UNITS)
    # It softens: small motions stay, large ones run away.
    soft = (Model("oscillator", (*DECLARED, "cubic_stiffness")), {**found.values, "beta": -60.0})
    violent = recorded("violent", pushes(-8.0, 12.0, 3.0, 0.0), 100)
    calm = recorded("calm", pushes(0.1, -0.1, 0.05, 0.0), 3)
    both, alone = Bench("oscillator", EFFECTS, [violent, calm], 0.01), Bench("oscillator", EFFECTS, [calm], 0.01)
    ((wild, small),) = held_out([soft], both, UNITS)
    ((expected,),) = held_out([soft], alone, UNITS)
    assert not np.isfinite(wild).all()
    np.testing.assert_allclose(small, expected, rtol=1e-9, atol=1e-12)


def test_a_constant_is_held_against_the_whole_recording_and_not_its_calm_end() -> None:
    whole = recorded("whole", pushes(1.0, -1.5, 0.7, 0.0), 0)
    n = whole.recording.time.size
    continued = HoldOut([replace(whole, fitted_samples=2 * n // 3)], [], UNITS, 2e-5)
    (left,), (apart,) = continued.constants, HoldOut([HELD], [whole], UNITS, 2e-5).constants
    y = whole.recording.output[:, 0]
    np.testing.assert_allclose(left.whole[0].columns[:, 0], (y - y.mean()) / whole.recording.noise[0])
    np.testing.assert_array_equal(left.held[0].columns, left.whole[0].columns[2 * n // 3 :])
    assert left.share == pytest.approx(1 / 3, abs=1 / n)
    assert apart.share == 1.0
    assert continued.scatter == pytest.approx(y.std())


def test_a_recording_of_a_steady_level_is_held_against_the_level_of_training() -> None:
    trained = recorded("trained", pushes(1.0, -1.5, 0.7, 0.0), 0)
    level = replace(HELD, recording=replace(HELD.recording, output=np.full_like(HELD.recording.output, 3.0)))
    (constant,) = HoldOut([trained], [level], UNITS, 2e-5).constants
    off = (3.0 - trained.recording.output.mean()) / HELD.recording.noise[0]
    np.testing.assert_allclose(constant.held[0].columns, off)
