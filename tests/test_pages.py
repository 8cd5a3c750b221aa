"""The pages of real runs in headless Chromium, by the tests of `test_browser`; DISCOVERY_REPORTS names their folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from test_browser import *  # noqa: F403

FOLDER = os.environ.get("DISCOVERY_REPORTS")
PAGES = sorted(Path(FOLDER).resolve().glob("*/report.html")) if FOLDER else []
NONE = pytest.param(None, marks=pytest.mark.skip("no real runs: DISCOVERY_REPORTS names no folder with */report.html"))


@pytest.fixture(scope="module", params=PAGES or [NONE], ids=lambda p: p.parent.name if p else "none")
def page(request: pytest.FixtureRequest) -> Path:
    return request.param
