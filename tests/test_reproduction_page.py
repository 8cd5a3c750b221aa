"""The page of the reproduction, made from studies that are real but small: what it shows is what the studies found."""

from __future__ import annotations

import base64
import csv
import inspect
import json
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_browser
from discovery_datasets import twin
from discovery_datasets.manoeuvres import Manoeuvre
from discovery_datasets.twin import ArmRig, TwinMotion
from test_browser import browser, opened  # noqa: F401

from benchmarks.paper import errata
from benchmarks.paper.errata_motion import time_scale
from benchmarks.paper.findings import typeset
from benchmarks.paper.items import paper_items
from benchmarks.paper.page import build_page
from benchmarks.paper.stand import Stand, stand
from benchmarks.paper.studies import (
    claims,
    comparison,
    dynamics,
    misprints,
    motor,
    normalisation,
    sensitivity,
    steps,
)
from benchmarks.paper.study import STUDIES, run_studies
from discovery.foundation.errors import InputError
from discovery.report.references import paper_numbers

#: Its small studies take half a minute; `make reproduce` builds the same page and its checks see it.
pytestmark = pytest.mark.slow
DURATION = 7.0
#: Figures that a section of the page has beside Figures 5 to 13.
OTHERS = {
    "coupling_torque", "driven_motor", "error_ratios", "force_map", "freed", "friction", "gear_ratio", "general_motion",
    "ladder", "massless_limit", "normalisation", "sensitivity_duration", "sensitivity_rod_mass", "sensitivity_speed",
    "shapes",
}  # fmt: skip
#: Items with a number of the paper: what the paper prints, and where a study has ours (factor to the row's unit last).
NUMBERS: dict[tuple[str, str], tuple[str, tuple[str, ...], float]] = {
    ("P11", "largest deflection"): ("0.850 rad", ("excursion", "deflection"), 1),
    ("P11", "variation of the radius"): ("70.0 mm", ("excursion", "radius_variation"), 1e3),
    ("P12", "linear ξ"): ("0.0458 s⁻¹", ("linear", "values", "xi"), 1),
    ("P12", "linear ω²"): ("8.967 s⁻²", ("linear", "values", "alpha"), 1),
    ("P12", "cubic ξ"): ("0.0458 s⁻¹", ("cubic", "values", "xi"), 1),
    ("P12", "cubic α"): ("8.791 s⁻²", ("cubic", "values", "alpha"), 1),
    ("P12", "cubic β"): ("0.514 s⁻²", ("cubic", "values", "beta"), 1),
    ("P12", "γ"): ("0.4462", ("gamma", "value"), 1),
    ("P13", "angle error, mean, linear"): ("16.7 mrad", ("errors", "linear", "angle", "mean"), 1e3),
    ("P13", "angle error, mean, cubic"): ("4.80 mrad", ("errors", "cubic", "angle", "mean"), 1e3),
    ("P14", "radius error, maximum, constant radius"): ("17.6 mm", ("errors", "linear", "radius", "peak"), 1e3),
    ("P14", "radius error, maximum, law (16)"): ("1.80 mm", ("law_on_recorded_deflection", "peak"), 1e3),
    ("P15", "position error, mean, linear"): ("28.3 mm", ("errors", "linear", "position", "mean"), 1e3),
    ("P15", "position error, mean, cubic spring"): ("19.2 mm", ("errors", "cubic", "position", "mean"), 1e3),
    ("P15", "position error, mean, with radius law"): ("5.30 mm", ("errors", "with_radius", "position", "mean"), 1e3),
    ("P15", "position error, peak, linear"): ("69.2 mm", ("errors", "linear", "position", "peak"), 1e3),
    ("P15", "position error, peak, with radius law"): ("25.3 mm", ("errors", "with_radius", "position", "peak"), 1e3),
}  # fmt: skip
#: Formulas of this page are text, so that only the checks of a page without drawn mathematics apply.
CHECKS = [
    check
    for name, check in vars(test_browser).items()
    if name.startswith("test_") and name != "test_mathematics_is_drawn"
]


class _Reader(HTMLParser):
    """Visible text, elements with their attributes, and every table as rows of cells by its label."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.text, self.elements, self.tables, self.identified = "", [], {}, {}  # type: ignore[var-annotated]
        self._stack: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self.elements.append((tag, attributes))
        if tag not in ("meta", "link", "img", "br"):
            self._stack.append(tag)
        if tag == "table":
            self._rows: list[list[str]] = []
            self.tables[attributes.get("aria-label") or attributes["aria-labelledby"]] = self._rows
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        while self._stack and self._stack.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if "style" in self._stack:
            return
        self.text += data
        if {"td", "th"} & set(self._stack):
            self._rows[-1][-1] += data


@dataclass(frozen=True)
class Made:
    folder: Path
    results: dict[str, Any]
    html: str
    reader: _Reader


def _short(*arguments: Any, **settings: Any) -> Stand:
    return stand(*arguments, **{**settings, "duration": DURATION * 100 / settings.get("rate", 100)})


def _remembering() -> Callable[..., TwinMotion]:
    """Return a simulation that is not repeated: most studies begin with the paper's rig and manoeuvre."""
    known: dict[Any, TwinMotion] = {}

    def simulate(arm: ArmRig, move: Manoeuvre, time: np.ndarray, **settings: Any) -> TwinMotion:
        key = (arm, move, time.tobytes(), repr(settings))
        if key not in known:
            known[key] = twin.simulate(arm, move, time, **settings)
        return known[key]

    return simulate


def _serial(work: Callable[[Any], Any], items: Any) -> list[Any]:
    return [work(item) for item in items]


def _reduce(patch: pytest.MonkeyPatch) -> None:
    """Make every study small: short recordings, and one or two cases where it has many."""
    for module in (claims, comparison, misprints, motor, normalisation, sensitivity, steps):
        patch.setattr(module, "stand", _short)
    simulate = _remembering()
    for place in ("stand", "errata_motion", "studies.dynamics", "studies.motor"):
        patch.setattr(f"benchmarks.paper.{place}.simulate", simulate)
    for module in (normalisation, sensitivity):
        patch.setattr(module, "in_parallel", _serial)
    patch.setattr(sensitivity, "SPEEDS", (1.0, 1.4))
    patch.setattr(sensitivity, "DURATIONS", (6.0, 7.0))
    patch.setattr(sensitivity, "ROD_MASSES", (0.003, 0.01245))
    listed = {(t.changed, t.value): t for t in normalisation.trials()}
    kept = (("length", 0.5), ("stiffness", 3.0), ("both masses", 0.4), ("mass ratio", 0.1), ("mass ratio", 0.8))
    trials = [listed[case] for case in (*kept, ("amplitude", 0.5), ("amplitude", 1.0))]
    patch.setattr(normalisation, "trials", lambda: trials)
    patch.setattr(dynamics, "RODS", (0.01245, 0.003))
    patch.setattr(dynamics, "MASS_RATIOS", (0.2845, 0.05))
    patch.setattr(dynamics, "TIME", np.arange(201) / 100)
    patch.setattr(motor, "_TIME", np.arange(201) / 100)
    patch.setattr(motor, "_BANDWIDTHS", (10.0, 30.0))
    study = partial(motor.encoder_as_input, gear_ratios=(20.0, 50.0), time=np.arange(201) / 100)
    patch.setattr(motor, "encoder_as_input", study)
    patch.setattr(errata, "time_scale", lambda: time_scale([(1.6, 2.5, 0.7)], duration=1.5))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        _reduce(patch)
        patch.chdir(folder.parent)
        run_studies(Path(folder.name), lambda _: None)
    html = build_page(folder).read_text(encoding="utf-8")
    results = json.loads((folder / "studies.json").read_text(encoding="utf-8"))
    return Made(folder, results, html, _Reader(html))


@pytest.fixture(scope="module")
def page(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page alone, away from its studies: one file is all that a reader needs."""
    alone = tmp_path_factory.mktemp("alone") / "report.html"
    alone.write_text(made.html, encoding="utf-8")
    return alone


def _leaves(value: Any) -> Iterator[float]:
    """Every number of nested results."""
    for item in value.values() if isinstance(value, dict) else value:
        if isinstance(item, (dict, list)):
            yield from _leaves(item)
        elif isinstance(item, (int, float)) and not isinstance(item, bool):
            yield float(item)


def _at(numbers: Any, place: tuple[str, ...]) -> float:
    for name in place:
        numbers = numbers[name]
    return numbers


def _number(text: str) -> float:
    return float(text.replace("−", "-").replace("\N{NARROW NO-BREAK SPACE}", "").split()[0])


def _csv(made: Made, name: str) -> list[dict[str, str]]:
    with (made.folder / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# --- the items of the paper


def test_every_study_has_numbers_that_are_numbers(made: Made) -> None:
    assert list(made.results) == ["provenance", *STUDIES]

    def missing(value: Any, place: str) -> Iterator[str]:
        if value is None:
            yield place
        elif isinstance(value, (dict, list)):
            for name, item in value.items() if isinstance(value, dict) else enumerate(value):
                yield from missing(item, f"{place}.{name}")

    found = [place for study in STUDIES for place in missing(made.results[study], study)]
    # A parameter at its bound has no standard deviation.
    assert [place for place in found if ".loop.sd." not in place] == []


def test_every_item_and_finding_is_on_the_page(made: Made) -> None:
    paper, findings = made.reader.tables["paper"][1:], made.reader.tables["findings"][1:]
    keys = [row[0] for row in paper]
    assert list(dict.fromkeys(keys)) == [f"P{n}" for n in range(1, 18)]
    assert keys == sorted(keys, key=lambda key: int(key[1:]))
    assert [row[0] for row in findings] == [*(f"erratum {c}" for c in "abcdef"), "g", "h", "i", *["misprint"] * 3]
    for row in (*paper, *findings):
        assert len(row) == 6
        assert all(cell.strip() for cell in row), row
        assert not any(re.search(r"\b(nan|NaN|None|null|inf)\b", cell) for cell in row), row
        # A difference may not exist where no number is printed; everything else must.
        assert "–" not in (row[2], row[3], row[5]), row
        assert not re.search(r"[{}]|theta|alpha|sqrt", " ".join(row)), row


def test_every_printed_number_stands_beside_ours(made: Made) -> None:
    rows = {(row[0], row[1]): row[2:5] for row in made.reader.tables["paper"][1:]}
    assert {key for key, row in rows.items() if key[0] in ("P11", "P12", "P13", "P14", "P15")} == NUMBERS.keys()
    for key, (printed, place, factor) in NUMBERS.items():
        paper, here, difference = rows[key]
        assert paper == printed, key
        ours = factor * _at(made.results["comparison"]["printed"], place)
        digits = len(re.sub(r"^0\.0*|\.", "", printed.split()[0]))
        assert _number(here) == pytest.approx(ours, rel=0.51 * 10.0 ** (1 - digits)), key
        assert here.partition(" ")[2] == printed.partition(" ")[2], key
        assert difference == f"{100 * (ours / _exact(printed) - 1):+.1f} %".replace("-", "−"), key


def _exact(printed: str) -> float:
    """The paper's number with every digit that it prints."""
    rounded = {"8.967 s⁻²": 8.9671, "8.791 s⁻²": 8.7907, "0.514 s⁻²": 0.5139}
    return rounded.get(printed, _number(printed))


@pytest.mark.parametrize("key", NUMBERS, ids=lambda key: " ".join(key))
def test_a_row_follows_its_study(made: Made, key: tuple[str, str]) -> None:
    """No number of ours is typed: another result gives another row."""
    results = deepcopy(made.results)
    _, place, _ = NUMBERS[key]
    holder = results["comparison"]["printed"]
    for name in place[:-1]:
        holder = holder[name]
    holder[place[-1]] *= 3
    before, after = (next(i for i in paper_items(r) if (i.key, i.what) == key) for r in (made.results, results))
    assert after.paper == before.paper
    assert after.ours != before.ours
    assert after.difference != before.difference


def test_findings_say_what_their_checks_found(made: Made) -> None:
    rows = {row[0]: row for row in made.reader.tables["findings"][1:] if row[0] != "misprint"}
    for key in "abcdef":
        erratum = made.results["misprints"][key]
        assert rows[f"erratum {key}"][5] == typeset(erratum["sentence"])
    assert "13/210 = 0.0619" in rows["g"][3]
    assert "0.0609 and 0.4429" in rows["g"][3]
    freed = {r["model"]: r for r in made.results["steps"]["freed"]}
    plain, held = (
        1e3 * freed[n]["errors"]["trained"]["angle_rms"] for n in ("none of the terms", "all held at first principles")
    )
    assert f"{plain:.1f} mrad rms without" in rows["h"][3]
    assert f"{held:.2g} mrad held" in rows["h"][3]
    (exact,) = [r for r in made.results["steps"]["ladder"] if (r["model"], r["how"]) == ("exact, 3 modes", "rig")]
    worst = max(e["mean"] for e in exact["errors"].values())
    assert rows["i"][4] == f"at most {1e3 * worst:.2g} mm"
    assert worst < 0.15e-3


@pytest.mark.parametrize(
    ("plain", "page"),
    [
        ("rho theta_t''^2", "ρ θ̈ₜ²"),
        ("3 EI/l^2 theta_t'", "3 EI/l² θ̇ₜ"),
        ("t_n = t / sqrt(m)", "tₙ = t / √m"),
        ("sqrt(EI / (m l^3))", "√(EI / (m l³))"),
        ("-R(theta_m) Phi = m p''", "−R(θₘ) Φ = m p̈"),
        ("within 2e-10 of 8.79 1/s^2", "within 2 × 10⁻¹⁰ of 8.79 s⁻²"),
        ("a rod of -3.3 g, the rod's mass", "a rod of −3.3 g, the rod’s mass"),
        ("33/140 of a tip-mass", "33/140 of a tip-mass"),
    ],
)
def test_plain_formulas_are_typeset(plain: str, page: str) -> None:
    assert typeset(plain) == page


def test_the_headline_has_the_numbers_of_the_study(made: Made) -> None:
    errors = made.results["comparison"]["printed"]["errors"]
    (headline,) = [line for line in made.reader.text.splitlines() if "mean tip error" in line]
    numbers = re.findall(r"([\d.]+) mm", headline)
    places = (
        ("with_radius", "position"),
        ("first_principles", "noise_free"),
        ("with_radius", "noise_free"),
        ("after_loop", "noise_free"),
    )
    ours = [1e3 * errors[model][kind]["mean"] for model, kind in places]
    assert numbers[0] == "5.3"
    for text, value in zip(numbers[1:], ours, strict=True):
        assert float(text) == pytest.approx(value, abs=0.51 * 10.0 ** -len(text.partition(".")[2]))


# --- tables and figures


def test_tables_and_files_hold_the_same_rows(made: Made) -> None:
    files = {p.stem for p in (made.folder / "tables").iterdir()}
    shown = {name.removeprefix("table-") for name in made.reader.tables}
    assert shown == files
    assert len(files) == 11
    for name in files:
        rows = _csv(made, name)
        table = made.reader.tables[name if name in ("paper", "findings") else f"table-{name}"]
        assert len(rows) == len(table) - 1 > 0, name
        assert len({len(row) for row in table}) == 1, name
        assert len({len(row) for row in rows}) == 1, name
        for row in rows:
            assert None not in row, name
            assert not {"nan", "None", "inf", "-inf"} & set(row.values()), name


def test_every_number_of_a_table_is_one_of_its_study(made: Made) -> None:
    sources = {
        "calibrations": [made.results["comparison"], paper_numbers()], "ladder": [made.results["steps"]],
        "freed": [made.results["steps"]], "sensitivity": [made.results["sensitivity"]],
        "other_arms": [made.results["normalisation"]], "mattiasson": [made.results["statics"]],
        "friction": [made.results["claims"]], "general": [made.results["dynamics"]], "motor": [made.results["motor"]],
    }  # fmt: skip
    assert {*sources, "paper", "findings"} == {p.stem for p in (made.folder / "tables").iterdir()}
    empty = {
        "calibrations": {"unit", "paper", "twin_printed", "twin_calibrated", "after_loop", "first_principles"},
        "freed": {"c_cen", "c_cor", "c_rad", "A"},
    }
    for name, studies in sources.items():
        numbers = [v for study in studies for v in _leaves(study)]
        if name == "motor":
            numbers += [float(bandwidth) for bandwidth in made.results["motor"]["by_bandwidth"]]
        known = np.outer([1.0, 1e2, 1e3], numbers)
        counted = 0
        for row in _csv(made, name):
            for column, cell in row.items():
                if cell == "":
                    assert column in empty.get(name, set()), (name, column)
                    continue
                try:
                    value = float(cell)
                except ValueError:
                    continue
                counted += 1
                assert np.isclose(known, value, rtol=1e-12, atol=0).any(), (name, column, value)
        assert counted > 10, name


def test_rows_of_tables_are_the_rows_of_their_study(made: Made) -> None:
    steps_ = made.results["steps"]
    for row, rung in zip(_csv(made, "ladder"), steps_["ladder"], strict=True):
        assert (row["model"], row["how"]) == (rung["model"], rung["how"])
        for where in ("trained", "inside", "beyond"):
            for size in ("mean", "peak"):
                assert float(row[f"{where}_{size}_mm"]) == pytest.approx(1e3 * rung["errors"][where][size])
    names = {"alpha": "alpha", "beta": "beta", "c_cen": "c_cen", "c_cor": "c_cor", "c_rad": "c_rad", "A": "A"}
    for row, terms in zip(_csv(made, "freed"), steps_["freed"], strict=True):
        assert row["terms"] == terms["model"]
        for column, name in names.items():
            value = terms["values"].get(name)
            assert (float(row[column]) if row[column] else None) == (value and pytest.approx(value))
    varied = [(name, r) for name in ("speed", "duration", "rod_mass") for r in made.results["sensitivity"][name]]
    for row, (name, numbers) in zip(_csv(made, "sensitivity"), varied, strict=True):
        assert row["changed"] == f"{name}={numbers[name]:g}"
        for column in ("deflection", "xi", "omega2", "alpha", "beta", "gamma"):
            assert float(row[column]) == numbers[column]
        for column in ("angle_linear", "angle_cubic", "position_linear", "position_cubic", "position_with_radius"):
            assert float(row[column]) == pytest.approx(1e3 * numbers[column])
    for row, trial in zip(_csv(made, "other_arms"), made.results["normalisation"]["trials"], strict=True):
        assert row["arm"] == f"{trial['changed']} {trial['value']:g}"
        for model, error in trial["errors"].items():
            assert float(row[model]) == pytest.approx(100 * error)


def test_calibrations_stand_in_their_columns(made: Made) -> None:
    rows = {row["quantity"]: row for row in _csv(made, "calibrations")}
    both = made.results["comparison"]
    for column, calibration in (("twin_printed", "printed"), ("twin_calibrated", "calibrated")):
        mean = both[calibration]["errors"]["with_radius"]["position"]["mean"]
        assert float(rows["position, mean: with radius law"][column]) == pytest.approx(1e3 * mean)
    for column in ("after_loop", "first_principles"):
        mean = both["printed"]["errors"][column]["position"]["mean"]
        assert float(rows["position, mean: exact arm"][column]) == pytest.approx(1e3 * mean)
    assert float(rows["position, mean: with radius law"]["paper"]) == pytest.approx(5.3)
    assert float(rows["cubic: α"]["twin_calibrated"]) == both["calibrated"]["cubic"]["values"]["alpha"]
    assert float(rows["cubic: α"]["paper"]) == 8.7907
    assert float(rows["cubic: α"]["first_principles"]) == pytest.approx(8.093, abs=5e-4)


def test_every_figure_is_embedded(made: Made) -> None:
    files = {p.stem: p.read_bytes() for p in (made.folder / "figures").iterdir()}
    assert files.keys() == {f"fig_{n:02d}" for n in range(5, 14)} | OTHERS
    images = [attributes for tag, attributes in made.reader.elements if tag == "img"]
    assert len(images) == len(files) == made.html.count("<figcaption>")
    embedded = set()
    for image in images:
        head, _, data = image["src"].partition(",")
        assert head == "data:image/svg+xml;base64"
        content = base64.b64decode(data)
        ElementTree.fromstring(content)
        embedded.add(content)
        assert len(image["alt"]) > 20
    assert embedded == set(files.values())


def test_nothing_refers_to_another_place(made: Made) -> None:
    for tag, attributes in made.reader.elements:
        assert tag not in ("script", "iframe", "object", "embed"), tag
        for name in ("src", "href", "srcset"):
            value = attributes.get(name) or ""
            assert value == "" or value.startswith(("data:", "#")), (tag, value[:80])
    pictures = b"".join(p.read_bytes() for p in (made.folder / "figures").iterdir()).decode()
    tables = "".join(p.read_text(encoding="utf-8") for p in (made.folder / "tables").iterdir())
    plain = re.sub(r"base64,[A-Za-z0-9+/=]+", "", made.html)
    here = {str(made.folder), str(Path(__file__).parents[1]), str(Path.home()), sys.prefix}
    for text in (plain, pictures, tables, json.dumps(made.results)):
        assert not any(place in text for place in here)
        assert not re.search(r"(?<![\w.<-])/(home|root|tmp|work|usr|var|Users)/|file:|[A-Z]:\\", text)
    assert "url(" not in plain
    assert f"python -m benchmarks.paper {made.folder.name}" in made.reader.text


def test_a_page_built_again_is_the_same(made: Made) -> None:
    studies = {p: p.read_bytes() for p in (made.folder / "studies").iterdir()}
    assert build_page(made.folder).read_text(encoding="utf-8") == made.html
    assert {p: p.read_bytes() for p in (made.folder / "studies").iterdir()} == studies
    assert not list(made.folder.rglob(".*"))


def test_a_page_of_incomplete_studies_is_refused(made: Made, tmp_path: Path) -> None:
    (tmp_path / "studies.json").write_text(json.dumps(made.results), encoding="utf-8")
    with pytest.raises(InputError, match=r"comparison\.nc is missing; remove comparison\.json"):
        build_page(tmp_path)
    less = {name: numbers for name, numbers in made.results.items() if name not in ("steps", "motor")}
    (tmp_path / "studies.json").write_text(json.dumps(less), encoding="utf-8")
    with pytest.raises(InputError, match="lacks steps, motor; run"):
        build_page(tmp_path)
    assert not (tmp_path / "report.html").exists()


# --- a reader's browser


@pytest.mark.browser
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__.removeprefix("test_"))
def test_in_a_browser(check: Callable[..., None], request: pytest.FixtureRequest, opened: Any) -> None:  # noqa: F811
    check(**{name: request.getfixturevalue(name) for name in inspect.signature(check).parameters})
