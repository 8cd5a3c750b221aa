from __future__ import annotations

import numpy as np
import pytest
from pendulum import swing

from discovery.estimation.bench import Bench
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.recordings.dataset import load_dataset
from discovery.screening import growing
from discovery.screening.growing import grown


def large_swing(tmp_path):
    """Fifty swings from 80 degrees with a drag that takes most of the energy, fitted with viscous friction."""
    rig, recording, _ = swing(tmp_path, lambda v: 0.01 * v + 0.03 * v * abs(v), duration=60.0)
    data = load_dataset(rig, [recording], keep_third=False)
    model = declared_model(data.train[0])
    return fit(model, data.train)


def test_a_loss_that_turns_the_phase_is_reached_from_the_first_swings(tmp_path) -> None:
    declared = large_swing(tmp_path)
    effects = ("viscous_damping", "gravity_torque", "quadratic_drag")
    old = declared.problem.bench
    bench = Bench(old.base, effects, old.experiments, old.step)
    whole = fit(declared.model, bench.experiments, start=declared.values, bench=bench)
    problem, minimum = whole.problem, whole.minimum
    (found,) = grown(minimum, problem, ["quadratic_drag"])
    assert found.effect == "quadratic_drag"
    assert found.chi2 < 1.2 * problem.bench.n_data
    assert abs(found.values["c_2"] - 0.03) < 5e-4
    assert abs(found.values["xi"] - 0.01) < 2e-3


def test_a_short_recording_needs_none(tmp_path) -> None:
    rig, recording, _ = swing(tmp_path, lambda v: 0.1 * v, duration=8.0)
    data = load_dataset(rig, [recording], keep_third=False)
    found = fit(declared_model(data.train[0]), data.train)
    assert grown(found.minimum, found.problem, ["coulomb_friction"]) == []
    np.testing.assert_allclose(found.values["g_c"], 30.0, rtol=2e-3)


def test_where_every_candidate_blows_up_on_the_first_swings_there_is_none(
    tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    declared = large_swing(tmp_path)
    monkeypatch.setattr(growing, "refit", lambda *args, **options: [])
    assert grown(declared.minimum, declared.problem, ["viscous_damping"]) == []
