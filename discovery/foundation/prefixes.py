"""Prefixes of units for display: an error of a few millimetres is not written in metres."""

from __future__ import annotations

import math

#: Units that take a prefix as they stand.
_PREFIXED = ("m", "rad", "s", "V", "A", "N", "N m")
#: Sizes below which thousandths and millionths are easier to read.
_MILLI, _MICRO = 0.1, 1e-4


def prefix_for(unit: str, size: float) -> tuple[float, str]:
    """Return a factor and the prefix with which values of a typical size, in an SI unit, are easy to read.

    Examples
    --------
    >>> prefix_for("m", 0.004), prefix_for("m", 3e-5), prefix_for("kg", 0.004)
    ((1000.0, 'm'), (1000000.0, 'µ'), (1.0, ''))
    """
    if unit not in _PREFIXED or not math.isfinite(size) or not 0 < abs(size) < _MILLI:
        return 1.0, ""
    return (1e6, "µ") if abs(size) < _MICRO else (1e3, "m")
