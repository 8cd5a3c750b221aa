from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.manoeuvres import sequence, trapezoid
from discovery_datasets.outside import Bump, Cable, Gust, Magnet, PulsingAir
from discovery_datasets.quick import Readings, readings
from scipy.integrate import solve_ivp
from synthetic_run import write_arm_run

from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.symbols import omega
from discovery.diagnosis.force_dependence import Sites, dependences, depends_on
from discovery.diagnosis.latent_force import close, reconstruct
from discovery.diagnosis.missing_force import LEAST_GAIN, MARGIN, MissingForce, missing_force, sparse_law, spline_law
from discovery.diagnosis.multiple_shooting import Chain
from discovery.diagnosis.slow_model import Law
from discovery.equations.model import Model
from discovery.estimation.declared import declared_model, rig_uncertainty
from discovery.estimation.fit import Fit, fit
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording
from discovery.report import figures
from discovery.report.page import build_report
from discovery.results import curves
from discovery.results.provenance import write_json
from discovery.rigs.rig import Rig
from discovery.rigs.rig_file import read_rig

RIG = replace(PAPER_RIG, retardation=1e-4)
FILE = read_rig(Path(__file__).parents[1] / "datasets" / "arm" / "rig.toml")
NOISE = 3e-4
#: Elastic force at the tip at 0.8 rad [N].
FORCE = 3 * RIG.flexural_rigidity * 0.8
TWICE = sequence(trapezoid(0.9, 1.1), trapezoid(-0.6, 0.9, start=7.0))
MOVES = {
    "once": trapezoid(1.0, 1.4),
    "twice": TWICE,
    "other": sequence(trapezoid(0.8, 1.2), trapezoid(-0.4, 0.9, start=9.0)),
}


class SteadyAir(PulsingAir):
    """Jets that push, but leave the friction alone: the force is known in time."""

    def friction_factor(self, time):
        return np.ones(time.shape)


AIR = SteadyAir(0.01 * FORCE, 0.7, (0.6, 1.1, 2.0, 2.9, 4.2), (0.1, 1.0, 2.0, 3.0, 4.0))
GUST = Gust(6.0, 0.5, 0.05 * FORCE, 1.2)
PLACE = 0.97 * np.exp(0.4j)
MAGNET = Magnet(PLACE.real, PLACE.imag, 0.15, 0.03 * FORCE)


def arm(name: str, *disturbances: Disturbance, seed: int = 1, rig: Rig = FILE) -> tuple[Experiment, Readings]:
    time = np.arange(1601) / 100
    seen = readings(RIG, MOVES[name], time, disturbances=disturbances)
    rng = np.random.default_rng(seed)
    tip = np.stack([seen.reading_x, seen.reading_y], axis=1) + NOISE * rng.standard_normal((time.size, 2))
    angle = seen.motor_angle + rng.uniform(-7e-5, 7e-5, time.size)
    recording = Recording(name, time, angle, tip, ("tip_x", "tip_y"), ("m", "m"), np.full(2, NOISE), "", "")
    return make_experiment(recording, rig), seen


def fitted(experiment: Experiment, base: str = "elastica") -> Fit:
    known = rig_uncertainty(experiment) if base == "elastica" else {}
    return fit(declared_model(experiment).on_base(base), [experiment], gaussian=known, tolerance=2e-5)


@cache
def clean() -> Fit:
    return fitted(arm("once")[0])


def with_true_parameters(experiment: Experiment) -> Fit:
    """Fit the initial state alone, with the parameters of the undisturbed arm."""
    values = {n: v for n, v in clean().values.items() if "[" not in n}
    model = clean().model
    return fit(Model(model.base, model.effects, {**model.known, **values}), [experiment], tolerance=2e-5)


def turning(seen: Readings, push: np.ndarray) -> np.ndarray:
    """Return the generalised force per unit inertia of a push on the disc: across the arm, and along it as it bends."""
    along = push * np.exp(-1j * np.angle(seen.tip))
    radius = np.abs(seen.tip) / RIG.length
    return (radius * along.imag - seen.deflection / 5 * along.real) / (RIG.effective_mass * RIG.length)


@cache
def missing(kind: str) -> MissingForce:
    hidden = {"magnet": MAGNET, "cable": Cable(0.0, 1.5, 0.3, 0.1 * FORCE), "bump": Bump(6.0, 0.04, 0.5 * FORCE, -0.7)}
    return missing_force(fitted(arm("twice", hidden[kind])[0]), [arm("other", hidden[kind], seed=2)[0]])


# Reconstruction.


def test_a_push_known_in_time_is_recovered_within_its_band() -> None:
    inside, scores = [], []
    for push, seed in ((AIR, 1), (GUST, 2)):
        experiment, seen = arm("once", push, seed=seed)
        force = reconstruct(with_true_parameters(experiment))
        true = np.interp(force.time, seen.time, turning(seen, push.push(seen.time)))
        inside.append(np.abs(force.mean - true) < 1.645 * force.sd)
        scores.append(np.corrcoef(force.mean, true)[0, 1])
        assert force.rms[0] > 5
        assert force.rms[1] < 1.5
    assert 0.8 <= np.mean(inside) <= 0.97
    assert min(scores) > 0.95


def test_a_clean_recording_needs_no_force() -> None:
    force = reconstruct(clean())
    assert np.mean(np.abs(force.mean) < 1.645 * force.sd) > 0.85
    assert np.sqrt(np.mean(force.mean**2)) < 1e-3
    found = missing_force(clean())
    assert force.gain < LEAST_GAIN
    assert found.dependence == found.depends == found.patches == ()
    assert found.summary()["result"] == "no patch"


def oscillator(push, time: np.ndarray, seed: int = 0) -> Fit:
    """Return the fit of the initial state of q'' + 0.1 q' + 9 q + 2 q^3 = push(t), all else known."""
    path = solve_ivp(
        lambda t, z: [z[1], push(t) - 0.1 * z[1] - 9 * z[0] - 2 * z[0] ** 3],
        (time[0], time[-1]), [1.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-12, max_step=0.05,
    )  # fmt: skip
    noisy = path.y[0] + 1e-3 * np.random.default_rng(seed).standard_normal(time.size)
    recording = Recording("swing", time, None, noisy[:, None], ("output",), ("m",), np.array([1e-3]), "", "")
    rig = replace(FILE, kind="oscillator", declared=("viscous_damping", "linear_stiffness", "cubic_stiffness"))
    experiment = make_experiment(recording, rig)
    model = Model("oscillator", rig.declared, {"g": 0.0, "xi": 0.1, "alpha": 9.0, "beta": 2.0})
    return fit(model, [experiment])


def test_the_force_on_an_oscillator_with_gaps_and_irregular_times_is_recovered() -> None:
    def push(t):
        return 0.3 * np.sin(0.7 * t) + 0.2 * np.cos(2.1 * t + 1)

    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(0, 20, 1200))
    result = oscillator(push, time[np.concatenate([[True], np.diff(time) > 1e-3])])
    experiment = result.problem.bench.experiments[0]
    experiment.recording.output[400:430] = np.nan
    force = reconstruct(result)
    true = push(force.time)
    assert 0.8 <= np.mean(np.abs(force.mean - true) < 1.645 * force.sd) <= 0.99
    assert np.sqrt(np.mean((force.mean - true) ** 2)) < 0.1 * np.sqrt(np.mean(true**2))
    blind = (force.time > experiment.recording.time[400]) & (force.time < experiment.recording.time[430])
    assert force.sd[blind].max() > 1.15 * np.median(force.sd)


def test_the_imitated_force_of_a_stiffness_is_that_of_its_spring() -> None:
    force = reconstruct(clean())
    spring, imitated = -force.variables["deflection"], force.equivalent["alpha"]
    assert imitated @ spring / (spring @ spring) == pytest.approx(1.0, abs=0.15) or force.gain < LEAST_GAIN
    experiment, _ = arm("once", AIR)
    force = reconstruct(with_true_parameters(experiment))
    assert force.equivalent == {}


def test_the_missing_force_is_in_no_catalogue() -> None:
    assert "external_force" not in catalogue()
    assert get_effect("external_force").power() == get_effect("external_force").external_force * omega


# The chain.


@pytest.mark.parametrize(("base", "tolerance"), [("constant_radius", 1e-4), ("elastica", 0.2)])
def test_a_chain_follows_another_initial_state_as_the_kernel_does(base: str, tolerance: float) -> None:
    result = clean() if base == "elastica" else fitted(arm("once")[0], base)
    (experiment,) = result.problem.bench.experiments
    values, start = {n: v for n, v in result.values.items() if "[" not in n}, result.minimum.x[-2:]
    moved = start + np.array([0.0, 0.1])
    wanted = result.predict([experiment], moved[None])[0]
    shown = replace(experiment, recording=replace(experiment.recording, output=wanted))
    chain = Chain(result.problem, values, shown, start)
    np.testing.assert_allclose(chain.reading, result.predict()[0], atol=1e-12)
    change = np.sqrt(np.mean((wanted - chain.reading) ** 2))
    assert np.sqrt(np.mean((close(chain, None) - wanted) ** 2)) < tolerance * change


def test_a_run_under_a_law_is_that_of_the_model_which_has_it() -> None:
    result = fitted(arm("once")[0], "constant_radius")
    (experiment,) = result.problem.bench.experiments
    values, start = {n: v for n, v in result.values.items() if "[" not in n}, result.minimum.x[-2:]
    shown = replace(experiment, recording=replace(experiment.recording, output=result.predict()[0]))
    law = Law(("deflection",), lambda v: -values["beta"] * v["deflection"] ** 3)
    chain = Chain(result.problem, {**values, "beta": 0.0}, shown, start)
    without = np.abs(chain.reading - result.predict()[0]).max()
    assert without > 0.02
    assert np.abs(close(chain, law) - result.predict()[0]).max() < 1e-4 * without


# What it depends on.


def made_up(force) -> Sites:
    """Return sites of a swing that decays, with a force of its angle, rate and time."""
    time = np.arange(0, 40, 0.2)
    angle, motor = np.exp(-0.03 * time) * np.sin(2.9 * time), 0.5 * (time > 17)
    rate = np.gradient(angle, time)
    variables = {
        "time": time, "angle": angle + motor, "deflection": angle, "rate": rate, "motor_angle": motor,
        "x": np.cos(angle + motor), "y": np.sin(angle + motor),
    }  # fmt: skip
    imitated = np.column_stack([np.ones_like(time), angle, rate])
    return Sites(force(variables), variables, imitated, np.ones(3), (time / 2.17).astype(np.int64), (time.size,))


@pytest.mark.parametrize("name", ["angle", "deflection", "rate"])
def test_the_variable_behind_a_force_is_found(name: str) -> None:
    rng = np.random.default_rng(3)
    noise = 0.05 * rng.standard_normal(200)
    found = depends_on(dependences(made_up(lambda v: np.sin(5 * v[name]) * np.exp(-v[name]) + noise)))
    assert [d.variables for d in found] == [(name,)]
    assert found[0].p_value <= 0.02


def test_noise_and_what_parameters_imitate_depend_on_nothing() -> None:
    rng = np.random.default_rng(4)
    noise = rng.standard_normal(200)
    assert depends_on(dependences(made_up(lambda v: noise))) == ()
    assert depends_on(dependences(made_up(lambda v: 3 * v["deflection"] - v["rate"] + 0.1 * noise))) == ()


def test_a_sparse_law_finds_its_terms_beside_what_parameters_imitate() -> None:
    noise = 0.01 * np.random.default_rng(6).standard_normal(200)
    sites = made_up(lambda v: 2.0 * v["angle"] ** 3 + 0.5 * v["deflection"] + noise)
    (best,) = [d for d in dependences(sites) if d.variables == ("angle",)]
    law = sparse_law(sites, best, ("alpha", "xi"))
    assert law.formula.endswith("angle^3")
    assert law.changes["alpha"] == pytest.approx(0.5, abs=0.05)
    grid = {"angle": np.linspace(-0.6, 1.0, 9)}
    wanted = 2 * grid["angle"] ** 3
    for other in (law, spline_law(sites, best, ("alpha", "xi"))):
        found = other.law.force(grid) - other.law.force({"angle": np.zeros(1)})
        np.testing.assert_allclose(found, wanted, atol=0.12)
    beyond = law.law.force({"angle": np.array([5.0, 50.0])})
    assert beyond[0] == beyond[1]


# The twin's troubles that no catalogue describes.


def test_a_magnet_is_found_to_depend_on_where_the_tip_is() -> None:
    found = missing("magnet")
    shares = {d.variables: d.share for d in found.dependence}
    assert ("angle",) in [d.variables for d in found.depends]
    others = (("deflection",), ("rate",), ("motor_angle",), ("time",))
    assert min(shares[("angle",)], shares[("x", "y")]) > 0.75
    assert max(shares[v] for v in others) < 0.5
    # The force turns back beyond the place: it is attracted from both sides.
    force, angle = found.forces[0].mean, found.forces[0].variables["angle"]
    before, beyond = (angle > 0.2) & (angle < 0.35), (angle > 0.45) & (angle < 0.6)
    assert np.median(force[before]) > 0.03
    assert np.median(force[beyond]) < -0.03


def test_a_law_of_the_magnet_predicts_the_recording_held_out() -> None:
    patch = missing("magnet").patch
    assert patch is not None
    assert patch.variables == ("angle",)
    assert patch.after < 0.5 * patch.before
    assert patch.accepted == (patch.after <= (1 - MARGIN) * patch.before)


@pytest.mark.slow
def test_a_cable_is_found_to_depend_on_angle_or_hub() -> None:
    sets = [d.variables for d in missing("cable").depends]
    assert any({"angle", "motor_angle"} & set(v) or v == ("x", "y") for v in sets)


def test_a_bump_depends_on_nothing_and_gets_no_patch() -> None:
    found = missing("bump")
    force = found.forces[0]
    assert force.gain > LEAST_GAIN
    assert abs(force.time[np.argmax(np.abs(force.mean))] - 6.0) < 0.3
    assert found.depends == ()
    assert found.patch is None


def test_nothing_is_called_explained() -> None:
    text = json.dumps(missing("magnet").summary())
    assert '"result": "patch"' in text
    assert "explain" not in text


def test_without_a_hold_out_the_rest_of_the_recording_judges() -> None:
    experiment = arm("twice", MAGNET)[0]
    part = missing_force(fitted(replace(experiment, fitted_samples=1066)))
    assert part.forces[0].time[-1] == pytest.approx(10.65, abs=0.02)
    assert all(p.before is not None for p in part.patches)
    whole = missing_force(fitted(experiment))
    assert all(p.before is None and not p.accepted for p in whole.patches)
    assert {p.reason for p in whole.patches} == {"nothing was held out to try it on"}


@pytest.mark.usefixtures("sketched")
def test_the_page_tells_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = {name: functions if name == "unexplained" else () for name, functions in figures.SECTIONS.items()}
    monkeypatch.setattr(figures, "SECTIONS", drawn)
    content = write_arm_run(tmp_path)
    found = missing("magnet")
    write_json(tmp_path / "results.json", {**content, "missing_force": found.summary()})
    curves.save_groups(tmp_path / "force.nc", curves.forces(found.forces))
    html = build_report(tmp_path).read_text(encoding="utf-8")
    section = html[html.index('<section id="unexplained">') : html.index('<section id="predictions">')]
    assert "A patch, not an explanation" in section
    for name in ("missing_force", "missing_force_states", "missing_force_map"):
        assert f'id="figure-{name}"' in section
    assert (tmp_path / "tables" / "force_dependence.csv").read_text().count("\n") == len(found.dependence) + 1
