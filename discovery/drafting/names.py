"""What the name of a column says: the quantity, whether it is a cause or a motion, and its unit."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import NamedTuple

from discovery.declarations.units import si_factor, si_symbol, standard_unit
from discovery.foundation.errors import InputError
from discovery.foundation.table_cells import TIMES

#: What may stand behind an underscore or a blank without brackets: other letters there are part of the name.
_BARE = {
    *("s", "ms", "us", "min", "m", "mm", "cm", "um", "km", "ft", "deg", "rad", "mrad", "V", "mV", "A", "mA"),
    *("N", "mN", "kN", "N m", "mN m", "kN m", "kip", "lbf", "inch", "pixel"),
    *("g", "mg", "rev", "rpm", "deg/s", "km/h", "mile/h"),
}
#: What a speed is made of: `_rad_s` states rad/s, and `_m_s2` m/s^2.
_MOVING = {"m", "mm", "cm", "um", "km", "ft", "deg", "rad", "mrad", "rev", "degrees", "radians"}
_RATE = re.compile(r"(?P<of>[^\W\d_]+)_(?:per_)?(?P<per>s|sec|seconds?|min|h)(?:\^?-?(?P<power>[12]))?")
_BRACKETS = re.compile(r"(?P<stem>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>[^)]*)\)|/\s*(?P<slash>\S+))\s*$")
_TIMES = {*TIMES, "times", "timestamp", "elapsed", "seconds", "clock"}
#: A current through a motor answers its voltage and how it turns: it drives where nothing else is named that does.
_CURRENTS = {"current", "i", "strom", "amps"}
_CAUSES = {"u", "f", "force", "torque", "tau", "voltage", "volt", "v", "input", "command", "cmd", *_CURRENTS}
_CAUSES |= {"excitation", "drive", "pwm", "duty", "thrust", "load", "kraft", "spannung", "volts"}
_CAUSES |= {"demand", "forzante", "forza", "fuerza", "effort"}
_MOVED = {"base", "hub", "cart", "pivot", "shaker", "table", "motor", "support", "road", "ground", "floor"}
_HEIGHTS = {"height", "altitude", "fall", "drop", "h"}
_MOTIONS = {"angle", "theta", "phi", "alpha", "deflection", "displacement", "position", "pos", "output", "y", "x", "z"}
_MOTIONS |= {"q", "disp", "travel", "distance", "encoder", "tip", "swing", "rotation", "winkel", "weg"}
#: Behind these, `_in` states inches; behind others it says that a signal goes in.
_INCHES = {"in", "inches"}
_LENGTHS = {"displacement", "disp", "deflection", "travel", "stroke", "distance", "height", "elongation"}
_ACCELERATIONS = {"acceleration", "acc", "accel", "accelerometer", "ax", "ay", "az", "accx", "accy", "accz"}
#: What is weighed: grams are grams there. A motion in grams is none, but an acceleration in those of gravity.
_WEIGHED = {"mass", "weight", "load", "m"}
_GRAVITIES = {"g": "g_0", "mg": "mg_0"}
#: Words for full turns; one of the latter counts them where a number is named beside it.
_REVOLUTIONS, _REVOLUTION = {"turns", "revolutions", "revs"}, {"turn", "revolution", "rev"}
_COUNTED = {"count", "counts", "counter", "number", "total"}
_SPEEDS = {"velocity", "speed", "rate", "omega", "vel", "gyro", "rpm", "cps", "drehzahl"}
_ASKED = {"setpoint", "target", "reference", "desired", "goal", "sollwert", "consigne"}
_OTHERS = {"temperature", "battery", "supply", "error", "err", "uncertainty", "sd", "std"}
#: Roles by words, the first one that fits; a base has no voltage, and an instrument may read a motion in volts.
_WORDS = (
    *(("acceleration", _ACCELERATIONS), ("speed", _SPEEDS), ("cause", _CAUSES)),
    *(("moved", _MOVED), ("height", _HEIGHTS), ("motion", _MOTIONS)),
)
#: Roles by units, which no word contradicts.
_RATES = {"m/s": "speed", "rad/s": "speed", "m/s^2": "acceleration", "rad/s^2": "acceleration"}
_FORCES = ("V", "A", "N", "J", "N m")


class Meaning(NamedTuple):
    """What a name says."""

    #: ``"time"``, ``"cause"``, ``"moved"`` (motion of a base), ``"height"``, ``"motion"``, ``"speed"``,
    #: ``"acceleration"``, ``"other"`` (neither cause nor motion), or ``""`` where the name says nothing.
    role: str
    unit: str | None  # as the name states it, None where it does not

    @property
    def lasts(self) -> bool:
        """Whether it is a time: that of a clock, or how long something lasts, as a pulse that drives.

        Examples
        --------
        >>> meaning_of("pwm_us").lasts, meaning_of("pwm").lasts
        (True, False)
        """
        return self.unit is not None and si_symbol(self.unit) == "s"


def meaning_of(name: str) -> Meaning:
    """Read the name of a column.

    Examples
    --------
    >>> meaning_of("angle_deg")
    Meaning(role='motion', unit='deg')
    >>> meaning_of("Motor voltage [mV]")
    Meaning(role='cause', unit='mV')
    >>> meaning_of("omega_rad_s")
    Meaning(role='speed', unit='rad/s')
    >>> meaning_of("wheel_turns"), meaning_of("ax_g")
    (Meaning(role='motion', unit='rev'), Meaning(role='acceleration', unit='g_0'))
    >>> meaning_of("MotorRPM") == meaning_of("rpm_left") == meaning_of("speed_rpm")
    True
    >>> meaning_of("reading")
    Meaning(role='', unit=None)
    """
    stem, unit = _split(name)
    words = words_of(stem)
    if unit == "A" and _role(words, None) not in ("cause", ""):
        unit = None  # the first of several signals: nothing but a current is read in amperes
    unit = "rev" if unit is None and _counts_turns(words) else unit
    unit = "rpm" if unit is None and "rpm" in words else unit
    role = _role(words, unit)
    if unit in _GRAVITIES and role in ("acceleration", "motion", "moved") and not _WEIGHED.intersection(words):
        return Meaning("acceleration", _GRAVITIES[unit])
    return Meaning(role, unit)


def _counts_turns(words: list[str]) -> bool:
    """Return whether words name full turns, and no speed of turning."""
    counted = _REVOLUTIONS.intersection(words) or (_REVOLUTION.intersection(words) and _COUNTED.intersection(words))
    return bool(counted) and not _SPEEDS.intersection(words)


def words_of(name: str) -> list[str]:
    """Return the words of a name in small letters.

    Examples
    --------
    >>> words_of("angularVelocity_2")
    ['angular', 'velocity']
    """
    return [word for word in re.split(r"[^a-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", name).lower()) if word]


def is_asked_for(name: str) -> bool:
    """Return whether a name is that of what a controller is asked for, which is not what it then applies.

    Examples
    --------
    >>> is_asked_for("setpoint_rpm"), is_asked_for("set point"), is_asked_for("voltage")
    (True, True, False)
    """
    words = words_of(name)
    return bool(_ASKED.intersection(words)) or ("set", "point") in pairwise(words)


def is_current(name: str, meaning: Meaning) -> bool:
    """Return whether a name is that of a current.

    Examples
    --------
    >>> is_current("I_motor", meaning_of("I_motor")), is_current("PWM", meaning_of("PWM"))
    (True, False)
    """
    return (meaning.unit is not None and si_symbol(meaning.unit) == "A") or bool(_CURRENTS.intersection(words_of(name)))


def _split(name: str) -> tuple[str, str | None]:
    """Return what is measured, and the unit that the name states: the longest one."""
    words = re.split(r"[_\s]+", name.strip())
    for count in range(len(words), 0, -1):
        unit = _bare("_".join(words[-count:]))
        # A name that is nothing but a unit is a quantity of its own: m, s, and V are masses, places, and voltages.
        if unit is not None and (count < len(words) or unit == "rev" or si_symbol(unit) in _RATES):
            return " ".join(words[:-count]), unit
    if words[-1] in _INCHES and _LENGTHS.intersection(words_of(name)):
        return " ".join(words[:-1]), "in"
    found = _BRACKETS.match(name)
    if found:
        unit = _known(found["square"] or found["round"] or found["slash"] or "")
        if unit is not None:
            return found["stem"], unit
    return name, None


def _bare(suffix: str) -> str | None:
    """Return the unit that a suffix states; None where it may be a part of the name."""
    unit = _known(suffix.replace("_", " "))
    if unit in _BARE:
        return unit
    suffix = re.sub(r"_*/_*", "_per_", suffix)
    rate = _RATE.fullmatch(suffix)
    if rate and rate["of"] in _MOVING:
        per = {"sec": "s", "second": "s", "seconds": "s"}.get(rate["per"], rate["per"])
        unit = f"{standard_unit(rate['of'])}/{per}" + ("^2" if rate["power"] == "2" else "")
        return standard_unit(unit)
    of, _, per = suffix.partition("_per_")
    of = standard_unit(of).replace("_", " ")
    return _known(f"{of}/({per.replace('_', ' ')})") if per and of in _BARE else None


def _known(text: str) -> str | None:
    text = text.strip()
    unit = "rpm" if text == "1/min" else standard_unit(text)  # no shaft is told by its frequency
    unit = "rev" if text.lower() in _REVOLUTIONS | _REVOLUTION else unit
    try:
        si_factor(unit)
    except InputError:
        return None
    return unit or None


def _role(words: list[str], unit: str | None) -> str:
    kind = None if unit is None else si_symbol(unit)
    by_word = next((role for role, known in _WORDS if known.intersection(words)), "")
    if _TIMES.intersection(words[:1]):
        return "time"
    if _OTHERS.intersection(words) or (kind == "s" and by_word):
        return "other"
    if kind == "s":
        return "time"
    if kind in _RATES:
        return _RATES[kind]
    # A voltage that is no command, the place of a base, and an azimuth are told by their units.
    contradicted = (by_word == "moved" and kind in _FORCES) or (by_word == "acceleration" and kind in ("m", "rad"))
    if by_word and not contradicted:
        return by_word
    if kind in _FORCES:
        return "cause"
    return "motion" if kind in ("m", "rad") else ""
