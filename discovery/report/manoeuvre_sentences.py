"""The sentences on rivals that explain recordings alike, and on the manoeuvre that would tell them apart."""

from __future__ import annotations

import math

from discovery.diagnosis.manoeuvre_design import Move
from discovery.foundation.estimate_text import figures
from discovery.report.numbers import Record, listed

#: Predictions that differ by so many noise sds would be told apart, were there no model error.
_SEEN = 3.0
_ALIKE = 0.01  # noise sds by which two laws differ that are one here
#: A system whose gentlest manoeuvre takes it so many times as far as it was recorded is held by nothing.
_AWAY = 3.0


def laws_of(found: Record) -> list[list[str]]:
    """Return the rivals of loop.json by law; results of old do not say which are one."""
    return found["clusters"] if "clusters" in found else [[name] for name in found["rivals"]]


def laws_apart(found: Record) -> list[str]:
    """Return one rival of each law that a designed manoeuvre of loop.json is to tell apart, the simplest."""
    return [names[0] for names in laws_of(found)]


def separation_sentence(found: Record) -> str:
    """Return which rivals of loop.json are one law, and what the manoeuvre that is designed for the others promises.

    Examples
    --------
    >>> separation_sentence({"clusters": [["equilibrium_offset", "angle_offset"]]})
    'Here equilibrium_offset and angle_offset are the same law: no recording like these tells them apart.'
    """
    said = [
        f"Here {listed(names)} are the same law: no recording like these tells them apart."
        for names in laws_of(found)
        if len(names) > 1
    ]
    if len(laws_of(found)) > 1:
        given, designed = found["given"], found["designed"]
        known = max(given["projected"], found.get("left", 0.0))
        hidden = designed["projected"] <= known and designed["chi2"] >= found["decides_from"]
        said.append(_promise(found) if found["decides"] else _hidden(found) if hidden else _undecided(found))
    return " ".join(said)


def _promise(found: Record) -> str:
    """Return what to do to tell laws apart, and what it promises."""
    given, designed = found["given"]["projected"], found["designed"]
    hidden = ", where the model error that is left hides it" if given > _SEEN else ""
    now = f"{figures(given, 2)} on the given recordings{hidden}" if given > _ALIKE else "alike on the given recordings"
    return (
        f"To tell {', '.join(laws_apart(found))} apart: {_what_to_do(found)}. With their parameters readjusted, the "
        f"predictions then differ by {figures(designed['projected'], 2)} noise sds rms ({now}), "
        f"and the right one is expected to win by a chi-square of "
        f"{figures(designed['chi2'])}, the best of {found['evaluations']} manoeuvres tried."
    )


def _hidden(found: Record) -> str:
    """Return that no manoeuvre tells laws apart better than the given recordings do, or beyond the model error."""
    given, designed = (figures(found[k]["projected"], 2) for k in ("given", "designed"))
    none = f"Of {found['evaluations']} manoeuvres tried none tells {', '.join(laws_apart(found))} apart"
    if found["designed"]["projected"] > found["given"]["projected"]:
        left = figures(found["left"], 2)
        return f"{none}: the {left} noise sds rms of model error that are left hide the {designed} of the best."
    return (
        f"{none} better than the given recordings ({designed} noise sds rms, {given} on these): the model error that "
        "is left hides it."
    )


def _undecided(found: Record) -> str:
    """Return that no manoeuvre tells laws apart, how far the best goes, and what would help."""
    designed, most = found["designed"], found["limits"]
    arm = found["columns"][1] == "motor_angle_rad"
    if found["deflection"] <= most["deflection"]:
        won = f"{figures(designed['chi2'], 2)}, and less than {found['decides_from']:g} may be chance"
        best = f"the best lets the right one win by an expected chi-square of {won}"
    elif math.isfinite(found["deflection"]):
        far = f"{found['deflection']:.3g} {found['deflection_unit']}"
        best = f"the gentlest {f'deflects the tip by {far}' if arm else f'takes the output to {far}'}"
        if not arm and _runs_away(found):
            best += f", {figures(found['deflection'] / most['deflection'], 2)} times as far"
    else:
        best = "every motion blows up"
    if arm:
        limits = (
            f"{most['angle']:.3g} rad, {most['speed']:.3g} rad/s, {most['acceleration']:.3g} rad/s^2, "
            f"{most['duration']:.3g} s, tip deflected by {most['deflection']:.3g} rad"
        )
        help_ = (
            "A camera with less noise would help, or other limits, stated in the rig file: wider ones, if they are "
            "safe, or slower ones."
        )
    else:
        reach = f"{most['deflection']:.3g} {found['deflection_unit']}"
        limits = f"{most['duration']:.3g} s, output up to {reach}, a tenth beyond what was recorded"
        help_ = (
            _stay(found)
            if _runs_away(found)
            else "An instrument with less noise would help, or larger motions, if they are safe."
        )
    return (
        f"No manoeuvre within the safe limits ({limits}) tells {', '.join(laws_apart(found))} apart: of "
        f"{found['evaluations']} tried, {best}. {help_}"
    )


def _runs_away(found: Record) -> bool:
    """Return whether even the gentlest manoeuvre takes what is no arm far beyond where it was recorded."""
    return bool(found["deflection"] > _AWAY * found["limits"]["deflection"])


def _stay(found: Record) -> str:
    """Return what to do with a system that leaves where it was recorded, whatever a manoeuvre does."""
    if not found["moves"]:
        return (
            "By the models it leaves where it was recorded once it is let go: make shorter recordings, or hold it by "
            "an input."
        )
    return (
        "By the models an input that does not depend on the output lets it leave where it was recorded: feed the "
        "output back and add pushes to the input, or make shorter recordings."
    )


def _what_to_do(found: Record) -> str:
    """Return the moves of a designed manoeuvre, or where to let go."""
    if not found["moves"]:
        unit = "" if found["unit"] == "1" else f" {found['unit']}"
        place, duration = f"{found['release']:+.3g}{unit}", f"{found['limits']['duration']:.3g} s"
        if found["unit"].endswith("/s"):
            return f"let it pass its rest at {place}, and record {duration} from there"
        return f"let it go at {place} from zero, at no speed, and record {duration}"
    moves = [Move(**move) for move in found["moves"]]
    if found["columns"][1] == "motor_angle_rad":
        return "; ".join(
            f"at {m.start:.2f} s turn {m.angle:+.2f} rad at {m.speed:.2f} rad/s, ramps {m.ramp * m.duration:.2f} s"
            for m in moves
        )
    unit = found["columns"][1].removeprefix("input_").replace("_", " ")
    by = "" if unit == "1" else f" {unit}"
    return "; ".join(
        f"at {m.start:.3g} s move the input by {m.angle:+.3g}{by} within {m.duration:.3g} s, ramps "
        f"{m.ramp * m.duration:.3g} s"
        for m in moves
    )
