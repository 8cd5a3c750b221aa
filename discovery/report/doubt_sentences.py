"""The sentences on what speaks against an answer, and on why there may be none."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from discovery.declarations.registry import effect_name
from discovery.declarations.units import quoted
from discovery.foundation.estimate_text import decimals, estimate_text, figures
from discovery.report.numbers import Record, listed, plain


def caution_sentence(found: Record) -> str:
    """Return what speaks against an answer, and what to do."""
    return _SENTENCES[found["code"]](found)


def _value(found: Record) -> str:
    unit = found["numbers"]["unit"]
    return f"{found['about']} = {figures(found['numbers']['value'])} {'' if unit == '1' else unit}".rstrip()


def _beside(found: Record) -> str:
    others = found["numbers"]["others"]
    return f", and so {'does' if len(others) == 1 else 'do'} {listed(others)}" if others else ""


def _estimate(found: Record, value: str = "value", sd: str = "sd") -> str:
    return estimate_text(*(found["numbers"][key] for key in (value, sd, "unit")))


def _strayed(found: Record) -> str:
    numbers = found["numbers"]
    others = f" ({', '.join(numbers['others'])}: far from the guess, too)" if numbers["others"] else ""
    times = numbers["value"] / numbers["guess"]
    size = f"{figures(times, 2)} times as large as" if times > 1.0 else f"{figures(1.0 / times, 2)} times smaller than"
    return (
        f"{_value(found)} of the declared model ends {size} its guess of {figures(numbers['guess'])}{others}, and "
        "added effects may make up for it: state its `value` and `sd` from a data sheet or a scale, correct the guess "
        "if it is one of a draft, or check units and signs of what the rig file states"
    )


def _held_sign(found: Record) -> str:
    name, other = found["about"], quoted(-found["numbers"]["guess"], found["numbers"]["unit"])
    if found["numbers"].get("passive"):
        return (
            f"{name} of the declared model ends at zero, and the recordings ask for a negative one, which no such "
            "constant is: something that the model lacks feeds energy there, or the recordings do not tell it"
        )
    return (
        f"{name} of the declared model ends at zero: a constant keeps the sign of its guess, and the recordings ask "
        f"for the other one. Give {name} a guess of {other}, or check the signs of the declared equations; added "
        "effects may make up for it"
    )


def _far_start(found: Record) -> str:
    times = figures(found["numbers"]["times"], 2)
    return (
        f"{found['about']} = {_estimate(found)}: what is not read begins {times} times as far off as the "
        "motion that is read explains, and its swing may stand for what the model lacks. If the recording begins at "
        "rest, say so: at_rest = true beside its file in [records]"
    )


def _acausal(found: Record) -> str:
    ahead, sd = quoted(found["numbers"]["ahead"], "s"), found["numbers"]["sd"]
    told = "" if sd is None else f" (+- {quoted(sd, 's')})"
    return (
        f"what is read moves {ahead}{told} before the input does: check the time of either column, and whether the "
        "input follows the output through a controller, as a command in a closed loop does; then the loop has to be "
        'declared (`[controller]` of kind "drive"), or what the controller does not make recorded as the input'
    )


def _missed(found: Record) -> str:
    numbers = found["numbers"]
    other = "the motion reach where training did not" if numbers["beyond"] else "training tell too little of the law"
    head, times = "misses the held-out recordings", "times as much as the training ones"
    if numbers["explains"]:
        trained = quoted(numbers["trained"], numbers["unit"])
        head = f"explains the training recordings to {trained} (rms) and misses the held-out ones"
        times = "times their noise"
    if numbers["rms"] > numbers["scatter"]:
        scatter = quoted(numbers["scatter"], numbers["unit"])
        times = f"{times}, and more than the {scatter} by which these scatter about their mean"
    changed = "did something change meanwhile" if numbers["continued"] else "has the rig or its payload changed"
    why = _hung(found) if found["about"] else f": {changed}, or does {other}?"
    rms, ratio = quoted(numbers["rms"], numbers["unit"]), figures(numbers["ratio"], 2)
    return f"the model {head} by {rms} (rms), {ratio} {times}{why}"


def _hung(found: Record) -> str:
    told, name = found["numbers"]["undetermined"], found["about"]
    remedy = f"state {name}" if told["constant"] else f"declare a system without {name} (docs/YOUR_SYSTEM.md)"
    remedy += ": what was refused for its held-out loss may be right"
    if found["effect"]:
        # It was added: there is nothing to leave out of a declaration.
        remedy = f"do not count on {effect_name(found['effect'])}: a simpler law may predict better"
    return (
        f", and that hangs on {name} = {estimate_text(told['value'], told['sd'], told['unit'])}, which training leaves "
        f"undetermined: moved by {figures(abs(told['sds']), 2)} sds it leaves {figures(100 * told['left'], 2)} % of "
        f"it. Hold out whole recordings (--holdout), or {remedy}"
    )


def _burst(found: Record) -> str:
    start, stop = (figures(found["numbers"][k], 4) for k in ("start", "stop"))
    when = f"at {start} s" if start == stop else f"between {start} and {stop} s"
    parts = {0.9: "nine tenths", 0.5: "half", 0.0: "a quarter"}
    part = next(words for least, words in parts.items() if found["numbers"]["share"] >= least)
    asked = "was it pushed there, did it hit something, or did readings jump?"
    if found["numbers"].get("begins"):
        when = f"{when}, where it begins"
        asked = "was it still held or pushed? Then let it begin later (samples in the rig file)"
        if found["numbers"].get("at_rest"):
            asked = "did it rest there, as at_rest in the rig file says? Else leave that out"
    if found["numbers"].get("input_jumps"):
        when, asked = f"{when}, where its input jumps", "does that act late, or slower than the model says?"
    return f"{part} of what is left of {found['about']} lies {when}: {asked}"


def _stamps(found: Record) -> str:
    numbers = found["numbers"]
    off, step = figures(numbers["deviation"], 2), numbers["step"]
    return (
        f"{figures(100 * numbers['share'], 2)} % of what is left of {found['about']} goes with how far the time stamps "
        f"lie from a steady clock of {figures(step, 3)} s ({off} s rms), as if readings were taken on it and stamps "
        f"erred. State that as their jitter ({off} s) in the rig file, or take the clock in their place, "
        f"time = {{ rate_hz = {figures(1 / step, 4)} }}"
    )


def _times(fall: float) -> str:
    """Return how an error changed that fell so many times."""
    return f"{figures(fall, 2)} times smaller" if fall >= 1 else f"{figures(1 / fall, 2)} times larger"


def _off(numbers: Record, than: str) -> str:
    """Return how far readings lie from a model, and beside their noise."""
    (rms, noise), ratio = (quoted(numbers[k], numbers["unit"]) for k in ("rms", "noise")), figures(numbers["ratio"], 2)
    which = "training" if numbers.get("trained") else "held-out"
    return f"{which} readings lie {rms} (rms) from the model, {ratio} times {than} noise of {noise}"


def _scattered(found: Record) -> str:
    numbers = found["numbers"]
    head = _off(numbers, "their estimated" if numbers["estimated"] else "their")
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
        f"{head}, though averages of what is left are noise, and so no model error: are the time stamps off, are there "
        "spikes, was it disturbed for a while, or is the noise larger?"
    )


def _quiet(found: Record) -> str:
    advice = "it was estimated too high, and small effects stay unseen. State the noise of a reading in the rig file"
    return f"{_off(found['numbers'], 'less than their estimated')}: {advice}"


def budget_sentence(numbers: Record) -> str:
    """Return which limit of work ended the search; results of old do not state it."""
    work = ("effects", "offers", "cost")
    effects, offers, cost = ((numbers.get(n, 0), numbers.get(f"most_{n}", math.inf)) for n in work)
    if effects[0] >= effects[1]:
        return f"the model holds {effects[1]} added effects, as many as the search may add"
    if cost[0] > cost[1]:
        return (
            f"simulations with what was added cost {plain(cost[0], 2)} times those of the start, and beyond "
            f"{plain(cost[1], 2)} times no further effect is sought"
        )
    if offers[0] >= offers[1]:
        return f"the catalogue was tried beside {offers[1]} sets, as many as the search may extend"
    return "a limit of the search’s work was reached, so no further effect was sought"


_SENTENCES: Mapping[str, Callable[[Record], str]] = {
    "declared_edge": lambda found: (
        f"{_value(found)} of the declared model ends at its bound, which follows from the recorded motion and not from "
        "physics, so that added effects may make up for it: check the units of time, input and output, or record "
        "faster motions"
    ),
    "strayed": _strayed,
    "stated_edge": lambda found: (
        f"{_value(found)} ends {figures(abs(found['numbers']['sds']), 2)} standard deviations from what the rig file "
        f"states, {_estimate(found, 'stated')}, as far as it may: measure it again, or state what it may err by; what "
        "the model lacks may have pushed it there, and added effects may make up for it"
    ),
    "combined": lambda found: (
        f"the recordings tell {listed([found['about'], *found['numbers']['others']])} together only: each may have "
        f"another size, and the rest makes up for it. State the `value` of {found['about']}"
    ),
    "held_sign": _held_sign,
    "far_start": _far_start,
    "acausal": _acausal,
    "effect_edge": lambda found: (
        f"{effect_name(found['effect'])} ends at the edge of what it may be, {_value(found)}{_beside(found)}: before "
        "you believe it, check units, signs, and constants that the rig file states"
    ),
    "seen_aside": lambda found: (
        f"{effect_name(found['effect'])} gives way the farther it is bent, and so does the sine of an angle: of a "
        'pendulum\'s bob that is seen from the side, declare [system] with like = "filmed_pendulum"'
    ),
    "untold": lambda found: (
        f"{effect_name(found['effect'])} serves, but none of its sizes lies 3 sds from zero, {found['about']} = "
        f"{_estimate(found)}: another law may do the same"
    ),
    "no_gain": lambda found: (
        f"the gain of the input is not told from zero, {found['about']} = {_estimate(found)}: the "
        "recordings are explained as well without an input. Is it the right column, with the right unit and clock?"
    ),
    "lost_gain": lambda found: (
        f"with what was added the gain of the input is not told from zero any more, {found['about']} = "
        f"{_estimate(found)} ({_estimate(found, 'before', 'before_sd')} before): that does as the input does in these "
        "recordings, and predicts no other input. Record another input, or state the gain"
    ),
    "unfinished": lambda found: (
        f"the final fit stopped after {found['numbers']['iterations']} steps on its way to a minimum: its values and "
        "intervals are not those of the best fit; declare better guesses, or state what the recordings do not tell"
    ),
    "stopped": lambda found: (
        f"the search ended before it had tried all it would: {budget_sentence(found['numbers'])}. More may be missing, "
        "or less in its place: declare what you know of the system, and search from there"
    ),
    "motionless": lambda found: (
        f"the training readings move by {figures(found['numbers']['times'], 2)} times their noise at most: they tell "
        "no law from none, and nothing that is missing could show in them"
    ),
    "missed": _missed,
    "stamps": _stamps,
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
    "quiet": _quiet,
}


def failure_sentence(failure: Record) -> str:
    """Return why the declared model has no fit."""
    numbers = failure["numbers"]
    at = f", at {plain(numbers['time'])} s" if "time" in numbers else ""
    words = {
        "runs_away": "the declared system runs away by itself, and so does every fit of it",
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


def stand_in_sentence(effect: str, found: Record) -> str:
    """Return which error of the rig file would do the same as an effect."""
    quantity, unit = found["quantity"], found["unit"]
    value = f"{found['value']:.{max(0, decimals(found['sd']))}f}"
    stated = estimate_text(found["stated"], found["sd"], unit)
    advice = f"measure the {quantity} before you believe the effect"
    if not found["doubtful"]:
        advice = "is that excluded? A usual standard deviation stands for one that the rig file does not state"
    return (
        f"a {quantity} of {value} {unit} in place of {stated} would do the same as {effect}; "
        f"it is {figures(abs(found['z']), 2)} standard deviations off: {advice}"
    )
