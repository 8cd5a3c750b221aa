"""The words of flags about times: clocks, stamps, gaps, and rows that stand twice, one entry a code."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

#: Severity and words of a code: ``{x:unit}`` is a value in the unit of its column, with three digits or ``{x:unit4}``;
#: ``{n:one|several}`` is a count with its word.
Words = tuple[str, str | Callable[[Mapping[str, Any]], str]]

TIMES: dict[str, Words] = {
    "rate_unknown": (
        "note",
        "The sampling rate is not known: times count samples, and rates and frequencies are per sample.",
    ),
    "clock_far": (
        "note",
        "The zero of its clock is far from the recordings: times are counted from {zero:.10g} s, the earliest of all.",
    ),
    "samples_missing": (
        "note",
        "{missing:sample is|samples are} missing in {gaps:gap|gaps} of the times; the longest lasts {longest:.4g} s. "
        "The motion is computed through them, an input is interpolated.",
    ),
    "split_at_gaps": (
        "note",
        lambda n: (
            "{gaps:gap is|gaps are} too long beside how fast the input varies to interpolate it; the longest lasts "
            "{longest:.4g} s. The recording is split there, as with samples = " + _spans(n["parts"]) + ": each part "
            "has an initial state of its own."
        ),
    ),
    "input_unknown": (
        "doubt",
        lambda n: (
            "{gaps:gap is|gaps are} too long beside how fast the input varies to interpolate it, the longest lasts "
            "{longest:.4g} s, and the motion is computed through them nevertheless: parts beside them are short, or "
            "cannot be used alone. Name good parts in [records] of the rig file, of samples = "
            + _spans(n["parts"])
            + "."
        ),
    ),
    "times_irregular": (
        "note",
        "The time stamps {kind}: their steps lie between {shortest:.4g} and {longest:.4g} s. They are taken as they "
        "are.",
    ),
    "read_at_marks": (
        "note",
        "Readings count marks, one a row: what was measured is when each passed, {shortest:.4g} to {longest:.4g} s "
        "after the one before.",
    ),
    "rows_repeated": (
        "left_out",
        "{count:row holds|rows hold} the time and all readings of the row before, the first at {start:time} s: written "
        "twice. Each is used once.",
    ),
    "times_rounded": (
        "note",
        "The time stamps are rounded to {rounding:.2g} s: a steady clock of {rate:.4g} readings a second explains all "
        "of them. Its times are used; jitter = 0 in the rig file keeps the stamps.",
    ),
    "times_long": (
        "note",
        "The samples are {step:.4g} s apart{by}: a motion is rarely read so seldom. If it was read more often, correct "
        "the unit or the rate in the rig file.",
    ),
    "times_short": (
        "doubt",
        "The samples are {step:.4g} s apart{by}: no motion is read so often. Correct the unit or the rate in the rig "
        "file.",
    ),
    "stamps_err": (
        "note",
        "Readings scatter more where they move fast, as if their time stamps erred by {jitter:.2g} s (of a step of "
        "{step:.3g} s): slope times that is added to their noise. State it, time = {{ ..., jitter = ... }}, if known.",
    ),
    "times_err": (
        "doubt",
        "Readings scatter the more, the faster they move, as if each were taken {jitter:unit2} (sd) from its stamp, "
        "though the stamps are steady (a step of {step:unit}): so do resampled readings, as those of a film at another "
        "rate. Slope times that is added to their noise. Give the times at which readings were really taken; or state "
        "the error, time = {{ ..., jitter = {entry:g} }}, where you know it.",
    ),
    "evened": ("note", "its times are not equally spaced: motion and force are taken every {step:.4g} s, by splines."),
}


def _spans(parts: Sequence[Sequence[int]]) -> str:
    words = [f"[{first}, {last}]" for first, last in parts]
    return " and ".join([*([", ".join(words[:-1])] if words[:-1] else []), words[-1]])
