"""Units at the border: everything inside the package is SI and radians.

Two notations meet here: unit strings of declarations (``"kg m^2 s^-2"``) and of users (``"mm"``, ``"deg"``). Exponents
are parsed here; factors come from pint, which is imported at the first conversion only.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING

from discovery.foundation.errors import InputError
from discovery.foundation.estimate_text import figures

if TYPE_CHECKING:
    import pint

# Coherent SI units in base dimensions; the radian, a ratio of lengths, has none (SI brochure, 9th ed., table 4).
_COHERENT: dict[str, dict[str, int]] = {
    "q": {"q": 1},  # unit of the coordinate in declarations: rad for an arm, that of the output for an oscillator
    "u": {"u": 1},  # unit of the recorded input in declarations
    "rad": {},
    "1": {},
    "m": {"m": 1},
    "kg": {"kg": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "K": {"K": 1},
    "mol": {"mol": 1},
    "cd": {"cd": 1},
    "Hz": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "C": {"A": 1, "s": 1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
}
#: What users write, and the one name of it: some of it pint has no name for, or takes for another unit (a giga-radian).
_SPELLED = {
    "°": "deg",
    "Grad": "deg",
    "degrees": "deg",
    "degree": "deg",
    "radians": "rad",
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "px": "pixel",
    **dict.fromkeys(("au", "a.u.", "arb. u.", "arb. units"), "1"),  # arbitrary: a number
    "Nm": "N m",
    "mNm": "mN m",
    "kNm": "kN m",
    **dict.fromkeys(("volt", "volts", "Volt", "Volts"), "V"),
    **dict.fromkeys(("ampere", "amperes", "amps", "Ampere"), "A"),
    **dict.fromkeys(("second", "Second", "Seconds"), "s"),
    **dict.fromkeys(("RPM", "U/min", "r/min", "rev/min", "revolution/min"), "rpm"),
    "rev": "revolution",
    "dps": "deg/s",
    **dict.fromkeys(("kmh", "kph", "kmph", "Kmh", "KMH", "KPH"), "km/h"),
    **dict.fromkeys(("mph", "MPH"), "mile/h"),
}
_SPELLING = re.compile(r"(?<!\w)(?:" + "|".join(map(re.escape, sorted(_SPELLED, key=len, reverse=True))) + r")(?!\w)")
_POWER = re.compile(r"(?<=[A-Za-z])(?=(?:-[1-9]|[2-4])(?![\w.]))")  # between a unit and a bare exponent
_COMPOUND = re.compile(r"[/ -]")  # what may hold one: m2 alone may be the second motor
_TOKEN = re.compile(
    r"\s*(?:(?P<slash>/)|(?P<symbol>[A-Za-z]+|1)(?:\^(?:(?P<power>-?\d+)|\((?P<fraction>-?\d+(?:/\d+)?)\)))?(?=[\s/]|\Z))"
)


@lru_cache(maxsize=1024)
def _exponents(unit: str) -> tuple[tuple[str, Fraction], ...]:
    total: dict[str, Fraction] = {}
    text = unit.replace("**", "^").replace("·", " ").replace("*", " ").strip()
    sign, position = 1, 0
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None or (token["symbol"] and token["symbol"] not in _COHERENT):
            counted = any(word in unit for word in ("px", "pixel"))
            pixels = " Pixels are counted: write '1' for them, of columns and constants alike." if counted else ""
            raise InputError(
                f"The unit {unit!r} cannot be read at {text[position:].strip()!r}: write products of powers such as "
                f"'N m^2', 's^-2' or 'm^(1/2)' of {' '.join(_COHERENT)}.{pixels}"
            )
        position = token.end()
        if token["slash"]:
            sign = -1
            continue
        power = sign * Fraction(token["power"] or token["fraction"] or 1)
        for base, exponent in _COHERENT[token["symbol"]].items():
            total[base] = total.get(base, Fraction(0)) + exponent * power
        sign = 1
    return tuple(sorted((base, power) for base, power in total.items() if power))


def dimension(unit: str) -> dict[str, Fraction]:
    """Exponents of the SI base units of a coherent unit, without pint.

    Parameters
    ----------
    unit : str
        Powers of coherent SI units separated by spaces; ``^`` or ``**`` for exponents (fractions in parentheses),
        ``/`` divides by the next factor. The radian, ``"1"`` and the empty string are dimensionless.

    Returns
    -------
    dict of str to Fraction
        Base unit (kg, m, s, A, K, mol, cd) to its exponent, none of them zero.

    Raises
    ------
    InputError
        If a factor is not a coherent SI unit (``mm``, ``deg``: convert with `si_factor` first).

    Examples
    --------
    >>> dimension("N m^2") == {"kg": 1, "m": 3, "s": -2}
    True
    >>> dimension("rad")
    {}
    """
    return dict(_exponents(unit))


def known_dimension(unit: str) -> dict[str, Fraction] | None:
    """Return the dimension of a unit; None of one that is no SI unit, such as the pixel of a camera."""
    with suppress(InputError):
        return dimension(unit)
    return None


def is_force(unit: str) -> bool:
    """Return whether a unit is certainly one of a force or a torque."""
    return known_dimension(unit) in (dimension("N"), dimension("N m"))


def mistaken_for(unit: str) -> str:
    """Return what to write instead of a mass whose letter also means gravity, as the end of a message; else nothing.

    Examples
    --------
    >>> mistaken_for("mg"), mistaken_for("kg")
    (" Did you mean 'mg_0', of the standard gravity, g_0 = 9.80665 m/s^2? 'mg' is a mass.", '')
    """
    if unit not in ("g", "mg"):
        return ""
    return f" Did you mean '{unit}_0', of the standard gravity, g_0 = 9.80665 m/s^2? {unit!r} is a mass."


def homogeneous(first: str, second: str) -> bool:
    """Whether two coherent units have the same dimension, the radian counting as none."""
    return dimension(first) == dimension(second)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True, preprocessors=[standard_unit])


def standard_unit(text: str) -> str:
    """Write a unit as unit libraries do: abbreviations and other languages are spelled out, powers have their sign.

    Examples
    --------
    >>> standard_unit("Nm"), standard_unit("rev/min"), standard_unit("mNm/RPM")
    ('N m', 'rpm', '(mN m)/(rpm)')
    >>> standard_unit("m/s2"), standard_unit("m2")
    ('m/s^2', 'm2')
    """
    spelled = _SPELLING.sub(lambda m: _SPELLED[m[0]] if m[0] == text else f"({_SPELLED[m[0]]})", text)
    return _POWER.sub("^", spelled) if _COMPOUND.search(text) else spelled


@lru_cache(maxsize=256)
def _base(unit: str) -> tuple[float, str]:
    """Factor to SI base units, and the base units in pint's words; angles stay apart from pure numbers here."""
    try:
        base = _registry().Quantity(1.0, unit or "dimensionless").to_base_units()
        zero = _registry().Quantity(0.0, unit or "dimensionless").to_base_units()
    except Exception as error:  # pint's parser lets exceptions of a dozen kinds out, bare assertions included
        raise InputError(
            f"The unit {unit!r} is not known. Write it like 'm', 'mm', 'deg', 's^-2', 'N m^2' or 'mV'."
        ) from error
    if zero.magnitude != 0.0:
        raise InputError(
            f"The unit {unit!r} has an offset from SI, so a factor cannot convert it: give the values in K."
        )
    return float(base.magnitude), str(base.units)


def si_factor(unit: str, expected: str | None = None) -> float:
    """Factor that takes a value in `unit` to SI (angles: radians).

    `unit`: the unit of the value, any that pint knows. `expected`: a unit of the dimension that is wanted, ``"m"`` for
    a length. An angle does not pass for a pure number here: a column in degrees where a ratio is expected is a mistake
    of the user. Raises InputError if the unit is not known, or is of another dimension.
    """
    if unit == expected or (expected is None and unit in _COHERENT):
        return 1.0
    factor, base = _base(unit)
    if expected is not None and base != _base(expected)[1]:
        like = "'rad', or 'deg' where the numbers are larger than a turn, 6.3" if expected == "rad" else repr(expected)
        raise InputError(
            f"The unit {unit!r} cannot be converted to {expected!r}: it measures another kind of quantity. "
            f"Write a unit like {like}."
        )
    return factor


def quoted(value: float, unit: str, digits: int = 3) -> str:
    """Write an SI value in the unit of its column, as the user knows it.

    Examples
    --------
    >>> quoted(0.25, "mm")
    '250 mm'
    """
    return figures(value / si_factor(unit), digits) + (f" {unit}" if unit != "1" else "")


def si_symbol(unit: str) -> str:
    """Name the SI unit of values that were given in `unit`: ``"mV"`` gives ``"V"``, ``"deg"`` gives ``"rad"``.

    What is written with a unit of force is no energy: ``"mN m"`` gives ``"N m"``, and ``"mJ"`` gives ``"J"``.
    """
    if unit in _COHERENT:
        return unit
    base = _base(unit)[1]
    for symbol in _COHERENT:
        if symbol in ("q", "u"):  # of declarations, not of users
            continue
        if _base("dimensionless" if symbol == "1" else symbol)[1] == base:
            return "N m" if symbol == "J" and _holds_force(unit) else symbol
    return f"{_registry().Unit(base):~C}".replace("**", "^").replace("*", " ")


def _holds_force(unit: str) -> bool:
    """Return whether a unit is written with one of force, as the newton metre is and the watt second is not."""
    factors = _registry().Quantity(1.0, unit).unit_items()
    return any(_registry().Unit(name).is_compatible_with("N") for name, _ in factors)


def in_coordinate(unit: str, coordinate: str, given: str = "u") -> str:
    """Write a unit of declarations with that of the coordinate in the place of q, positive powers first.

    The unit of the recorded input, `given`, stands in the place of u.

    Examples
    --------
    >>> in_coordinate("s^-2 q", "rad"), in_coordinate("q^-2 s^-2", "m"), in_coordinate("q^-1", "m / s")
    ('rad s^-2', 'm^-2 s^-2', 's m^-1')
    """
    powers: dict[str, Fraction] = {}
    for symbol, power in _factors(unit):
        for own, exponent in _factors({"q": coordinate, "u": given}.get(symbol, symbol)):
            powers[own] = powers.get(own, Fraction(0)) + exponent * power
    ordered = sorted((n for n, power in powers.items() if power and n != "1"), key=lambda n: powers[n] < 0)
    return powers_text((n, powers[n]) for n in ordered)


def powers_text(powers: Iterable[tuple[str, Fraction]]) -> str:
    """Write a product of powers of units as `dimension` reads it."""
    return " ".join(n if p == 1 else f"{n}^{p}" if p.denominator == 1 else f"{n}^({p})" for n, p in powers) or "1"


def _factors(unit: str) -> list[tuple[str, Fraction]]:
    """Return the symbols of a unit with their powers; what follows a slash divides."""
    found, sign = [], 1
    for word in unit.replace("/", " / ").split():
        if word == "/":
            sign = -1
            continue
        symbol, _, power = word.partition("^")
        found.append((symbol, sign * Fraction(power.strip("()") or 1)))
    return found
