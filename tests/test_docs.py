"""The pages of docs: what they show is executed, what is generated is current, what they link to exists."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, fields
from pathlib import Path
from urllib.parse import urlsplit
from xml.etree import ElementTree

import pytest
from pydantic import BaseModel

from discovery.declarations.registry import catalogue
from discovery.mechanics.upgrades import UPGRADES
from discovery.report.sentences import OUTCOMES
from discovery.rigs import rig_schema
from discovery.rigs.quantities import QUANTITIES, key_of
from discovery.rigs.rig_file import read_rig
from discovery.rigs.system_table import Table
from discovery.runs.loop_result import ModelErrorReport
from discovery.selection.decision import Candidacy, Decision
from discovery.selection.odds import Odds
from discovery.selection.settings import LoopSettings
from discovery.selection.verdict import VERDICTS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
SCRIPT = runpy.run_path(str(DOCS / "catalogue_page.py"))
catalogue_page, main = SCRIPT["catalogue_page"], SCRIPT["main"]
RIG_SCRIPT = runpy.run_path(str(DOCS / "rig_file_page.py"))
rig_file_page = RIG_SCRIPT["rig_file_page"]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def blocks() -> list[str]:
    return BLOCK.findall((DOCS / "ADD_AN_EFFECT.md").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory, blocks: list[str]) -> Path:
    """Return a folder with the page's effect, installed as another package's entry point."""
    folder = tmp_path_factory.mktemp("package")
    (folder / "cubic_damping.py").write_text(blocks[0])
    (folder / "test_cubic_damping.py").write_text(blocks[1])
    info = folder / "my_package-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[discovery.effects]\ncubic_damping = cubic_damping\n")
    return folder


def run(package: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", *arguments],
        cwd=package,
        env={**os.environ, "PYTHONPATH": str(package)},
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
def test_the_new_effect_fulfils_the_contract(package: Path) -> None:
    result = run(package, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "test_cubic_damping.py")
    assert result.returncode == 0, result.stdout
    passed = re.search(r"(\d+) passed", result.stdout)
    assert passed
    assert int(passed[1]) > 10


@pytest.mark.slow
def test_the_posterior_page_runs(tmp_path: Path) -> None:
    (code,) = BLOCK.findall((DOCS / "POSTERIOR.md").read_text(encoding="utf-8"))
    (tmp_path / "datasets").symlink_to(ROOT / "datasets")
    result = run(tmp_path, "-c", code)
    assert result.returncode == 0, result.stderr
    noise, status, ranking = result.stdout.splitlines()
    assert noise == "correlated"
    assert "systematic residual" in status
    assert "'declared'" in ranking
    assert (tmp_path / "posterior.nc").stat().st_size > 1e5


def test_the_session_of_the_page_is_true(package: Path, blocks: list[str]) -> None:
    session = "\n".join(b for b in blocks if b.startswith(">>>"))
    assert "recover" in session
    (package / "session.txt").write_text(session)
    code = "import doctest, sys; sys.exit(doctest.testfile('session.txt', module_relative=False).failed)"
    result = run(package, "-c", code)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_card_of_the_new_effect(package: Path) -> None:
    result = run(package, "-m", "discovery", "effects", "cubic_damping")
    assert result.returncode == 0, result.stderr
    assert "Rayleigh" in result.stdout
    assert "c_3" in result.stdout


def test_the_catalogue_page_is_current() -> None:
    assert (DOCS / "CATALOGUE.md").read_text(encoding="utf-8") == catalogue_page(), "run `make docs`"


def test_the_catalogue_page_shows_every_effect_and_parameter() -> None:
    sections = dict(re.findall(r"^### `(\w+)`\n(.*?)(?=^##|\Z)", catalogue_page(), re.MULTILINE | re.DOTALL))
    shown = {**catalogue(), **UPGRADES}
    assert set(sections) == set(shown)
    for effect_id, effect in shown.items():
        assert "```math\n" in sections[effect_id]
        assert effect.cite in sections[effect_id]
        for parameter in effect.parameters():
            assert f"| `{parameter.name}` | {parameter.unit} | {parameter.meaning} |" in sections[effect_id]
    # All of a formula stands in its block, and no word of another markup is left.
    outside = re.sub(r"```math\n.*?\n```", "", catalogue_page(), flags=re.DOTALL)
    assert not re.search(r"^    |::|:math:", outside, re.MULTILINE)
    bases = "`elastica`, `elastica_4`, `elastica_calm`, `elastica_2`, `elastica_1`"
    assert f"Acts on arms (bases: {bases})." in sections["base_backlash"]
    assert "Changes the base to `elastica_calm`" in sections["elastica_geometry"]


@pytest.mark.parametrize(
    ("write", "page"),
    [(main, catalogue_page), (RIG_SCRIPT["main"], rig_file_page)],
    ids=["catalogue", "rig file"],
)
def test_a_generated_page_is_written_by_its_command(
    tmp_path: Path, write: Callable[[list[str]], None], page: Callable[[], str]
) -> None:
    write([str(tmp_path / "page.md")])
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == page()
    with pytest.raises(SystemExit, match="usage"):
        write([])


def test_the_page_of_rig_files_is_current() -> None:
    assert (DOCS / "RIG_FILE.md").read_text(encoding="utf-8") == rig_file_page(), "run `make docs`"


TABLES = [table for own in Table.__subclasses__() for table in (own, *own.__subclasses__())]


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_every_key_of_a_rig_file_is_explained(table: type[BaseModel]) -> None:
    assert table.__doc__
    for key, field in table.model_fields.items():
        assert field.description, key
        assert field.description.endswith(".")
        row = rf"^\| `{key}` \| [^|]+ \| [^|]+ \| {re.escape(field.description)} \|$"
        assert re.search(row, rig_file_page(), re.MULTILINE), key


def test_no_table_of_a_rig_file_is_without_a_section() -> None:
    named = set(rig_schema.RigTable.model_json_schema()["$defs"])
    assert named == {table.__name__ for table in TABLES} - {"RigTable", "QuantityTable"}
    # Every key that is a table leads to its section, and those that hold the same lead to one.
    links = set(re.findall(r"\]\(#(\w+)\)", rig_file_page()))
    assert len(links) == len(named)


@pytest.mark.parametrize("stem", QUANTITIES)
def test_every_quantity_of_a_rig_file_is_explained(stem: str) -> None:
    known = QUANTITIES[stem]
    row = re.search(rf"^\| `{key_of(stem)}` \| (.*) \|$", rig_file_page(), re.MULTILINE)
    assert row
    unit, _, _, kinds, meaning = row[1].split(" | ")
    assert (unit, meaning) == (known.unit, known.meaning)
    assert re.findall(r"`(\w+)`", kinds) == [*known.kinds]


def test_the_example_of_a_rig_file_is_read(tmp_path: Path) -> None:
    (example,) = re.findall(r"^```toml\n(.*?)^```$", rig_file_page(), re.MULTILINE | re.DOTALL)
    (tmp_path / "rig.toml").write_text(example, encoding="utf-8")
    rig = read_rig(tmp_path / "rig.toml")
    assert rig.mass is not None
    assert (rig.mass.value, rig.mass.sd) == pytest.approx((0.412, 0.0005))
    assert (rig.columns.time.jitter, rig.columns.output.noise) == pytest.approx((2e-5, 1e-5))
    assert [part.name for part in rig.records["train"]] == ["slow", "fast"]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_external_links_are_whole() -> None:
    found = {link for page in PAGES for link in re.findall(r"\]\((https?:[^)]*)\)", page.read_text(encoding="utf-8"))}
    assert found
    for link in found:
        address = urlsplit(link)
        assert address.scheme == "https", link
        assert re.fullmatch(r"[a-z0-9-]+(\.[a-z0-9-]+)+", address.netloc), link
        assert not re.search(r"[\s<>\"{}|\\^`]", link), link


def test_the_architecture_page_names_real_modules() -> None:
    text = (DOCS / "ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = [re.findall(r"`([^`]+)`", line.split("|")[1]) for line in text.splitlines() if line.startswith("| `")]
    assert len(rows) > 10
    for row in rows:
        for name in row:
            places = [ROOT / name, ROOT / "discovery" / name]
            assert any(p.exists() for p in places) or name == "reports/", name


def test_the_architecture_page_names_every_room() -> None:
    text = (DOCS / "ARCHITECTURE.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `(discovery/[^`]+)/` \|", text, re.MULTILINE))
    rooms = {p.parent.relative_to(ROOT).as_posix() for p in (ROOT / "discovery").glob("*/__init__.py")}
    assert rooms - {"discovery"} <= named


@pytest.fixture(scope="module")
def attribution() -> str:
    return (DOCS / "ATTRIBUTION.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def loop_json() -> str:
    return (DOCS / "LOOP_JSON.md").read_text(encoding="utf-8")


def test_the_attribution_page_is_short(attribution: str) -> None:
    assert sum(any(c.isalnum() for c in word) for word in attribution.split()) <= 2500


def numbers_of(text: str) -> dict[str, float]:
    """Return the values of the rows "| `name` | value | ..." of a page."""
    return {name: float(value) for name, value in re.findall(r"^\| `(\w+)` \| ([\d.e-]+) \|", text, re.MULTILINE)}


def test_the_attribution_page_states_the_numbers_that_decide(attribution: str) -> None:
    decide, _, work = attribution.partition("### The budget of work")
    settings = {f.name: f.default for f in fields(LoopSettings) if f.name not in ("seed", "follow_up", "budget")}
    assert numbers_of(decide) == settings
    assert numbers_of(work) == asdict(LoopSettings().budget)


def test_every_field_of_the_evidence_is_explained(loop_json: str) -> None:
    rows = loop_json.partition("| in `effects[].evidence` |")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)` \|", rows, re.MULTILINE) == [*(f.name for f in fields(Odds)), "odds"]


def test_every_verdict_and_record_is_named(attribution: str, loop_json: str) -> None:
    shown = re.findall(r"^\| `(\w+)` \| [^|]+ \| [^|]+ \|$", attribution.partition("## 8.")[2], re.MULTILINE)
    assert set(shown[: len(VERDICTS)]) == set(VERDICTS)
    for record in (ModelErrorReport, Decision, Candidacy):
        assert not [f.name for f in fields(record) if f"`{f.name}`" not in loop_json], record.__name__
    assert not [code for code in OUTCOMES if f"`{code}`" not in attribution + loop_json]


def test_the_picture_is_what_its_script_draws(tmp_path: Path) -> None:
    drawn = tmp_path / "architecture.svg"
    subprocess.run([sys.executable, str(DOCS / "draw_architecture.py"), str(drawn)], check=True)
    committed = DOCS / "images" / "architecture.svg"
    assert committed.read_text(encoding="utf-8") == drawn.read_text(encoding="utf-8"), "run `make docs`"
    assert ElementTree.parse(committed).getroot().tag.endswith("svg")


def test_pictures_are_small() -> None:
    assert all(p.stat().st_size < 200_000 for p in (DOCS / "images").iterdir())


def slug(heading: str) -> str:
    """Return the anchor of a heading."""
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower().replace("`", "")
    return re.sub(r"[^\w\- ]", "", words).strip().replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_to_headings_lead_to_one(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", page.read_text(encoding="utf-8")):
        other = page.parent / target if target else page
        headings = re.findall(r"^#+ (.+)$", other.read_text(encoding="utf-8"), re.MULTILINE)
        assert anchor in map(slug, headings), f"{page.name} links to {target}#{anchor}"


@pytest.mark.slow
def test_the_way_of_the_data_is_what_is_traced(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    script = runpy.run_path(str(DOCS / "trace_modules.py"))
    page.write_text(f"{script['BEGIN']}\n{script['END']}\n", encoding="utf-8")
    traced = [sys.executable, str(DOCS / "trace_modules.py"), str(page), str(tmp_path / "way.svg")]
    subprocess.run(traced, check=True, capture_output=True)
    stated = (DOCS / "ARCHITECTURE.md").read_text(encoding="utf-8").partition(script["BEGIN"])[2]
    numbers = [
        [int(n) for n in re.findall(r"\b\d+\b", text)][:4] for text in (stated, page.read_text(encoding="utf-8"))
    ]
    # A module more or less is not worth a new picture.
    assert numbers[0] == pytest.approx(numbers[1], rel=0.1), "run `make docs`"
