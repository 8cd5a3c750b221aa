"""The page in headless Chromium: what a reader's browser makes of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import synthetic_run

from discovery.report import build_report

pytestmark = pytest.mark.browser

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)


def _executable(*names: str) -> str:
    for name in names:
        found = shutil.which(name)
        if found:
            return found
    pytest.skip(f"none of {', '.join(names)} is installed: Debian has them in chromium and chromium-driver")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    chromium = _executable("chromium", "chromium-browser", "google-chrome")
    chromedriver = _executable("chromedriver")
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(chromedriver))
    yield driver
    driver.quit()


@pytest.fixture(scope="module", params=["arm", "oscillator", "loop"])
def page(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    getattr(synthetic_run, f"write_{request.param}_run")(folder)
    # Alone, away from its run: one file is all that a reader needs.
    return build_report(folder).rename(tmp_path_factory.mktemp("alone") / "report.html")


@pytest.fixture(params=[1280, 390])
def opened(request: pytest.FixtureRequest, browser: Any, page: Path) -> Any:
    width = request.param
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    # The browser's own first page asks for its own parts: leave it, and forget what it did.
    browser.get("about:blank")
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(page.as_uri())
    browser.execute_async_script(
        "const done = arguments[0]; Promise.allSettled([...document.images].map(i => i.decode())).then(() => done());"
    )
    assert browser.execute_script("return window.innerWidth") == width
    return browser


def test_no_console_message_and_no_request(opened: Any, page: Path) -> None:
    assert opened.get_log("browser") == []
    events = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
    asked = [e["request"]["url"] for e in sent if not e["documentURL"].startswith("chrome://")]
    assert page.as_uri() in asked
    assert [u[:100] for u in asked if not u.startswith("data:") and u != page.as_uri()] == []


def test_every_image_is_decoded(opened: Any, page: Path) -> None:
    sizes = opened.execute_script("return [...document.images].map(i => [i.complete, i.naturalWidth, i.width, i.alt])")
    # A page over all runs shows a choice of the figures and formulas of each.
    assert len(sizes) >= (7 if page.name == "report.html" else 3)
    for complete, natural, shown, alt in sizes:
        assert complete, alt
        assert natural > 0, alt
        assert shown > 200, alt
        assert alt


def test_the_page_does_not_scroll_sideways(opened: Any) -> None:
    wide, narrow = opened.execute_script("const d = document.documentElement; return [d.scrollWidth, d.clientWidth]")
    assert wide <= narrow
    outside = opened.execute_script(
        """
        const limit = document.documentElement.clientWidth + 1;
        const boxed = e => e.closest('.scroll') && !e.matches('.scroll');
        return [...document.body.querySelectorAll('*')]
          .filter(e => !boxed(e) && e.getBoundingClientRect().right > limit).map(e => e.outerHTML.slice(0, 120));
        """
    )
    assert outside == []


def test_parameters_are_seen_without_scrolling(opened: Any, page: Path) -> None:
    found = opened.execute_script(
        """
        return [...document.querySelectorAll('.stacked')].map(t => [t.parentElement.scrollWidth,
          t.parentElement.clientWidth, t.rows[1].cells[0].getBoundingClientRect().top,
          t.rows[1].cells[3].getBoundingClientRect().top, t.rows[1].cells[3].getBoundingClientRect().right]);
        """
    )
    # The pages over several runs have no such table.
    assert bool(found) == ('class="stacked"' in page.read_text(encoding="utf-8"))
    for wide, shown, symbol, value, right in found:
        assert wide <= shown
        assert abs(value - symbol) < 12
        assert right <= opened.execute_script("return document.documentElement.clientWidth")


def test_mathematics_is_drawn(opened: Any, page: Path) -> None:
    boxes = opened.execute_script(
        """
        return [...document.querySelectorAll('math')].filter(m => !m.closest('details')).map(
          m => [m.getBoundingClientRect().width, m.getBoundingClientRect().height, m.outerHTML.slice(0, 200)]);
        """
    )
    assert len(boxes) > (9 if page.name == "report.html" else 3)
    for width, height, source in boxes:
        assert width > 3, source
        assert height > 5, source
    # Exponents are raised and small, unless the elements are only passed through as text.
    raised = opened.execute_script(
        """
        return [...document.querySelectorAll('math[display=block] msup')].map(m => {
          const [base, exponent] = [...m.children].map(c => c.getBoundingClientRect());
          return exponent.bottom < base.bottom && exponent.height < base.height; });
        """
    )
    assert raised
    assert all(raised)


def test_headings_are_in_order(opened: Any) -> None:
    levels = opened.execute_script("return [...document.querySelectorAll('h1,h2,h3,h4')].map(h => +h.tagName[1])")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(later <= earlier + 1 for earlier, later in pairwise(levels))


def test_the_contents_lead_to_sections(opened: Any) -> None:
    missing = opened.execute_script(
        "const links = [...document.querySelectorAll('nav a')].map(a => a.getAttribute('href'));"
        "return links.filter(h => !document.querySelector(h));"
    )
    assert missing == []
    assert opened.execute_script("return document.querySelectorAll('nav a').length") >= 7


def test_text_is_large_and_dark_enough(opened: Any) -> None:
    styles = opened.execute_script(
        """
        return [...document.querySelectorAll('p, li, td, th, figcaption, dd, dt')].map(e => {
          const s = getComputedStyle(e); return [parseFloat(s.fontSize), s.color]; });
        """
    )

    def luminance(colour: str) -> float:
        channels = [int(c) / 255 for c in colour[colour.index("(") + 1 : -1].split(",")[:3]]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    assert min(size for size, _ in styles) >= 14
    # Contrast with white of at least 4.5 (Web Content Accessibility Guidelines, level AA).
    assert min(1.05 / (luminance(colour) + 0.05) for _, colour in styles) >= 4.5
