"""A value with its standard deviation, with the digits that the standard deviation leaves."""

from __future__ import annotations

import math

#: From here on a number has an exponent.
_PLAIN = 1e7
#: Units that take a prefix as they stand.
_PREFIXED = ("m", "rad", "s", "V", "A", "N", "N m")
#: Sizes below which thousandths and millionths are easier to read.
_MILLI, _MICRO = 0.1, 1e-4


def decimals(sd: float) -> int:
    """Return the decimals that leave two significant digits of a standard deviation; negative for tens and more."""
    return 1 - math.floor(math.log10(float(f"{sd:.1e}")))


def figures(value: float, digits: int = 3) -> str:
    """Write a number with so many significant digits, and one of less than ten million without an exponent.

    Examples
    --------
    >>> figures(-5103.2, 2), figures(0.25), figures(2.5e7)
    ('-5100', '0.25', '2.5e+07')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(float(text)) < _PLAIN else text


def places(value: float, sd: float) -> tuple[int, int]:
    """Return the decimals of a finite value and its positive sd, and the power of ten that stands behind both.

    Examples
    --------
    >>> places(8.79068, 0.00124), places(0.000574, 0.000079)
    ((4, 0), (2, -4))
    """
    exponent = math.floor(math.log10(max(abs(value), sd)))
    exponent = 0 if -4 < exponent < 6 else exponent
    return decimals(sd) + exponent, exponent


def estimate_text(value: float, sd: float | None, unit: str = "1") -> str:
    """Write a value with its standard deviation, if it has one, and its unit, if it is no ratio.

    The standard deviation has two significant digits, and the value as many decimals; alone it has six digits.

    Examples
    --------
    >>> estimate_text(0.00599864, 1.2e-6, "N m"), estimate_text(0.000574279, 7.9e-5, "s^-1"), estimate_text(0.25, None)
    ('0.0059986 +- 0.0000012 N m', '(5.74 +- 0.79)e-4 s^-1', '0.25')
    """
    if not sd or not math.isfinite(sd) or not math.isfinite(value):
        text = f"{value:.6g}"
    else:
        digits, exponent = places(value, sd)
        both = " +- ".join(_fixed(number / 10.0**exponent, digits) for number in (value, sd))
        text = f"({both})e{exponent}" if exponent else both
    return f"{text} {unit}" if unit != "1" else text


def _fixed(value: float, digits: int) -> str:
    text = f"{round(value, digits):.{max(0, digits)}f}"
    return text.removeprefix("-") if float(text) == 0 else text


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
