"""Manoeuvres for systems without a motor at the hub: courses of their input, and releases."""

from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from driven_oscillator import EFFECTS, NOISE, TIME, experiment
from synthetic_run import write_arm_run

from discovery.diagnosis.manoeuvre_design import hub_drive
from discovery.diagnosis.separation import Separation, separate
from discovery.equations.model import Model
from discovery.estimation.fit import Fit, fit
from discovery.recordings.dataset import load_dataset
from discovery.report import build_report, figures
from discovery.report.ambiguity import draw_manoeuvres
from discovery.report.manoeuvre_sentences import separation_sentence
from discovery.simulation.simulate import Simulator

PAIR = ("coulomb_friction", "quadratic_drag")
#: One law while the spring is linear: where it rests, or where the instrument has its zero.
TWINS = ("equilibrium_offset", "angle_offset")
BENCH = Path(__file__).parents[1] / "datasets" / "spring_bench" / "rig.toml"


@cache
def driven() -> dict[str, Fit]:
    """Return rivals fitted to a recording that a small sine moved."""
    errors = np.random.default_rng(2).normal(0.0, NOISE, TIME.size)
    model = Model("oscillator", EFFECTS, {"g": 1.7})
    return {name: fit(model.with_effect(name), [experiment(errors)]) for name in PAIR}


@cache
def free() -> dict[str, Fit]:
    """Return rivals fitted to three swings of a slider that was let go."""
    part = [load_dataset(BENCH).train[0].first(180)]
    model = Model("oscillator", EFFECTS, {"g": 0.0})
    return {name: fit(model.with_effect(name), part) for name in PAIR}


@cache
def course() -> Separation:
    return separate(driven(), np.random.default_rng(1), evaluations=60)


@cache
def release() -> Separation:
    return separate(free(), np.random.default_rng(1))


@cache
def with_twins(which: str) -> Separation:
    """Return the manoeuvre for a drag and two offsets that are one law, in swings that were driven or free."""
    if which == "driven":
        errors = np.random.default_rng(2).normal(3 * NOISE, NOISE, TIME.size)
        model, part = Model("oscillator", EFFECTS, {"g": 1.7}), experiment(errors)
    else:
        model, part = Model("oscillator", EFFECTS, {"g": 0.0}), load_dataset(BENCH).train[0].first(180)
        read = part.recording
        part = replace(part, recording=replace(read, output=read.output + 3 * read.noise))
    fits = {name: fit(model.with_effect(name), [part]) for name in (*TWINS, "quadratic_drag")}
    return separate(fits, np.random.default_rng(1), evaluations=60)


def chi2(found: Separation, rivals: dict[str, Fit]) -> float:
    """Return how far the rivals lie apart on a course as they are, by a simulation of its own [noise sds squared]."""
    readings = []
    for name in found.rivals:
        bench = rivals[name].problem.bench
        parameters, _ = rivals[name].problem.expand(rivals[name].minimum.x[:, None])
        moved = Simulator(bench.base, bench.effects, found.table[:, 0], hub_drive(found.moves), step=bench.shortest)
        readings.append(moved(parameters, np.zeros(1), np.zeros(1))[:, 0, 0])
    return float(np.square((readings[0] - readings[1]) / NOISE).sum())


def test_an_input_goes_as_far_as_it_went_and_tells_more_than_the_recording() -> None:
    found, recorded = course(), next(iter(driven().values())).problem.bench.experiments[0]
    assert found.moves
    assert not found.release
    assert found.designed.chi2 > 2 * found.given.chi2
    time, values = found.table.T
    assert np.abs(values).max() <= np.abs(recorded.recording.input).max() * (1 + 1e-6)
    assert time[-1] <= np.ptp(TIME) + 1e-9
    assert found.deflection <= found.limits.deflection
    assert found.designed.chi2 <= chi2(found, driven()) * 1.05


def test_what_has_no_input_is_let_go_from_where_it_has_been() -> None:
    found = release()
    assert not found.moves
    assert found.evaluations == 24
    most = np.abs(load_dataset(BENCH).train[0].first(180).recording.output).max()
    assert 0.0 < abs(found.release) <= most
    assert found.designed.chi2 > found.given.chi2
    assert found.unit == "m"
    time, *predicted = found.table.T
    np.testing.assert_allclose([p[0] for p in predicted], found.release, atol=1e-4)
    apart = np.square((predicted[0] - predicted[1]) / 5e-5).sum() * (len(time) and 1.0)
    assert apart > 0.0


def test_rivals_are_let_go_at_one_place_wherever_each_of_them_rests() -> None:
    part = load_dataset(BENCH).train[0].first(180)
    off = replace(part, recording=replace(part.recording, output=part.recording.output + 5e-3))
    model = Model("oscillator", (*EFFECTS, "equilibrium_offset"), {"g": 0.0})
    found = separate({name: fit(model.with_effect(name), [off]) for name in PAIR}, np.random.default_rng(1))
    np.testing.assert_allclose(found.table[0, 1:], found.release, atol=1e-9)


def test_one_law_is_one_where_no_manoeuvre_keeps_the_deflection_either() -> None:
    """What runs away leaves nothing that could be tried: then the given recordings alone say it."""
    errors = np.random.default_rng(2).normal(3 * NOISE, NOISE, TIME.size)
    part = experiment(errors)
    part = replace(part, rig=replace(part.rig, deflection_limit=1e-9))
    model = Model("oscillator", EFFECTS, {"g": 1.7})
    fits = {name: fit(model.with_effect(name), [part]) for name in TWINS}
    found = separate(fits, np.random.default_rng(1), evaluations=8)
    assert found.deflection > 1e-9
    assert [set(names) for names in found.clusters] == [set(TWINS)]
    assert separation_sentence(found.summary()).endswith("are the same law: no recording like these tells them apart.")


@pytest.mark.parametrize("which", ["driven", "free"])
def test_rivals_that_are_one_law_do_not_hide_what_tells_another(which: str) -> None:
    found = with_twins(which)
    assert set(map(frozenset, found.clusters)) == {frozenset(TWINS), frozenset(["quadratic_drag"])}
    assert found.designed.chi2 > 10.0
    record = json.loads(json.dumps(found.summary()))
    for decides in (True, False):
        said = separation_sentence(record | {"decides": decides})
        same, _, others = said.partition(". ")
        assert sorted(same.removeprefix("Here ").split(" are the same law: ")[0].split(" and ")) == sorted(TWINS)
        first = next(names[0] for names in found.clusters if len(names) > 1)
        assert first in others
        assert ({*TWINS} - {first}).pop() not in others


def test_what_is_one_law_alone_is_said_without_advice_that_cannot_help() -> None:
    part = load_dataset(BENCH).train[0].first(180)
    model = Model("oscillator", EFFECTS, {"g": 0.0})
    found = separate({name: fit(model.with_effect(name), [part]) for name in TWINS}, np.random.default_rng(1))
    assert not found.decides
    assert len(found.clusters) == 1
    said = separation_sentence(found.summary())
    assert said.endswith("are the same law: no recording like these tells them apart.")
    assert "would help" not in said


@pytest.mark.parametrize("which", [course, release])
def test_the_file_holds_the_table(which) -> None:
    found = which()
    table = pd.read_csv(io.StringIO(found.csv()))
    assert tuple(table.columns) == found.columns
    assert table.columns[0] == "time_s"
    np.testing.assert_allclose(table.to_numpy(), found.table, rtol=1e-6, atol=1e-6)
    assert json.loads(json.dumps(found.summary()))["unit"] == found.unit


def test_the_sentences_say_what_to_do() -> None:
    moved, let_go = (separation_sentence(which().summary() | {"decides": True}) for which in (course, release))
    assert "move the input by" in moved
    assert "turn" not in moved
    assert re.search(r"let it go at [+-][\d.e-]+ m from zero, at no speed, and record", let_go)
    for which in (course, release):
        said = separation_sentence(which().summary() | {"decides": False})
        assert "rad/s" not in said
        assert re.search(r"s, output up to [\d.e-]+ [mV], a tenth beyond what was recorded", said)
    record = release().summary() | {"decides": False}
    no_better = record | {"given": {**record["given"], "projected": 2 * record["designed"]["projected"]}}
    assert "apart better than the given recordings" in separation_sentence(no_better)
    started = separation_sentence(release().summary() | {"decides": True, "unit": "m/s"})
    assert re.search(r"let it pass its rest at [+-][\d.e-]+ m/s, and record", started)
    assert "deflect" not in separation_sentence(
        release().summary() | {"decides": False, "deflection": 9.9, "unit": "m/s"}
    )


@pytest.mark.parametrize(
    ("times", "far"), [(1.5, ""), (450.0, ", 450 times as far"), (np.inf, "every motion blows up")]
)
@pytest.mark.parametrize(("which", "remedy"), [(course, "feed the output back"), (release, "shorter recordings")])
def test_larger_motions_are_not_advised_for_what_runs_away(which, remedy: str, times: float, far: str) -> None:
    record = which().summary()
    said = separation_sentence(record | {"decides": False, "deflection": times * record["limits"]["deflection"]})
    assert far in said
    assert (remedy in said) == (times > 3.0)
    assert ("larger motions" in said) == (times < 3.0)
    assert ("times as far" in said) == (3.0 < times < np.inf)


def page_with(folder: Path, *designs: Separation, decides: bool = True) -> str:
    """Return the page of a run whose loop designed manoeuvres."""
    results = write_arm_run(folder)
    results["loop"]["separation"] = [design.summary() | {"decides": decides} for design in designs]
    (folder / "results.json").write_text(json.dumps(results), encoding="utf-8")
    return build_report(folder).read_text(encoding="utf-8")


@pytest.mark.usefixtures("undrawn")
def test_the_page_shows_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(figures.SECTIONS, "undecided", (draw_manoeuvres,))
    page = page_with(tmp_path, course(), release())
    assert 'id="figure-manoeuvre_1"' in page
    assert 'id="figure-manoeuvre_2"' in page
    assert "let go at" in page
    moves = pd.read_csv(tmp_path / "tables" / "moves.csv")
    assert moves["by"].tolist() == [m.angle for m in course().moves]


@pytest.mark.usefixtures("undrawn")
def test_where_nothing_decides_the_page_says_so_and_names_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(figures.SECTIONS, "undecided", (draw_manoeuvres,))
    page = page_with(tmp_path, course(), release(), decides=False)
    assert page.count("No manoeuvre within the safe limits") == 2
    assert "manoeuvre_1" not in page
    assert not (tmp_path / "tables" / "moves.csv").exists()


@pytest.mark.usefixtures("undrawn")
def test_the_page_joins_what_is_one_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(figures.SECTIONS, "undecided", (draw_manoeuvres,))
    page = page_with(tmp_path, with_twins("free"))
    assert "are the same law: no recording" in page
    (row,) = pd.read_csv(tmp_path / "tables" / "separation.csv").to_dict("records")
    assert " = ".join(next(names for names in with_twins("free").clusters if len(names) > 1)) in row["rivals"]
    # Between laws: the offsets have one sensitivity.
    assert row["similarity"] < 0.999
    assert row["designed_chi2"] == with_twins("free").designed.chi2


def test_results_of_old_that_know_no_laws_are_read() -> None:
    record = release().summary()
    del record["clusters"]
    assert separation_sentence(record) == separation_sentence(release().summary())


@pytest.mark.usefixtures("undrawn")
def test_a_release_alone_moves_no_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(figures.SECTIONS, "undecided", (draw_manoeuvres,))
    page = page_with(tmp_path, release())
    assert "let go at" in page
    assert 'id="table-separation"' in page
    assert not (tmp_path / "tables" / "moves.csv").exists()
