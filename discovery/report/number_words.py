"""Numbers in sentences, with the digits that mean something, and lists of words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from discovery.foundation.prefixes import prefix_for

__all__ = ["listed", "plain", "sizes"]


def listed(words: Iterable[str]) -> str:
    """Return words as a reader lists them: a, b and c."""
    words = list(words)
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def plain(value: float | None, digits: int = 3) -> str:
    """Return a number without an exponent where it has few digits."""
    if value is None or math.isnan(value):
        return "unknown"
    if math.isinf(value):
        return "beyond all bounds"
    if value == 0 or not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits}g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}")))))
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if digits == 2 and "." in text else text


def sizes(values: Sequence[float | None], unit: str) -> tuple[list[str], str]:
    """Return sizes in one unit, with a prefix that makes the largest easy to read, and that unit."""
    known = [v for v in values if v is not None and math.isfinite(v)]
    factor, prefix = prefix_for(unit, max(known, default=0.0))
    return [plain(None if v is None else factor * v) for v in values], "" if unit == "1" else prefix + unit
