"""The signals of a file: its times, its input and its output, told by names, units and values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from discovery.declarations.units import si_factor, si_symbol
from discovery.drafting.columns import numbers_of
from discovery.drafting.guessed_units import counts_frames, guessed_unit
from discovery.drafting.names import Meaning, is_current, meaning_of, words_of
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError, suggestion
from discovery.foundation.io import Table, read_table
from discovery.foundation.text_table import unnamed_columns
from discovery.recordings.reading_noise import estimate_noise, white_noise
from discovery.recordings.renewals import Renewals, renewals
from discovery.recordings.rounding import quantum, resolution
from discovery.recordings.running_on import runs_on
from discovery.recordings.time_stamps import steady_clock
from discovery.recordings.turns import joined_turns

#: Of a step, by which sampled times may differ.
_JITTER = 0.05
#: Share of rows in which what is called a time rises at least; rounded coarsely, most may repeat.
_RISES = 0.05
#: A column without a name that says so is one of times where it rises in nearly every row.
_CLOCK = 0.95
#: Roles without which other columns are looked at, and the fewest rows that tell anything.
_NEEDED, _FEWEST = {"time", "output"}, 3
#: Outputs that say nothing of a drive where they go one way: what falls is driven by its weight.
_NO_PLACES = {"height", "speed", "acceleration"}
#: Of its noise, the least that a motion is.
_MOVING = 5.0
#: What a picture tells of a place; numbered ones are coordinates of several bodies.
_AXES = {"x", "y", "z"}


@dataclass(frozen=True)
class Signal:
    """One column: name in the file, unit, whether that is a guess, and numbers in it (n,)."""

    name: str
    unit: str
    guessed: bool
    values: FloatArray

    @property
    def si(self) -> FloatArray:
        """The values in SI units."""
        return self.values * si_factor(self.unit)


@dataclass(frozen=True)
class Signals:
    """What a file holds: times (None where a rate is stated), what drives the system, and its motion.

    `header` are names given to the columns of a file without names, and `rate` [Hz] is that of one without times. The
    input is the motion of a base where it is `moved`; the name of the output says that it `reads` a ``"height"``,
    ``"speed"``, ``"acceleration"``, or something else. Of the columns that are `unused`, some are `still`: numbers that
    never change, and may yet be an input. What `differ` are those that do between recordings, be one the input.
    """

    path: Path
    header: tuple[str, ...]
    time: Signal | None
    rate: float | None
    input: Signal | None
    output: Signal
    moved: bool
    reads: str
    unused: tuple[str, ...]
    still: tuple[str, ...]
    differ: tuple[str, ...] = ()

    @cached_property
    def seconds(self) -> FloatArray:
        """The times [s] of the readings (n,), those of a steady clock where rounded stamps repeat."""
        if self.time is None:
            return np.arange(self.output.values.size) / (self.rate or 1.0)
        repeats = bool((np.diff(self.time.values) == 0.0).any())
        clock = steady_clock(self.time.values, [self.output.values]) if repeats else None
        return self.time.si if clock is None else clock.time * si_factor(self.time.unit)

    @cached_property
    def renewed(self) -> Renewals | None:
        """When the output was renewed; None where every reading is a new one."""
        return renewals(self.seconds, self.output.values)

    @cached_property
    def noise(self) -> tuple[float, float]:
        """The noise of a reading of the output, no less than that of its steps, and the step if that is what it is."""
        values, time, renewed = self.output.values, self.seconds, self.renewed
        if renewed is not None:
            values, time = values[renewed.fresh], time[renewed.fresh] if renewed.time is None else renewed.time
        scatter, step = estimate_noise(values, time), quantum(values, time)
        rounding = resolution(values, time) if step > 0.0 else 0.0
        return max(scatter, rounding), step if rounding > scatter else 0.0


def open_table(path: Path) -> tuple[Table, tuple[str, ...]]:
    """Read a file, and name its columns where it does not; InputError for a file that is no table."""
    header = unnamed_columns(path)
    return read_table(path, header or None), header


def find_signals(
    paths: Sequence[Path], *, rate: float | None = None, chosen: Mapping[str, str | None] | None = None
) -> list[Signals]:
    """Tell the signals of recordings of one system apart; without times, they have a `rate` of readings [Hz].

    The columns of the first one, and their units, are those of all. Where nothing in it drives, a cause does that is
    held, and at another value in another recording. `chosen` are columns that the user names, by ``"time"``,
    ``"input"`` and ``"output"``. InputError if there are no times and no rate, no output, or several columns could be
    it.
    """
    wanted = {role: name for role, name in (chosen or {}).items() if name is not None}
    first = _in_file(paths[0], rate, wanted)
    differ = _differing(paths, first.still)
    held = _first(differ, {name: meaning_of(name) for name in differ}, ("cause",), None)
    if first.input is None and held is not None:
        first = _in_file(paths[0], rate, {**wanted, "input": held})
    first = replace(first, differ=differ)
    signals = {"time": first.time, "input": first.input, "output": first.output}
    named = {role: signal.name for role, signal in signals.items() if signal is not None}
    others = (_in_file(path, rate, named) for path in paths[1:])
    return [first, *(_alike(first, other) for other in others)]


def _differing(paths: Sequence[Path], names: Sequence[str]) -> tuple[str, ...]:
    """Return which columns that never change in the first file hold another number in another one."""
    if len(paths) < 2 or not names:
        return ()
    files = [numbers_of(open_table(path)[0], set()) for path in paths]
    in_all = [name for name in names if all(name in file for file in files)]
    return tuple(name for name in in_all if len({v for file in files for v in _ends(file[name])}) > 1)


def _alike(first: Signals, other: Signals) -> Signals:
    """Return the signals of another recording in the units of the first."""

    def read(known: Signal | None, found: Signal | None) -> Signal | None:
        return None if known is None or found is None else replace(found, unit=known.unit)

    output = replace(other.output, unit=first.output.unit)
    time, given = read(first.time, other.time), read(first.input, other.input)
    return replace(other, time=time, input=given, output=output, moved=first.moved)


def _in_file(path: Path, rate: float | None, wanted: Mapping[str, str]) -> Signals:
    """Tell the signals of one file apart, of which some columns are named by their roles."""
    table, header = open_table(path)
    told = wanted.keys() | (set() if rate is None else {"time"})
    columns = numbers_of(table, set(wanted.values()) if told >= _NEEDED else None)
    if table.lines.size and table.lines.size < _FEWEST:
        raise InputError(f"{path} has too few rows of readings ({table.lines.size}). Export the recording again.")
    for name in wanted.values():
        if name not in columns:
            cell = f" Its cells are like {str(table.columns[name][0])!r}." if name in table.columns else ""
            cell = cell or suggestion(name, columns)
            raise InputError(f"{path} has no column of numbers {name!r}.{cell} {_list(columns)}")
    meanings = {name: meaning_of(name) for name in columns}
    time = None if rate is not None and "time" not in wanted else _time(path, columns, meanings, wanted.get("time"))
    # Neither a second column of times nor one that never changes is a signal, unless the user says so.
    varying = {n for n, values in columns.items() if meanings[n].role != "time" and _changes(values)}
    rest = [n for n in columns if n != time and n in varying | set(wanted.values())]
    given = wanted.get("input") or _input(rest, meanings, wanted.get("output"))
    output = wanted.get("output") or _output(path, {n: columns[n] for n in rest if n != given}, meanings)
    if output is None and len(rest) == 1 and given is not None and "input" not in wanted:
        output, given = given, None  # the only signal is what was measured
    if output is None:
        raise InputError(f"{path} has no column that could be the output. Name one with --output. {_list(columns)}")
    instants = np.arange(columns[output].size, dtype=np.float64) if time is None else columns[time]
    read = _joined(_signal(output, columns, meanings, "output"), instants)
    still = [name for name, values in columns.items() if meanings[name].role != "other" and not _changes(values)]
    if given is None and meanings[output].role not in _NO_PLACES and runs_on(read.si, read.unit):
        # What goes on and on is driven, be it by a constant.
        given = _input([name for name in still if np.nanmax(np.abs(columns[name])) > 0.0], meanings, output)
    used, moved = {time, given, output}, given is not None and meanings[given].role == "moved"
    return Signals(
        path,
        header,
        None if time is None else _signal(time, columns, meanings, "time"),
        rate,
        input=None if given is None else _joined(_signal(given, columns, meanings, "input"), instants, moved=moved),
        output=read,
        moved=moved,
        reads=meanings[output].role,
        unused=tuple(name for name in table.columns if name not in used),
        still=tuple(name for name in still if name not in used),
    )


def _joined(signal: Signal, time: FloatArray, *, moved: bool = True) -> Signal:
    """Return a signal, without the jumps by full turns of an angle that was measured."""
    if not moved or si_symbol(signal.unit) != "rad":
        return signal
    joined, told = joined_turns(signal.si, time)
    return replace(signal, values=joined / si_factor(signal.unit)) if told else signal


def _changes(values: FloatArray) -> bool:
    least, largest = _ends(values)
    return largest > least


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))


def _list(columns: Mapping[str, FloatArray]) -> str:
    return f"Columns of numbers: {', '.join(columns)[:300] or 'none'}."


def _time(path: Path, columns: Mapping[str, FloatArray], meanings: Mapping[str, Meaning], named: str | None) -> str:
    """Return the column of times: called so, of frames, the first in even steps, or else the only one that rises."""
    if named is not None:
        return named
    for name, values in columns.items():
        steps = np.sign(np.diff(values))
        if meanings[name].role == "time" and (steps > 0).mean() > max((steps < 0).mean(), _RISES):
            return name
    perhaps = {name: columns[name] for name, told in meanings.items() if told.role == "" or told.lasts}
    frames = [name for name, values in perhaps.items() if counts_frames(name, values)]
    if frames:
        return frames[0]
    for name, values in perhaps.items():
        steps = np.diff(values)
        if steps.size and steps[0] > 0 and (np.abs(steps - steps[0]) <= _JITTER * steps[0]).all():
            return name
    rising = [name for name, values in perhaps.items() if (np.diff(values) > 0).all()]
    # A clock that was set back, or stamps that repeat, are told where it is read.
    rising = rising or [name for name, values in perhaps.items() if (np.diff(values) > 0).mean() > _CLOCK]
    if len(rising) == 1:
        return rising[0]
    raise InputError(
        f"{path} has no column of times that could be recognised. Name it with --time, or say with --rate how many "
        f"readings there are a second. {_list(columns)}"
    )


def _first(
    names: Sequence[str], meanings: Mapping[str, Meaning], roles: Sequence[str], taken: str | None
) -> str | None:
    return next((name for role in roles for name in names if meanings[name].role == role and name != taken), None)


def _input(names: Sequence[str], meanings: Mapping[str, Meaning], taken: str | None) -> str | None:
    """Return the column of what drives: a cause, no current, with a unit, before others; else the motion of a base."""
    of = sorted(names, key=lambda name: (is_current(name, meanings[name]), meanings[name].unit is None))
    return _first(of, meanings, ("cause", "moved"), taken)


def _output(path: Path, names: Mapping[str, FloatArray], meanings: Mapping[str, Meaning]) -> str | None:
    """Return the column of the motion: by its name, else the only speed, acceleration, or name that says nothing.

    Of several motions it is the first that is more than noise, of those along axes the one that varies most.
    """
    moving = [
        n
        for n, values in names.items()
        if np.nanstd(values) > _MOVING * max(white_noise(values) or 0.0, resolution(values))
    ]
    for of, roles in ((moving, ("height", "motion")), (list(names), ("height", "motion")), (list(names), ("moved",))):
        if (known := _first(of, meanings, roles, None)) is not None:
            alike = [n for n in of if meanings[n] == meanings[known] and not any(map(str.isdigit, n))]
            along = [n for n in alike if _AXES.intersection(words_of(n))]
            return max(along, key=lambda n: np.nanstd(names[n])) if known in along else known
    for role in ("speed", "acceleration", ""):
        found = [name for name in names if meanings[name].role == role]
        if len(found) > 1:
            most = f"; {max(found, key=lambda n: np.nanstd(names[n]))} varies most" if role else ""
            raise InputError(
                f"{path}: any of the columns {', '.join(found)[:300]} could be the output{most}. Name it with "
                "--output, and what drives the system, if one of them does, with --input."
            )
        if found:
            return found[0]
    return None


def _signal(name: str, columns: Mapping[str, FloatArray], meanings: Mapping[str, Meaning], role: str) -> Signal:
    values, unit = columns[name], meanings[name].unit
    if unit is not None and (role == "time") == (si_symbol(unit) == "s"):
        return Signal(name, unit, False, values)
    return Signal(name, guessed_unit(name, meanings[name], role, values), True, values)
