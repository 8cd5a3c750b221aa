from __future__ import annotations

import base64
import csv
import json
import math
import re
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import synthetic_run
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.dashboard.page import build_index
from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.system import Constant, SystemDeclaration
from discovery.diagnosis.missing_force import missing_force
from discovery.equations.latex import dotted, letter
from discovery.equations.latex import term as written_term
from discovery.equations.model import Model
from discovery.foundation.errors import ComputationError, InputError
from discovery.mechanics import base_names, get_base
from discovery.mechanics.systems import declare
from discovery.posterior.inference_data import arranged
from discovery.report import build_report, evidence, figures, posterior, sentences, story
from discovery.report.effect_formulas import effect_formula
from discovery.report.equations import drive_symbols, model_formulas
from discovery.report.estimates import posterior_table
from discovery.report.figures import laws, motion, residual
from discovery.report.figures.search import LOSS, draw_model_error, draw_ranking, nats_axis
from discovery.report.mathml import block, broken, inline
from discovery.report.model_error_words import model_error_words
from discovery.report.noise import honest_table, noise_differs, noise_sentence
from discovery.report.numbers import (
    MISSING,
    chance,
    interval,
    scale_for,
    scale_for_change,
    significant,
    uncertain,
    unit_text,
)
from discovery.report.page import _ASKED, _every, chart_data
from discovery.report.posterior import convergence_sentence
from discovery.report.results import Run
from discovery.report.style import decimate, new_figure
from discovery.report.words import headline, origin, page_prose, prose, sentence
from discovery.results.provenance import read_json, write_json
from discovery.selection.decision import Decision
from discovery.selection.settings import LoopSettings

#: Thin spaces as plain ones.
_PLAIN = str.maketrans("\N{NARROW NO-BREAK SPACE}\N{NO-BREAK SPACE}", "  ")
Made = tuple[Path, dict[str, Any], str]


class _Reader(HTMLParser):
    """Visible text, tags and attributes of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.text, self.tags, self.stack = "", [], []  # type: ignore[var-annotated]
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.stack.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self.stack and self.stack.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if "style" not in self.stack:
            self.text += data


def _made(folder: Path) -> Made:
    return folder, read_json(folder / "results.json"), (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def arm(drawn_run: Callable[[str], Path]) -> Made:
    return _made(drawn_run("arm"))


@pytest.fixture(scope="module")
def oscillator(sketch: Callable[[Path], Path], tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Return a page with empty pictures: what is in them is read of the arm's, and of this one by a browser."""
    folder = tmp_path_factory.mktemp("oscillator")
    synthetic_run.write_oscillator_run(folder)
    sketch(folder)
    return _made(folder)


@pytest.fixture(scope="module", params=["arm", "oscillator"])
def made(request: pytest.FixtureRequest) -> Made:
    return request.getfixturevalue(request.param)


def _walk(value: Any) -> Iterator[float]:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from _walk(item)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield float(value)


def test_the_page_needs_no_other_file(made: Made) -> None:
    _, _, page = made
    reader = _Reader(page)
    for tag, attributes in reader.tags:
        assert tag not in ("iframe", "object", "embed"), tag
        for name in ("src", "href", "srcset"):
            value = attributes.get(name) or ""
            assert value == "" or value.startswith(("data:", "#")), (tag, value[:80])
    assert "url(" not in page
    assert "@import" not in page


def test_every_figure_has_alt_text_caption_and_file(made: Made) -> None:
    folder, _, page = made
    reader = _Reader(page)
    images = [a for t, a in reader.tags if t == "img"]
    assert len(images) == page.count("<figcaption>") == len(list((folder / "figures").iterdir()))
    for image in images:
        assert len(image["alt"] or "") > 20
        assert (image["src"] or "").startswith(("data:image/svg+xml;base64,", "data:image/png;base64,"))
    names = {p.stem for p in (folder / "figures").iterdir()}
    assert names == {a["id"].removeprefix("figure-") for t, a in reader.tags if t == "figure" and a["id"]}


def test_an_arm_has_every_figure(arm: Made) -> None:
    names = {p.stem for p in (arm[0] / "figures").iterdir()}
    wanted = {"errors", "motion", "deflections", "phase", "inclusion", "corner", "spring_law", "radius_law"}
    wanted |= {"marginals", "correlations", "chains", "bands_train_a", "bands_hold_in"}
    wanted |= {
        "comparison",
        "correlogram",
        "residual",
        "spectrum",
        "amplitude",
        "model_error",
        "odds",
        "ranking_1",
        "ranking_2",
    }
    assert names == wanted | {"time_hold_in", "time_hold_out", "time_train_a"}


def test_an_oscillator_shows_what_it_has(oscillator: Made) -> None:
    folder, _, page = oscillator
    names = {p.stem for p in (folder / "figures").iterdir()}
    assert {"comparison", "errors", "motion", "phase", "residual", "spectrum", "time_train_a"} <= names
    assert "model_error" in names
    assert not names & {"corner", "spring_law", "radius_law", "amplitude", "odds", "ranking_1"}
    assert "Check against the elastica" not in page
    assert "This run sampled no posterior." in page
    assert "The final model is the declared one." in page


def test_the_verdict_comes_first_and_in_order(arm: Made) -> None:
    page = arm[2]
    note, verdict = (re.search(rf'<p class="{name}[^"]*">(.*?)</p>', page) for name in ("note", "verdict"))
    assert note
    assert verdict
    assert "These recordings are simulated by a twin of the rig." in note[1]
    assert verdict[1] == (
        "Explained: the declared model lacked elastica geometry and Coulomb friction (or quadratic drag); with them, "
        "the rms error on a recording that no fit saw falls from 2.98 to 0.473 mm (noise floor 0.424 mm)."
    )
    assert page.index("<h1>") < note.start() < verdict.start() < page.index("<h2 ")
    assert re.findall("<h2[^>]*>(.*?)</h2>", page) == [
        "The answer",
        "Why: how the answer was found",
        "The parameters",
        "What sparse regression proposes by itself",
        "Check against the elastica",
        "The posterior of the declared model",
        "What the models leave: the residual",
        "What was recorded",
        "Predictions",
        "Provenance",
        "Effects and methods used, and their sources",
    ]


def _loop(results: dict[str, Any], verdict: str, *effects: dict[str, Any]) -> dict[str, Any]:
    """Give a run another verdict, under which a model error is left."""
    left = {"verdict": verdict, "effects": [*effects], "complete": False}
    return results["loop"] | left | {"model_error": synthetic_run.model_error(1e-3, 8e-5, "m", "deflection", "rate")}


DELAY = {"id": "sensor_delay", "parameters": {}, "evidence": synthetic_run.odds(6.0, 2.0, 3.0),
         "probability": 0.97, "group_probability": 0.97, "ambiguous_with": []}  # fmt: skip
GEOMETRY = {**DELAY, "id": "elastica_geometry", "evidence": {}, "probability": None, "group_probability": None}
LEAD = {"effects": ["table_tilt"], "code": "held_out", "numbers": synthetic_run.odds(94.0, 1.0, 0.9)}


@pytest.mark.usefixtures("undrawn")
def test_what_is_named_beside_a_model_error_is_named(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["loop"] = _loop(results, "partly_explained", DELAY)
    assert headline(Run(tmp_path, results)) == (
        "Partly explained: the declared model lacked sensor delay; with it, the rms error on a recording that no fit "
        "saw falls from 2.98 to 0.473 mm (noise floor 0.424 mm). What is left is a model error of 0.0800 mm, 8 % of "
        "that before; it depends on deflection and rate."
    )
    edge = {"value": 0.3, "unit": "s", "others": []}
    results["loop"]["cautions"] = [{"code": "effect_edge", "about": "tau", "effect": "sensor_delay", "numbers": edge}]
    write_json(tmp_path / "results.json", results)
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert '<p class="verdict partly_explained">' in page
    assert "A doubt. Sensor delay ends at the edge of what it may be, " in _Reader(page).text
    assert ".verdict.partly_explained {" in page
    text = _Reader(page).text
    assert "Odds of 400 to 1, probability 0.97." in text
    assert "The verdict rests on the model error: 1.00 → 0.0800 mm, 8 % is left" in text


def test_a_model_error_that_shows_held_out_alone_is_told(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["loop"] = _loop(results, "partly_explained", DELAY)
    results["loop"]["model_error"] |= {"after": 4e-5, "share": 0.04, "held": 6e-5}
    assert headline(Run(tmp_path, results)).endswith(
        "What is left is a model error of 0.0400 mm, 4 % of that before, 0.0600 mm held out; it depends on "
        "deflection and rate."
    )
    # Where the evidence for any is weak, one above what counts as none held out is not said to lie below it.
    complete = {**results["loop"], "verdict": "explained"}
    assert model_error_words(complete).endswith("; it cannot be told from none")
    # What counts as none depends on nothing.
    assert "depends on" not in model_error_words(complete)
    complete["model_error"] = {**complete["model_error"], "held": 4e-5}
    assert model_error_words(complete).endswith("counts as none")
    # So is one that is far larger than that of training.
    left = {**results["loop"], "model_error": results["loop"]["model_error"] | {"after": 8e-5, "held": 1.7e-4}}
    assert ", 0.170 mm held out; it depends on" in model_error_words(left)
    left["model_error"]["held"] = 1.5e-4
    assert "held out" not in model_error_words(left)


@pytest.mark.usefixtures("undrawn")
def test_what_is_not_explained_tells_its_strongest_lead(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["loop"] = {**_loop(results, "unexplained"), "lead": LEAD}
    told = headline(Run(tmp_path, results))
    assert told.startswith("Not explained: the declared model leaves 0.473 mm rms on a recording that no fit saw")
    assert "no effect is likely enough to be named" in told
    assert told.endswith(
        "The strongest lead is table tilt, with odds of 2.3 to 1; it is not named: the log evidence gains 94.0 nats in "
        "training, but only 1.00 on the held-out recordings."
    )
    write_json(tmp_path / "results.json", results)
    text = _Reader(build_report(tmp_path).read_text(encoding="utf-8")).text
    assert text.count("The strongest lead is table tilt") == 2
    assert "How strong the evidence is" not in text
    results["loop"] = _loop(results, "unexplained", GEOMETRY)
    assert "Not explained: with elastica geometry, the rms error" in headline(Run(tmp_path, results))


def test_nothing_missing_is_said_with_the_noise(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["loop"] |= {"verdict": "nothing_missing", "effects": []}
    told = headline(Run(tmp_path, results))
    assert told.startswith("Nothing is missing: the declared model leaves 0.473 mm rms")
    assert told.endswith("which is noise (floor 0.424 mm).")


@pytest.mark.usefixtures("undrawn")
def test_the_story_follows_the_decisions(tmp_path: Path) -> None:
    """A pair, an exchange and a removal: each search stands beside what was in the model then."""
    results = synthetic_run.write_arm_run(tmp_path)
    decision, odds, candidate = synthetic_run.decision, synthetic_run.odds, synthetic_run.candidate
    pair = [candidate("wind", "table_tilt", train=12345.0, held=14.1)]
    other = [candidate("hysteresis", train=9.0, held=4.0), candidate("sensor_delay", train=8.0, held=4.5)]
    numbers = odds(12345.0, 14.1, 3.0)
    results["loop"] = _loop(results, "partly_explained", {**DELAY, "id": "hysteresis"}) | {
        "steps": [
            decision("declare", accepted=False, code="astray", numbers={"left": 0.83}),
            decision("add", "wind", "table_tilt", accepted=True, numbers=numbers, candidates=pair),
            decision("exchange", "wind", "hysteresis", accepted=True, numbers={"odds": 5.1}, candidates=other),
            decision("remove", "table_tilt", accepted=True, code="size", numbers=odds(21.0, 14.0, 0.4)),
            decision("mechanics", "elastica_4", accepted=True, numbers={"odds": 6.7}),
            decision("stop", accepted=True, code="budget"),
        ]
    }
    run = Run(tmp_path, results)
    assert [(s.beside, s.taken) for s in story.searches(run)] == [
        ((), ("wind", "table_tilt")),
        (("table_tilt",), ("hysteresis",)),
    ]
    assert story.searches(run)[1].outcome(["sensor_delay"]) == "as likely"
    assert [(s["head"], s["outcome"]) for s in story.steps(run)] == [
        ("Fitted the declared model", "most of the motion is left"),
        ("Tried: wind and table tilt", "added"),
        ("Exchanged: wind for hysteresis", ""),
        ("Tried without: table tilt", "taken out"),
        ("Compared the mechanics: elastica 4", "kept"),
        ("Stopped", ""),
    ]
    write_json(tmp_path / "results.json", results)
    text = _Reader(build_report(tmp_path).read_text(encoding="utf-8")).text.replace("\N{NARROW NO-BREAK SPACE}", " ")
    for words in (
        "The log evidence gains 12 345 nats in training and 14.1 held out: odds of 9700 to 1; a model error that "
        "looks the same limits them.",
        "With hysteresis in the place of wind the log evidence is 5.10 nats higher.",
        "The prediction moves by 0.4 times the model error that is left",
        "A limit of the search’s work was reached, so no further effect was sought.",
        "added, later dropped",
        "The exact arm with four curvature modes",
        "A doubt. The declared model leaves 83 % of the variance: check",
    ):
        assert words in text


def test_a_chart_of_readings_with_others_left_out_warns_of_nothing() -> None:
    time = np.linspace(0.0, 30.0, 12_000)
    readings = np.where(np.arange(time.size) % 2 == 0, np.sin(time), np.nan)[:, None]
    assert _every(readings) >= 1


def test_what_the_templates_ask_for_is_there() -> None:
    pages = (Path(figures.__file__).parents[1] / "templates").glob("*.j2")
    call = re.compile(rf"\b({'|'.join(_ASKED)})\.(\w+)\(")
    asked = [found for page in pages for found in call.findall(page.read_text(encoding="utf-8"))]
    assert len(asked) > 30
    assert [(room, name) for room, name in asked if not hasattr(_ASKED[room], name)] == []


def test_every_decision_of_the_loop_has_its_words() -> None:
    folder = Path(story.__file__).parents[1]
    sources = [folder / "runs" / "loop.py", *(folder / "selection").glob("*.py")]
    used = {word for path in sources for word in re.findall(r'Decision\(\s*"(\w+)"', path.read_text(encoding="utf-8"))}
    assert used
    assert used <= story._WORDS.keys()
    codes = re.search(r"code : str\n(.*?)\n    numbers", Decision.__doc__ or "", re.DOTALL)
    assert codes
    for code in re.findall(r'"(\w+)"', codes[1]):
        step = synthetic_run.decision("add", "wind", accepted=True, code=code, numbers=synthetic_run.odds(1.0, 2.0))
        assert len(sentences.decision_sentence(step).split()) <= 25


@pytest.mark.parametrize(
    ("log_odds", "said"),
    [
        (math.log(340), "odds of 340 to 1"),
        (math.log(9737), "odds of 9700 to 1"),
        (642.0, "odds of more than 10 000 to 1"),
        (math.inf, "odds of more than 10 000 to 1"),
        (0.0, "even odds"),
        (-math.log(20), "odds of 1 to 20"),
        (-1e5, "odds of less than 1 to 10 000"),
        (None, "odds that cannot be told"),
    ],
)
def test_odds_have_the_digits_that_mean_something(log_odds: float | None, said: str) -> None:
    assert sentences.chances(log_odds) == said


@pytest.mark.parametrize(
    ("probability", "said"),
    [(0.5, "0.50"), (0.9973, "0.997"), (1 - 4.9e-11, "more than 0.9999"), (1.0, "more than 0.9999"),
     (0.004, "0.004"), (1e-9, "less than 0.0001"), (None, "unknown")],
)  # fmt: skip
def test_probabilities_have_the_digits_that_mean_something(probability: float | None, said: str) -> None:
    assert sentences.probability_words(probability) == said


@pytest.mark.parametrize("broken", [None, math.inf])
def test_a_declared_model_without_a_finite_error_is_told(arm: Made, broken: float | None) -> None:
    error = {**synthetic_run.model_error(1.0, 2e-5, "m"), "before": broken, "share": None if broken is None else 0.0}
    loop = {**arm[1]["loop"], "model_error": error}
    told = sentences.verdict_sentence(loop)
    assert told.startswith("the model error falls from ")
    assert "to 20.0 µm, which counts as none (up to 45.0 µm)" in told
    picture = draw_model_error(Run(arm[0], {**arm[1], "loop": loop}))
    assert [t.get_text() for t in picture.figure.axes[0].texts] == ["blows up", "0.0200 mm"]


def test_searches_are_told_apart_by_what_is_in_the_model(arm: Made) -> None:
    found = story.searches(Run(arm[0], arm[1]))
    assert [s.beside for s in found] == [(), ("coulomb_friction",)]
    assert [s.taken for s in found] == [("coulomb_friction",), ()]
    assert found[1].refused == {("table_tilt",): "held_out", ("encoder_ripple",): "chance"}
    assert [found[0].outcome(c["effects"]) for c in found[0].candidates] == ["added", "as likely", ""]
    with (arm[0] / "tables" / "candidates.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(r["search"], r["effects"], float(r["train"]), float(r["held"])) for r in rows] == [
        (f"{i}", "; ".join(c["effects"]), c["train"], c["held"]) for i, s in enumerate(found, 1) for c in s.candidates
    ]


def test_candidates_are_bars_of_log_evidence(arm: Made) -> None:
    first, second = draw_ranking(Run(arm[0], arm[1]))
    assert "beside Coulomb friction" in second.caption
    for picture, search in zip((first, second), story.searches(Run(arm[0], arm[1])), strict=True):
        (axes,) = picture.figure.axes
        left, right = axes.get_xlim()
        drawn = [p.get_width() for p in axes.patches]
        simulated = [c for c in search.candidates if not story.blows_up(c)]
        told = [c[k] for c in simulated for k in ("train", "held")]
        # A loss beyond the axis ends at its edge.
        assert drawn == pytest.approx([max(v, left, LOSS) for v in told])
        assert max(told) <= right
        hatched = [bool(p.get_hatch()) for p in axes.patches]
        assert hatched == [False, True] * len(simulated)
    labels = [t.get_text() for t in second.figure.axes[0].get_yticklabels()]
    assert labels[:3] == [
        "table tilt\n(too little held out)",
        "encoder ripple\n(no more than chance)",
        "hysteresis +\nbase compliance",
    ]


@pytest.mark.parametrize(("train", "held"), [(-math.inf, 1050.0), (-math.inf, -math.inf), (40.0, -math.inf)])
@pytest.mark.parametrize("tried", [False, True])
def test_a_candidate_that_blows_up_is_said_to_and_has_no_bar(
    tmp_path: Path, train: float, held: float, *, tried: bool
) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    weighed = synthetic_run.candidate("wind", train=train, held=held, error=math.inf)
    rows = [weighed, synthetic_run.candidate("hysteresis", train=4.0, held=1.0)]
    step = {"numbers": {"train": train, "held": held, "ahead": held}, "candidates": rows}
    what, code = ("wind", "finite") if tried else ("hysteresis", "training")
    results["loop"]["steps"] = [synthetic_run.decision("add", what, accepted=False, code=code, **step)]
    write_json(tmp_path / "results.json", results)
    # JSON has no number for what is infinite: the project's words stand there, and are read as they were.
    json.loads((tmp_path / "results.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert read_json(tmp_path / "results.json")["loop"]["steps"][0]["candidates"] == rows
    run = Run(tmp_path, read_json(tmp_path / "results.json"))
    ((_, first, outcome, *shown, _), _) = evidence.ranking_table(run).rows  # type: ignore[union-attr]
    assert (first, outcome, {*shown}) == ("wind", "blows up", {MISSING})
    (picture,) = draw_ranking(run)
    (axes,) = picture.figure.axes
    assert [p.get_width() for p in axes.patches] == [4.0, 1.0]
    assert axes.get_yticklabels()[0].get_text() == "wind\n(blows up)"
    assert axes.get_xlim()[1] < 100
    assert "Arrows" not in picture.caption


@pytest.mark.parametrize("most", [0.4, 5.0, 59.0, 61.0, 2e3, 4e6])
def test_an_axis_of_log_evidence_shows_the_odds_that_decide(most: float) -> None:
    axes = new_figure(2.0).subplots()
    nats_axis(axes, [most, -0.3 * most, None, -math.inf])
    left, right = axes.get_xlim()
    assert left < 0 < LoopSettings.nats < right
    assert most < right
    assert len([t for t in axes.get_xticks() if left <= t <= right]) >= 3


def test_an_error_that_grows_does_not_fall(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["loop"]["errors"]["after"]["holdout_inside"]["rms"] = 4e-3
    assert "goes from 2.98 to 4.00 mm" in headline(Run(tmp_path, results))


@pytest.mark.usefixtures("sketched")
def test_a_declared_model_that_blows_up_is_told_and_hides_nothing(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    before = results["loop"]["errors"]["before"]
    held = next(r["name"] for r in results["recordings"] if r["role"] == "holdout")
    for group in before.keys() - {"train"}:
        before[group] = dict.fromkeys(before[group], math.inf)
    results["loop"]["model_error"] |= {"before": math.inf, "share": 0.0}
    mechanics = next(s for s in results["loop"]["steps"] if s["action"] == "mechanics" and s["accepted"])
    mechanics["numbers"] = {}
    if results.get("clean"):
        next(iter(results["clean"].values()))["before"] = dict.fromkeys(("rms", "mean", "peak"), math.inf)
    write_json(tmp_path / "results.json", results)
    with xr.open_dataset(tmp_path / "trajectories.nc", group=held) as stored:
        dataset = stored.load()
    dataset["before"][100:] = 1e190
    dataset["before"][200:] = np.nan
    dataset.to_netcdf(tmp_path / "trajectories.nc", mode="a", group=held)
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert "falls from ∞ to 0.473" in page.translate(_PLAIN)
    assert "The motion blows up on the simpler mechanics." in page
    drawn = next(t for t in Run(tmp_path, results).trajectories if t.name == held).models["before"]
    assert np.isfinite(drawn[:100]).all()
    assert np.isnan(drawn[100:]).all()


@pytest.mark.usefixtures("undrawn")
def test_notes_stand_with_the_recordings(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["recordings"][0]["notes"] = ["'tip_x_m' is stuck for 29 samples from 3.3 s, while the system moves."]
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    data = (
        build_report(tmp_path)
        .read_text(encoding="utf-8")
        .partition('<section id="data">')[2]
        .partition("</section>")[0]
    )
    name = results["recordings"][0]["name"]
    assert f"<li>{name}: &#39;tip_x_m&#39; is stuck for 29 samples from 3.3 s, while the system moves.</li>" in data


def test_a_free_decay_is_shown_without_an_input(oscillator: Made) -> None:
    run = Run(*oscillator[:2])
    assert "output and input" in motion.draw_motion(run).caption
    run.__dict__["trajectories"] = tuple(replace(t, input=None) for t in run.trajectories)
    shown = motion.draw_motion(run)
    assert shown.caption.startswith("Measured: output of ")
    assert "input" not in shown.caption + shown.alt
    assert len(shown.figure.axes) == 1


@pytest.mark.usefixtures("undrawn")
def test_a_contradiction_is_part_of_the_answer(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    tried = {
        "id": "base_compliance", "parameters": {"c_b": {"value": 0.051, "sd": 0.002, "unit": "1"}}, "value": 8.09,
        "z": 0.1, "chi2": 812.0, "odds": 48.76, "reconciles": True,
    }  # fmt: skip
    check = {
        "parameter": "alpha", "unit": "s^-2", "value": 6.5, "sd": 0.01, "predicted": 8.1, "predicted_sd": 0.2,
        "z": -7.99, "odds": 28.5, "source": "the rig", "contradicts": True,
    }  # fmt: skip
    said = {
        "parameter": "alpha", "reconciling": ["base_compliance"], "tried": [tried], "sought": True, "gross": False,
        "overruled": None,
        "instead": [],
    }  # fmt: skip
    results["loop"]["contradiction"] = {"checks": [check], "contradictions": [said]}
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    text = _Reader(build_report(tmp_path).read_text(encoding="utf-8")).text
    answer, story_told = text.split("Why: how the answer was found")
    apart = "α = 6.500 ± 0.010 s⁻² contradicts the rig, 8.10 ± 0.20 (8 standard deviations apart); base compliance"
    for part in (answer, story_told):
        assert apart in part
    assert "48.8" in story_told
    assert "M. Evans, H. Moshonov, Bayesian Analysis 1 (2006) 893." in story_told


def test_methods_that_a_run_did_not_use_are_not_cited(arm: Made) -> None:
    cited = _Reader(arm[2]).text.split("and their sources")[1]
    assert "Theiler" in cited
    assert not re.search("Holm|Hunter|Alvarez", cited)


@pytest.mark.parametrize(
    "printed",
    [
        "0.045827 ± 0.000024",  # posterior mean and sd of xi
        "0.4748 to 0.4784",  # 90 % interval of beta
        "8.0931",  # final alpha
        "0.012815 ± 0.000023",  # friction found
        "at its bound",  # why tau_r has no interval
        "2.38",  # held-out mean before [mm]
        "0.378",  # held-out mean after [mm]
        "187\N{NARROW NO-BREAK SPACE}000",  # chi-square that friction removes
        "Odds of more than 10 000 to 1, probability 0.77, of the group more than 0.9999.",
        "Coulomb friction: more than 10 000 to 1, probability 0.77, of the group more than 0.9999",  # first screen
        "65.3",  # log odds of friction against model error
        "1.16 → 0.00913 mm, 0.79 % is left; up to 0.0450 mm counts as none",
        "Tried: encoder ripple",
        "The log evidence gains 4.20 nats in training, but only 0.700 on the held-out recordings.",
        "The log evidence is 7.25 nats lower on them.",
        "the best candidate promises a chi-square of 14.8, chance alone 20.4",
        "Coulomb friction, or quadratic drag in its place: their odds differ by less than 20 to 1.",
        "Search 2 beside Coulomb friction",
        "conditional on its selection",
        "0.0162",  # distance to the noise-free tip [mm]
        "−1.2",  # discrepancy of alpha with the elastica
        "∞",  # discrepancy of a prediction without spread
        "These recordings cannot tell it from quadratic drag.",
        "0.434 to 0.448",  # interval of gamma from the radius
        "8.791",  # alpha of the source paper beside it
        "28.3",  # the paper's mean position error of the linear model [mm]
        "test arm <1>",
        "discovery run rig.toml --out <out> & more",
    ],
)
def test_numbers_on_the_page(arm: Made, printed: str) -> None:
    assert printed.translate(_PLAIN) in _Reader(arm[2]).text.translate(_PLAIN)


def _cells(page: str, table: str) -> list[list[str]]:
    """Return the text of a table's rows."""
    found = re.search(rf'aria-labelledby="table-{table}"><thead>.*?<tbody>(.*?)</tbody>', page, re.DOTALL)
    assert found, table
    rows = re.findall("<tr>(.*?)</tr>", found[1])
    return [[_Reader(c).text.translate(_PLAIN) for c in re.findall("<td[^>]*>(.*?)</td>", row)] for row in rows]


def test_the_posterior_stands_beside_prior_fit_and_paper(arm: Made) -> None:
    rows = _cells(arm[2], "posterior")
    assert rows[1] == [
        "α", "linear stiffness", "s⁻²", "8.10097 ± 0.00033", "8.10043", "8.10097", "8.10151", "8.10097 ± 0.00033",
        "8.791",
    ]  # fmt: skip
    assert rows[4][8] == "–"  # the paper has no noise
    assert "paper, least squares" in arm[2]
    caption = re.search('id="table-posterior">(.*?)</p>', arm[2])
    assert caption
    assert "counts residuals as correlated as they are; that of the posterior (gaussian noise) does not." in caption[1]
    assert "Standard deviations of the posterior are those under gaussian noise." in arm[2]
    assert _cells(arm[2], "diagnostics")[1] == ["α", "1.0012", "5123", "4.7 × 10⁻⁶", "3.25"]


def test_a_narrow_screen_shows_values_before_words(arm: Made) -> None:
    found = re.search('<table class="stacked" aria-labelledby="table-posterior">.*?<tbody><tr>(.*?)</tr>', arm[2])
    assert found
    cells = re.findall(r'<td[^>]*style="order:(\d+)"(?: data-label="(.*?)")?>(.*?)</td>', found[1])
    shown = [(label, _Reader(text).text) for _, label, text in sorted(cells, key=lambda c: int(c[0]))]
    assert [text for _, text in shown[:3]] == ["ξ", "0.045827 ± 0.000024", "s⁻¹"]
    assert [label for label, _ in shown[3:6]] == ["5 %", "50 %", "95 %"]
    assert shown[-1] == ("", "viscous damping")


def test_the_noise_of_the_posterior_is_told_where_another_is_preferred(arm: Made) -> None:
    folder, results, page = arm
    told = page.index("The evidence prefers correlated noise, and the table says what the parameters are under it.")
    honest, naive = page.index('id="table-parameters"'), page.index('id="table-posterior"')
    assert page.index("<h2>The posterior") < told < honest < page.index("The parameters as they were sampled") < naive
    assert _cells(page, "parameters")[1][:7] == ["α", "linear stiffness", "s⁻²", "8.1010", "8.0969", "8.1050", "7.5"]
    assert '<a href="#noise">which noise</a>' in page
    assert '<h3 id="noise">' in page
    differs = " ".join(noise_differs(Run(folder, results)))
    assert "independent and Gaussian (gaussian noise)" in differs
    assert "the profiles and the check against the elastica" in differs
    assert "Under correlated noise the 90 % intervals overlap those of the draws." in differs
    assert "only one manoeuvre was fitted: a parameter of an incomplete model depends on the manoeuvre" in differs
    changed = json.loads(json.dumps(results))
    intervals = changed["noise"]["models"][0]["intervals"]
    intervals["alpha"] = [8.2, 8.3, 8.4]
    assert "the 90 % interval of α does not overlap" in " ".join(noise_differs(Run(folder, changed)))
    intervals["xi"] = [0.01, 0.02, 0.03]
    assert "the 90 % intervals of ξ and α do not overlap" in " ".join(noise_differs(Run(folder, changed)))
    same = {**results, "posterior": {**results["posterior"], "noise": "correlated"}}
    assert noise_differs(Run(folder, same)) == []
    close = json.loads(json.dumps(results))
    close["noise"]["models"][1]["log_evidence"] = close["noise"]["models"][0]["log_evidence"] - 2.9
    assert noise_differs(Run(folder, close)) == []
    assert "cannot tell correlated noise from gaussian noise" in noise_sentence(Run(folder, close))
    assert honest_table(Run(folder, close)) is None
    many = {**results, "recordings": [{"role": "train"}] * 3}
    assert "manoeuvre" not in " ".join(noise_differs(Run(folder, many)))


def test_whether_the_sampler_converged_is_told(arm: Made) -> None:
    folder, results, page = arm
    plain = _Reader(page).text.translate(_PLAIN)
    assert (
        "Yes: 4 independent ensembles of 16 walkers each; the worst R-hat is 1.0012 (ξ; limit 1.01); the fewest "
        "effective samples are 5120 (ξ); 120 steps after burn-in are 60 times the longest autocorrelation time, 2.00 "
        "steps (limit 50 times); accepted proposals by move: independence 88 % and stretch 46 %."
    ) in plain
    quick = Run(folder, results)
    quick.__dict__["sampling"] = {**quick.sampling, "method": "independence", "pareto_k": 0.1234}
    assert convergence_sentence(quick).startswith(
        "Yes: 4 independent chains by Metropolis’s rule from draws around the fit, Pareto k of their weights 0.12 "
        "(limit 0.5); the worst R-hat is 1.0012"
    )
    rows = [{**results["posterior"]["rows"][0], "r_hat": 1.02}]
    apart = Run(folder, {**results, "posterior": {"rows": rows}})
    assert convergence_sentence(apart).startswith("Not yet: ")
    short = Run(folder, results)
    short.__dict__["sampling"] = {**short.sampling, "steps": 100}
    assert convergence_sentence(short).startswith("Not yet: ")


def test_what_leans_on_its_prior_is_told(arm: Made) -> None:
    assert _cells(arm[2], "priors")[3] == [
        "γ", "normal, 0.4422 ± 0.0036", "0.877", "−0.346", "−34.6 %", "0.100", "10.0 %", "yes",
    ]  # fmt: skip
    assert _cells(arm[2], "priors")[0][2:] == ["more than 0.9999", "0.000", "0.0 %", "0.000", "0.0 %", "no"]
    assert "The recordings alone do not fix γ: other priors would give another answer." in arm[2]
    assert _cells(arm[2], "profiles")[:2] == [
        ["ξ", "below 0.04586", "0.045788 to 0.045866"],
        ["α", "8.10047 to 8.10147", "8.1004 to 8.1015"],
    ]


def test_no_prior_that_matters_is_told_too(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    for row in results["posterior"]["priors"]:
        row["sensitive"] = False
    assert posterior.prior_sentence(Run(tmp_path, results)).startswith("No parameter leans on its prior")


def test_parameters_that_depend_on_each_other_are_told(arm: Made) -> None:
    assert "<li>α and β: −0.97, one rises where the other falls.</li>" in arm[2]


def test_how_many_readings_the_bands_hold(arm: Made) -> None:
    rows = _cells(arm[2], "coverage")
    assert rows[0] == ["train_a", "fitted", "tip x", "400", "91.2 %", "10.0 mm"]
    assert rows[2] == ["hold_in", "held out", "tip x", "400", "87.6 %", "0.500 m"]


def test_the_noise_is_chosen_by_evidence(arm: Made) -> None:
    rows = _cells(arm[2], "noise")
    assert [row[:3] for row in rows] == [
        ["correlated (preferred)", "0 ± 0.02", "0.12"],
        ["gaussian (sampled)", "−321.0 ± 0.02", "0.91, unreliable"],
    ]
    assert [len(row) for row in rows] == [7, 7]  # one column for each parameter of the model
    assert rows[1][4] == "8.1004 to 8.1015"
    assert "The evidence prefers correlated noise: intervals are 7.5 times as wide" in arm[2]
    candidates = _cells(arm[2], "model_evidence")
    assert [(row[3], row[5]) for row in candidates] == [("0 ± 0.02", "1.25"), ("−55.50 ± 0.02", "6.80")]
    assert "held out, rms [mm]" in arm[2]
    assert "correlated noise for all, because what the smaller model lacks is correlated" in arm[2]
    assert "Not asked, because it does not apply: input (no recorded input" in arm[2]


@pytest.mark.parametrize(
    ("pending", "said"),
    [
        ({"because": "running"}, "This was written before the posterior and the evidence were there, which follow."),
        (
            {"because": "time", "effective": 1234.0, "wanted": 4000.0},
            "The time limit left out the posterior and the evidence. 1234 of 4000 effective samples were there.",
        ),
        ({"because": "time"}, "The time limit left out the posterior and the evidence. With more time, the same"),
        ({"because": "It did not converge."}, "Left out: the posterior and the evidence. It did not converge."),
    ],
)
@pytest.mark.usefixtures("undrawn")
def test_what_is_still_to_come_is_told_at_the_top(pending: dict[str, Any], said: str, tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    results["pending"] = {"left_out": ["the posterior", "the evidence"], **pending}
    write_json(tmp_path / "results.json", results)
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert f"<strong>Not all is here.</strong> {said}" in page
    assert page.index(said) < page.index("<h2 ")
    assert "There is no posterior yet, see above." in page
    assert "This run sampled no posterior." not in page


@pytest.mark.usefixtures("undrawn")
def test_what_was_not_asked_for_is_not_missing(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    results["pending"] = {"left_out": ["the posterior"], "because": "asked"}
    write_json(tmp_path / "results.json", results)
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert "Not all is here" not in page
    assert "This run sampled no posterior." in page


@pytest.mark.usefixtures("undrawn")
def test_a_loop_has_a_page_without_the_rest_of_a_run(tmp_path: Path) -> None:
    synthetic_run.write_loop_run(tmp_path)
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert "This is the page of a closed loop" in page
    assert "A loop samples no posterior." in page
    assert "results.json" not in page
    assert "What sparse regression proposes" not in page


def test_the_page_over_all_runs_leads_to_the_page_of_a_loop(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path / "whole")
    for name in ("with_page", "without"):
        (tmp_path / name).mkdir()
        write_json(tmp_path / name / "loop.json", results["loop"])
    (tmp_path / "with_page" / "report.html").write_text("page")
    page = build_index(tmp_path).read_text(encoding="utf-8")
    assert '<a href="with_page/report.html">With page</a>' in page
    assert "<h2>Without</h2>" in page


def test_a_card_shows_verdict_picture_and_the_error_before_and_after(arm: Made, tmp_path: Path) -> None:
    shutil.copytree(arm[0], tmp_path / "whole")
    page = build_index(tmp_path).read_text(encoding="utf-8")
    reader = _Reader(page)
    assert '<p class="verdict explained">Explained</p>' in page
    assert "2.98 → 0.473 mm" in reader.text
    assert "Coulomb friction or quadratic drag" in reader.text
    (image,) = (a for t, a in reader.tags if t == "img")
    assert (image["src"] or "").startswith("data:image/png;base64,")
    assert "measured, declared and final model" in (image["alt"] or "")


def test_white_noise_stays_in_the_band_and_an_echo_leaves_it() -> None:
    noise = np.random.default_rng(3).normal(size=4000)
    alone = residual.correlation(noise, noise, 40)
    assert alone[0] == pytest.approx(1.0)
    assert np.mean(np.abs(alone[1:]) < 2.576 / np.sqrt(noise.size)) > 0.9
    late = residual.correlation(np.roll(noise, 7), noise, 40)
    assert int(np.argmax(late)) == 7
    gaps = np.where(np.arange(noise.size) % 9, noise, np.nan)
    assert residual.correlation(gaps, gaps, 3)[0] == pytest.approx(1.0)
    assert not residual.correlation(np.ones(50), noise[:50], 5).any()


def test_the_fit_is_all_without_an_error_and_none_by_the_mean() -> None:
    measured = np.sin(np.linspace(0.0, 20.0, 500))
    assert residual.fit_per_cent(measured, np.zeros(500)) == 100.0
    assert residual.fit_per_cent(measured, measured.mean() - measured) == pytest.approx(0.0, abs=1e-9)
    half = residual.fit_per_cent(measured, 0.5 * (measured - measured.mean()))
    assert half == pytest.approx(50.0)


def test_small_readings_are_shown_in_small_units(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    chart = chart_data(Run(tmp_path, results))
    assert chart
    (channel,) = json.loads(str(chart))[0]["channels"]
    assert (channel["unit"], channel["small"], channel["factor"]) == ("mV", "mV", 1.0)
    assert channel["noise"] == pytest.approx(0.2)
    assert channel["measured"]["low"] == pytest.approx(-50.0, rel=1e-3)


def test_the_equation_has_its_numbers_and_no_two_of_them_touch() -> None:
    from discovery.report.answer import _with_numbers as with_printed

    def _with_numbers(formula: str, values: dict[str, float]) -> str:
        return with_printed(formula, {name: significant(value, 4) for name, value in values.items()})

    body = r"\alpha \delta_0 + \alpha_m"
    told = _with_numbers(body, {r"\alpha": 8.093, r"\delta_0": 0.5})
    assert _text(block(told)) == "8.093·0.5000+αm"
    assert _text(block(_with_numbers(body, {r"\delta_0": -0.5}))) == "α(−0.5000)+αm"
    stiffness = r"x + \beta q"
    assert _with_numbers(stiffness, {r"\beta": -25722.1}) == r"x - 25\,720 q"
    taken = stiffness.replace("+", "-")
    assert _with_numbers(taken, {r"\beta": -2.5}) == "x + 2.500 q"
    # A sum in brackets keeps them.
    assert with_printed(r"x + \left(- b - q\right) y", {"b": "0.2"}) == r"x + \left(- 0.2 - q\right) y"
    assert _with_numbers("v_c^{2}", {"v_c": 7.974e-5}) == r"\left(7.974\times 10^{-5}\right)^{2}"
    assert _with_numbers("2 w_h^{2}", {"w_h": 0.1007}) == r"2 \cdot 0.1007^{2}"
    touching = _with_numbers(body, {r"\alpha": 7.974e-5, r"\delta_0": 0.5e-4})
    assert touching == r"7.974\times 10^{-5} \cdot 5.000\times 10^{-5} + \alpha_m"
    # A letter of an index, of a word or below dots is none of the symbols.
    parts = r"x_g + k_{\mathrm{g}} + \dot{g} + \mathrm{g g} + \gamma + \text{ the g} + \frac{g}{2}"
    assert _with_numbers(parts, {"g": 9.81}) == parts.replace(r"\frac{g}", r"\frac{9.810}")


@pytest.fixture
def shaken() -> str:
    """Return the name of the base of a body of known mass on a shaken table."""
    table = SystemDeclaration(
        name="carriage on a table",
        coordinates={"x": "m"},
        constants={"mass": Constant("kg", 2.0), "stiffness": Constant("N / m", 800.0, free=True)},
        kinetic="mass*dot(x)^2/2",
        potential="stiffness*(x - table)^2/2",
        forces={"x": "-stiffness*table/10"},
        input=("table", "m"),
        output="x",
        places={"body": "x", "spring": "x - table", "x": "x"},
    )
    return declare(table)


def test_the_final_equation_of_a_declared_system_is_complete(shaken: str, tmp_path: Path) -> None:
    """Known constants have their numbers, and a place is defined where an effect acts there."""
    from discovery.report.answer import equation_lines

    results = synthetic_run.write_oscillator_run(tmp_path)
    effects = ["cubic_stiffness_at_spring", "input_dead_zone"]
    model = {**Model(shaken, tuple(effects), {"mass": 2.0}).to_dict(), "effects": effects}
    fitted = {"stiffness": 900.0, "beta_spring": 6e5, "w_u": 0.1}
    numbers = {n: {"value": value, "sd": 0.1, "unit": "1"} for n, value in fitted.items()}
    results["loop"]["model"]["after"] |= {"model": model, "parameters": numbers}
    results["rig"]["kind"] = "system"
    found = [_text(broken(tex)).translate(_PLAIN) for _, tex in equation_lines(Run(tmp_path, results))]
    assert found[:5] == [
        "T=2.000x.22", "V=900.0(x−table)22", "Qx=−900.0table10", "spring=x−table", "V=600000spring44",
    ]  # fmt: skip
    assert found[5].startswith("table→table")


def test_what_an_effect_takes_from_its_place_is_told(shaken: str) -> None:
    *_, line = model_formulas(Model(shaken, ("hysteresis_at_spring",), {"mass": 2.0}).to_dict(), "system")
    assert line.latex.endswith(r", \quad k_{\mathrm{spring}} \text{ the stiffness at spring}")


def test_a_rate_of_a_word_has_its_dot_above_all_of_it() -> None:
    (mover,) = ElementTree.fromstring(block(dotted(letter("table"), 1))).iter("mover")
    assert ["".join(part.itertext()) for part in mover] == ["table", "."]
    assert dotted(letter("table"), 2) == r"\ddot{\mathrm{table}}"


def test_the_reading_of_two_modes_stands_beside_their_equations() -> None:
    lines = model_formulas({"base": "oscillator", "effects": ["linear_stiffness", "second_mode"]}, "oscillator")
    assert [_text(block(line.latex)) for line in lines if line.needed] == ["q..+αq=gu", "yread=q+z2"]


def test_minus_signs_are_operators() -> None:
    for effect_id, effect in catalogue().items():
        for system in effect.systems:
            assert "-" not in _text(block(effect_formula(effect, system))), effect_id


def test_states_of_a_shaken_system_have_names_of_its_own(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    error = synthetic_run.model_error(1e-3, 8e-5, "m", "deflection", "time")
    results["loop"] = _loop(results, "unexplained") | {"model_error": error}
    results["rig"]["kind"] = "base_excited"
    assert "it depends on deflection relative to the base and time." in headline(Run(tmp_path, results))


@pytest.mark.parametrize("name", ["output", "deflection"])
def test_one_state_has_one_name_on_a_page(tmp_path: Path, name: str) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    left = {"model_error": synthetic_run.model_error(1e-3, 8e-5, "m", name, "time")}
    results["loop"] = _loop(results, "unexplained") | left
    run = Run(tmp_path, results)
    assert "it depends on output and time." in headline(run)
    assert ["depends on", "output and time", ""] in evidence.model_error_table(run).rows


def test_what_was_tried_twice_is_told_once(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    loop = _loop(results, "unexplained")
    tried = synthetic_run.decision("add", "wind", accepted=False, code="size", numbers=synthetic_run.odds(50.0, 9.0))
    other = {**tried, "numbers": synthetic_run.odds(60.0, 9.0, size=3.0)}
    told = story.steps(Run(tmp_path, {**results, "loop": {**loop, "steps": [tried, other, tried]}}))
    assert len(told) == 2


def test_a_force_that_cannot_be_reconstructed_is_said_to_be_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def grows(*_: Any) -> Any:
        raise ComputationError("The motion grows.")

    monkeypatch.setattr("discovery.diagnosis.missing_force.reconstruct", grows)
    recorded = SimpleNamespace(experiments=[SimpleNamespace(coordinate_unit="m")])
    fit = SimpleNamespace(problem=SimpleNamespace(units=SimpleNamespace(time=1.0), bench=recorded))
    with pytest.raises(ComputationError, match="The missing force could not be reconstructed: the motion grows"):
        missing_force(fit)  # type: ignore[arg-type]


def test_a_formula_becomes_latex() -> None:
    (line,) = model_formulas({"base": "oscillator", "effects": ["cubic_stiffness", "quadratic_drag"]}, "oscillator")
    assert line.latex == r"\ddot{q} + \beta q^{3} + c_2 \dot{q} \left|{\dot{q}}\right| = g u"


def test_an_error_counts_as_seen_by_a_chart_of_small_integers(arm: Made) -> None:
    run = Run(*arm[:2])
    (first, *_), shown = json.loads(chart_data(run) or ""), run.held_out[0]
    assert first["name"] == shown.name
    packed = first["channels"][0]["left"]["after"]
    whole = np.frombuffer(base64.b64decode(packed["data"]), "<i2").astype(float)
    values = packed["low"] + packed["step"] * (whole + 32767)
    left = (shown.models["after"] - shown.measured)[:, 0]
    good = whole != -32768
    assert np.array_equal(good, np.isfinite(left))
    assert np.abs(values - left)[good].max() <= packed["step"]


@pytest.mark.usefixtures("sketched")
def test_a_posterior_alone_has_no_further_sections(tmp_path: Path) -> None:
    """Results of a run that did not study its posterior."""
    results = synthetic_run.write_arm_run(tmp_path)
    for key in ("priors", "profiles", "correlations", "autocorrelation", "coverage"):
        del results["posterior"][key]
    del results["noise"], results["evidence"]
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    page = build_report(tmp_path).read_text(encoding="utf-8")
    for title in ("Which noise", "Prior, likelihood", "depend on each other?", "converge?", "what is read?"):
        assert title not in page
    assert "corner" in {p.stem for p in (tmp_path / "figures").iterdir()}


def test_draws_are_told_apart_by_ensemble_and_walker(tmp_path: Path) -> None:
    values = np.arange(4.0 * 5 * 3).reshape(4, 5, 3)
    group = arranged({"xi": values, "rate_0_init[a]": values + 1.0, "rate_0_init[b]": values + 2.0})
    synthetic_run._write_groups(tmp_path / "posterior.nc", {"posterior": group})
    draws = Run(tmp_path, {}).draws
    assert list(draws) == ["xi", "rate_0_init[a]", "rate_0_init[b]"]
    assert np.array_equal(draws["xi"], values)
    assert np.array_equal(draws["rate_0_init[b]"], values + 2.0)


@pytest.mark.usefixtures("undrawn")
def test_a_changed_result_changes_the_page(arm: Made, tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    results["loop"]["errors"]["after"]["holdout_inside"]["mean"] = 9.8765e-4
    results["posterior"]["rows"][1]["mean"] = 7.65432
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    text = _Reader(build_report(tmp_path).read_text(encoding="utf-8")).text
    for printed in ("0.988", "7.65432 ± 0.00033"):
        assert printed in text
        assert printed not in _Reader(arm[2]).text


def test_tables_hold_the_numbers_of_the_results(made: Made) -> None:
    folder, results, _ = made
    known = np.array(sorted(set(_walk(results))))
    counts = {"search", "size", "chi2_removed"}
    checked = 0
    for path in (folder / "tables").glob("*.csv"):
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert rows, path.name
        for row in rows:
            for column, cell in row.items():
                if column not in counts and re.fullmatch(r"-?\d[\d.]*(e-?\d+)?", cell):
                    assert float(cell) in known, (path.name, column, cell)
                    checked += 1
    assert checked > 60


def test_another_rig_is_not_set_beside_the_paper(tmp_path: Path) -> None:
    from discovery.report.measures import fits_table

    results = synthetic_run.write_arm_run(tmp_path)
    beside = fits_table(Run(tmp_path, results))
    results["rig"]["quantities"]["length"]["value"] = 0.7
    alone = fits_table(Run(tmp_path, results))
    assert beside is not None
    assert alone is not None
    assert "paper" in beside.header
    assert "paper" not in alone.header
    assert "28.3" not in alone.html()


@pytest.mark.usefixtures("sketched")
def test_optional_files_may_be_missing(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    for name in ("amplitude.nc", "laws.nc", "posterior.nc", "trajectories.nc"):
        (tmp_path / name).unlink()
    results |= {"discovery": None, "radius": None, "clean": None, "fit_errors": {}}
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    # A file that lacks a group is as good as one that lacks the curve.
    synthetic_run._write_groups(tmp_path / "amplitude.nc", {"before": xr.Dataset()})
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert {p.stem for p in (tmp_path / "figures").iterdir()} == {
        "errors", "spectrum", "model_error", "odds", "ranking_1", "ranking_2", "correlations",
    }  # fmt: skip
    assert "What sparse regression proposes" not in page


@pytest.mark.slow
def test_the_same_run_gives_the_same_files(arm: Made, tmp_path: Path) -> None:
    synthetic_run.write_arm_run(tmp_path)
    assert build_report(tmp_path).read_text(encoding="utf-8") == arm[2]
    assert not list(tmp_path.rglob(".*"))


@pytest.mark.usefixtures("sketched")
def test_the_users_own_style_is_left_alone(tmp_path: Path) -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    synthetic_run.write_oscillator_run(tmp_path)
    build_report(tmp_path)
    assert dict(mpl.rcParams) == before


def test_no_results(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not the folder of a finished run"):
        build_report(tmp_path)
    (tmp_path / "results.json").write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read as JSON"):
        build_report(tmp_path)
    (tmp_path / "results.json").write_text('{"rig": {}}', encoding="utf-8")
    with pytest.raises(InputError, match="lacks recordings, loop, provenance"):
        build_report(tmp_path)
    assert not (tmp_path / "report.html").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_broken_file_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(figures.SECTIONS, "elastica", (laws.draw,))
    synthetic_run.write_arm_run(tmp_path)
    (tmp_path / "laws.nc").write_bytes(b"no netCDF")
    with pytest.raises(InputError, match=r"laws\.nc cannot be read"):
        build_report(tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_reading_the_report_package_needs_no_drawing_library() -> None:
    import subprocess
    import sys

    code = "import sys, discovery.report; print('matplotlib' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


# Numbers and units


def test_a_chance_is_told_no_finer_than_anybody_can_tell() -> None:
    assert [chance(p) for p in (None, 0.0, 6e-247, 0.031)] == ["–", "less than 0.0001", "less than 0.0001", "0.031"]


@pytest.mark.parametrize(
    ("value", "sd", "printed"),
    [
        (8.79068, 0.00124, "8.7907 ± 0.0012"),
        (-0.001477, 1.2e-5, "−0.001477 ± 0.000012"),
        (1234.5, 67.0, "1234 ± 67"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (1.91234e7, 3.1e4, "(1.9123 ± 0.0031) × 10⁷"),
        (2.5e-6, 1e-8, "(2.500 ± 0.010) × 10⁻⁶"),
        (9.9996, 0.0999, "10.00 ± 0.10"),
        (0.4472136, None, "0.44721"),
        (0.4472136, 0.0, "0.44721"),
        (None, 0.1, "–"),
        (float("nan"), 0.1, "–"),
    ],
)
def test_uncertain(value: float | None, sd: float | None, printed: str) -> None:
    assert re.sub("\N{NARROW NO-BREAK SPACE}", " ", uncertain(value, sd)) == printed


@pytest.mark.parametrize(
    ("value", "printed"),
    [
        (0.0458137, "0.0458"), (-3.0, "−3.00"), (123456.0, "123 000"), (0, "0"), (None, "–"), (float("nan"), "–"),
        (float("-inf"), "−∞"), (9.996, "10.0"), (6.0e-247, "6.00 × 10⁻²⁴⁷"),
    ],
)  # fmt: skip
def test_significant(value: float | None, printed: str) -> None:
    assert significant(value).replace("\N{NARROW NO-BREAK SPACE}", " ") == printed


@given(st.floats(min_value=1e-12, max_value=1e12), st.integers(2, 6), st.sampled_from([-1, 1]))
def test_printed_numbers_are_the_numbers(size: float, digits: int, sign: int) -> None:
    text = significant(sign * size, digits).replace("\N{NARROW NO-BREAK SPACE}", "").replace("\N{MINUS SIGN}", "-")
    mantissa, _, power = text.partition("×10")
    exponent = int(power.translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")) or 0)
    assert float(mantissa) * 10.0**exponent == pytest.approx(sign * size, rel=0.5000001 * 10.0 ** (1 - digits))


def test_a_sentence_has_its_powers_of_ten_raised() -> None:
    told = prose("3 terms explain all but 1.2e-06 of the variance of recording a1e-5b")
    assert told.translate(_PLAIN) == "3 terms explain all but 1.2 × 10⁻⁶ of the variance of recording a1e-5b"


def test_a_change_is_told_in_one_unit_while_both_ends_have_digits_in_it() -> None:
    told = {"m": scale_for_change("m", 9.08e-4, 4.93e-5).symbol, "far": scale_for_change("m", 0.05, 5e-7).symbol}
    assert told == {"m": "mm", "far": "µm"}
    assert scale_for_change("m", math.inf, 4.93e-5).symbol == "µm"


def test_intervals_and_units() -> None:
    assert interval(0.4337006, 0.4481064) == "0.434 to 0.448"
    assert interval(None, 1.0) == "–"
    assert unit_text("s^-2 q^-2", "V").split() == ["s⁻²", "V⁻²"]
    assert unit_text("1") == ""
    assert (scale_for("m", 4e-4).symbol, scale_for("m", 4e-5).symbol, scale_for("kg", 1e-3).symbol) == (
        "mm",
        "µm",
        "kg",
    )
    assert scale_for("V", 7e-3).factor == 1e3


@given(st.integers(10, 5000), st.integers(0, 2**31))
def test_decimated_curves_keep_their_extremes(n: int, seed: int) -> None:
    values = np.random.default_rng(seed).standard_normal(n)
    time, kept = decimate(np.arange(n, dtype=float), values, limit=100)
    assert kept.size <= max(n if n <= 100 else 0, 102)
    assert kept.min() == values.min()
    assert kept.max() == values.max()
    assert np.all(np.diff(time) >= 0)
    assert np.array_equal(values[time.astype(int)], kept)


# Mathematics


def _text(mathml: str) -> str:
    return "".join(ElementTree.fromstring(f"<p>{mathml}</p>".replace("&#x2061;", "")).itertext())


@pytest.mark.parametrize(
    ("term", "text"),
    [
        ("delta^2 theta_t'", "δ2θ.t"),
        ("theta_t'|theta_t'|", "θ.t|θ.t|"),
        ("sign(theta_t')", "sign(θ.t)"),
        ("sin(2 delta)", "sin(2δ)"),
        ("1 - a delta^2 + kappa delta^2 theta_t'^2", "1−aδ2+κδ2θ.t2"),
        ("u", "u"),
    ],
)
def test_terms_become_mathematics(term: str, text: str) -> None:
    assert _text(block(written_term(term))) == text


@pytest.mark.parametrize("broken", ["delta^", "(delta", "delta)", "a $ b", "^2"])
def test_broken_terms_are_refused(broken: str) -> None:
    with pytest.raises(InputError, match="formula"):
        written_term(broken)


def test_every_effect_that_sparse_regression_names_has_a_term_that_can_be_written() -> None:
    from discovery.sindy.library import _effects

    for name in (*_effects("delta", "theta_t'"), *_effects("q", "q'")):
        assert _text(block(written_term(name)))


@pytest.mark.parametrize("effect_id", catalogue())
def test_every_effect_has_a_formula(effect_id: str) -> None:
    effect = catalogue()[effect_id]
    for system in effect.systems:
        body = effect_formula(effect, system)
        assert ElementTree.fromstring(block(body)).find(".//mi") is not None
        for parameter in effect.parameters():
            head = parameter.name.partition("_")[0]
            assert head not in _text(block(body)) or len(head) <= 2, (effect_id, head)


@pytest.mark.parametrize("base", base_names())
def test_every_base_has_formulas(base: str) -> None:
    system = get_base(base).system
    effects = [e for e, effect in catalogue().items() if system in effect.systems and e not in get_base(base).provides]
    for made in model_formulas({"base": base, "effects": effects}, system):
        assert made.words
        assert ElementTree.fromstring(block(made.latex)).find(".//mi") is not None


def test_the_inertias_of_an_arm_stand_before_its_acceleration() -> None:
    effects = ["linear_stiffness", "tip_rotary_inertia"]
    equation, deflection = model_formulas({"base": "constant_radius", "effects": effects}, "flexible_arm")
    left = r"\left(\frac{9 J}{4} + 1\right) \ddot{\theta}_t + \alpha \delta - \frac{3 J \ddot{\theta}_m}{4}"
    assert equation.latex == f"{left} = 0"
    assert deflection.words == "with the deflection"


def test_the_papers_equation_is_written_as_in_the_paper() -> None:
    lines = model_formulas({"base": "constant_radius", "effects": synthetic_run.ARM_DECLARED}, "flexible_arm")
    assert [_text(block(line.latex)) for line in lines] == ["θ..t+ξθ.t+αδ+βδ3=0", "δ=θt−θm", "ρt/l=cos(γδ)"]


def test_an_oscillator_is_written_in_its_own_coordinate() -> None:
    effects = ["viscous_damping", "linear_stiffness", "cubic_stiffness", "quadratic_drag"]
    (line,) = model_formulas({"base": "oscillator", "effects": effects}, "oscillator")
    assert _text(block(line.latex)) == "q..+ξq.+αq+βq3+c2q.|q.|=gu"


def test_what_nothing_drives_equals_zero() -> None:
    effects = ["viscous_damping", "gravity_torque"]
    free = {"base": "oscillator", "effects": effects, "known": {"g": 0.0, "g_0": 9.8}}
    (line,) = model_formulas(free, "oscillator")
    assert _text(block(line.latex)) == "q..+ξq.+gcsin(q)−gscos(q)=0"
    assert drive_symbols(free) == {}
    assert drive_symbols({**free, "known": {}}) == {"g": "acceleration per unit of input", "u": "recorded input"}
    assert set(drive_symbols({"base": "base_excited", "effects": effects})) == {"p", "u"}
    assert drive_symbols({"base": "falling_body", "effects": []}) == {}
    assert drive_symbols({"base": "constant_radius", "effects": ["linear_stiffness"]}) == {}


def test_the_input_is_defined_beside_its_equation(oscillator: Made) -> None:
    assert "Here g is the acceleration per unit of input, u is the recorded input." in _Reader(oscillator[2]).text


@pytest.mark.usefixtures("undrawn")
def test_the_posterior_of_the_final_model_stands_below_its_equation(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    rows = synthetic_run._posterior_rows({"xi": (14.0, 0.1, "s^-1")})
    results["posterior"] = {"subject": "after", "status": "", "rows": rows}
    results["rig"]["kind"] = "pendulum"
    models, check = results["loop"]["model"], {
        "parameter": "k_g", "unit": "s^-2", "value": 9.81, "sd": 0.01, "predicted": 9.8, "predicted_sd": 0.1,
        "z": 0.1, "odds": -3.4, "source": "g / L of the rig", "contradicts": False,
    }  # fmt: skip
    final = {**models["after"]["model"], "effects": [*models["after"]["model"]["effects"], "quadratic_drag"]}
    models["after"] = {**models["after"], "model": final}
    results["loop"]["contradiction"] = {"checks": [check], "contradictions": []}
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    told = _Reader(build_report(tmp_path).read_text(encoding="utf-8")).text.partition("The parameters")[2]
    assert told.index("q..+ξq.+αq+βq3+c2q.|q.|=gu") < told.index("The declared model") < told.index("Parameters. 5 to")
    assert "The posterior is that of the final model, after the loop." in told
    assert "No fitted value contradicts what the rig predicts." in told
    assert "k_g = √(g_c² + g_s²)" in told
    assert "the rig and the elastica" not in told


def test_what_effects_change_together_is_one_law() -> None:
    """Two offsets of the camera, two delays, two gains of the drive: what is read is what all of them leave."""
    effects = ["angle_offset", "sensor_delay", "input_gain", "position_scale", "time_base_error", "input_offset"]
    law = ["radius_law", "radius_quartic"]
    lines = model_formulas({"base": "constant_radius", "effects": effects + law}, "flexible_arm")[2:]
    texts = [_text(block(line.latex)) for line in lines]
    assert texts[0] == "xread=(s+1)(xcos(θ0)−ysin(θ0)),yread=(s+1)(xsin(θ0)+ycos(θ0))"
    assert re.fullmatch(r"tread=t−dtt−j\(.*\)−τ", texts[1])
    assert texts[2:] == ["θm→θh+θm(kh+1)", "ρt/l=r4δ4+cos(γδ)"]
    assert lines[3].words == f"{get_effect('radius_law').title()}. {get_effect('radius_quartic').title()}"


def test_an_inner_law_acts_on_each_place_of_the_rod() -> None:
    memory = {"effects": ["linear_stiffness", "hysteresis", "asymmetric_viscous_damping"]}
    (equation, _, hysteresis) = model_formulas({"base": "constant_radius", **memory}, "flexible_arm")
    assert _text(block(equation.latex)) == "θ..t+αδ+3∫01(1−s)(αhbzh)ds+avξ|θ.t|=0"
    assert _text(block(hysteresis.latex)) == "P=3∫01(−αhbzhb.)ds,z.h=b.−zh2b.+zh|zh||b.|2wh2,b=13∂θ∂s"
    line, inner = model_formulas({"base": "oscillator", **memory}, "oscillator")
    assert _text(block(inner.latex)) == "P=−αhbzhq.,z.h=q.−zh2q.+zh|zh||q.|2wh2"
    assert _text(block(line.latex)) == "q..+αq+αhbzh+avξ|q.|=gu"


def test_a_joint_turns_the_rod() -> None:
    lines = model_formulas({"base": "elastica", "effects": ["linear_stiffness", "base_backlash"]}, "flexible_arm")
    assert _text(block(lines[-1].latex)).startswith("θ→θ+p,p=3cpb+wpb")


def test_a_discovered_input_stands_on_the_right(oscillator: Made) -> None:
    found = re.search('aria-label="Equation" data-tex="[^"]+">(.*?)</div>', oscillator[2])
    assert found
    assert _text(found[1]) == "q..+8.12q+0.0456q.−0.432q3=−2.50u"


def test_a_discovered_equation_of_an_arm(arm: Made) -> None:
    found = re.search('aria-label="Equation" data-tex="[^"]+">(.*?)</div>', arm[2])
    assert found
    assert _text(found[1]) == "θ..t+8.12δ+0.0456θ.t−0.432δ3=0"


def test_quantities_of_the_noise_say_what_they_mean(arm: Made) -> None:
    folder, results, _ = arm
    rows = results["posterior"]["rows"]
    sampled = [{**rows[0], "name": n, "unit": "1", "meaning": f"meaning of {n}"} for n in ("nu", "share[output]")]
    run = Run(folder, {**results, "posterior": {**results["posterior"], "rows": [*rows, *sampled]}})
    table = posterior_table(run)
    cells = {record["name"]: row[1] for record, row in zip(table.raw_rows, table.rows, strict=True)}
    assert cells["nu"] == "meaning of nu"
    assert cells["share[output]"] == "meaning of share[output]"
    assert cells["sigma"].startswith("noise, sd")
    assert "noise" not in cells["alpha"]


def test_the_error_stands_before_the_equation_and_its_button_copies_all_lines(made: Made) -> None:
    first = made[2][made[2].index('<div class="first">') :]
    places = [first.index(f'class="part {name}"') for name in ("error", "equation", "numbers", "series")]
    assert places == sorted(places)
    assert first[: places[2]].count("data-tex=") == 1


def test_a_formula_may_be_broken_before_its_outermost_signs() -> None:
    parts = broken(r"a - \left(b + 1\right) = -2").split("<wbr/>")
    assert [_text(part) for part in parts] == ["a", "−(b+1)", "=−2"]
    assert all(ElementTree.fromstring(part).tag == "math" for part in parts)
    assert 'form="infix"' in parts[1]
    # The bars of a size stay around it.
    assert [_text(part) for part in broken(r"a + q \left|{q - b}\right|").split("<wbr/>")] == ["a", "+q|q−b|"]


def test_nothing_in_a_name_is_markup_or_a_command() -> None:
    for name in ("<script>alert(1)</script>", r"\input{file}", "a&lt;b&gt;", "x_<b>$%#", "{{}}_}{"):
        drawn = inline(letter(name))
        assert {node.tag for node in ElementTree.fromstring(drawn).iter()} <= {
            "math",
            "mrow",
            "mi",
            "mn",
            "mtext",
            "msub",
        }
        assert not re.search(r"\\(?!mathrm)|[<>&$%#]", letter(name))
    drawn = inline(r"\text{ at <b> &lt;i&gt;}")
    assert [node.tag for node in ElementTree.fromstring(drawn).iter()] == ["math", "mrow", "mtext"]


def test_words_are_one_element_and_factors_have_a_thin_space_between_them() -> None:
    (word,) = ElementTree.fromstring(block(r"\mathrm{stiffness}")).iter("mtext")
    assert word.text == "stiffness"
    tags = [node.tag for node in ElementTree.fromstring(block(r"\xi \dot{\theta}_t^{2} \cos{\left(q \right)}"))[0]]
    assert tags == ["mi", "mspace", "msubsup", "mspace", "mi", "mrow"]


def test_the_final_equation_of_an_arm_has_one_sum_for_each_energy() -> None:
    from discovery.report.effect_formulas import meanings

    model = {"base": "elastica_4", "effects": ["viscous_damping", "linear_stiffness", "table_tilt", "coulomb_friction"]}
    values = {"xi": 0.04, "alpha": 8.0, "phi_x": -0.001, "phi_y": 0.002, "length": 1.0, "f_c": 0.1, "v_c": 0.001}
    lines = [f.latex for f in model_formulas(model, "flexible_arm", values) if f.needed]
    assert [tex.partition(" = ")[0] for tex in lines[1:]] == ["V", "D"]
    assert lines[1] == r"V = 8.0 U + 0.009807 \bar{x}_g - 0.01961 \bar{y}_g"
    told = meanings(" ".join(lines))
    assert all(words in told for words in ("kinetic energy of the rod and the tip", "the speed of the tip", "along y"))


def test_numbers_before_a_term_are_multiplied_and_have_the_digits_of_their_deviation(tmp_path: Path) -> None:
    from discovery.report.answer import equation_lines

    results = synthetic_run.write_oscillator_run(tmp_path)
    numbers = {"alpha": (86.85, 0.26), "delta_0": (-0.0202, 0.0024), "xi": (0.000578, 0.0012)}
    model = {"base": "oscillator", "effects": ["linear_stiffness", "equilibrium_offset", "viscous_damping"]}
    fitted = {n: {"value": v, "sd": sd, "unit": "1"} for n, (v, sd) in numbers.items()}
    results["loop"]["model"]["after"] |= {"model": model, "parameters": fitted}
    ((_, tex), *_) = equation_lines(Run(tmp_path, results))
    assert "86.85 q + 1.754" in tex
    assert r"6\times 10^{-4}" in tex
    assert r"\left(-" not in tex


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"effects": 3, "offers": 4, "cost": 1.0}, "the model holds 3 added effects, as many as the search may add"),
        ({"effects": 1, "offers": 1, "cost": 32.0}, "cost 32 times those of the start, and beyond 8 times no further"),
        ({"effects": 2, "offers": 9, "cost": 1.0}, "the catalogue was tried beside 9 sets"),
        ({}, "a limit of the search’s work was reached"),
    ],
)
def test_the_limit_that_ended_the_search_is_told(numbers: dict[str, float], said: str) -> None:
    limits = {"most_effects": 3, "most_offers": 9, "most_cost": 8.0} if numbers else {}
    step = synthetic_run.decision("stop", accepted=True, code="budget", numbers={**numbers, **limits})
    assert said in sentences.decision_sentence(step)


def test_an_added_effect_that_another_replaced_is_told_with_it(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    decision = synthetic_run.decision
    results["loop"] = _loop(results, "explained", {**DELAY, "id": "hysteresis"}) | {
        "steps": [decision("exchange", "wind", "hysteresis", accepted=True, numbers={"odds": 5.1})]
    }
    run = Run(tmp_path, results)
    assert story.fate(run, ["wind"]) == ", later exchanged for hysteresis"
    assert story.fate(run, ["table_tilt"]) == ", later dropped"
    assert story.fate(run, ["hysteresis"]) == ""


def test_pages_of_one_coordinate_name_no_paper_of_an_arm(arm: Made, oscillator: Made) -> None:
    assert "source paper, equation" not in _Reader(arm[2]).text
    assert "source paper" not in _Reader(oscillator[2]).text
    with (oscillator[0] / "tables" / "sources.csv").open(encoding="utf-8", newline="") as file:
        assert next(row["role"] for row in csv.DictReader(file)) == "declared"


def test_a_unit_of_one_has_no_brackets_and_an_empty_column_is_left_out(made: Made) -> None:
    text = _Reader(made[2].partition("<script")[0]).text
    assert "[]" not in text
    assert "( " not in text
    unsure = any(p.get("reason") for p in made[1]["loop"]["model"]["after"]["parameters"].values())
    assert ("why no interval" in text) == unsure


@pytest.mark.parametrize(("largest", "power"), [(3.0, 0), (0.02, 0), (6e-3, -3), (4e-5, -5), (2e6, 6), (0.0, 0)])
def test_small_and_large_draws_are_told_in_a_power_of_ten(largest: float, power: int) -> None:
    from discovery.report.figures.posterior import _tens

    assert _tens(np.array([0.0, -largest])) == power


@pytest.mark.parametrize(
    ("held", "ahead", "said"),
    [
        (-4.25, -3.0, "but loses 4.25 on"),
        (1.25, 2.0, "but only 1.25 on"),
        (
            -25.6,
            14.2,
            "but loses 25.6 on the held-out recordings over the intervals of its parameters; "
            "by its estimate alone it gains 14.2",
        ),
        (
            0.0,
            2.0,
            ", and nothing on the held-out recordings over the intervals of its parameters; "
            "by its estimate alone it gains 2.00 there",
        ),
        (-1e-9, 0.0, ", and nothing on the held-out"),
        (200.0, -381.0, "gains 50.0 nats in training and 200 held out, but by its estimate alone it loses 381 there"),
        (19.6, 0.0, "gains 50.0 nats in training and 19.6 held out, but by its estimate alone it gains nothing there"),
        (0.0, -3.0, "and nothing held out, and by its estimate alone it loses 3.00 there"),
        (200.0, 1.25, "but by its estimate alone it gains only 1.25 there"),
    ],
)
def test_what_is_missed_held_out_is_told(held: float, ahead: float, said: str) -> None:
    numbers = {**synthetic_run.odds(50.0, held), "ahead": ahead}
    step = synthetic_run.decision("add", "wind", accepted=False, code="held_out", numbers=numbers)
    assert said in sentences.decision_sentence(step)


@pytest.mark.parametrize("code", ["accepted", "unknown"])
@pytest.mark.parametrize(
    ("train", "held", "said"),
    [
        (114.0, -93.5, "gains 114 nats in training and loses 93.5 held out"),
        (50.0, 4.25, "gains 50.0 nats in training and 4.25 held out"),
        (-3.0, -4.0, "loses 3.00 nats in training and 4.00 held out"),
        (-3.0, 4.0, "loses 3.00 nats in training and gains 4.00 held out"),
    ],
)
def test_gains_and_losses_of_evidence_are_told_as_such(code: str, train: float, held: float, said: str) -> None:
    step = synthetic_run.decision("add", "wind", accepted=True, code=code, numbers=synthetic_run.odds(train, held))
    assert said in sentences.decision_sentence(step)


def test_the_name_of_a_rig_does_not_say_where_its_recordings_are_from(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    results["rig"]["name"] = "twin rotor, simulated by no one"
    assert origin(Run(tmp_path, results)) == ""
    results["data_note"] = "A twin made them."
    assert origin(Run(tmp_path, results)) == "A twin made them."


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rolling_loss = 100 N s m^-1 ends far off", "rolling_loss = 100 N s m⁻¹ ends far off"),
        ("loss = 100 N s ends far off", "loss = 100 N s ends far off"),
        ("f = 3 N ends far off", "f = 3 N ends far off"),
        ("f_c = 3 N ends far off", "f<sub>c</sub> = 3 N ends far off"),
        ("k3 ends far off", "k3 ends far off"),
        ("alpha ends far off", "α ends far off"),
        ("sensor_delay ends far off", "Sensor delay ends far off"),
        ("a model error is left", "A model error is left"),
        ("half of what is left", "Half of what is left"),
    ],
)
def test_a_sentence_begins_with_a_capital_and_identifiers_keep_their_letters(text: str, said: str) -> None:
    assert sentence(page_prose(text)) == said
