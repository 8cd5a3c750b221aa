from __future__ import annotations

import numpy as np
import pytest
from pendulum import swing
from scipy.integrate import solve_ivp

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.estimation.residual import variance_left
from discovery.recordings.dataset import load_dataset
from discovery.recordings.experiment import make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.screening import growing
from discovery.screening.growing import grown, grows


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


@pytest.mark.parametrize(("sweep", "astray"), [(0.6, True), (0.0, False)], ids=["resonance", "one frequency"])
def test_of_a_driven_system_only_a_fit_that_went_astray_grows(sweep: float, astray: bool) -> None:
    """A hardening spring bends the resonance, and a linear fit lies on another branch of it."""
    time = np.linspace(0.0, 20.0, 1601)
    start = 8.0 if astray else 14.0

    def force(t):
        return 2.0 * np.sin(start * t + sweep * t**2)

    def slopes(t, y):
        return [y[1], force(t) - 0.5 * y[1] - 150.0 * y[0] - 4e5 * y[0] ** 3]

    solved = solve_ivp(slopes, (0.0, 20.0), (0.0, 0.0), method="LSODA", t_eval=time, rtol=1e-9, atol=1e-11)
    noise = 2e-5
    read = (solved.y[0] + noise * np.random.default_rng(3).standard_normal(time.size))[:, None]
    rig = Rig("o", "oscillator", columns=Columns(TimeColumn(), InputColumn("u", "N", "spline"), OutputColumn("y", "m")))
    recording = Recording("r", time, force(time), read, ("output",), ("m",), np.array([noise]), sha256="", source="")
    experiment = make_experiment(recording, rig)
    linear = fit(Model("oscillator", ("viscous_damping", "linear_stiffness"), {"g": 1.0}), [experiment])
    effects = (*linear.model.effects, "cubic_stiffness")
    bench = Bench("oscillator", effects, [experiment], linear.problem.bench.step / 4)
    begun = {n: v for n, v in linear.values.items() if "[" not in n}
    whole = fit(linear.model, [experiment], start=begun, bench=bench)
    assert (variance_left(whole.problem, whole.chi2) > 0.2) == astray
    may_grow = grows(whole.minimum, whole.problem, first=False)
    found = grown(whole.minimum, whole.problem, ["cubic_stiffness"]) if may_grow else []
    assert may_grow == astray
    assert grows(whole.minimum, whole.problem, first=True) == astray
    assert [r.effect for r in found] == (["cubic_stiffness"] if astray else [])
    assert all(r.values["beta"] == pytest.approx(4e5, rel=1e-3) for r in found)
