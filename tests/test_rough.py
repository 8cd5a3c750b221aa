"""Rough cases: the truth against theory and another solver, the sizes of errors, the seal, and their scores."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from discovery_datasets import disturbances as plain
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.manoeuvres import rest, trapezoid
from discovery_datasets.one_coordinate import Laws, follow, integrate
from discovery_datasets.quick import readings
from discovery_datasets.quick_effects import PowerFriction, Taper
from scipy.integrate import quad, solve_ivp

from benchmarks.blind import by_system, generate, score
from benchmarks.blind.rough import body_effects, body_errors, sizes
from benchmarks.blind.rough.bodies import BODIES, draw_body
from benchmarks.blind.rough.cases import draw_subject
from benchmarks.blind.rough.ingredient import Action, Ingredient
from benchmarks.blind.rough.instruments import INSTRUMENT_ERRORS, instrument_error
from benchmarks.blind.rough.plan import kind_and_system
from benchmarks.blind.rough.waves import draw_waves


def moved(laws, duration, *, start=(1.0, 0.0), steps=20_000, push=None):
    """Times, and states from a start on without input."""
    time = np.linspace(0, duration, steps + 1)
    stages = time[:-1, None] + (time[1] - time[0]) * np.array([0.0, 0.5, 1.0])
    inputs = np.zeros((steps, 3, 3))
    inputs[..., 2] = 1.0
    inputs[..., 1] = 0.0 if push is None else push(stages)
    first = np.zeros(6)
    first[:2] = start
    return time, integrate(laws, first, time, inputs, 1)


# --- bodies against theory


def test_a_damped_swing_is_the_textbooks():
    time, state = moved(Laws(viscous=0.1, linear=4.0), 20.0)
    turning = np.sqrt(4.0 - 0.05**2)
    exact = np.exp(-0.05 * time) * (np.cos(turning * time) + 0.05 / turning * np.sin(turning * time))
    np.testing.assert_allclose(state[:, 0], exact, atol=1e-9)


def test_dry_friction_takes_the_same_from_each_half_swing():
    time, state = moved(Laws(linear=1.0, dry=0.02, dry_speed=1e-5), 5 * np.pi)
    turns = np.abs(np.interp(np.arange(6) * np.pi, time, state[:, 0]))
    np.testing.assert_allclose(-np.diff(turns), 0.04, rtol=2e-3)


def test_a_spring_across_the_motion_begins_with_the_third_power():
    for q in (0.01, 0.02):
        time = np.linspace(0, 1, 3)
        motion = np.zeros((2, 3, 3))
        motion[..., 0] = q
        inputs = np.zeros((2, 3, 3))
        force = follow(Laws(across=3.0, across_reach=2.0), time, motion, inputs, 1)
        np.testing.assert_allclose(force, 3.0 * q**3 / 2.0**2, rtol=1e-4)


def resistance(p, time, q, v, z, e):
    """All laws again, in other words: force against the motion, and the rates of what has memory."""
    total = p.viscous * v + p.linear * (1 + p.drift * -np.expm1(-time / p.drift_time)) * q + p.gravity * np.sin(q)
    stretched = np.hypot(q, p.across_reach)
    total += 2 * p.across * (stretched - p.across_reach) * q / stretched + p.quintic * q**5
    total += p.exponential * p.exponential_reach * (np.expm1(q / p.exponential_reach) - q / p.exponential_reach)
    total += p.kink * np.sign(q) * max(abs(q) - p.kink_at, 0) + p.stop * max(q - p.stop_at, 0)
    near = np.exp(-(((q - p.place) / p.place_width) ** 2) / 2)
    dry = p.dry + p.creep * np.exp(-abs(v) / p.creep_speed) + p.fading * p.fading_speed / (p.fading_speed + abs(v))
    total += (dry + p.place_friction * near) * np.arctan2(v, p.dry_speed) / (np.pi / 2)
    total += p.place_pull * near * (q - p.place) / p.place_width + p.asymmetry * abs(v)
    total += p.drag * v * np.hypot(v, p.drag_rest) + p.loss * v / (1 + (p.loss_reach / max(abs(q), 1e-12)) ** 2)
    total += p.power_loss * v * np.hypot(v, p.dry_speed) ** (p.power - 1)
    rate = v / p.slip_reach
    slip = rate * (1 - (abs(z) ** p.slip_knee if z * rate > 0 else 0))
    return total + p.slip_force * z + p.relaxing * e, slip, v - e / p.relaxing_time


EVERYTHING = Laws(
    viscous=0.03, linear=1.0, gravity=0.4, across=0.1, across_reach=2.0, exponential=0.1, exponential_reach=-3.0,
    quintic=0.02, drift=0.05, drift_time=30.0, dry=0.004, creep=0.003, creep_speed=0.2, dry_speed=0.05, drag=0.02,
    drag_rest=0.02, asymmetry=0.005, loss=0.05, loss_reach=1.5, slip_force=0.02, slip_reach=0.2, slip_knee=1.5,
    relaxing=0.05, relaxing_time=2.0, power_loss=0.01, power=1.5, fading=0.003, fading_speed=0.3, kink=0.03,
    kink_at=0.4, stop=0.05, stop_at=0.6, place=0.2, place_width=0.2, place_friction=0.01, place_pull=0.02,
    coupling=0.01, share=0.3, ground=0.3, ground_loss=0.02,
)  # fmt: skip


def test_all_laws_together_are_those_of_another_solver():
    p = EVERYTHING

    def slope(time, state):
        q, v, z, e, a, b = state
        total, slip, strain = resistance(p, time, q, v, z, e)
        pull = p.coupling * (a - q)
        return [
            v, 0.1 * np.sin(0.7 * time) - total + pull, slip, strain, b,
            -pull / p.share - p.ground * a - p.ground_loss * b,
        ]  # fmt: skip

    time, state = moved(p, 15.0, push=lambda t: 0.1 * np.sin(0.7 * t))
    other = solve_ivp(slope, (0, 15), [1.0, 0, 0, 0, 0, 0], t_eval=time[::1000], rtol=1e-10, atol=1e-11, max_step=0.02)
    np.testing.assert_allclose(state[::1000], other.y.T, atol=2e-6)


def test_a_given_motion_takes_the_force_of_its_laws():
    p = EVERYTHING._replace(coupling=0.0)
    waves = draw_waves(np.random.default_rng(0), 0.3, 1.2, 6, 3.0)
    time = np.linspace(0, 20, 40_001)
    stages = time[:-1, None] + (time[1] - time[0]) * np.array([0.0, 0.5, 1.0])
    inputs = np.zeros((*stages.shape, 3))
    inputs[..., 2] = 1.0
    force = follow(p, time, np.stack(waves.motion(stages), axis=-1), inputs, 4000)

    def memory(t, state):
        q, v, _ = (x[0] for x in waves.motion(np.array([t])))
        return resistance(p, t, q, v, *state)[1:]

    other = solve_ivp(memory, (0, 20), [0, 0], t_eval=time[::4000], rtol=1e-9, atol=1e-10, max_step=0.05)
    path = np.array(waves.motion(time[::4000])).T
    expected = [
        a + resistance(p, t, q, v, *m)[0] for t, (q, v, a), m in zip(time[::4000], path, other.y.T, strict=True)
    ]
    np.testing.assert_allclose(force, expected, atol=2e-6)


def test_waves_know_their_derivatives():
    waves = draw_waves(np.random.default_rng(1), 0.5, 2.0, 9, 4.0)
    time, small = np.linspace(0.0, 30.0, 400), 1e-4
    value, rate, second = waves.motion(time)
    ahead, behind = waves(time + small), waves(np.maximum(time - small, 0))
    np.testing.assert_allclose(rate[1:], (ahead - behind)[1:] / (2 * small), atol=1e-5)
    np.testing.assert_allclose(second[1:], (ahead - 2 * value + behind)[1:] / small**2, atol=1e-5)
    assert waves(np.zeros(1)) == 0


# --- errors of an arm


def test_a_tapered_rod_bends_as_beam_theory_says():
    # Under a small load at its tip: w = F int (l - x)^2 / EI(x) dx.
    heavy = replace(PAPER_RIG, beam_mass=1e-6 * PAPER_RIG.tip_mass)
    tilt, time = plain.TableTilt(y=1e-5), np.array([0.0, 0.01, 0.02])
    even, thin = (readings(heavy, rest(), time, disturbances=[tilt, *d]).tip.imag[0] for d in ([], [Taper(0.3)]))
    expected = quad(lambda s: 3 * (1 - s) ** 2 / (1 + 0.3 * (1 - 2 * s)), 0, 1)[0]
    assert thin / even == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("power", "known"),
    [(1.0, replace(PAPER_RIG, disc_friction=PAPER_RIG.disc_friction + 2e-3)), (2.0, plain.QuadraticDrag(2e-3))],
)
def test_friction_of_a_power_holds_the_laws_with_a_name(power, known):
    time, move, short = np.linspace(0, 2, 41), trapezoid(1.0, 1.2), {"modes": 3, "nodes": 8}
    found = readings(PAPER_RIG, move, time, disturbances=[PowerFriction(2e-3, power)], **short).tip
    rig, effects = (known, []) if power == 1 else (PAPER_RIG, [known])
    np.testing.assert_allclose(found, readings(rig, move, time, disturbances=effects, **short).tip, atol=2e-6)


# --- errors of instruments


@pytest.mark.parametrize("name", INSTRUMENT_ERRORS)
@pytest.mark.parametrize("columns", [1, 2])
def test_an_error_of_an_instrument_grows_with_its_strength_and_repeats(name, columns):
    time = np.arange(2000) / 50
    reading = np.column_stack([np.sin(2 * time), np.cos(2 * time)])[:, :columns]
    found = instrument_error(name, np.random.default_rng(2), size=1.0, noise=1e-3, frequency=2.0)
    away = []
    for strength in (0.0, 0.5, 1.0, 1.0):
        action = found.act(strength)
        seen = reading if action.optics is None else action.optics(time, reading)
        seen = seen if action.scatter is None else action.scatter(time, seen, np.random.default_rng(3))
        away.append(seen - reading)
    np.testing.assert_allclose(away[0], 0, atol=1e-12)
    np.testing.assert_array_equal(away[2], away[3])
    assert 1e-4 < away[2].std() < 1e-2
    assert away[1].std() == pytest.approx(0.5 * away[2].std(), rel=0.02)


def test_noise_with_memory_has_it():
    found = instrument_error("coloured_noise", np.random.default_rng(5), size=1.0, noise=1.0, frequency=2 * np.pi)
    noise = found.act(1.0).scatter(np.arange(200_000) / 50, np.zeros((200_000, 1)), np.random.default_rng(0))[:, 0]
    assert noise.std() == pytest.approx(1.0, rel=0.03)
    correlation = np.mean(noise[:-1] * noise[1:]) / noise.var()
    assert correlation == pytest.approx(np.exp(-0.02 / found.shape["memory_s"]), abs=0.01)


# --- draws and sizes


@pytest.mark.parametrize("system", BODIES)
def test_a_body_is_what_its_seed_says(system):
    body, again, other = (draw_body(system, s) for s in ((7, 1), (7, 1), (7, 2)))
    pd.testing.assert_frame_equal(body.frame("train", {}, noise=True), again.frame("train", {}, noise=True))
    assert not np.array_equal(body.readings("train", []).time, other.readings("train", []).time)
    silent = body.frame("holdout", {})
    scatter = body.frame("holdout", {}, noise=True) - silent
    assert scatter.iloc[:, -1].std() == pytest.approx(body.noise, rel=0.15)
    assert body.rig_file("x").count("[model]") == 1
    assert body.reach / body.noise < 1e6


@pytest.mark.slow
@pytest.mark.parametrize("system", BODIES)
def test_every_ingredient_of_a_body_acts_and_moves_nothing_at_strength_zero(system):
    body, rng = draw_body(system, (8, 1)), np.random.default_rng(0)
    bare = body.frame("train", {}).iloc[:, -1]
    for name in (*body.effects("single"), *body.effects("outside"), *body.errors()):
        found = (body.error if name in body.errors() else body.effect)(name, rng)
        none, some = (body.frame("train", {"it": found.act(s)}).iloc[:, -1] for s in (0.0, 1.0))
        np.testing.assert_allclose(none, bare, atol=1e-4 * body.noise, err_msg=name)
        assert np.abs(some - bare).max() > 0.02 * body.noise, name


def test_no_outsider_nor_error_is_in_the_catalogue_and_every_effect_is():
    from discovery.declarations.effect import OSCILLATOR
    from discovery.declarations.registry import catalogue

    known = catalogue()
    assert not {*body_effects.OUTSIDERS, *body_errors.LAWS, *INSTRUMENT_ERRORS, "taper"} & set(known)
    assert all(OSCILLATOR in known[name].systems for name in body_effects.EFFECTS)
    body, rng = draw_body("oscillator", (9, 9)), np.random.default_rng(0)
    for name in body.effects("single"):
        values = body.effect(name, rng).catalogue(1.0)
        assert values
        assert set(values) <= {p.name for p in known[body.effect(name, rng).accepted[0]].parameters()}


def test_shares_of_kinds_and_systems_are_kept_in_every_25():
    found = [kind_and_system(4, i) for i in range(50, 75)]
    assert sum(kind == "none" for kind, _ in found) == sum(kind == "outside" for kind, _ in found) == 3
    assert sum(system == "arm" for _, system in found) == 9
    assert found != [kind_and_system(4, i) for i in range(75, 100)]


class _Straight:
    """A subject whose sizes are sums of squares of strengths."""

    def errors(self):
        return ("power_friction", "kinked_spring", *INSTRUMENT_ERRORS)

    def error(self, name, rng):
        return Ingredient(name, lambda s: Action({"size": s}), 10.0)


def test_errors_together_are_between_half_a_noise_sd_and_three(monkeypatch):
    def left(self, actions):
        return float(np.sqrt(1e-4 + sum(a.laws["size"] ** 2 for a in actions.values())))

    monkeypatch.setattr(sizes.Sizer, "_left", left)
    subject = _Straight()
    joints = []
    for i in range(40):
        found = sizes.draw_errors(subject, sizes.Sizer(subject), np.random.default_rng(i))
        assert 2 <= len(found.ingredients) <= 4
        assert np.hypot.reduce(found.sizes) == pytest.approx(found.joint, rel=0.02)
        joints.append(found.joint)
    assert sizes.JOINT[0] <= min(joints) < 0.9
    assert 2.0 < max(joints) <= sizes.JOINT[1]


# --- a case from end to end


def _case(out, system, monkeypatch):
    monkeypatch.setattr("benchmarks.blind.rough.cases.kind_and_system", lambda seed, index: ("single", system))
    monkeypatch.setattr(generate, "limit_memory", lambda: None)
    (outcome,) = generate.generate(out, 12, range(1), 1, "rough")
    assert not outcome.error
    return json.loads((out / "truth" / f"{outcome.name}.json").read_text())


@pytest.mark.slow
def test_a_case_is_written_sealed_the_same_again_and_kept(tmp_path, monkeypatch):
    truth = _case(tmp_path / "one", "decay", monkeypatch)
    assert truth == _case(tmp_path / "two", "decay", monkeypatch)
    case = tmp_path / "one" / "cases" / truth["case"]
    assert {p.name for p in case.iterdir()} - {"train_2.csv"} == {"rig.toml", "train.csv", "holdout.csv"}
    for path in case.iterdir():
        assert path.read_bytes() == (tmp_path / "two" / "cases" / truth["case"] / path.name).read_bytes()
    (effect,) = truth["effects"]
    told = (case / "rig.toml").read_text()
    assert not any(word in told for word in (effect["id"], *(e["id"] for e in truth["model_errors"])))
    assert sizes.JOINT[0] <= truth["model_error_over_noise"] <= sizes.JOINT[1]
    assert 1.5 <= effect["unabsorbed_over_noise"] / truth["model_error_over_noise"] <= 20
    assert 0 < truth["truth_error_over_noise"] < effect["unabsorbed_over_noise"] + 5
    noisy = pd.read_csv(case / "holdout.csv").iloc[:, -1]
    clean = pd.read_csv(tmp_path / "one" / "truth" / f"{truth['case']}_holdout_clean.csv")["output"]
    assert 0.9 * truth["noise"] < (noisy - clean).std() < 5 * truth["noise"]
    # A finished case is not drawn again.
    monkeypatch.setattr("benchmarks.blind.rough.cases.draw_subject", None)
    assert generate.write_rough_case(tmp_path / "one", 12, 0) == truth


@pytest.mark.slow
def test_an_arm_of_the_rough_world_is_none_of_the_exact_one():
    from discovery_datasets.cases import draw_case

    arm = draw_subject("arm", (12, 0, 3))
    assert arm.draw.scene.rig != draw_case([12, 0]).scene.rig
    assert "taper" in arm.errors()
    assert not set(arm.effects("outside")) & set(arm.effects("single"))


# --- scores


def _result(folder, number, effects, verdict, named, after, **more):
    name = f"rough_001_{number:04d}"
    (folder / "truth").mkdir(exist_ok=True)
    results = folder / "results" / name
    results.mkdir(parents=True)
    error = {"id": "power_friction", "over_noise": 1.0, "resembles": ["quadratic_drag"]}
    truth = {
        "case": name, "world": "rough", "system": "decay", "kind": more.pop("kind", "single"), "noise": 1e-3,
        "effects": effects, "model_error_over_noise": 1.0, "model_errors": [error], "truth_error": 1e-3,
        "reach": {"train": 0.1, "holdout": 0.1}, "laws": {},
    }  # fmt: skip
    (folder / "truth" / f"{name}.json").write_text(json.dumps(truth))
    time = np.linspace(0, 1, 20)
    pd.DataFrame({"time_s": time, "output": time}).to_csv(folder / "truth" / f"{name}_holdout_clean.csv", index=False)
    wrong = {"before": 9e-3, "bare": 9e-3, "after": after}
    table = pd.DataFrame({"time_s": time, **{f"output_{when}": time + e for when, e in wrong.items()}})
    table.to_csv(results / "prediction.csv", index=False)
    parameters = {"f_c": {"value": 0.11, "sd": 0.01, "unit": "s^-2"}}
    model = {"after": {"model": {"base": "oscillator"}, "parameters": parameters}}
    loop = {"verdict": verdict, "effects": named, "model": model, **more}
    (results / "loop.json").write_text(json.dumps(loop))
    (results / "done.json").write_text(json.dumps({"seconds": 1.0}))


def test_rough_cases_are_scored_by_their_system(tmp_path, monkeypatch, capsys):
    dry = {
        "id": "coulomb_friction", "family": "friction", "accepted": ["coulomb_friction"], "catalogue": {"f_c": 0.1},
        "unabsorbed_over_noise": 9.0,
    }  # fmt: skip
    stop = {**dry, "id": "stop", "accepted": ["stop"], "catalogue": {}}
    rubs, drags = {"id": "coulomb_friction", "probability": 0.98}, {"id": "quadratic_drag", "ambiguous_with": []}
    group = {"id": "stribeck_friction", "ambiguous_with": ["coulomb_friction"], "group_probability": 0.9}
    _result(tmp_path, 0, [dry], "partly_explained", [rubs, drags], 1.5e-3, model_error={"rms": 1e-3})
    _result(tmp_path, 1, [dry], "explained", [group], 1e-3)
    _result(tmp_path, 2, [dry], "unexplained", [], 9e-3)
    _result(tmp_path, 3, [], "partly_explained", [{"id": "cubic_stiffness", "ambiguous_with": []}], 1.9e-3, kind="none")
    _result(tmp_path, 4, [stop], "explained", [rubs], 9e-3, kind="outside")
    monkeypatch.setattr("sys.argv", ["score", str(tmp_path)])
    score.main()
    found = json.loads((tmp_path / "scores.json").read_text())["by_system"]["rough"]["decay"]
    counts = {name: (p["k"], p["n"]) for name, p in found["shares"].items()}
    assert counts == {
        "named in the set or its group": (2, 3),
        "the same, plain effects": (2, 3),
        "named itself": (1, 3),
        "nothing invented": (2, 4),
        "nothing unlike a model error": (3, 4),
        "clean: nothing named": (0, 1),
        "outsiders never explained": (0, 1),
        "outsiders: nothing named": (0, 1),
        "hold-out not made worse": (5, 5),
        "hold-out as good as the truth's": (3, 4),
        "90 % intervals cover": (1, 1),
    }
    assert found["verdicts"]["single"] == {"explained": 1, "partly_explained": 1, "unexplained": 1}
    assert found["errors"]["after over before"]["median"] == pytest.approx(1.5 / 9)
    assert found["believed"]["mean probability"] == pytest.approx((0.98 + 0.9) / 2)
    said = capsys.readouterr().out
    assert "world rough" in said
    assert "partly_explained" in said
    assert by_system.misses(score.collect(tmp_path)[0])["case"].str[-1].tolist() == ["0", "2", "3", "4"]
