"""Numbers as a reader wants them: of a page with a true minus sign and units in superscripts, of sentences in ASCII."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from discovery.foundation.estimate_text import decimals, places, prefix_for

MISSING = "–"
#: A record of a result file: codes and numbers by name.
Record = Mapping[str, Any]
#: Greek letters by name.
GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eta": "η", "theta": "θ", "kappa": "κ", "lambda": "λ",
    "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "varphi": "φ", "psi": "ψ",
    "omega": "ω", "Omega": "Ω", "Delta": "Δ", "Phi": "Φ",
    "Gamma": "Γ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ", "chi": "χ", "pi": "π",
}  # fmt: skip
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_MINUS = "\N{MINUS SIGN}"
#: Probabilities and their ratios are told no finer than one in so many.
_LEAST = 1e-4
#: A size below so much of its unit is written in a smaller one.
_READABLE = 0.01
_NARROW = "\N{NARROW NO-BREAK SPACE}"


@dataclass(frozen=True)
class Scale:
    """A unit for display: what a value in SI is multiplied by, and the symbol."""

    factor: float
    symbol: str

    def text(self, value: float | None) -> str:
        """Return an SI value in this unit, without it; a dash where there is none."""
        return significant(None if value is None else value * self.factor)

    def quantity(self, value: float | None) -> str:
        """Return an SI value in this unit, with it."""
        return f"{self.text(value)} {self.symbol}".rstrip()


def scale_for(unit: str, typical: float) -> Scale:
    """Return the prefix of an SI unit under which values of a typical size are easy to read."""
    factor, prefix = prefix_for(unit, typical)
    return Scale(factor, prefix + unit_text(unit))


def scale_for_change(unit: str, before: float, after: float) -> Scale:
    """Return the prefix for a size before and after: that of the larger one while the smaller one has digits there."""
    scale = scale_for(unit, before if math.isfinite(before) else after)
    return scale if after * scale.factor >= _READABLE else scale_for(unit, after)


def unit_text(unit: str, coordinate: str = "rad") -> str:
    """Return a unit such as ``"s^-2 q^-2"`` as a reader writes it; `coordinate` stands for q, and nothing for 1."""
    factors = []
    for factor in unit.replace("**", "^").split():
        symbol, _, power = factor.partition("^")
        symbol = coordinate if symbol == "q" else symbol
        if symbol != "1":
            factors.append(symbol + (power.strip("()").translate(_SUPERSCRIPT) if power else ""))
    return "\N{NO-BREAK SPACE}".join(factors)


def fixed(value: float, decimals: int) -> str:
    """Return a number with so many decimals, thousands grouped, zero without a sign."""
    text = f"{value:.{max(0, decimals)}f}" if decimals >= 0 else f"{round(value, decimals):.0f}"
    text = "0" + text[2:] if re.fullmatch(r"-0\.?0*", text) else text
    whole, dot, rest = text.partition(".")
    digits = whole.lstrip("-")
    if len(digits) > 4:
        digits = f"{int(digits):,}".replace(",", _NARROW)
    return (_MINUS if whole.startswith("-") else "") + digits + dot + rest


def ten_to(exponent: int) -> str:
    """Return a power of ten."""
    return f"10{str(exponent).translate(_SUPERSCRIPT)}"


def power_of_ten(exponent: int) -> str:
    """Return the factor that stands behind a number."""
    return f"×{_NARROW}{ten_to(exponent)}"


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits; a dash where there is none.

    Examples
    --------
    >>> significant(0.0458137), significant(None)
    ('0.0458', '–')
    """
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "∞" if value > 0 else f"{_MINUS}∞"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 < exponent < 7:
        return fixed(value, digits - 1 - exponent)
    return f"{fixed(value / 10.0**exponent, digits - 1)}{_NARROW}{power_of_ten(exponent)}"


def in_newtons(known: Mapping[str, Any] | None) -> str:
    """Return what is known of a parameter in newtons and kilograms, with its unit; nothing where nothing is."""
    if known is None:
        return ""
    return f"{uncertain(known['value'], known['sd'])}\N{NO-BREAK SPACE}{unit_text(known['unit'])}"


def uncertain(value: float | None, sd: float | None) -> str:
    """Return ``value ± sd`` with two digits of the standard deviation and the value rounded like it.

    Examples
    --------
    >>> uncertain(8.79068, 0.00124)
    '8.7907 ± 0.0012'
    """
    if value is None or math.isnan(value):
        return MISSING
    if sd is None or not math.isfinite(sd) or sd <= 0:
        return significant(value, 5)
    return _both((value, sd), " ± ", *places(value, sd))


def rounded(value: float | None, sd: float | None) -> str:
    """Return a value alone with the digits that two digits of its standard deviation leave.

    Examples
    --------
    >>> rounded(8.79068, 0.00124)
    '8.7907'
    """
    if not value or not sd or not math.isfinite(sd):
        return significant(value, 5)
    return significant(value, max(2, 1 + decimals(sd) + math.floor(math.log10(abs(value)))))


def near_one(share: float) -> str:
    """Return a share; what is close to one only as far as anybody can tell.

    Examples
    --------
    >>> near_one(0.87), near_one(0.9987), near_one(0.9999999)
    ('0.870', '0.9987', 'more than 0.9999')
    """
    if 1 - _LEAST < share < 1:
        return f"more than {1 - _LEAST:g}"
    return fixed(share, 4) if 0.99 < share < 1 else significant(share)


def chance(probability: float | None) -> str:
    """Return a probability that something is by chance; a very small one only as far as anybody can tell.

    Examples
    --------
    >>> chance(0.0312), chance(6e-247)
    ('0.031', 'less than 0.0001')
    """
    small = probability is not None and probability < _LEAST
    return f"less than {_LEAST:.4f}" if small else significant(probability, 2)


def ratio(value: float) -> str:
    """Return a likelihood ratio; beyond ten thousand a number would promise more than a model of noise can keep.

    Examples
    --------
    >>> ratio(16.2), ratio(2.5e278).replace(chr(0x202F), " ")
    ('16', 'more than 10 000')
    """
    return significant(value, 2) if value < 1 / _LEAST else f"more than {fixed(1 / _LEAST, 0)}"


def interval(low: float | None, high: float | None) -> str:
    """Return both ends of an interval with the digits that their distance deserves."""
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return MISSING
    if high == low:
        return f"{significant(low, 5)} to {significant(high, 5)}"
    return _both((low, high), " to ", *places(max(abs(low), abs(high)), high - low))


def _both(values: tuple[float, float], between: str, digits: int, exponent: int) -> str:
    both = between.join(fixed(value / 10.0**exponent, digits) for value in values)
    return f"({both}){_NARROW}{power_of_ten(exponent)}" if exponent else both


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
