"""The compiled twin against the reference one and theory; the cases of the blind benchmark; its scores."""

from __future__ import annotations

import json
import re
import subprocess
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from discovery_datasets import disturbances as plain
from discovery_datasets import outside, quick_effects
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.cases import draw_case
from discovery_datasets.engine import bouc_wen
from discovery_datasets.hidden import FAMILIES, draw_hidden
from discovery_datasets.manoeuvres import rest, sequence, trapezoid
from discovery_datasets.quick import readings
from discovery_datasets.twin import simulate
from scipy.optimize import brentq

from benchmarks.blind import base, generate, peers, run, score
from benchmarks.blind.truth import catalogue_values
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.recordings.dataset import load_dataset

TIME = np.linspace(0, 3, 61)
MOVE = sequence(trapezoid(1.0, 1.2), trapezoid(-0.4, 1.0, start=2.0))
SHORT = {"modes": 3, "nodes": 8}
DAMPED = replace(PAPER_RIG, retardation=1e-4)
STILL = replace(PAPER_RIG, disc_friction=0.0)
BEAM = PAPER_RIG.flexural_rigidity / PAPER_RIG.length


def reading(motion):
    return motion.reading_x + 1j * motion.reading_y


@pytest.fixture(scope="module")
def undisturbed():
    return readings(PAPER_RIG, MOVE, TIME, **SHORT)


KNOWN_TO_BOTH = [
    plain.CoulombFriction(4e-4),
    plain.QuadraticDrag(1e-3),
    plain.PeriodicDisturbance(1e-3, 2.0, 0.3, 1.1),
    plain.TableTilt(x=1e-3, y=-1e-3),
    plain.InitialCurvature(0.02),
    plain.StiffnessDrift(-5e-3),
    plain.StructuralDamping(2e-3),
    plain.ViscoelasticRelaxation(0.05, 0.5),
    plain.EncoderRipple(3e-3, 8.0),
    plain.SensorDelay(0.01),
    plain.CameraOriginOffset(x=2e-3),
    plain.PositionScale(3e-3),
]


@pytest.mark.slow
@pytest.mark.parametrize("effect", [plain.Disturbance(), *KNOWN_TO_BOTH], ids=lambda e: e.id or "none")
def test_the_compiled_engine_is_the_reference_twin(effect):
    quick = readings(DAMPED, MOVE, TIME, disturbances=[effect], refine=3.0, **SHORT)
    slow = simulate(DAMPED, MOVE, TIME, disturbances=[effect], rtol=1e-9, **SHORT)
    np.testing.assert_allclose(reading(quick), reading(slow), atol=3e-6)


def test_steps_and_modes_are_fine_enough_for_a_hundredth_of_a_millimetre():
    rig = replace(PAPER_RIG, retardation=1e-4)
    usual = readings(rig, trapezoid(1.4, 1.45), TIME)
    finer = readings(rig, trapezoid(1.4, 1.45), TIME, modes=7, nodes=16, refine=2.0)
    assert np.abs(usual.deflection).max() > 0.9
    np.testing.assert_allclose(usual.tip, finer.tip, atol=1e-5)


ONLY_QUICK = {
    "material_nonlinearity": (0.0, 0.02),
    "quadratic_stiffness": (0.0, 0.02),
    "amplitude_dependent_damping": (0.0, 0.02),
    "nonlinear_structural_damping": (0.0, 0.02),
    "tip_rotary_inertia": (0.0, 1e-3),
    "equilibrium_offset": (0.0, 3e-3),
    "input_gain": (0.0, 3e-3),
    "angle_offset": (0.0, 3e-3),
    "asymmetric_viscous_damping": (0.0, 1e-3),
}
SHAPED = [
    (quick_effects.Hysteresis(0.0, 0.5), quick_effects.Hysteresis(2e-3, 0.5)),
    (quick_effects.StribeckFriction(0.0, 0.0, 0.1), quick_effects.StribeckFriction(3e-4, 3e-4, 0.1)),
    (quick_effects.TimeBaseError(), quick_effects.TimeBaseError(drift=3e-3)),
    (outside.Magnet(0.9, 0.2, 0.2, 0.0), outside.Magnet(0.9, 0.2, 0.2, 3e-3)),
    (outside.RoughPlace(0.9, 0.2, 0.2, 0.0), outside.RoughPlace(0.9, 0.2, 0.2, 3e-3)),
    (outside.StickyPlace(0.9, 0.2, 0.03, 0.0), outside.StickyPlace(0.9, 0.2, 0.05, 1e-2)),
    (outside.Cable(0.0, 1.5, 0.5, 0.0), outside.Cable(0.0, 1.5, 0.5, 5e-3)),
    (outside.Bump(1.0, 0.04, 0.0, 1.0), outside.Bump(1.0, 0.04, 0.05, 1.0)),
    (outside.Gust(1.0, 0.5, 0.0, 1.0), outside.Gust(1.0, 0.5, 5e-3, 1.0)),
    (outside.DrippingMass(0.0, (1.0, 1.5)), outside.DrippingMass(2e-3, (1.0, 1.5))),
    (outside.PulsingAir(0.0, 1.0, (2.0,), (0.0,)), outside.PulsingAir(2e-3, 1.0, (2.0,), (0.0,))),
]
PAIRS = [
    (quick_effects.QUICK_EFFECTS[n](a), quick_effects.QUICK_EFFECTS[n](b)) for n, (a, b) in ONLY_QUICK.items()
] + SHAPED


@pytest.mark.parametrize(("none", "real"), PAIRS, ids=[b.id for _, b in PAIRS])
def test_an_effect_of_no_strength_changes_nothing_and_a_real_one_is_seen(none, real, undisturbed):
    without = readings(PAPER_RIG, MOVE, TIME, disturbances=[none], **SHORT)
    np.testing.assert_allclose(reading(without), reading(undisturbed), atol=1e-9)
    with_it = readings(PAPER_RIG, MOVE, TIME, disturbances=[real], **SHORT)
    assert np.abs(reading(with_it) - reading(undisturbed)).max() > 3e-4
    with pytest.raises(ValueError, match="compiled engine alone"):
        simulate(PAPER_RIG, MOVE, TIME, disturbances=[real], **SHORT)


# --- each effect against theory


def first_frequency(rig, *, clamp=np.inf, inertia=0.0):
    """Angular frequency of a beam on a torsion spring with a heavy tip, from the beam's own equation [rad/s]."""
    mass, turn = rig.tip_mass / rig.beam_mass, inertia / (rig.beam_mass * rig.length**2)
    give = 0.0 if np.isinf(clamp) else rig.flexural_rigidity / (rig.length * clamp)

    def determinant(k):
        c, s, ch, sh = np.cos(k), np.sin(k), np.cosh(k), np.sinh(k)
        # w = A (cos - cosh) + B sin + C sinh, root: w = 0, w' = give w''; tip: moment and shear of the disc.
        rows = [[2 * give * k, 1.0, 1.0]]
        bend = [-c - ch, -s, sh]
        slope = [-s - sh, c, ch]
        deflection = [c - ch, s, sh]
        shear = [s - sh, -c, ch]
        rows.append([b - turn * k**3 * t for b, t in zip(bend, slope, strict=True)])
        rows.append([v + mass * k * w for v, w in zip(shear, deflection, strict=True)])
        return np.linalg.det(np.array(rows))

    wave = brentq(determinant, 0.3, 1.7, xtol=1e-13)
    return wave**2 * np.sqrt(rig.flexural_rigidity / (rig.beam_mass * rig.length**3))


@pytest.mark.parametrize(
    ("effect", "known"),
    [
        (plain.Disturbance(), {}),
        (quick_effects.BaseCompliance(8 * BEAM), {"clamp": 8 * BEAM}),
        (quick_effects.TipRotaryInertia(2e-3), {"inertia": 2e-3}),
    ],
    ids=lambda v: getattr(v, "id", ""),
)
def test_small_swings_have_the_frequency_of_beam_theory(effect, known):
    # A slope of the table that ends is the gentlest of pushes: the arm then swings about its straight rest.
    push = outside.Gust(0.0, 2.0, 2e-4, np.pi / 2)
    time = np.linspace(0, 30, 3001)
    motion = readings(STILL, rest(), time, disturbances=[effect, push])
    free = motion.tip.imag[time > 2.0] / STILL.length
    later = time[time > 2.0]
    frequency = first_frequency(STILL, **known)
    design = np.column_stack([np.cos(frequency * later), np.sin(frequency * later)])
    left = free - design @ np.linalg.lstsq(design, free, rcond=None)[0]
    assert left.std() < 0.01 * free.std()


def test_a_compliant_clamp_turns_by_the_moment_over_its_stiffness():
    weight, stiffness = 2e-4 * 9.80665, 5 * BEAM
    tilt = plain.TableTilt(y=2e-4)
    stiff, soft = (
        readings(PAPER_RIG, rest(), TIME[:3], disturbances=e).tip[-1]
        for e in ([tilt], [tilt, quick_effects.BaseCompliance(stiffness)])
    )
    turn = weight * PAPER_RIG.length * (PAPER_RIG.tip_mass + PAPER_RIG.beam_mass / 2) / stiffness
    assert np.angle(soft) - np.angle(stiff) == pytest.approx(turn, rel=1e-3)


def test_play_lets_the_rod_lie_at_its_end():
    tilt = plain.TableTilt(y=2e-4)
    stiff = readings(PAPER_RIG, rest(), TIME[:3], disturbances=[tilt]).tip[-1]
    loose = quick_effects.BaseBacklash(0.01, 30 * BEAM, 1e-4)
    lying = readings(PAPER_RIG, rest(), TIME[:3], disturbances=[tilt, loose]).tip[-1]
    assert np.angle(lying) - np.angle(stiff) == pytest.approx(0.01, rel=0.01)


def test_a_material_law_bends_as_its_moment_says():
    # At small strain M = EI (kappa + b kappa^3): the energy gained by a cubic part softens the rod where b < 0.
    still, weight = rest(), plain.TableTilt(y=0.2)
    hard, soft = (
        readings(PAPER_RIG, still, TIME[:3], disturbances=[weight, quick_effects.MaterialNonlinearity(b)]).deflection[
            -1
        ]
        for b in (0.05, -0.05)
    )
    plain_one = readings(PAPER_RIG, still, TIME[:3], disturbances=[weight]).deflection[-1]
    assert hard < plain_one < soft


def test_an_offset_clamp_is_a_turned_camera(undisturbed):
    clamp, camera = (
        reading(readings(PAPER_RIG, MOVE, TIME, disturbances=[e], **SHORT))
        for e in (quick_effects.EquilibriumOffset(0.02), quick_effects.AngleOffset(0.02))
    )
    np.testing.assert_allclose(clamp, camera, atol=1e-9)
    np.testing.assert_allclose(camera, reading(undisturbed) * np.exp(0.02j), atol=1e-9)


def test_a_clock_reports_the_past():
    fine = readings(DAMPED, MOVE, np.linspace(0, 3, 3001), refine=3.0, **SHORT)
    clock = quick_effects.TimeBaseError(drift=0.01, wait=0.02, period=0.4)
    late = readings(DAMPED, MOVE, TIME, disturbances=[clock], refine=3.0, **SHORT)
    then = TIME - 0.01 * TIME - 0.02 * np.mod(TIME / 0.4, 1.0)
    expected = np.interp(then, fine.time, fine.tip.real) + 1j * np.interp(then, fine.time, fine.tip.imag)
    np.testing.assert_allclose(reading(late)[1:], expected[1:], atol=2e-6)


@pytest.mark.parametrize(
    "effect",
    [
        quick_effects.Hysteresis(5e-3, 0.3),
        quick_effects.BaseHysteresis(10 * BEAM, 2e-2, 0.01),
        quick_effects.AmplitudeDependentDamping(0.1),
        quick_effects.StribeckFriction(4e-3, 4e-3, 0.1),
    ],
    ids=lambda e: e.id,
)
def test_losses_calm_the_arm(effect):
    time = np.linspace(0, 12, 601)
    swings = [
        np.abs(readings(STILL, trapezoid(1.0, 1.2), time, disturbances=d, **SHORT).deflection[time > 9]).max()
        for d in ([], [effect])
    ]
    assert swings[1] < 0.9 * swings[0]


def test_hysteresis_is_bounded_and_sticks_at_a_turn():
    z, path = 0.0, np.concatenate([np.linspace(0, 5, 4001), np.linspace(5, -5, 8001)])
    seen = []
    for change in np.diff(path):
        z += bouc_wen(z, change)
        seen.append(z)
    assert max(seen) == pytest.approx(1.0, abs=1e-3)
    assert min(seen) == pytest.approx(-1.0, abs=1e-3)
    assert seen[4000] - seen[4001] == pytest.approx(10 / 8000, rel=0.01)


def test_two_effects_on_one_coefficient_are_refused():
    with pytest.raises(ValueError, match="two disturbances set"):
        readings(PAPER_RIG, MOVE, TIME, disturbances=[plain.CoulombFriction(1e-4), plain.CoulombFriction(2e-4)])


# --- cases


@pytest.fixture(scope="module")
def draws():
    return [draw_case([7, i]) for i in range(8)]


def test_cases_are_what_their_seed_says_and_stay_in_their_ranges(draws):
    again = draw_case([7, 3])
    assert again.scene.rig == draws[3].scene.rig
    assert [h.id for h in again.hidden] == [h.id for h in draws[3].hidden]
    np.testing.assert_array_equal(again.train[0](TIME)[0], draws[3].train[0](TIME)[0])
    for draw in draws:
        rig = draw.scene.rig
        assert 0.5 <= rig.length <= 1.5
        assert 0.03 <= rig.beam_mass / rig.tip_mass <= 0.35
        assert 0.28 <= draw.scene.deflection <= 1.16
        assert 1e-4 <= draw.noise <= 3e-3
        assert 8 <= draw.time[-1] <= 30
        assert len(draw.hidden) == {"none": 0, "single": 1, "outside": 1, "pair": 2}[draw.kind]
        assert draw.train[0].kinks != draw.holdout.kinks
        assert all((h.id in FAMILIES["outside"]) == (draw.kind == "outside") for h in draw.hidden)
    assert len({draw.kind for draw in draws}) >= 3


def test_no_trouble_outside_is_in_the_catalogue_and_every_effect_can_be_drawn(draws):
    from discovery.declarations.registry import catalogue

    assert not set(FAMILIES["outside"]) & set(catalogue())
    rng = np.random.default_rng(0)
    for names in FAMILIES.values():
        for name in names:
            hidden = draw_hidden(name, draws[0].scene, rng)
            assert hidden.make(0.5).id == name
            assert hidden.most >= 3


def test_a_case_is_written_sealed_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(generate, "size_over_noise", lambda draw, rig, effects, folder: 0.1 + 2.0 * len(effects))
    index = next(i for i in range(20) if draw_case([7, i]).kind == "single")
    truth = generate.write_case(tmp_path, 7, index)
    case = tmp_path / "cases" / truth["case"]
    assert {p.name for p in case.iterdir()} >= {"rig.toml", "train.csv", "holdout.csv"}
    name = truth["effects"][0]["id"]
    assert name not in (case / "rig.toml").read_text()
    noisy, clean = (
        pd.read_csv(case / "holdout.csv"),
        pd.read_csv(tmp_path / "truth" / f"{truth['case']}_holdout_clean.csv"),
    )
    assert (noisy - clean)["tip_x_m"].std() == pytest.approx(truth["noise"], rel=0.1)
    assert truth["effects"][0]["unabsorbed_over_noise"] == pytest.approx(np.sqrt(2.1**2 - 0.1**2))
    monkeypatch.setattr(generate, "draw_case", None)
    assert generate.write_case(tmp_path, 7, index) == truth


def test_a_case_that_cannot_be_written_is_replaced_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr(generate, "limit_memory", lambda: None)

    def write(out, seed, index):
        if index in {1, 4}:
            raise ArithmeticError("no such luck")
        return {"effects": []}

    monkeypatch.setattr(generate, "write_case", write)
    outcomes = list(generate.generate(tmp_path, 7, range(4), 1))
    assert [o.name for o in outcomes if not o.error] == [f"case_007_000{i}" for i in (0, 2, 3)]
    monkeypatch.setattr(generate, "write_case", lambda out, seed, index: write(out, seed, min(index, 3)))
    outcomes = list(generate.generate(tmp_path, 7, range(4), 1))
    assert [o.name for o in outcomes if not o.error] == [f"case_007_000{i}" for i in (0, 2, 3, 4)]
    said = generate.tally(outcomes, 4)
    assert "4 cases are written, 0 are missing; 1 could not be written" in said
    assert "case_007_0001: ArithmeticError: no such luck" in said
    assert "3 cases are written, 2 are missing" in generate.tally(outcomes[:4], 5)


def test_a_failed_case_is_a_result_and_is_tried_again(tmp_path, monkeypatch):
    (tmp_path / "cases" / "case_0").mkdir(parents=True)
    monkeypatch.setattr(run, "limit_memory", lambda: None)

    def fail(*_, **__):
        raise ArithmeticError("no such luck")

    monkeypatch.setattr(run, "close", fail)
    cases = [tmp_path / "cases" / "case_0"]
    ((name, done),) = run.run(tmp_path, cases, workers=1)
    assert name == "case_0"
    assert "no such luck" in done["error"]
    monkeypatch.setattr(run, "close", lambda *_, **__: {"seconds": 1.0, "verdict": "explained", "effects": []})
    ((_, done),) = run.run(tmp_path, cases, workers=1)
    assert "error" not in done
    assert list(run.run(tmp_path, cases, workers=1)) == []


# --- clean arms


def _arm(seed, index):
    return {"case": index, "rod_over_tip": 0.1, "deflection": 0.5, "deflection_holdout": 0.6, "rms_m": 1e-4 * seed}


@pytest.mark.slow
def test_the_bare_exact_arm_is_fitted_to_whole_recordings():
    folder = Path(__file__).parents[1] / "datasets" / "arm"
    data = load_dataset(folder / "rig.toml", [sorted(folder.glob("train*.csv"))[0]])
    assert data.train[0].fitted_samples is not None
    bare = run.exact_arm(fit(declared_model(data.train[0]), data.train), data)
    assert bare.model.base == "elastica_4"
    assert bare.problem.bench.n_data == np.isfinite(data.train[0].recording.output).sum()


def test_clean_arms_go_on_where_they_were_and_one_without_a_fit_is_missed(tmp_path, monkeypatch, capsys):
    tried = []

    def fit(seed, index):
        tried.append((seed, index))
        if index == 1:
            raise ArithmeticError("no such luck")
        if index == 2 and len(tried) == 3:
            raise KeyboardInterrupt
        return _arm(seed, index)

    monkeypatch.setattr(base, "limit_memory", lambda: None)
    monkeypatch.setattr(base, "error", fit)
    with pytest.raises(KeyboardInterrupt):
        base.study(tmp_path, 2, 4, 1)
    monkeypatch.setattr("sys.argv", ["base", str(tmp_path), "--cases", "4", "--seed", "2", "--workers", "1"])
    base.main()
    # What was done stays, what failed is tried again.
    assert tried == [(2, 0), (2, 1), (2, 2), (2, 1), (2, 2), (2, 3)]
    said = capsys.readouterr().out
    assert "missed: ArithmeticError: no such luck" in said
    assert "at most 0.3 mm: 3 of 4" in said
    found = json.loads((tmp_path / "base.json").read_text())
    assert (found["within the noise"]["k"], found["within the noise"]["n"], found["failed"]) == (3, 4, 1)
    # Arms of another seed are others.
    arms = base.study(tmp_path, 5, 1, 1)
    assert [arm["rms_m"] for arm in arms] == [5e-4]


def test_all_steps_of_the_benchmark_take_one_seed():
    root = Path(__file__).parents[1]
    plan = subprocess.run(["make", "-n", "blind", "SEED=71"], cwd=root, capture_output=True, text=True, check=True)
    steps = [line for line in plan.stdout.splitlines() if "blind.base" in line or "blind.generate" in line]
    assert len(steps) == 3
    assert all("--seed 71" in step for step in steps)


# --- peers


def test_every_effect_has_a_column_or_a_reason_why_not(draws):
    rng = np.random.default_rng(0)
    excused = {
        name for line in re.findall(r"^- ([a-z_, ]+):", peers.__doc__, re.MULTILINE) for name in line.split(", ")
    }
    inside = {name for family, names in FAMILIES.items() if family != "outside" for name in names}
    assert excused == {n for n in inside if not peers.nameable(draw_hidden(n, draws[0].scene, rng).accepted)}


def test_peers_name_a_strong_effect_that_has_a_column(tmp_path, monkeypatch):
    # A quarter of the thresholds of the benchmark.
    monkeypatch.setattr(peers, "TRIALS", 10)
    time = np.arange(0, 12, 0.01)
    gentle = sequence(trapezoid(0.8, 0.9), trapezoid(-0.4, 0.6, start=4.0))
    (tmp_path / "rig.toml").write_text(generate.rig_file("arm", DAMPED, 1e-4))
    motion = readings(DAMPED, gentle, time, disturbances=[quick_effects.QuadraticStiffness(0.05)])
    frame = generate.record(motion, rng=np.random.default_rng(0), position_noise=1e-4, angle_noise=1e-6)
    generate.write_csv(frame, tmp_path / "train.csv")
    target, known, candidates, names = peers.columns(tmp_path)
    assert candidates.shape == (target.size, len(names))
    assert known.shape == (target.size, 2)
    assert list(dict.fromkeys(names)) == list(peers.COLUMNS)
    assert np.isfinite(candidates).all()
    found = peers.peers(tmp_path)
    assert {peer: names[0] for peer, names in found.items()} == dict.fromkeys(
        ("pysindy", "lasso"), "quadratic_stiffness"
    )


# --- scores


def test_intervals_are_clopper_and_pearsons():
    p = score.proportion([True] * 8 + [False] * 2)
    assert (p["low"], p["high"]) == pytest.approx((0.4439, 0.9748), abs=1e-4)  # the usual table, 8 of 10
    assert score.proportion([])["share"] is None


def test_the_detection_limit_is_where_half_are_named():
    rng = np.random.default_rng(0)
    size = np.exp(rng.uniform(np.log(0.5), np.log(30), 400))
    named = rng.random(400) < 1 / (1 + (size / 3.0) ** -2.5)
    limit = score.detection_limit(size, named)
    assert limit["low"] < 3.0 < limit["high"]
    assert limit["high"] / limit["low"] < 1.7
    assert score.detection_limit(size, np.ones(400, bool))["half"] is None


def test_a_group_saves_a_name_and_an_extra_is_invented():
    truth = [{"accepted": ["sensor_delay"]}, {"accepted": ["angle_offset", "equilibrium_offset"]}]
    groups = {"encoder_ripple": {"encoder_ripple", "sensor_delay"}, "table_tilt": {"table_tilt"}}
    found = score.judge(["encoder_ripple", "table_tilt"], groups, truth)
    assert found == {"in_set": [True, False], "alone": [False, False], "first": False, "invented": ["table_tilt"]}
    found = score.judge(["equilibrium_offset"], {"equilibrium_offset": {"equilibrium_offset"}}, truth)
    assert found["in_set"] == [False, True]
    assert found["first"]


def _write_result(folder, truth, loop, error_mm, before=9):
    case = truth["case"]
    results = folder / "results" / case
    results.mkdir(parents=True)
    (folder / "truth").mkdir(exist_ok=True)
    (folder / "truth" / f"{case}.json").write_text(json.dumps(truth))
    clean = pd.DataFrame({"time_s": TIME, "tip_x_m": np.cos(TIME), "tip_y_m": np.sin(TIME)})
    clean.to_csv(folder / "truth" / f"{case}_holdout_clean.csv", index=False)
    shifted = {
        f"tip_{axis}_{when}_m": clean[f"tip_{axis}_m"] + (1e-3 * worse * error_mm if axis == "x" else 0)
        for axis in "xy"
        for when, worse in (("before", before), ("bare", 1), ("after", 1))
    }
    pd.DataFrame({"time_s": TIME, **shifted}).to_csv(results / "prediction.csv", index=False)
    (results / "loop.json").write_text(json.dumps(loop))
    (results / "done.json").write_text(json.dumps({"seconds": 1.0, "verdict": loop["verdict"], "effects": []}))


def test_a_size_is_in_the_bin_that_it_begins():
    assert score.binned(pd.Series([0.0, 0.99, 1.0, 4.0, 99.0])).tolist() == [
        "0 to 1", "0 to 1", "1 to 2", "4 to 8", "16 to inf",
    ]  # fmt: skip


def test_peers_are_scored_also_on_what_they_have_columns_for(tmp_path):
    named = {"sensor_delay": ["sensor_delay"], "angle_offset": ["table_tilt"], "hysteresis": ["coulomb_friction"]}
    same = {"angle_offset": ["angle_offset", "equilibrium_offset"]}
    for name, found in named.items():
        effect = {
            "id": name, "family": "rod", "accepted": same.get(name, [name]), "parameters": {},
            "unabsorbed_over_noise": 9.0,
        }  # fmt: skip
        truth = {
            "case": f"case_{name}", "kind": "single", "effects": [effect], "noise": 3e-4, "rig": {},
            "deflection": {"train": 0.8, "holdout": 0.7},
        }  # fmt: skip
        loop = {"verdict": "explained", "effects": [], "model": {"after": {"model": {"base": "elastica"}}}}
        _write_result(tmp_path, truth, loop, 0.1)
        (tmp_path / "results" / f"case_{name}" / "peers.json").write_text(json.dumps({"pysindy": found}))
    goals = score.headline(*score.collect(tmp_path))["0.3 mm"]
    counts = {name: (p["k"], p["n"]) for name, p in goals.items() if name.startswith("pysindy")}
    assert counts == {
        "pysindy: single effect in the set": (1, 3),
        "pysindy: in the set, of those with a column": (1, 2),
        "pysindy: single effect first": (1, 3),
        "pysindy: first, of those with a column": (1, 2),
        "pysindy: nothing invented": (1, 3),
    }


def test_scores_are_those_of_a_small_table(tmp_path, monkeypatch, capsys):
    rig = asdict(PAPER_RIG)
    delay = {
        "id": "sensor_delay", "family": "instrument", "accepted": ["sensor_delay"], "parameters": {"delay": 0.01},
        "unabsorbed_over_noise": 9.0,
    }  # fmt: skip
    magnet = {
        "id": "magnet",
        "family": "outside",
        "accepted": ["magnet"],
        "parameters": {},
        "unabsorbed_over_noise": 9.0,
    }

    def effect(name, **values):
        parameters = {n: {"value": v, "sd": 0.001, "unit": "s"} for n, v in values.items()}
        return {"id": name, "parameters": parameters, "ambiguous_with": []}

    plans = [
        ("single", [delay], "explained", [effect("elastica_geometry"), effect("sensor_delay", tau=0.011)], 0.2),
        ("single", [delay], "explained", [effect("encoder_ripple")], 0.5),
        ("none", [], "nothing_missing", [effect("elastica_geometry")], 0.1),
        ("outside", [magnet], "unexplained", [], 5.0),
    ]
    for i, (kind, effects, verdict, found, error) in enumerate(plans):
        truth = {
            "case": f"case_{i}", "kind": kind, "effects": effects, "noise": 3e-4, "rig": rig,
            "deflection": {"train": 0.8, "holdout": 0.7},
        }  # fmt: skip
        estimates = {n: p for e in found for n, p in e["parameters"].items()}
        after = {"model": {"base": "elastica"}, "parameters": estimates}
        loop = {"verdict": verdict, "effects": found, "model": {"after": after}}
        _write_result(tmp_path, truth, loop, error, before=np.nan if i == 1 else 9)
    table, intervals = score.collect(tmp_path)
    goals = score.headline(table, intervals)["0.3 mm"]
    counts = {name: (p["k"], p["n"]) for name, p in goals.items()}
    assert counts["single effect in the set or its group"] == (1, 2)
    assert counts["nothing invented, all but outside"] == (2, 3)
    assert counts["nothing invented, clean"] == (1, 1)
    assert counts["outside flagged unexplained"] == (1, 1)
    assert counts["outside not made worse"] == (1, 1)
    assert counts["explained: hold-out within the noise"] == (2, 3)
    assert counts["explained: hold-out within twice the noise"] == (3, 3)
    assert intervals["z"].tolist() == pytest.approx([1.0])
    assert score.missed(table)["case"].tolist() == ["case_1"]
    monkeypatch.setattr("sys.argv", ["score", str(tmp_path)])
    score.main()
    said = capsys.readouterr().out
    assert "1 of    2" in said
    assert "1/2 (1 to 99)" in said
    found = json.loads((tmp_path / "scores.json").read_text(), parse_constant=pytest.fail)
    assert list(found["by_size"]) == ["clean", "8 to 16"]
    plain_to_see = found["by_size"]["8 to 16"]
    assert {name: (p["k"], p["n"]) for name, p in plain_to_see["shares"].items()} == {
        "named first": (1, 2),
        "in the set or its group": (1, 2),
        "nothing invented": (1, 2),
        "90 % intervals cover": (1, 1),
        "hold-out within the noise": (1, 2),
        "within twice the noise": (2, 2),
    }
    errors = plain_to_see["hold-out over noise"]
    assert (errors["after"]["low"], errors["after"]["high"]) == pytest.approx((0.2 / 0.3, 0.5 / 0.3))
    # The declared model blew up in one of the two.
    assert errors["before"]["median"] == pytest.approx(9 * 0.2 / 0.3)
    assert errors["before"]["high"] == "Infinity"
    assert {"kind": "outside", "size": "8 to 16", "explained": 0, "unexplained": 1, "nothing_missing": 0} in found[
        "verdicts"
    ]
    assert {p.name for p in tmp_path.glob("*.svg")} == {
        "named_by_size.svg",
        "holdout_by_size.svg",
        "shares_by_size.svg",
        "holdout.svg",
        "confusion.svg",
        "coverage.svg",
    }


# --- the mapping from the twin's parameters to the catalogue's

MAPPED = [
    plain.CoulombFriction(6e-4),
    plain.QuadraticDrag(2e-3),
    plain.PeriodicDisturbance(1e-3, 2.0, 0.3, 1.1),
    plain.TableTilt(x=1e-3, y=-1e-3),
    plain.InitialCurvature(0.02),
    plain.StiffnessDrift(-5e-4),
    plain.StructuralDamping(2e-3),
    plain.ViscoelasticRelaxation(0.05, 0.5),
    plain.EncoderRipple(3e-3, 8.0, 0.4),
    plain.SensorDelay(0.01),
    plain.CameraOriginOffset(x=2e-3),
    plain.PositionScale(3e-3),
    quick_effects.MaterialNonlinearity(0.01),
    quick_effects.TipRotaryInertia(2e-4),
    quick_effects.BaseCompliance(30 * BEAM),
    quick_effects.AsymmetricViscousDamping(4e-4),
    quick_effects.StribeckFriction(4e-4, 4e-4, 0.1),
    quick_effects.InputGain(3e-3),
    quick_effects.AngleOffset(3e-3),
    quick_effects.TimeBaseError(drift=1e-3),
]


@pytest.mark.parametrize("effect", MAPPED, ids=lambda e: e.id)
def test_mapped_parameters_are_those_of_the_catalogue(effect):
    from discovery.declarations.registry import get_effect

    values = catalogue_values(effect.id, asdict(effect), asdict(PAPER_RIG))
    assert values
    assert set(values) <= {p.name for p in get_effect(effect.id).parameters()}


@pytest.mark.slow
@pytest.mark.parametrize("effect", MAPPED, ids=lambda e: e.id)
def test_mapped_parameters_give_the_same_motion(effect, tmp_path):
    from discovery.equations.model import Model
    from discovery.estimation.bench import Bench
    from discovery.estimation.fit import fit
    from discovery.estimation.problem import known_values
    from discovery.recordings.dataset import load_dataset

    rig = replace(PAPER_RIG, retardation=1e-4)
    gentle = sequence(trapezoid(0.8, 0.9), trapezoid(-0.4, 0.6, start=4.0))
    time = np.arange(801) / 100.0
    (tmp_path / "rig.toml").write_text(generate.rig_file("arm", rig, 3e-4))
    with_it = readings(rig, gentle, time, disturbances=[effect])
    bare = readings(rig, gentle, time)
    frame = generate.record(with_it, rng=np.random.default_rng(0), position_noise=0.0, angle_noise=0.0)
    frame.to_csv(tmp_path / "train.csv", index=False, float_format="%.9f")
    (e,) = load_dataset(tmp_path / "rig.toml", [tmp_path / "train.csv"], keep_third=False).train
    values = catalogue_values(effect.id, asdict(effect), asdict(rig))
    mass = rig.effective_mass
    known = {
        **known_values(e),
        "tau_r": rig.retardation,
        "alpha": 3 * rig.flexural_rigidity / (mass * rig.length**3),
        "xi": rig.disc_friction / mass,
        **values,
    }
    model = Model("elastica", ("viscous_damping", "linear_stiffness", effect.id), known)
    bench = Bench("elastica", model.effects, [e], 0.002)
    # Only the initial state, and what the truth does not fix, is left to fit.
    left = np.hypot(*(fit(model, [e], bench=bench).predict()[0] - e.recording.output).T)
    size = np.abs(reading(with_it) - reading(bare))
    assert size.mean() > 1e-4
    assert left.mean() < max(5e-5, 0.02 * size.mean())


def test_a_second_mode_is_mechanics_of_an_arm_and_an_effect_of_another_body() -> None:
    loop = {"effects": [{"id": "second_mode"}, {"id": "quadratic_drag"}]}
    named = {system: [e["id"] for e in score.beside_mechanics(loop, {"system": system})] for system in ("arm", "bench")}
    assert named == {"arm": ["quadratic_drag"], "bench": ["second_mode", "quadratic_drag"]}
    assert score.beside_mechanics(loop, {}) == score.beside_mechanics(loop, {"system": "arm"})
