"""What speaks against an answer: values at the edge of their range, a hold-out that is missed."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import driven_oscillator as bench
import numpy as np
import pandas as pd
import pytest
from pushed_oscillator import DECLARED, TRUTH, UNITS, experiment, pushes, recorded

from discovery.declarations.registry import get_effect
from discovery.diagnosis import edges
from discovery.diagnosis.caution import Caution, acausal, missed, motionless, stopped, unfinished
from discovery.diagnosis.edges import (
    at_edges,
    combined,
    gain_untold,
    held_sign,
    stated_edges,
    strayed_constant,
    untold,
)
from discovery.diagnosis.undetermined import hung_on
from discovery.equations.model import Model
from discovery.estimation.declared import first_fit
from discovery.estimation.fit import Fit, fit
from discovery.estimation.holdout import SEPARATE
from discovery.estimation.log_evidence import Evidence
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem
from discovery.recordings.dataset import load_dataset
from discovery.report.contradiction_sentences import contradiction_sentences
from discovery.report.doubt_sentences import caution_sentence
from discovery.report.sentences import decision_sentence
from discovery.runs.loop import close_loop
from discovery.screening.refits import Refit
from discovery.selection.contender import Contender
from discovery.selection.decision import Decision


@pytest.fixture(scope="module")
def scaled() -> Fit:
    """An oscillator, declared, and a scale of its instrument, added."""
    noise = bench.NOISE * np.random.default_rng(1).standard_normal(bench.TIME.size)
    return fit(Model("oscillator", (*bench.EFFECTS, "position_scale"), {"g": bench.GAIN}), [bench.experiment(noise)])


def moved(fitted: Fit, name: str, share: float) -> list[Caution]:
    """Return the cautions where a parameter lies so far between its bounds."""
    x, k = fitted.minimum.x.copy(), fitted.problem.names.index(name)
    low, high = (bound[k] for bound in fitted.problem.bounds)
    x[k] = low + share * (high - low)
    return at_edges(replace(fitted, minimum=replace(fitted.minimum, x=x)), ("position_scale",))


def test_readings_that_do_not_move_tell_nothing(tmp_path: Path) -> None:
    """A speed that a motor holds, read to its noise: no law is missing, and none could show."""
    rng, time = np.random.default_rng(4), np.arange(0.0, 20.0, 0.05)
    rest = pd.DataFrame({"t": time, "x": rng.normal(0.0, 0.01, time.size)})
    swing = rest.assign(x=rest.x + np.exp(-0.1 * time) * np.cos(3.0 * time))
    rig = 'name = "r"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
    (tmp_path / "rig.toml").write_text(rig + 'output = { name = "x", unit = "m", noise = 0.01 }\n', encoding="utf-8")
    found = []
    for name, frame in (("rest", rest), ("swing", swing)):
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
        (part,) = load_dataset(tmp_path / "rig.toml", [tmp_path / f"{name}.csv"], keep_third=False).train
        found.append(motionless([part.recording]))
    assert found[0] is not None
    assert found[0].numbers["times"] < 3.0
    assert "no law from none" in caution_sentence(found[0].summary())
    assert found[1] is None


def test_a_value_at_an_edge_that_is_no_zero_is_doubted(scaled: Fit) -> None:
    assert at_edges(scaled, ("position_scale",)) == []
    # Without damping an oscillator is an oscillator.
    assert moved(scaled, "xi", 0.0) == []
    (declared,) = moved(scaled, "xi", 1.0)
    assert (declared.code, declared.about, declared.effect) == ("declared_edge", "xi", "")
    assert declared.numbers["unit"] == "s^-1"
    assert "xi = " in caution_sentence(declared.summary())
    assert "s^-1 of the declared model ends at its bound, which follows from the" in caution_sentence(
        declared.summary()
    )
    # A fit that nears its bound along a direction that no reading tells does not touch it.
    for share, sign in ((1e-6, "-"), (1 - 1e-6, "")):
        (effect,) = moved(scaled, "s", share)
        assert (effect.code, effect.effect) == ("effect_edge", "position_scale")
        words = caution_sentence(effect.summary())
        assert words.startswith(f"position scale ends at the edge of what it may be, s = {sign}0.3: before you believe")
    assert moved(scaled, "s", 0.9) == []


def test_a_law_whose_size_ends_at_an_edge_stands_for_what_it_cannot_be(scaled: Fit) -> None:
    def imitation(share: float) -> float:
        x, k = scaled.minimum.x.copy(), scaled.problem.names.index("s")
        low, high = (bound[k] for bound in scaled.problem.bounds)
        x[k] = low + share * (high - low)
        refit = Refit("position_scale", scaled.problem, replace(scaled.minimum, x=x))
        return Contender(("position_scale",), refit, Evidence.none()).imitation("position_scale")

    assert [imitation(share) for share in (0.0, 0.5, 0.9, 1.0)] == [1.0, 0.0, 0.0, 1.0]


def test_a_shape_at_either_end_is_doubted() -> None:
    """A width is not absent where it is smallest, as the damping of a mode is that has none."""
    effects, names = ("hysteresis_at_joint", "second_mode"), ("w_h_joint", "zeta_2", "omega_2")
    parameters = {p.name: p for e in effects for p in get_effect(e).parameters()}
    bounds = np.array([parameters[n].bounds for n in names]).T
    model = SimpleNamespace(parameters=parameters, effects=effects)

    def told_of(x: list[float], added: int, **gaussian: tuple[float, float]) -> list[Caution]:
        problem: Any = SimpleNamespace(free=names, bounds=bounds, gaussian=gaussian, model=model)
        problem.edges = partial(Problem.edges, problem)
        told, values = (lambda n: {"unit": parameters[n].unit}), dict(zip(names, x, strict=True))
        minimum = SimpleNamespace(x=np.array(x))
        fitted: Any = SimpleNamespace(problem=problem, minimum=minimum, told=told, values=values, model=model)
        return at_edges(fitted, effects[:added])

    def found(x: list[float], **gaussian: tuple[float, float]) -> list[tuple[str, str]]:
        return [(c.about, c.effect) for c in told_of(x, 1, **gaussian)]

    added, declared = ("w_h_joint", effects[0]), ("omega_2", "")
    assert found([3.0, 2.0, 1000.0]) == [added, ("zeta_2", ""), declared]
    assert found([0.003, 0.0, 0.02]) == [added, declared]
    assert found([0.0035, 0.05, 0.5]) == []
    # Of several values of an added effect one doubt tells.
    _, both = told_of([3.0, 2.0, 1000.0], 2)
    assert (both.about, both.effect, both.numbers["others"]) == ("zeta_2", "second_mode", ["omega_2"])
    assert ", and so does omega_2: before you believe it" in caution_sentence(both.summary())
    # What a law holds by convention is known.
    assert found([3.0, 0.05, 0.5], w_h_joint=(1.0, 1.0)) == []


def told(hold: float, *, train: float = 1.0, where: str = "outside") -> dict[str, Any]:
    after = {"train": {"rms": train}, "holdout": {"rms": hold}, f"holdout_{where}": {"rms": hold}}
    return {"after": after, "noise_floor": 1.0, "unit": "m", "holdout_scatter": 19.0, "holdout_kind": SEPARATE}


def test_a_hold_out_that_is_missed_is_told() -> None:
    found = missed(told(20.0), left=0.1, held=0.1, least=0.3)
    assert found is not None
    assert caution_sentence(found.summary()).endswith(
        "misses the held-out ones by 20 m (rms), 20 times their noise, and more than the 19 m by which these scatter "
        "about their mean: has the rig or its payload changed, or does the motion reach where training did not?"
    )
    inside = missed(told(18.0, where="inside"), left=0.1, held=5.0, least=0.3)
    assert inside is not None
    assert "scatter" not in caution_sentence(inside.summary())
    assert caution_sentence(inside.summary()).endswith("changed, or does training tell too little of the law?")
    same = missed({**told(18.0, where="inside"), "holdout_kind": "last third"}, left=0.1, held=5.0, least=0.3)
    assert same is not None
    assert "did something change meanwhile, or does training tell" in caution_sentence(same.summary())
    # Averages are noise inside the range of training: readings scatter, and another doubt says so.
    assert missed(told(20.0, where="inside"), left=0.1, held=0.1, least=0.3) is None
    # Noise that is stated too small shows in training as well.
    assert missed(told(20.0, train=18.0), left=0.1, held=0.1, least=0.3) is None
    # A model that errs in training is told where it errs far more elsewhere.
    assert missed(told(20.0, train=5.0), left=4.0, held=18.0, least=0.3) is None
    elsewhere = missed(told(20.0, train=2.0), left=1.0, held=18.0, least=0.3)
    assert elsewhere is not None
    assert "misses the held-out recordings by 20 m (rms), 10 times as much as" in caution_sentence(elsewhere.summary())
    assert missed(told(1.4), left=0.1, held=0.1, least=0.3) is None


def test_what_is_no_more_than_chance_is_told_by_its_log_evidence() -> None:
    step = {"action": "add", "effects": ["play"], "accepted": False, "code": "chance", "numbers": {"train": 12.0}}
    assert decision_sentence(step).startswith("it gains 12.0 nats in training, no more than")


COAST = """
name = "coasting"
[system]
coordinates = {{ x = "m" }}
kinetic = "mass*dot(x)^2/2"
dissipation = "loss*dot(x)^2/2"
output = "dot(x)"
places = {{ body = "x" }}
[system.constants]
mass = {{ value = 2.0, unit = "kg" }}
loss = {{ guess = {guess}, unit = "N s/m" }}
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "v", unit = "m/s", noise = 0.01 }}
"""


def strayed_from(folder: Path, rig: str) -> Caution | None:
    """Fit what a rig file declares to a.csv, and return the constant that ends far from its guess."""
    (folder / "rig.toml").write_text(rig)
    data = load_dataset(folder / "rig.toml", [folder / "a.csv"])
    return strayed_constant(first_fit(data.train, natural_units(data.train)))


def test_a_constant_far_above_its_guess_is_doubted(tmp_path: Path) -> None:
    time = np.arange(0.0, 10.0, 0.05)
    speed = 3.0 * np.exp(-0.25 * time) + 0.01 * np.random.default_rng(1).standard_normal(time.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, speed]), delimiter=",", header="t,v", comments="")

    def doubt(guess: float) -> Caution | None:
        return strayed_from(tmp_path, COAST.format(guess=guess))

    # The loss is 0.5 N s/m.
    found = doubt(0.02)
    assert found is not None
    assert (found.code, found.about, found.numbers["guess"]) == ("strayed", "loss", 0.02)
    assert found.numbers["value"] == pytest.approx(0.5, rel=0.05)
    words = caution_sentence(found.summary())
    assert "ends 25 times as large as its guess of 0.02, and" in words
    assert "state its `value` and `sd`" in words
    assert doubt(0.1) is doubt(20.0) is None


def test_constants_that_are_told_together_only_are_not_said_to_stray(tmp_path: Path) -> None:
    """What coasts tells the ratio of loss and mass, 0.25 per second, and neither of them."""
    time = np.arange(0.0, 10.0, 0.05)
    speed = 3.0 * np.exp(-0.25 * time) + 0.01 * np.random.default_rng(1).standard_normal(time.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, speed]), delimiter=",", header="t,v", comments="")
    rig = COAST.format(guess=500.0).replace("mass = { value = 2.0", "mass = { guess = 2.0")
    (tmp_path / "rig.toml").write_text(rig)
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"])
    found = first_fit(data.train, natural_units(data.train))
    assert strayed_constant(found) is None
    (together,) = combined(found)
    assert (together.code, {together.about, *together.numbers["others"]}) == ("combined", {"mass", "loss"})
    assert "the recordings tell mass and loss together only" in caution_sentence(together.summary())
    (tmp_path / "rig.toml").write_text(COAST.format(guess=0.4))
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"])
    assert combined(first_fit(data.train, natural_units(data.train))) == []


HANGING = """
name = "pendulum"
[system]
coordinates = {{ angle = "rad" }}
kinetic = "inertia*dot(angle)^2/2"
potential = "-torque*cos(angle)"
dissipation = "loss*dot(angle)^2/2"
output = "angle"
places = {{ pivot = "angle" }}
[system.constants]
inertia = {{ guess = {guess}, unit = "kg m^2" }}
torque = {{ value = 2.0, unit = "N m" }}
loss = {{ guess = 0.1, unit = "N m s" }}
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "y", unit = "rad", noise = 0.001 }}
"""


def test_an_inertia_that_vanishes_is_doubted_and_a_loss_is_not(tmp_path: Path) -> None:
    """The inertia is 0.02 kg m^2, and there is no loss."""
    time = np.arange(0.0, 8.0, 0.02)
    angle = 0.02 * np.cos(10.0 * time) + 0.001 * np.random.default_rng(1).standard_normal(time.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, angle]), delimiter=",", header="t,y", comments="")

    def doubt(guess: float) -> Caution | None:
        return strayed_from(tmp_path, HANGING.format(guess=guess))

    found = doubt(0.5)
    assert found is not None
    assert found.about == "inertia"
    assert "ends 25 times smaller than its guess of 0.5, and" in caution_sentence(found.summary())
    assert doubt(0.03) is None


def test_an_output_that_moves_before_its_input_is_doubted() -> None:
    drive = pushes(1.0, -1.5, 0.7, 0.0)
    for tau, ahead in ((-0.05, True), (0.05, False), (0.0, False)):
        late = recorded("r", drive, 1, tau=tau)
        found = acausal(fit(Model("oscillator", (*DECLARED, "sensor_delay")), [late], start=TRUTH))
        assert (found is not None) is ahead
        if found is not None:
            assert found.numbers["ahead"] == pytest.approx(0.05, abs=0.01)
            assert "before the input does" in caution_sentence(found.summary())
            bent = found.summary() | {"numbers": {"ahead": 0.05, "sd": None}}
            assert "moves 0.05 s before the input does" in caution_sentence(bent)


def test_an_early_output_is_doubted_where_its_delay_has_no_interval() -> None:
    late = recorded("r", pushes(1.0, -1.5, 0.7, 0.0), 1, tau=-0.05)
    fitted = fit(Model("oscillator", (*DECLARED, "sensor_delay")), [late], start=TRUTH)
    found = acausal(replace(fitted, reasons={**fitted.reasons, "tau": "too bent"}))
    assert found is not None
    assert found.numbers["sd"] is None


def test_a_miss_names_the_undetermined_parameter_that_it_hangs_on(tmp_path: Path) -> None:
    time = np.arange(0.0, 10.0, 0.05)
    speed = 3.0 * np.exp(-0.25 * time) + 0.1 * np.random.default_rng(0).standard_normal(time.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, speed]), delimiter=",", header="t,v", comments="")
    (tmp_path / "rig.toml").write_text(COAST.format(guess=0.4).replace("0.01 }", "0.1 }"))
    train = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train
    off = missed(told(20.0), left=0.1, held=0.1, least=0.3)
    assert off is not None

    def found(readings: int, drag: float = 0.0) -> Caution:
        # Later it is slower than the law says by a `drag`.
        later = np.where(time >= time[readings], drag, 0.0)[:, None]
        moved = [replace(e.recording, output=e.recording.output - later) for e in train]
        short = [replace(e, recording=r, fitted_samples=readings) for e, r in zip(train, moved, strict=True)]
        return hung_on(off, first_fit(short, natural_units(short)))

    # In 0.4 s the speed falls by a tenth.
    about = found(8)
    assert (about.code, about.about) == ("missed", "loss")
    numbers = about.numbers["undetermined"]
    assert abs(numbers["value"]) < 3 * numbers["sd"]
    assert abs(numbers["sds"]) < 3
    assert numbers["left"] < 0.5
    words = caution_sentence(about.summary())
    assert "and that hangs on loss = " in words
    assert "which training leaves undetermined" in words
    assert "Hold out whole recordings (--holdout), or state loss: what was refused" in words
    # What training tells is not in doubt, wherever the held-out error comes from.
    assert found(130) == found(130, drag=1.0) == off


SEEN = """
name = "seen from the side"
[system]
coordinates = {{ x = "m" }}
kinetic = "mass*dot(x)^2/2"
potential = "spring*x^2/2"
dissipation = "loss*dot(x)^2/2"
output = "x + place"
places = {{ body = "x" }}
[system.constants]
mass = {{ {mass}, unit = "kg" }}
spring = {{ value = 40.0, unit = "N/m" }}
loss = {{ guess = 0.3, unit = "N s/m" }}
place = {{ guess = {place}, unit = "m" }}
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "y", unit = "m", noise = 1e-3 }}
"""


def seen(folder: Path, *, mass: str = "value = 1.0", place: float = 0.02, decay: float = 0.2) -> Path:
    """Write a rig file beside a free swing in closed form, of a mass of 1 kg seen 0.02 m off; return its path."""
    time = np.arange(0.0, 12.0, 0.02)
    swing = 0.1 * np.exp(-decay * time) * np.cos(np.sqrt(40.0 - decay**2) * time) + 0.02
    swing += 1e-3 * np.random.default_rng(3).standard_normal(time.size)
    np.savetxt(folder / "a.csv", np.column_stack([time, swing]), delimiter=",", header="t,y", comments="")
    (folder / "rig.toml").write_text(SEEN.format(mass=mass, place=place))
    return folder / "rig.toml"


@pytest.mark.parametrize(("guess", "doubted"), [(0.01, False), (-0.01, True)])
def test_a_constant_that_its_guess_holds_on_the_wrong_side_of_zero_is_doubted(
    tmp_path: Path, guess: float, doubted: bool
) -> None:
    data = load_dataset(seen(tmp_path, place=guess), [tmp_path / "a.csv"])
    fitted = first_fit(data.train, natural_units(data.train))
    found = held_sign(fitted, fitted)
    assert (found is not None) == doubted
    if found is not None:
        assert "place of the declared model ends at zero" in (words := caution_sentence(found.summary()))
        assert "Give place a guess of 0.01 m" in words


def test_a_loss_that_would_have_to_feed_energy_is_doubted_without_another_sign(tmp_path: Path) -> None:
    data = load_dataset(seen(tmp_path, decay=-0.02), [tmp_path / "a.csv"])
    fitted = first_fit(data.train, natural_units(data.train))
    found = held_sign(fitted, fitted)
    assert found is not None
    # Not where what was added has taken its place.
    without = SimpleNamespace(values={n: v for n, v in fitted.values.items() if n != "loss"}, sd=fitted.sd)
    assert held_sign(fitted, without) is None
    words = caution_sentence(found.summary())
    assert words.startswith("loss of the declared model ends at zero")
    assert "feeds energy" in words
    assert "guess of" not in words


@pytest.mark.parametrize("sd", [0.02, 0.002])
def test_recordings_overrule_a_constant_that_is_stated_wrong_and_no_effect_is_named_for_it(
    tmp_path: Path, sd: float
) -> None:
    """However sure the rig file is: its mass is 1.3 kg where the swing is that of 1 kg."""
    stated = f"value = 1.3, sd = {sd}"
    found = close_loop(load_dataset(seen(tmp_path, mass=stated), [tmp_path / "a.csv"])).summary()
    assert (found["verdict"], found["effects"]) == ("nothing_missing", [])
    (told,) = contradiction_sentences(found["contradiction"])
    assert float(told.split()[2]) == pytest.approx(1.0, abs=0.002)
    assert "contradicts what the rig file states, 1.300" in told
    assert told.endswith("the recordings overrule it. Is the rig file right?")


def test_of_two_constants_that_only_their_ratio_tells_the_one_that_moved_is_told(tmp_path: Path) -> None:
    rig = seen(tmp_path, mass="value = 1.3, sd = 0.02")
    text = rig.read_text(encoding="utf-8").replace("spring = { value = 40.0,", "spring = { value = 40.0, sd = 0.5,")
    rig.write_text(text, encoding="utf-8")
    tested = close_loop(load_dataset(rig, [tmp_path / "a.csv"])).summary()["contradiction"]
    (told,) = tested["contradictions"]
    assert (told["parameter"], told["overruled"]) == ("mass", True)
    # 40 N/m over 1 kg is 52 over 1.3: which of them is wrong no recording tells.
    (other,) = told["instead"]
    assert other["name"] == "spring"
    assert other["value"] == pytest.approx(52.0, rel=0.01)
    assert re.search(r"overrule it, or spring = 5\d\.\d+ .* N m.* in its place", *contradiction_sentences(tested))


@pytest.mark.parametrize("place", ["value = 0.0, sd = 0.02", "value = -0.005, sd = 0.02", "value = 1e-7, sd = 0.02"])
def test_a_stated_constant_may_change_its_sign(tmp_path: Path, place: str) -> None:
    rig = seen(tmp_path, place=0.5)
    rig.write_text(rig.read_text(encoding="utf-8").replace("guess = 0.5", place), encoding="utf-8")
    found = close_loop(load_dataset(rig, [tmp_path / "a.csv"]))
    assert (found.verdict, found.cautions) == ("nothing_missing", [])
    assert found.after.values["place"] == pytest.approx(0.02, abs=1e-3)


def test_a_constant_that_is_stated_right_is_left_alone(tmp_path: Path) -> None:
    found = close_loop(load_dataset(seen(tmp_path, mass="value = 1.0, sd = 0.02"), [tmp_path / "a.csv"])).summary()
    assert found["verdict"] == "nothing_missing"
    assert contradiction_sentences(found["contradiction"]) == []


@pytest.mark.parametrize(
    ("value", "sd", "told"), [(-29.0, 56.0, True), (8.0, None, True), (9.1, 1.2, False), (-9.1, 1.2, False)]
)
def test_a_gain_that_is_lost_with_what_was_added_is_doubted(
    monkeypatch: pytest.MonkeyPatch, value: float, sd: float | None, told: bool
) -> None:
    monkeypatch.setattr(edges, "_serves_without", lambda *_: True)
    model = Model("oscillator", DECLARED)
    assert model.mechanics.push() is not None

    def fitted(value: float, sd: float | None) -> Fit:
        row = {"value": value, "sd": sd, "unit": "rad s^-2"}
        return cast(Fit, SimpleNamespace(model=model, problem=SimpleNamespace(free=("g",)), told=lambda _: row))

    found = gain_untold(fitted(9.3, 1.0), fitted(value, sd))
    assert (found is not None) == told
    if found is not None:
        assert "g = " in (said := caution_sentence(found.summary()))
        assert "9.3 +- 1.0 rad s^-2 before" in said
    # What no recording told before is not lost: it was never there.
    never = gain_untold(fitted(9.3, 5.0), fitted(value, sd))
    assert (never is not None) == (told and sd is not None)
    if never is not None:
        assert "the gain of the input is not told from zero, g = " in (said := caution_sentence(never.summary()))
        assert "before" not in said
    # The input may act through a second mode.
    model = Model("oscillator", (*DECLARED, "second_mode"))
    assert gain_untold(fitted(9.3, 1.0), fitted(value, sd)) is None


@pytest.mark.parametrize("acts", [True, False])
def test_a_gain_is_not_needed_only_where_the_motion_is_explained_without(acts: bool) -> None:
    """An interval that holds zero may be that of a gain that is told together with a loss."""
    given = pushes(1.0, -1.5, 0.7, 0.0)
    # Or a free decay beside a column that has nothing to do with it.
    read = recorded("train", given if acts else pushes(0.0, 0.0, 0.0, 0.0), 0).recording
    found = fit(
        Model("oscillator", DECLARED), [experiment("train", read.output[:, 0], given)], start=TRUTH, units=UNITS
    )
    assert edges._serves_without(found, "g") != acts


def test_a_fit_that_stopped_on_its_way_is_doubted(scaled: Fit) -> None:
    assert scaled.minimum.converged
    assert unfinished(scaled) is None
    found = unfinished(replace(scaled, minimum=replace(scaled.minimum, converged=False, iterations=8)))
    assert found is not None
    assert "stopped after 8 steps" in caution_sentence(found.summary())


def test_an_added_effect_of_no_size_that_is_told_is_a_doubt(tmp_path: Path) -> None:
    found = close_loop(load_dataset(seen(tmp_path, mass="value = 1.0, sd = 0.02"), [tmp_path / "a.csv"])).after
    model = found.model.with_effect("coulomb_friction_at_body")
    fitted = fit(model, found.problem.bench.experiments, start=found.own_values)
    (told,) = untold(fitted, ("coulomb_friction_at_body",))
    assert (told.code, told.about, told.effect) == ("untold", "f_c_body", "coulomb_friction_at_body")
    assert "none of its sizes lies 3 sds from zero, f_c_body = " in caution_sentence(told.summary())
    assert untold(fitted, ()) == []


def test_a_constant_of_zero_has_no_ratio_to_another(tmp_path: Path) -> None:
    rig = seen(tmp_path, mass="value = 1.0, sd = 0.01", place=0.5)
    text = rig.read_text(encoding="utf-8").replace("guess = 0.5", "value = 0.0, sd = 0.002")
    rig.write_text(text, encoding="utf-8")
    found = close_loop(load_dataset(rig, [tmp_path / "a.csv"])).summary()["contradiction"]["contradictions"]
    assert [(c["parameter"], c["instead"]) for c in found] in ([("place", [])], [])


@pytest.mark.parametrize(("code", "told"), [("budget", True), ("exhausted", False)])
def test_a_search_that_its_limit_of_work_ended_is_doubted(code: str, told: bool) -> None:
    numbers = {"effects": 5, "most_effects": 5, "offers": 2, "most_offers": 7, "cost": 1.0, "most_cost": 6.0}
    steps = [Decision("stop", (), True, "budget", numbers), Decision("stop", (), True, code, numbers)]
    found = stopped(steps)
    assert (found is not None) == told
    if found is not None:
        assert "holds 5 added effects, as many as the search may add" in caution_sentence(found.summary())


@pytest.mark.parametrize(("sds", "doubted"), [(0.0, False), (-2.9, False), (-3.0, True), (3.0, True)])
def test_a_stated_value_that_ends_as_far_away_as_it_may_is_doubted(tmp_path: Path, sds: float, doubted: bool) -> None:
    rig = seen(tmp_path)
    text = rig.read_text(encoding="utf-8").replace("value = 40.0,", "value = 40.0, sd = 1.5,")
    rig.write_text(text, encoding="utf-8")
    data = load_dataset(rig, [tmp_path / "a.csv"])
    fitted = first_fit(data.train, natural_units(data.train))
    assert stated_edges(fitted) == []
    x = fitted.minimum.x.copy()
    x[fitted.problem.names.index("spring")] = 40.0 + sds * 1.5
    found = stated_edges(replace(fitted, minimum=replace(fitted.minimum, x=x)))
    assert [c.about for c in found] == (["spring"] if doubted else [])
    for caution in found:
        assert caution.numbers["stated"] == pytest.approx(40.0 * caution.numbers["value"] / (40.0 + sds * 1.5))
        said = caution_sentence(caution.summary())
        assert "ends 3 standard deviations from what the rig file states, " in said
        assert "as far as it may" in said
