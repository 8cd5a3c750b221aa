"""Numbers in sentences, with the digits that mean something."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["plain", "sizes"]

#: Units that take a prefix where a size is below a tenth.
_PREFIXED = ("m", "rad", "V", "s")


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
    """Return sizes in one unit, thousandths of it where all of them are small, and that unit."""
    known = [v for v in values if v is not None and math.isfinite(v)]
    small = unit in _PREFIXED and 0 < max(known, default=0.0) < 0.1
    scaled = [v * 1e3 if small and v is not None else v for v in values]
    return [plain(v) for v in scaled], f"m{unit}" if small else "" if unit == "1" else unit
