"""The templates of the exported files, which lie beside this module."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        variable_start_string="@",
        variable_end_string="@",
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )


def filled(template: str, fields: Mapping[str, Any]) -> str:
    """Return the template in a file with its fields, ``@NAME@`` there; what a field holds is no template."""
    return _environment().get_template(template).render(fields)


def indented(lines: Iterable[str]) -> str:
    """Return lines as those of the body of a function."""
    return "\n".join(f"    {line}" for line in lines)
