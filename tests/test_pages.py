"""The pages of real runs in headless Chromium, by the tests of `test_browser`; DISCOVERY_REPORTS names their folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
import test_browser
from test_browser import *  # noqa: F403

FOLDER = os.environ.get("DISCOVERY_REPORTS")
ROOT = Path(FOLDER or ".").resolve()
PAGES = [*sorted(ROOT.glob("*/report.html")), *ROOT.glob("index.html")] if FOLDER else []
NONE = pytest.param(None, marks=pytest.mark.skip("no real runs: DISCOVERY_REPORTS names no folder with pages"))


@pytest.fixture(scope="module", params=PAGES or [NONE], ids=lambda p: p.parent.name if p else "none")
def page(request: pytest.FixtureRequest) -> Path:
    return request.param


def test_the_contents_lead_to_sections(opened: Any) -> None:
    """As for a run's page, but the page over all runs has as many sections as there are runs."""
    links = opened.execute_script("return [...document.querySelectorAll('nav a')].map(a => a.getAttribute('href'))")
    assert links
    here = [link for link in links if link.startswith("#")]
    assert [link for link in here if not opened.execute_script(f"return !!document.querySelector('{link}')")] == []


def test_mathematics_is_drawn(opened: Any, page: Path) -> None:
    """As for a run's page; the page over the source paper prints its few formulas as text."""
    if "<math" not in page.read_text(encoding="utf-8"):
        pytest.skip(f"{page.parent.name} has no drawn mathematics")
    test_browser.test_mathematics_is_drawn(opened, page)
