"""Units in the words of mechanics."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from discovery.declarations.units import dimension, powers_text

#: Units of mechanics by what they measure, the shortest first.
_WORDS = (
    *("1", "m", "s", "kg", "N", "N m", "N s", "N m s", "N m^-1", "N s m^-1", "m s^-1", "m s^-2", "kg m^2", "kg m"),
    *("A", "C", "V", "ohm", "H", "F", "N m A^-1", "N A^-1"),
)


def named_unit(exponents: Mapping[str, Fraction]) -> str:
    """Return a unit of given base units in the words of mechanics: ``"N m"``, or powers of newtons and base units.

    What has mass and time is told in newtons, what has mass alone in kilograms.

    Examples
    --------
    >>> named_unit(dimension("kg m^2 s^-2")), named_unit(dimension("N s^2 m^-2")), named_unit(dimension("N / m^3"))
    ('N m', 'kg m^-1', 'N m^-3')
    """
    for word in _WORDS:
        if dimension(word) == exponents:
            return word
    parts = dict(exponents)
    if parts.get("kg") == 1 and parts.get("s"):
        for base, power in dimension("N").items():
            parts[base] = parts.get(base, Fraction(0)) - power
        parts["N"] = Fraction(1)
    order = sorted(parts.items(), key=lambda pair: (pair[1] < 0, pair[0] != "N", pair[0]))
    return powers_text((base, power) for base, power in order if power)
