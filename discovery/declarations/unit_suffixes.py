"""Units in the suffixes of column and key names: ``tip_x_mm``, ``flexural_rigidity_N_m2``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from discovery.declarations.units import si_factor
from discovery.foundation.errors import InputError

# What ordinary columns and keys end in: it needs no pint, whose import takes longer than the reading.
_SUFFIXES = frozenset({"s", "m", "rad", "kg", "N m^2"})


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

    Parameters
    ----------
    name : str
        Name of a column or of a key.
    stems : iterable of str
        The stems that are known; the longest one that fits wins.

    Returns
    -------
    (stem, unit) or None
        The unit is ``""`` where the suffix is missing; None if no stem fits or what follows it is not a unit.
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
