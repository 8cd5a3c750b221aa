"""The source paper's own numbers, as printed."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def paper_numbers() -> dict[str, Any]:
    """Return rig, parameters, manoeuvre and errors that the paper prints, in SI units; see ``published.toml``."""
    text = files("discovery.report").joinpath("templates/published.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
