"""Nothing that a file holds is executed or becomes markup: names from rig files, recordings and results are data."""

from __future__ import annotations

import ast
import base64
import hashlib
import json
import pickle
import re
import shutil
import subprocess
import sys
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from synthetic_run import write_oscillator_run
from test_cli import call
from test_faults import RIG, swing

from discovery import report
from discovery.equations.model import Model
from discovery.export import FittedModel, to_numpy, to_sympy_file
from discovery.foundation.errors import InputError
from discovery.foundation.io import read_table
from discovery.report import build_report

#: Each would do something where it is pasted into code, markup or mathematics.
HOSTILE = [
    '"""; open("pwned", "w") #',
    "'''\nimport os; open('pwned', 'w') #",
    "\\end{align*}\\input{secret}",
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "]]></style></svg><svg onload=alert(1)>",
    "{{ 7 * 7 }}{% include 'x' %}",
    "$\\frac{$ %s%n {0.__class__}",
    "javascript:alert(1)//${x}`y`",
    "$(touch pwned) `touch pwned` ; touch pwned",
]
ASSETS = Path(report.__file__).parent / "assets"
_TAGS = {"script", "iframe", "object", "embed", "link", "base", "form", "svg", "foreignobject"}


class Page(HTMLParser):
    """What a browser would make of a page: its tags with their attributes, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def harmless(page: str) -> Page:
    """Check that a page can do nothing, whatever names it shows."""
    read = Page(page)
    for tag, attributes in read.tags:
        own = {
            "link": [{"rel": "icon", "href": "data:,"}],
            "script": [{}, {"type": "application/json", "id": "chart-data"}],
        }
        assert tag not in _TAGS or attributes in own.get(tag, []), tag
        assert not [name for name in attributes if name.startswith("on")], (tag, attributes)
        for name in ("src", "href"):
            assert not (attributes.get(name) or "").strip().lower().startswith("javascript"), attributes
    policies = [a for t, a in read.tags if t == "meta" and (a.get("http-equiv") or "") == "Content-Security-Policy"]
    assert len(policies) == 1
    assert "default-src 'none'" in (policies[0]["content"] or "")
    # A script runs by the hash of its own text alone; the data of the chart are of a type that no browser runs.
    fixed = {p.read_text(encoding="utf-8") for p in ASSETS.glob("*.js")}
    texts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert set(texts) <= fixed
    hashes = [base64.b64encode(hashlib.sha256(t.encode()).digest()).decode() for t in texts]
    allowed = re.search("script-src ([^;]*);", policies[0]["content"] or "")
    assert (allowed[1].split() if allowed else []) == [f"'sha256-{h}'" for h in hashes]
    return read


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    HOSTILE,
    ids=range(len(HOSTILE)),
)
def test_hostile_names_are_shown_and_do_nothing(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recording = tmp_path / f"{name.replace('/', ':')}.csv"
    swing(0.2).to_csv(recording, index=False)
    swing(0.15, n=390).to_csv(tmp_path / "hold.csv", index=False)
    rig, out = tmp_path / "rig.toml", tmp_path / "out"
    text = RIG.format(unit="rad", file="train.csv")
    rig.write_text(text.replace('"a pendulum"', json.dumps(name.replace("\n", " "))))
    said = call(
        capsys, "run", rig, "--train", recording, "--holdout", "hold.csv", "--out", out, "--quiet", "--no-posterior",
        "--note", name,
    )  # fmt: skip
    assert said.status == 0, said.err
    page = harmless((out / "report.html").read_text())
    words = " ".join(" ".join(page.words).split())
    assert " ".join(name.split()) in words
    for picture in (out / "figures").glob("*.svg"):
        tree = ElementTree.parse(picture)
        tags = {element.tag.rpartition("}")[2] for element in tree.iter()}
        assert not tags & {"script", "foreignObject", "a"}, picture
        assert not [a for element in tree.iter() for a in element.attrib if a.lower().startswith("on")]
    for file in out.rglob("*.json"):
        json.loads(file.read_text())
    assert call(capsys, "export", out, "--out", out).status == 0
    for file in ("model.py", "model_sympy.py"):
        tree = ast.parse((out / file).read_text())
        assert not [n for n in ast.walk(tree) if isinstance(n, ast.Import) and {a.name for a in n.names} & {"os"}]
        subprocess.run([sys.executable, out / file], check=True, cwd=out)
    if shutil.which("gcc"):
        syntax = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "model.c"]
        subprocess.run(syntax, check=True, cwd=out)
    with zipfile.ZipFile(out / "model.fmu") as archive:
        description = ElementTree.fromstring(archive.read("modelDescription.xml"))
        assert all(re.fullmatch(r"[\w./]+", member) and ".." not in member for member in archive.namelist())
    tags = {
        "fmiModelDescription",
        "CoSimulation",
        "SourceFiles",
        "File",
        "UnitDefinitions",
        "Unit",
        "DefaultExperiment",
    }
    tags |= {"ModelVariables", "ScalarVariable", "Real", "ModelStructure", "Outputs", "InitialUnknowns", "Unknown"}
    assert {element.tag for element in description.iter()} <= tags
    latex = [line for line in (out / "model.tex").read_text().splitlines() if not line.startswith("%")]
    assert "secret" not in "".join(latex)
    assert not [*tmp_path.rglob("*pwned")]


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("name", ["".join(HOSTILE), "../../../outside", "x" * 400])
def test_a_page_of_altered_results_does_nothing(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b" / "c"
    write_oscillator_run(folder)
    text = (folder / "results.json").read_text()
    content = json.loads(text)
    content["rig"]["name"] = content["data_note"] = name
    content["provenance"]["command"] = name
    for effect in content["loop"]["effects"]:
        effect["ambiguous_with"] = [name]
    content["loop"]["test"] = name
    for recording in content["recordings"]:
        recording["notes"] = [name]
    (folder / "results.json").write_text(json.dumps(content))
    before = {path for path in tmp_path.rglob("*") if folder not in path.parents}
    harmless(build_report(folder).read_text())
    assert {path for path in tmp_path.rglob("*") if folder not in path.parents} == before


@pytest.mark.parametrize("key", ["name", "effect", "unit", "status", "verdict", "reason"])
@pytest.mark.usefixtures("undrawn")
def test_no_text_of_the_results_becomes_markup(key: str, tmp_path: Path) -> None:
    write_oscillator_run(tmp_path)
    text = (tmp_path / "results.json").read_text()
    hostile = json.dumps("<img src=x onerror=alert(1)>")
    changed = re.sub(rf'"{key}": "[^"]*"', lambda _: f'"{key}": {hostile}', text)
    (tmp_path / "results.json").write_text(changed)
    try:
        page = build_report(tmp_path)
    except (InputError, KeyError, ValueError, StopIteration):
        return  # what the page cannot be made of
    harmless(page.read_text())


class Touch:
    """A pickle that does something when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mat", ".h5"])
def test_no_recording_is_unpickled(suffix: str, tmp_path: Path) -> None:
    path, pwned = tmp_path / f"x{suffix}", tmp_path / "pwned"
    path.write_bytes(pickle.dumps(Touch(pwned)))
    with pytest.raises(InputError):
        read_table(path)
    if suffix == ".parquet":
        pd.DataFrame({"t": np.arange(3.0), "y": [pickle.dumps(Touch(pwned))] * 3}).to_parquet(path)
        with pytest.raises(InputError, match="not a number"):
            read_table(path).numbers("y")
    if suffix == ".h5":
        import h5py

        with h5py.File(path, "w") as file:
            file["y"] = np.void(pickle.dumps(Touch(pwned)))
        with pytest.raises(InputError):
            read_table(path)
    assert not pwned.exists()


def told_and_done(text: str) -> tuple[str, str]:
    """Return what a module says of itself, and what it does."""
    module = ast.parse(text)
    assert isinstance(module.body[0], ast.Expr)
    return ast.get_docstring(module) or "", ast.dump(ast.Module(module.body[1:], []))


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_an_exported_file_does_the_same_whatever_the_names(name: str) -> None:
    model, values = Model("oscillator", ("viscous_damping", "linear_stiffness")), {"xi": 0.1, "alpha": 9.0, "g": 1.0}

    def fitted(name: str) -> FittedModel:
        sources = {"rig": {"name": name, "sha256": "0" * 64}, "data": [{"source": name, "sha256": "1" * 64}]}
        return FittedModel(model, values, initial={name: (0.1, 0.0)}, provenance={"discovery": "1", **sources})

    for write in (to_numpy, to_sympy_file):
        (told, done), (plainly, same) = (told_and_done(write(fitted(n))) for n in (name, "plain"))
        assert done == same
        assert told != plainly
