"""The page in headless Chromium: what a reader's browser makes of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.browser

#: A hidden picture has nothing to decode.
DECODED = "Promise.allSettled([...document.images].filter(i => i.width).map(i => i.decode()))"
LIGHT, DARK = ([{"name": "prefers-color-scheme", "value": v}] for v in ("light", "dark"))
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


@pytest.fixture(scope="module", params=["arm", pytest.param("oscillator", marks=pytest.mark.slow), "loop"])
def page(
    request: pytest.FixtureRequest, drawn_run: Callable[[str], Path], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    # Alone, away from its run: one file is all that a reader needs.
    return shutil.copy(drawn_run(request.param) / "report.html", tmp_path_factory.mktemp("alone") / "report.html")


def looks(check: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that leaves the page as it was: the next one of these looks at the same page."""
    check.looks = True  # type: ignore[attr-defined]
    return check


@pytest.fixture(params=[1280, 390])
def opened(request: pytest.FixtureRequest, browser: Any, page: Path) -> Any:
    # Other pages have these tests as a parameter.
    test = request.node.callspec.params.get("check", request.function)
    width, only_looks = request.param, getattr(test, "looks", False)
    if not (only_looks and getattr(browser, "untouched", None) == (page, width)):
        _open(browser, page, width)
    browser.untouched = (page, width) if only_looks else None
    return browser


def _open(browser: Any, page: Path, width: int) -> None:
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": LIGHT})
    # The browser's own first page asks for its own parts: leave it, and forget what it did.
    browser.get("about:blank")
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(page.as_uri())
    browser.execute_async_script(f"const done = arguments[0]; {DECODED}.then(() => done());")
    assert browser.execute_script("return window.innerWidth") == width


#: What does not depend on the width is tried on a wide window, and among the longer studies on a narrow one.
WIDE = pytest.mark.parametrize("opened", [1280, pytest.param(390, marks=pytest.mark.slow)], indirect=True)


@WIDE
def test_no_console_message_and_no_request(opened: Any, page: Path) -> None:
    assert opened.get_log("browser") == []
    events = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
    asked = [e["request"]["url"] for e in sent if not e["documentURL"].startswith("chrome://")]
    assert page.as_uri() in asked
    assert [u[:100] for u in asked if not u.startswith("data:") and u != page.as_uri()] == []


@WIDE
def test_every_image_is_decoded(opened: Any, page: Path) -> None:
    # On the screen, the live chart takes the place of the first figure; every other one is in sight once folds open.
    opened.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    opened.execute_async_script(f"const done = arguments[0]; {DECODED}.then(() => done());")
    sizes = opened.execute_script(
        "return [...document.images].filter(i => !i.closest('.static')).map(i => "
        "[i.complete, i.naturalWidth, i.width, i.alt])"
    )
    # A page over all runs shows a choice of the figures and formulas of each, that of a controller one course.
    fewest = 1 if page.parent.name == "closed_loop" else 7 if page.name == "report.html" else 3
    assert len(sizes) >= fewest
    for complete, natural, shown, alt in sizes:
        assert complete, alt
        assert natural > 0, alt
        assert shown > 200, alt
        assert alt


@looks
def test_the_page_does_not_scroll_sideways(opened: Any) -> None:
    wide, narrow = opened.execute_script("const d = document.documentElement; return [d.scrollWidth, d.clientWidth]")
    assert wide <= narrow
    outside = opened.execute_script(
        """
        const limit = document.documentElement.clientWidth + 1;
        const boxed = e => e.parentElement?.closest('.scroll, .contents');
        return [...document.body.querySelectorAll('*')]
          .filter(e => !boxed(e) && e.getBoundingClientRect().right > limit).map(e => e.outerHTML.slice(0, 120));
        """
    )
    assert outside == []


@looks
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


@looks
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


@looks
def test_headings_are_in_order(opened: Any) -> None:
    levels = opened.execute_script("return [...document.querySelectorAll('h1,h2,h3,h4')].map(h => +h.tagName[1])")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(later <= earlier + 1 for earlier, later in pairwise(levels))


@looks
def test_the_contents_lead_to_sections(opened: Any) -> None:
    missing = opened.execute_script(
        "const links = [...document.querySelectorAll('nav a')].map(a => a.getAttribute('href'));"
        "return links.filter(h => !document.querySelector(h));"
    )
    assert missing == []
    assert opened.execute_script("return document.querySelectorAll('nav a').length") >= 7


@looks
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


def _all_open(browser: Any) -> None:
    browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")


def _needs(browser: Any, selector: str) -> None:
    if not browser.execute_script("return !!document.querySelector(arguments[0])", selector):
        pytest.skip(f"this page has no {selector}")


@pytest.mark.parametrize("opened", [pytest.param(1280, marks=pytest.mark.slow), 390], indirect=True)
def test_no_serious_finding_of_the_accessibility_checker(opened: Any) -> None:
    checker = Path(pytest.importorskip("axe_core_python").__file__).parent / "axe.min.js"
    _all_open(opened)
    opened.execute_cdp_cmd("Runtime.evaluate", {"expression": checker.read_text(encoding="utf-8")})
    told = "[v.impact, v.id, v.nodes.length, v.nodes[0].html]"
    run = f"axe.run(document).then(r => JSON.stringify(r.violations.map(v => {told})))"
    asked = {"expression": run, "awaitPromise": True, "returnByValue": True}
    for features in (DARK, LIGHT):
        opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": features})
        found = json.loads(opened.execute_cdp_cmd("Runtime.evaluate", asked)["result"]["value"])
        assert [v for v in found if v[0] in ("serious", "critical")] == [], features


@WIDE
def test_the_chart_zooms_moves_and_shows_all(opened: Any) -> None:
    _needs(opened, "#chart")

    def shown() -> list[float]:
        return opened.execute_script("const d = document.getElementById('chart').dataset; return [+d.from, +d.to]")

    def press(what: str) -> list[float]:
        opened.execute_script("document.querySelector(arguments[0]).click()", f'[data-act="{what}"]')
        return opened.execute_async_script(
            "const done = arguments[0]; setTimeout(() => { const d = document.getElementById('chart').dataset;"
            "done([+d.from, +d.to]); }, 60)"
        )

    whole = press("all")
    near = press("in")
    assert whole[0] < near[0] < near[1] < whole[1]
    later = press("on")
    assert later[0] > near[0]
    assert later[1] - later[0] == pytest.approx(near[1] - near[0])
    assert press("all") == whole
    plots = opened.find_element("css selector", '[data-part="plots"]')
    plots.send_keys("+")
    opened.execute_async_script("setTimeout(arguments[0], 60)")
    assert shown()[1] - shown()[0] == pytest.approx((whole[1] - whole[0]) / 2)


@WIDE
def test_dragging_over_the_chart_zooms_and_the_pointer_reads(opened: Any) -> None:
    _needs(opened, "#chart")
    chains = pytest.importorskip("selenium.webdriver.common.action_chains")
    opened.execute_script("document.getElementById('chart').scrollIntoView({block: 'center'})")
    opened.execute_script("document.querySelector('[data-act=all]').click()")
    over = opened.find_element("css selector", "[data-part=values] .u-over")
    before = opened.execute_script("const d = document.getElementById('chart').dataset; return d.to - d.from")
    chains.ActionChains(opened).move_to_element(over).click_and_hold().move_by_offset(60, 0).release().perform()
    opened.execute_async_script("setTimeout(arguments[0], 100)")
    after = opened.execute_script("const d = document.getElementById('chart').dataset; return d.to - d.from")
    assert 0 < after < before / 2
    assert opened.find_element("css selector", "[data-part=readout]").text.startswith("t = ")


@WIDE
def test_a_curve_is_switched_off_and_on(opened: Any) -> None:
    _needs(opened, "#chart")
    button = opened.find_element("css selector", '[data-series="before"]')
    drawn = "return [...document.querySelectorAll('#chart canvas')].map(c => c.toDataURL().length + c.toDataURL())"
    settle = "setTimeout(arguments[0], 100)"
    opened.execute_async_script(settle)
    first = opened.execute_script(drawn)
    opened.execute_script("arguments[0].click()", button)
    opened.execute_async_script(settle)
    assert button.get_attribute("aria-pressed") == "false"
    assert opened.execute_script(drawn)[1] != first[1]
    opened.execute_script("arguments[0].click()", button)
    assert button.get_attribute("aria-pressed") == "true"


@WIDE
def test_folds_open_and_a_link_into_one_opens_it(opened: Any) -> None:
    _needs(opened, "details summary")
    fold = opened.find_element("css selector", "details summary")
    assert not opened.execute_script("return arguments[0].parentElement.open", fold)
    opened.execute_script("arguments[0].click()", fold)
    assert opened.execute_script("return arguments[0].parentElement.open", fold)


@WIDE
def test_the_dark_page_is_dark_and_its_figures_too(opened: Any) -> None:
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": DARK})
    colour = opened.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert max(int(c) for c in colour[colour.index("(") + 1 : -1].split(",")[:3]) < 60
    _needs(opened, "figure img")
    assert "invert" in opened.execute_script("return getComputedStyle(document.querySelector('figure img')).filter")


@WIDE
def test_paper_shows_the_pictures_and_what_is_folded(opened: Any) -> None:
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": DARK})
    colour = opened.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert colour == "rgb(255, 255, 255)"
    _needs(opened, "#chart")
    shown = "return arguments[0].map(s => document.querySelector(s).getBoundingClientRect().height > 0)"
    assert opened.execute_script(shown, ["#chart", ".static img", "nav"]) == [False, True, False]
    opened.execute_script("dispatchEvent(new Event('beforeprint'))")
    assert opened.execute_script("return [...document.querySelectorAll('details')].every(d => d.open)")
    opened.execute_script("dispatchEvent(new Event('afterprint'))")
    assert not opened.execute_script("return [...document.querySelectorAll('details')].some(d => d.open)")


@WIDE
def test_without_scripts_the_pictures_are_there(opened: Any, page: Path) -> None:
    opened.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        opened.get(page.as_uri())
        assert not [c for c in opened.find_elements("css selector", "#chart") if c.is_displayed()]
        first = opened.find_elements("css selector", ".static img")
        assert all(image.is_displayed() for image in first)
    finally:
        opened.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


def test_the_verdict_and_the_error_after_are_in_sight(opened: Any) -> None:
    """What one opens the page for is read without scrolling: the verdict with the error after, and the contents."""
    _needs(opened, ".report .verdict")
    seen = "return arguments[0].map(s => document.querySelector(s).getBoundingClientRect().bottom)"
    verdict, contents, equation, after = opened.execute_script(
        seen, [".verdict", ".contents a", ".first .formula", ".bars td.after"]
    )
    assert max(verdict, contents) < 900
    wide = opened.execute_script("return window.innerWidth") > 1000
    assert not wide or max(equation, after) < 900
    if wide:
        opened.execute_script("window.scrollTo(0, document.body.scrollHeight / 2)")
        assert 0 <= opened.execute_script(seen, [".contents a"])[0] < 900


@WIDE
def test_an_equation_is_copied_as_latex(opened: Any) -> None:
    _needs(opened, "[data-tex]")
    buttons = opened.find_elements("css selector", "button.copy")
    assert len(buttons) == opened.execute_script("return document.querySelectorAll('[data-tex]').length")
    opened.execute_cdp_cmd(
        "Browser.grantPermissions", {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]}
    )
    # Only a page that has the focus may write to the clipboard.
    opened.execute_cdp_cmd("Emulation.setFocusEmulationEnabled", {"enabled": True})
    opened.execute_script("arguments[0].click()", buttons[0])
    opened.execute_async_script("setTimeout(arguments[0], 200)")
    assert buttons[0].text == "Copied"
