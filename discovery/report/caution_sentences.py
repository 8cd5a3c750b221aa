"""The sentences on why an answer may not be believed, or why there is none, made from `cautions` and `failure`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from discovery.declarations.registry import effect_name
from discovery.declarations.units import quoted
from discovery.foundation.estimate_text import figures
from discovery.report.numbers import plain

Record = Mapping[str, Any]


def caution_sentence(found: Record) -> str:
    """Return what speaks against an answer, and what to do."""
    return _SENTENCES[found["code"]](found)


def _value(found: Record) -> str:
    unit = found["numbers"]["unit"]
    return f"{found['about']} = {figures(found['numbers']['value'])} {'' if unit == '1' else unit}".rstrip()


def _strayed(found: Record) -> str:
    numbers = found["numbers"]
    others = f" ({', '.join(numbers['others'])}: far above the guess, too)" if numbers["others"] else ""
    return (
        f"{_value(found)} of the declared model ends {figures(numbers['value'] / numbers['guess'], 2)} times as large "
        f"as its guess of {figures(numbers['guess'])}{others}, and added effects may make up for it: state its `value` "
        "and `sd` from a data sheet or a scale, or check units and signs of what the rig file states"
    )


def _missed(found: Record) -> str:
    numbers = found["numbers"]
    other = "the motion reach where training did not" if numbers["beyond"] else "training tell too little of the law"
    head, times = "misses the held-out recordings", "times as much as the training ones"
    if numbers["explains"]:
        head = "explains the training recordings to their noise and misses the held-out ones"
        times = "times their noise"
    if numbers["rms"] > numbers["scatter"]:
        scatter = quoted(numbers["scatter"], numbers["unit"])
        times = f"{times}, and more than the {scatter} by which these scatter about their mean"
    return (
        f"the model {head} by {quoted(numbers['rms'], numbers['unit'])} (rms), {figures(numbers['ratio'], 2)} "
        f"{times}: has the rig or its payload changed, or does {other}?"
    )


def _burst(found: Record) -> str:
    start, stop = (figures(found["numbers"][k], 4) for k in ("start", "stop"))
    when = f"at {start} s" if start == stop else f"between {start} and {stop} s"
    part = "half" if found["numbers"]["share"] >= 0.5 else "a quarter"
    asked = "was it pushed there, did it hit something, or did readings jump?"
    if found["numbers"].get("input_jumps"):
        when, asked = f"{when}, where its input jumps", "does that act late, or slower than the model says?"
    return f"{part} of what is left of {found['about']} lies {when}: {asked}"


def _times(fall: float) -> str:
    """Return how an error changed that fell so many times."""
    return f"{figures(fall, 2)} times smaller" if fall >= 1 else f"{figures(1 / fall, 2)} times larger"


def _scattered(found: Record) -> str:
    numbers = found["numbers"]
    which, source = "training" if numbers.get("trained") else "held-out", "estimated " if numbers["estimated"] else ""
    rms, noise = (quoted(numbers[k], numbers["unit"]) for k in ("rms", "noise"))
    head = (
        f"{which} readings lie {rms} (rms) from the model, {figures(numbers['ratio'], 2)} times their {source}noise of "
        f"{noise}"
    )
    if not numbers["white"]:
        return (
            f"{head}, and errors last over several readings: it is no noise of single readings, even where the model "
            "error counts as none"
        )
    if numbers["estimated"]:
        return (
            f"{head}, and what is left is white: that noise was estimated too low, or is larger for a while. Intervals "
            "are as wide as what is left asks for; state the noise of a reading in the rig file"
        )
    return (
        f"{head}, though averages of what is left are noise: are the time stamps off, are there spikes, was it "
        "disturbed for a while, or is the noise larger?"
    )


_SENTENCES: Mapping[str, Callable[[Record], str]] = {
    "declared_edge": lambda found: (
        f"{_value(found)} of the declared model ends at its bound, which follows from the recorded motion and not from "
        "physics, so that added effects may make up for it: check the units of time, input and output, or record "
        "faster motions"
    ),
    "strayed": _strayed,
    "effect_edge": lambda found: (
        f"{effect_name(found['effect'])} ends at the edge of what it may be, {_value(found)}: before you believe it, "
        "check the constants that the rig file states, units and signs"
    ),
    "missed": _missed,
    "burst": _burst,
    "like_noise": lambda found: (
        f"what is left is {figures(found['numbers']['ratio'], 2)} times the noise, as large held out, and depends on "
        "no state of the motion: it may be noise of the instrument that has a memory, or is larger than stated"
    ),
    "not_carried": lambda found: (
        f"with what was added the error is {_times(found['numbers']['train'])} in training, and "
        f"{_times(found['numbers']['held'])} held out: it may describe these training recordings only"
    ),
    "scattered": _scattered,
}


def failure_sentence(failure: Record) -> str:
    """Return why the declared model has no fit."""
    numbers = failure["numbers"]
    at = f", at {plain(numbers['time'])} s" if "time" in numbers else ""
    words = {
        "runs_away": "the declared system runs away from rest by itself, and so does every fit of it",
        "diverges": f"wherever its fit begins, the declared model leaves the measured range a hundred times over{at}",
        "unresolved": "the declared model moves too fast, or too wildly, for any integration step",
    }[failure["code"]]
    if "grows_in" in numbers:
        words += f"; at its guesses a small motion grows e-fold in {plain(numbers['grows_in'])} s"
    if "followed" in numbers:
        words += f"; it can be fitted to the first {plain(numbers['followed'])} s"
    return words


def remedy_sentence(failure: Record) -> str:
    """Return what would help where the declared model has no fit."""
    numbers = failure["numbers"]
    short = numbers.get("followed") or 3 * numbers.get("grows_in", 0.0)
    part = f"train on parts of {plain(short, 2)} s or less (samples = [start, stop] in [records])" if short else ""
    if failure["code"] == "runs_away":
        words = "check the signs: a spring has the potential + k q^2/2, a loss the dissipation + c dot(q)^2/2"
        return f"{words}. If the system is unstable by nature, {part}" if part else words
    if failure["code"] == "diverges":
        words = "check the units of the columns, and give guesses within a factor of two of the truth"
        return f"{words}; or {part}" if part else words
    return "check the units of stiffness and inertia, and their guesses: a light part on a stiff spring rings too fast"
