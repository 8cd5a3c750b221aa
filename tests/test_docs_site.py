"""The documentation: its gallery runs and finds what was hidden, its pages are complete, it builds without warning."""

from __future__ import annotations

import ast
import contextlib
import re
import runpy
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import matplotlib.pyplot as plt
import pytest
from worked_page import work_through

import discovery

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
GALLERY = sorted((DOCS / "gallery").glob("plot_*.py"))
#: The effects that are hidden in the recordings of each example, and their sizes as the script or the card states them.
HIDDEN = {
    "plot_cart_pendulum": {"f_c_joint": 3e-3},
    "plot_circuit": {"beta": 1.5 * (377.0**2)},
    "plot_drive": {"f_c": 0.75},
    "plot_flexible_arm": {"tau": 0.01},
    "plot_pendulum": {"c_2": 0.0425},
    "plot_ring_down": {"xi": 0.0704},
    "plot_spring_bench": {"f_c": 0.12},
}
QUICK = ("plot_ring_down",)


def cases() -> list[object]:
    return [pytest.param(p, id=p.stem, marks=[] if p.stem in QUICK else pytest.mark.slow) for p in GALLERY]


@pytest.mark.slow
@pytest.mark.parametrize("script", cases())
def test_an_example_runs_and_finds_what_was_hidden(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plt, "show", lambda: None)
    plt.switch_backend("agg")
    plt.close("all")
    with contextlib.chdir(script.parent):
        found = runpy.run_path(str(script))["found"]
    assert plt.get_fignums()
    plt.close("all")
    assert found.verdict == "explained"
    for name, value in HIDDEN[script.stem].items():
        assert found.after.values[name] == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize("script", GALLERY, ids=lambda p: p.stem)
def test_an_example_uses_public_names_and_its_truth_is_its_own(script: Path) -> None:
    tree = ast.parse(script.read_text(encoding="utf-8"))
    imported = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    imported |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert imported <= {"discovery", "numpy", "pathlib", "scipy.integrate", "scipy.linalg", "tempfile"}
    used = {
        n.attr
        for n in ast.walk(tree)
        if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.value.id == "discovery"
    }
    assert used <= set(discovery.__all__)
    assert ("scipy.integrate" in imported) != ('"datasets"' in script.read_text(encoding="utf-8"))


def test_every_example_is_known() -> None:
    assert set(HIDDEN) == {p.stem for p in GALLERY}


@pytest.mark.slow
def test_the_first_page_is_true(tmp_path: Path) -> None:
    (tmp_path / "datasets").symlink_to(ROOT / "datasets")
    work_through((DOCS / "START.md").read_text(encoding="utf-8"), "START.md", tmp_path)
    plt.close("all")


def test_the_recordings_of_the_spring_bench_are_those_of_its_script(tmp_path: Path) -> None:
    folder = ROOT / "datasets" / "spring_bench"
    subprocess.run([sys.executable, str(folder / "simulate.py"), str(tmp_path)], check=True)
    for made in tmp_path.iterdir():
        committed = (folder / made.name).read_text(encoding="utf-8").splitlines()
        again = made.read_text(encoding="utf-8").splitlines()
        assert committed[0] == again[0]
        pairs = zip(committed[1:], again[1:], strict=True)
        assert all(abs(float(a.split(",")[1]) - float(b.split(",")[1])) <= 1.5e-3 for a, b in pairs)


def test_the_reference_names_every_public_name() -> None:
    listed = re.findall(r"^   (\w+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.MULTILINE)
    # `load_rig` is the other name of `read_rig`.
    assert sorted([*listed, "load_rig"]) == sorted(discovery.__all__)


def test_every_page_is_in_the_contents() -> None:
    listed = set(re.findall(r"^(\w+)$", (DOCS / "index.md").read_text(encoding="utf-8"), re.MULTILINE))
    assert {p.stem for p in DOCS.glob("*.md")} - {"index"} <= listed


class _Links(HTMLParser):
    """Places that a page names, and where it leads."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.places: set[str] = set()
        self.links: list[str] = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        self.places.add(named.get("id") or "")
        self.links += [named[key] or "" for key in ("href", "src") if key in named]


def lost_links(site: Path) -> list[str]:
    """Return the links within a site that lead to no file, or to no place in it."""
    pages = {page.resolve(): _Links(page) for page in site.rglob("*.html")}
    lost = []
    for page, found in pages.items():
        for link in found.links:
            if re.match(r"\w+:", link):
                continue
            path, _, place = link.partition("#")
            target = (page.parent / unquote(path.partition("?")[0])).resolve() if path else page
            there = target.exists() and (not place or target not in pages or unquote(place) in pages[target].places)
            lost += [] if there else [f"{page.name}: {link}"]
    return lost


def test_a_link_to_nothing_is_seen(tmp_path: Path) -> None:
    page = '<h1 id="top">t</h1><a href="#top"></a><a href="b.html#end"></a><a href="#end"></a><img src="c.png">'
    (tmp_path / "a.html").write_text(page, encoding="utf-8")
    (tmp_path / "b.html").write_text("<p id='start'>", encoding="utf-8")
    assert lost_links(tmp_path) == ["a.html: b.html#end", "a.html: #end", "a.html: c.png"]


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="`make docs-site` installs the generator")
    pytest.importorskip("sphinx_gallery", reason="`make docs-site` installs the generator")
    # The examples are run above.
    options = ["-q", "-W", "--keep-going", "-D", "plot_gallery=0", "-d", str(tmp_path / "doctrees")]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, str(DOCS), str(tmp_path / "html")], capture_output=True, text=True
    )
    assert built.returncode == 0, built.stderr
    pages = {p.relative_to(tmp_path / "html").as_posix() for p in (tmp_path / "html").rglob("*.html")}
    assert {"index.html", "START.html", "examples/index.html", "reference/discovery.close_loop.html"} <= pages
    loaded = (tmp_path / "html" / "MECHANICS.html").read_text(encoding="utf-8")
    assert "<math" in loaded
    assert lost_links(tmp_path / "html") == []
    assert not re.search(r'<(?:script|link)[^>]+(?:src|href)="https?:', loaded)
