"""The commented text of a drafted rig file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from discovery.declarations.unit_suffixes import split_suffix
from discovery.declarations.units import si_factor, si_symbol
from discovery.drafting.centre import centre_of
from discovery.drafting.force_view import is_seen_as_force, other_way, view
from discovery.drafting.guessed_units import angle_unit, said_of
from discovery.drafting.kind import Guess, equations, fits, guess_kind, has_columns_of_an_arm, swing_of
from discovery.drafting.law_of_motion import LOOKS, is_one_line, is_relative
from discovery.drafting.names import is_asked_for
from discovery.drafting.record_lines import DIFFERS, begins_at_rest, quoted_text, record_lines, trial_rows, unused_words
from discovery.drafting.signals import Signal, Signals, find_signals, open_table
from discovery.foundation.arguments import as_path, as_paths, check_names, check_number, expect
from discovery.foundation.errors import InputError
from discovery.foundation.estimate_text import figures
from discovery.foundation.sampling import mean_rate
from discovery.recordings.file_signals import ARM_STEMS
from discovery.recordings.running_on import falls_upwards
from discovery.rigs.kinds import KINDS

#: Standard deviations by which the centre of a free motion may lie beside zero without one being stated.
_BESIDE = 3.0
#: What absorbs an error of a zero, whatever the law of motion: it shifts the readings.
_OFF = "angle_offset"
#: Share of the steps of a held input that are none, and of its range that it jumps by.
_HELD, _JUMP = 0.5, 0.05


class Drafted(NamedTuple):
    """The text of a rig file, and what is said of the columns that it leaves out; empty where there are none."""

    text: str
    unused: str


def draft(
    files: Any,
    folder: str | os.PathLike[str] | None = None,
    *,
    holdout: Any = (),
    kind: str | None = None,
    rate: float | None = None,
    chosen: Mapping[str, str | None] | None = None,
) -> str:
    """Return the text of a rig file for recordings; what is no more than a guess says so.

    Parameters
    ----------
    files : path or sequence of path
        Recordings to fit, of the same columns. The first one tells them; all are asked what pulls the system back.
    folder : path, optional
        Where the rig file goes: files are named from there; that of the first recording by default.
    holdout : path or sequence of path
        Recordings that are never fitted.
    kind : str, optional
        Kind of system, if it is known.
    rate : float, optional
        Readings a second [Hz], for files without times.
    chosen : mapping of str to str or None, optional
        Columns that the user names, by ``"time"``, ``"input"`` and ``"output"``.

    Raises
    ------
    InputError
        For a file that cannot be read, or whose signals cannot be told apart; for a kind that there is not.

    Examples
    --------
    >>> text = draft_rig("datasets/spring_bench/train_high.csv")
    >>> [line for line in text.splitlines() if line.startswith("output")][0].partition("  #")[0]
    'output = { name = "position_mm", unit = "mm" } '
    """
    return drafted(files, folder, holdout=holdout, kind=kind, rate=rate, chosen=chosen).text


def drafted(
    files: Any, folder: Any = None, *, holdout: Any = (), kind: str | None, rate: float | None, chosen: Any = None
) -> Drafted:
    """Draft a rig file as `draft` does, and keep what is said of the columns that it leaves out."""
    remedy = "Give the path of a recording, or a list of them."
    fitted, held = as_paths(files, "files", remedy), as_paths(holdout, "holdout", remedy)
    _check_wishes(kind, rate, chosen)
    if not fitted:
        raise InputError("There is no recording to draft a rig file from. Give the path of one.")
    path = fitted[0]
    place = path.parent if folder is None else as_path(folder, "folder", "Give the folder of the rig file.")
    rows: list[str] = []
    rests: list[Path] = []
    unused = ""
    names = open_table(path)[0].columns
    if (kind is None or KINDS[kind].has_rod) and has_columns_of_an_arm(names):
        lines = _arm(path)
    else:
        found, *others = find_signals([*fitted, *held], rate=rate, chosen=chosen)
        guess = guess_kind([found, *others]) if kind is None else Guess(kind, "")
        if KINDS[guess.kind].needs_input is False and (chosen or {}).get("input") is None:
            found, *others = (_free(each) for each in (found, *others))
        _check(found, guess)
        if KINDS[guess.kind].unit == "rad" and found.output.guessed and found.output.unit == "1":
            found = replace(found, output=replace(found.output, unit=angle_unit(found.output.values)))
        unused = unused_words(found, [role for role, name in (chosen or {}).items() if name is not None])
        lines = _system([found, *others], guess, unused, third=not held)
        if len(fitted) == 1 and found.time is not None:
            rows = trial_rows(found)
        rests = [each.path for each in (found, *others) if begins_at_rest(each)]
    return Drafted("\n".join([*lines, "", *record_lines(fitted, held, place, rows, rests)]) + "\n", unused)


def _free(found: Signals) -> Signals:
    """Return signals of a system that nothing drives."""
    if found.input is None:
        return found
    return replace(found, input=None, moved=False, unused=(*found.unused, found.input.name))


def _check_wishes(kind: str | None, rate: float | None, chosen: Mapping[str, str | None] | None) -> None:
    """Refuse a kind that is not known, a rate that is none, and roles of columns that there are not."""
    if kind is not None:
        check_names([kind], KINDS, "A rig file", "kind of system")
    if rate is not None:
        check_number(rate, "rate", above=0.0)
    if chosen is not None:
        expect(chosen, Mapping, "chosen", 'Name the columns, as in chosen={"output": "x_mm"}.')
        check_names(chosen, ("time", "input", "output"), "A recording", "column for")


def _check(found: Signals, guess: Guess) -> None:
    """Refuse a kind that does not read what was recorded."""
    if found.reads == "speed" and not KINDS[guess.kind].has_own_equations:
        raise InputError(
            f"The output {found.output.name!r} of {found.path} is a speed, and {guess.kind} reads none. Leave --kind "
            "out for a draft of a system in its own equations (docs/YOUR_SYSTEM.md), or name a position with --output."
        )
    if KINDS[guess.kind].has_rod:
        raise InputError(
            f"{found.path} lacks the columns of a flexible arm: time_s, motor_angle_rad, and tip_x_m with tip_y_m, or "
            "tip_angle_rad, or tip_deflection_m. Rename its columns, with any unit as the suffix."
        )


def _top(path: Path) -> Iterator[str]:
    yield f"# Drafted by `discovery init` from {path.name}. Look at the lines that say `guessed`, correct what is"
    yield "# wrong, and see with `discovery check` what is understood."
    yield f"name = {quoted_text(path.stem)}"


def _arm(path: Path) -> Iterator[str]:
    yield from _top(path)
    table = open_table(path)[0]
    stems = {split[0]: (name, split[1]) for name in table.columns if (split := split_suffix(name, ARM_STEMS))}
    if {"tip_x", "tip_y"} <= set(stems):
        x, y = (table.numbers(stems[s][0]) * si_factor(stems[s][1] or "m") for s in ("tip_x", "tip_y"))
        reach = float(np.nanquantile(np.hypot(x, y), 0.99))
        yield f"length_m = {reach:.3f}                 # guessed: how far the tip was from the origin; measure it"
    else:
        yield "length_m = 1.0                   # FILL IN what you measure; guessed, and no more than that"
    yield "# Without these, nothing is predicted from first principles. A bare number has a usual uncertainty;"
    yield "# { value = 0.044, sd = 0.0002 } states it."
    yield "# tip_mass_kg = 0.044"
    yield "# beam_mass_kg = 0.012"
    yield "# flexural_rigidity_N_m2 = 0.126"
    yield "# position_noise_m = 3e-4         # of one camera reading; else it is estimated from the scatter"
    yield "# angle_noise_rad = 7e-5          # half a step of the encoder"


def _system(recordings: Sequence[Signals], guess: Guess, unused: str, *, third: bool) -> Iterator[str]:
    found = recordings[0]
    yield from _top(found.path)
    yield f"kind = {quoted_text(guess.kind)}" + (f"   # guessed: {guess.why}" if guess.why else "")
    own = KINDS[guess.kind].has_own_equations
    others = [other for other, its in KINDS.items() if other != guess.kind and fits(its, found)]
    if found.reads != "speed":
        if others:
            again = f"discovery init {found.path.name} --kind KIND"
            yield f"# or {', '.join(others)}: `{again}` declares what fits the kind"
        yield "# Any other system has equations of its own: docs/YOUR_SYSTEM.md"
    yield from other_way(found)
    if guess.kind == "oscillator" and found.input is None and si_symbol(found.output.unit) in ("m", "pixel"):
        yield '# A bob on a rod or thread, seen from the side: [system] with like = "filmed_pendulum" instead of `kind`'
        yield "# and [model]; read as a place, the sine of its angle would look like a spring that is not straight."
    if KINDS[guess.kind].hangs:
        yield "# from the axis to the middle of a small bob; stated, it is held against the motion:"
        yield "# length_m = { value = 0.80, sd = 0.005 }"
    yield ""
    if own:
        yield from (*equations(recordings), "")
    yield "[columns]"
    zero = _zero(recordings, guess)
    yield from _columns(found, guess, zero)
    if unused:
        yield f"# not used: {unused}"
        if own:
            yield "# What is read beside the output is fitted with it: `also`, docs/YOUR_SYSTEM.md"
    if KINDS[guess.kind].shaken and found.input is not None and is_one_line(found.input.unit, found.output.unit):
        yield from _base(found, found.input)
    if is_seen_as_force(found):
        yield from ("", *view(recordings, third=third))
    declared = [*KINDS[guess.kind].declared, *([] if zero is None else [_OFF])]
    if declared or not own:
        yield ""
        yield "[model]"
        yield "# what you declare; what it lacks is searched"
        if zero is not None:
            yield f"# {_OFF} fits what the guessed zero is off by: take it out where you state a zero that you measured"
        yield f"effects = [{', '.join(map(quoted_text, declared))}]"


def _base(found: Signals, base: Signal) -> Iterator[str]:
    """Say that the output counts from the base, and how a motion against the floor is declared."""
    relative = is_relative(found.seconds, found.output.si, base.si)
    yield f"# The output is read as relative to the base, {base.name!r}. {LOOKS[relative]}"
    yield "# If it was measured against the floor, remove the line `kind` and the table [model], and declare instead:"
    yield from (f"# {line}".rstrip() for line in equations([replace(found, moved=True)]))


def _columns(found: Signals, guess: Guess, zero: float | None) -> Iterator[str]:
    time = found.seconds
    if found.header:
        names = ", ".join(map(quoted_text, found.header))
        yield f"header = [{names}]   # the file has no line of names: name every column"
    span = float(time[-1] - time[0])
    size = f"{time.size} readings, {figures(span, 4)} s, {figures(mean_rate(time), 4)} a second on average"
    if found.time is None:
        yield f"time = {{ rate_hz = {found.rate:g} }}   # {size}"
    else:
        yield f"{_column('time', found.time)}   # {_guessed(found.time)}{size}"
    if found.input is not None:
        motion = KINDS[guess.kind].shaken or found.moved or is_seen_as_force(found)
        differentiated = motion or found.reads == "acceleration"
        between, why = ("", []) if differentiated else _between(found.input)
        yield f"{_column('input', found.input, between)}   # {_guessed(found.input)}{_range(found.input)}"
        yield from why
        if is_asked_for(found.input.name):
            yield "# By its name it is what a controller is asked for. What that applies drives: name its column, as a"
            yield "# voltage, a current or a duty. With this one the controller is a part of the system."
        if found.input.name in found.differ:
            yield f"# guessed as the input: it {DIFFERS[0]}. Remove the line if it does not drive"
    more, so = ("", "") if zero is None else (f", zero = {zero:.6g}", "zero guessed from the motion; ")
    good = np.isfinite(found.output.si)
    if guess.kind == "falling_body" and falls_upwards(si_factor("g_0"), time[good], found.output.si[good]):
        more, so = f"{more}, scale = -1", f"{so}scale guessed: it grows as the body falls, and a height does not; "
    if found.reads == "acceleration" and not KINDS[guess.kind].has_own_equations:
        more += ', reads = "acceleration"'
    yield f"{_column('output', found.output, more)}   # {_guessed(found.output)}{so}{_range(found.output)}"
    noise, step = found.noise
    shown = figures(noise, 2) if noise > 0.0 else "0.1"
    unit = "" if found.output.unit == "1" else f" {found.output.unit}"
    if step > 0.0:
        yield f"# It reads in steps of {figures(step, 3)}{unit}. The sd of rounding, {shown}{unit}, is taken as noise."
    elif noise > 0.0:
        yield f"# Its readings scatter by {shown}{unit} from one to the next, which is taken as their noise."
    yield f"# If you know the noise of a reading, state it: noise = {shown} inside the brackets of the output."
    yield "# Readings that were smoothed hide theirs: take raw ones."


def _between(given: Signal) -> tuple[str, list[str]]:
    """Say how an input runs between its samples, and why: held where it stays and jumps, else the recordings choose."""
    steps = np.abs(np.diff(given.values))
    if not steps.any():
        return ', interpolation = "hold"', []
    if (steps == 0.0).mean() > _HELD and steps.max() > _JUMP * np.ptp(given.values):
        return ', interpolation = "hold"', ["# guessed: it stays and jumps, so that it is held between its samples"]
    why = '# "auto": the recordings choose how it runs between samples; if you know it, "hold", "linear", "spline"'
    return ', interpolation = "auto"', [why]


def _column(role: str, signal: Signal, more: str = "") -> str:
    return f"{role} = {{ name = {quoted_text(signal.name)}, unit = {quoted_text(signal.unit)}{more} }}"


def _guessed(signal: Signal) -> str:
    """Say that a unit is a guess."""
    return said_of(signal.name, signal.unit, signal.values) if signal.guessed else ""


def _range(signal: Signal) -> str:
    return f"{figures(float(np.nanmin(signal.values)), 4)} to {figures(float(np.nanmax(signal.values)), 4)}"


def _zero(recordings: Sequence[Signals], guess: Guess) -> float | None:
    """Return the reading about which it goes, where a system that may rest anywhere is read beside zero."""
    found, its = recordings[0], KINDS[guess.kind]
    if found.input is not None or si_symbol(found.output.unit) == "s":
        return None
    sprung = its.has_own_equations and found.reads != "speed" and swing_of(recordings) is not None
    if not (its.rests_anywhere or sprung):
        return None
    centre = centre_of(found.seconds, found.output.values, found.noise[0])
    return centre.at if abs(centre.at) > _BESIDE * centre.sd else None
