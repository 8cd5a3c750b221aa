"""What the name of a column says: the quantity, whether it is a cause or a motion, and its unit."""

from __future__ import annotations

import re
from typing import NamedTuple

from discovery.declarations.units import si_factor, si_symbol
from discovery.foundation.errors import InputError

__all__ = ["Meaning", "meaning_of"]

#: Words for which unit libraries have no name, or another meaning.
_SPELLED = {
    "°": "deg",
    "degrees": "deg",
    "degree": "deg",
    "radians": "rad",
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "px": "pixel",
    "Nm": "N m",
    "mNm": "mN m",
    "volt": "V",
    "volts": "V",
}
#: What may stand behind an underscore or a blank without brackets: other letters there are part of the name.
_BARE = {
    *("s", "ms", "us", "min", "m", "mm", "cm", "um", "km", "deg", "rad", "mrad", "V", "mV", "A", "mA"),
    *("N", "mN", "kN", "N m", "mN m", "pixel", "g"),
}
_BRACKETS = re.compile(r"(?P<stem>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>[^)]*)\)|/\s*(?P<slash>\S+))\s*$")
_TIMES = {"t", "time", "times", "timestamp", "zeit", "temps", "elapsed", "seconds", "clock"}
_CAUSES = {"u", "f", "force", "torque", "tau", "voltage", "volt", "v", "current", "i", "input", "command", "cmd"}
_CAUSES |= {"excitation", "drive", "pwm", "thrust", "load"}
_MOVED = {"base", "hub", "cart", "pivot", "shaker", "table", "motor", "support"}
_HEIGHTS = {"height", "altitude", "fall", "drop", "h"}
_MOTIONS = {"angle", "theta", "phi", "alpha", "deflection", "displacement", "position", "pos", "output", "y", "x", "z"}
_MOTIONS |= {"q", "disp", "travel", "distance", "encoder", "tip", "swing", "rotation"}
_RATES = {"velocity", "speed", "rate", "omega", "vel", "gyro", "acceleration", "acc", "accel", "temperature", "error"}


class Meaning(NamedTuple):
    """What a name says.

    Attributes
    ----------
    role : str
        ``"time"``, ``"cause"``, ``"moved"`` (motion of a base), ``"height"``, ``"motion"``, ``"other"`` (a rate), or
        ``""`` where the name says nothing.
    unit : str or None
        As the name states it, None where it does not.
    """

    role: str
    unit: str | None


def meaning_of(name: str) -> Meaning:
    """Read the name of a column.

    Examples
    --------
    >>> meaning_of("angle_deg")
    Meaning(role='motion', unit='deg')
    >>> meaning_of("Motor voltage [mV]")
    Meaning(role='cause', unit='mV')
    >>> meaning_of("reading")
    Meaning(role='', unit=None)
    """
    stem, unit = _split(name)
    words = [word for word in re.split(r"[^a-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", stem).lower()) if word]
    return Meaning(_role(words, unit), unit)


def _split(name: str) -> tuple[str, str | None]:
    """Return what is measured, and the unit that the name states."""
    found = _BRACKETS.match(name)
    if found:
        unit = _known(found["square"] or found["round"] or found["slash"] or "")
        if unit is not None:
            return found["stem"], unit
    words = re.split(r"[_\s]+", name.strip())
    for count in (2, 1):
        unit = _known(" ".join(words[-count:])) if len(words) > count else None
        if unit in _BARE:
            return " ".join(words[:-count]), unit
    return name, None


def _known(text: str) -> str | None:
    unit = _SPELLED.get(text.strip(), text.strip())
    try:
        si_factor(unit)
    except InputError:
        return None
    return unit or None


def _role(words: list[str], unit: str | None) -> str:
    if _TIMES.intersection(words[:1]) or (not words and unit is not None and si_symbol(unit) == "s"):
        return "time"
    kind = None if unit is None else si_symbol(unit)
    for role, known in (("other", _RATES), ("cause", _CAUSES), ("moved", _MOVED), ("height", _HEIGHTS)):
        # A voltage that is no command, and the place of a base, are told by their units.
        if known.intersection(words) and not (role == "moved" and kind in ("V", "A", "N", "N m")):
            return role
    if kind in ("V", "A", "N", "J", "N m"):
        return "cause"
    return "motion" if _MOTIONS.intersection(words) or kind in ("m", "rad") else ""
