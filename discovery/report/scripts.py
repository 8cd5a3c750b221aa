"""What runs on a page: fixed scripts that are allowed by their hash, and nothing else."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files

from markupsafe import Markup

#: Files of `assets` in the order in which they run: the plotting library (MIT licence beside it), and the page's own.
_SCRIPTS = ("uPlot.iife.min.js", "page.js", "chart.js")


@cache
def _asset(name: str) -> str:
    return (files("discovery.report") / "assets" / name).read_text(encoding="utf-8")


def scripts(*, chart: bool) -> list[Markup]:
    """Return the text of every script of a page; those of the live chart only where there is one."""
    return [Markup(_asset(name)) for name in _SCRIPTS if chart or name == "page.js"]


def sheet() -> Markup:
    """Return the style sheet of the plotting library."""
    return Markup(_asset("uPlot.min.css"))


def policy(*, chart: bool) -> str:
    """Return the content-security policy: no request at all, and only scripts with these hashes."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"
        for text in scripts(chart=chart)
    )
    return (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {hashes}; "
        "base-uri 'none'; form-action 'none'"
    )
