"""Fields of settings that are of the wrong kind or out of range."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from discovery.foundation.arguments import check_number, check_seed, check_whole, expect

__all__ = ["check_fields"]


def check_fields(settings: Any) -> None:
    """Refuse a field of a dataclass that is unlike its default, negative, or beyond the ``range`` of its metadata.

    ``range`` is (least, most) and may be followed by what the number is larger than. Every field has a default.

    Raises
    ------
    InputError
        With the name of the field.
    """
    for known in fields(settings):
        given, default = getattr(settings, known.name), known.default
        if isinstance(default, float):
            least, most, *above = known.metadata.get("range", (0.0, float("inf")))
            check_number(given, known.name, least, most, **({"above": above[0]} if above else {}))
        elif isinstance(default, int) and not isinstance(default, bool):
            check_seed(given) if known.name == "seed" else check_whole(given, known.name, 0)
        else:
            expect(given, type(default), known.name, f"Give one, such as {default!r:.60}.")
