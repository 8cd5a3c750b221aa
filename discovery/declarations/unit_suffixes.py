"""Units in the suffixes of column and key names, as in ``flexural_rigidity_N_m2``, and in the words of mechanics."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from fractions import Fraction

from discovery.declarations.units import dimension, powers_text, si_factor
from discovery.foundation.errors import InputError

# What ordinary columns and keys end in: it needs no pint, whose import takes longer than the reading.
_SUFFIXES = frozenset({"s", "m", "rad", "kg", "N m^2"})
#: Units of mechanics by what they measure, the shortest first.
_WORDS = (
    *("1", "m", "s", "kg", "N", "N m", "N s", "N m s", "N m^-1", "N s m^-1", "m s^-1", "m s^-2", "kg m^2", "kg m"),
    *("A", "C", "V", "ohm", "H", "F", "N m A^-1", "N A^-1"),
)


def suffix_unit(suffix: str) -> str:
    """Read the unit in the suffix of a name: ``"N_m2"`` gives ``"N m^2"``, ``"rad_per_s"`` gives ``"rad / s"``."""
    words = []
    for word in suffix.split("_"):
        match = re.match(r"([A-Za-z]+?)(-?\d+)?\Z", word)
        if match is None:
            raise InputError(f"The suffix {suffix!r} is not a unit. Write it like 'm', 'mm', 'deg' or 'N_m2'.")
        words.append("/" if word == "per" else match.group(1) + (f"^{match.group(2)}" if match.group(2) else ""))
    return " ".join(words)


def split_suffix(name: str, stems: Mapping[str, str] | Iterable[str]) -> tuple[str, str] | None:
    """Split a name such as ``tip_x_mm`` into the stem and its unit.

    `name`: name of a column or of a key. `stems`: the stems that are known; the longest one that fits wins. Returned:
    the unit is ``""`` where the suffix is missing; None if no stem fits or what follows it is not a unit.
    """
    for stem in sorted(stems, key=len, reverse=True):
        if name == stem:
            return stem, ""
        if name.startswith(stem + "_"):
            try:
                unit = suffix_unit(name[len(stem) + 1 :])
                if unit not in _SUFFIXES:
                    si_factor(unit)
            except InputError:
                return None
            return stem, unit
    return None


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
