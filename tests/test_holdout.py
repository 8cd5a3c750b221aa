from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_search import DECLARED, EFFECTS, UNITS, pushes, recorded, searched

from discovery.bench import Bench
from discovery.fit import fit
from discovery.holdout import HoldOut
from discovery.model import Model
from discovery.node import Node
from discovery.predict import held_out
from discovery.refits import Refit

HELD = recorded("held", pushes(-0.8, 1.2, 0.3, 0.0), 100)


def judge() -> HoldOut:
    return HoldOut([recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)], [HELD], UNITS, 2e-5)


def test_a_motion_that_blows_up_is_infinitely_wrong() -> None:
    held = judge()
    right = HELD.recording.output.copy()
    chi2, count, rough = held.score([right])
    assert (chi2, count) == (0.0, right.size)
    assert np.isfinite(rough)
    right[-5:] = np.nan
    assert held.score([right]) == (np.inf, count, np.inf)
    # Where nothing was measured, nothing is missed.
    gaps = replace(HELD, recording=replace(HELD.recording, output=right))
    chi2, count, _ = HoldOut(held.train, [gaps], UNITS, 2e-5).score([right])
    assert (chi2, count) == (0.0, right.size - 5)


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


def test_a_set_that_blows_up_on_held_out_recordings_is_no_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    search = searched()
    case = search.case
    monkeypatch.setattr(
        case.judge, "predictions", lambda bench, models: [[np.full_like(HELD.recording.output, np.nan)]]
    )
    node = Node.of((), Refit("", search.root.refit.problem, search.root.refit.minimum), case)
    assert node.held == node.held_rough == np.inf


def test_a_model_that_blows_up_beyond_the_fitted_motion_is_infinitely_wrong_and_no_error() -> None:
    train = [recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)]
    found = fit(Model("oscillator", DECLARED), train, start={"xi": 0.08, "alpha": 9.0}, units=UNITS)
    bench, held = Bench("oscillator", EFFECTS, train, 0.04), judge()
    # It pushes away from rest, so fast that no step is short enough.
    (wild,) = held.predictions(bench, [(found.model, {**found.values, "alpha": -1e4}, [])])
    assert held.score(wild)[0] == held.score(wild)[2] == held.errors(wild)["holdout"]["rms"] == np.inf
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
    ((wild, small),) = held_out([soft], [violent, calm], both, UNITS)
    ((expected,),) = held_out([soft], [calm], alone, UNITS)
    assert not np.isfinite(wild).all()
    np.testing.assert_allclose(small, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("continued", [False, True])
def test_the_uncertainty_of_predictions_is_that_of_draws_of_the_estimates(
    continued: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = [recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 0)]
    train = [replace(train[0], fitted_samples=250)] if continued else train
    found = fit(Model("oscillator", DECLARED), train, start={"xi": 0.08, "alpha": 9.0}, units=UNITS)
    held = HoldOut(train, [] if continued else [HELD], UNITS, 2e-5)
    draws = np.random.default_rng(0).multivariate_normal(found.minimum.x, found.covariance, size=200)
    problem, bench = found.problem, found.problem.bench
    models = [(found.model, problem.named(x), problem.predict(x)) for x in (found.minimum.x, *draws)]
    (centre,), *others = held.predictions(bench, models)
    wanted = np.isfinite(held.outputs()[0])
    far = [np.mean(np.square((other - centre) / HELD.recording.noise)[wanted]) for (other,) in others]
    assert held.uncertainty(found) == pytest.approx(np.sqrt(np.mean(far)), rel=0.1)
    assert 0.01 < held.uncertainty(found) < 1
    blown = [np.full_like(centre, np.inf)]
    monkeypatch.setattr(held, "predictions", lambda bench, models: [blown for _ in models])
    assert held.uncertainty(found) == np.inf
