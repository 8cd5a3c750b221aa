"""The kind of system that a recording is of, as far as its signals tell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from discovery.declarations.unit_suffixes import split_suffix
from discovery.declarations.units import si_factor, si_symbol
from discovery.drafting.centre import centre_of
from discovery.drafting.force_view import is_seen_as_force
from discovery.drafting.law_of_motion import acceleration_of, own_period, rates_of
from discovery.drafting.signals import Signals
from discovery.foundation.errors import InputError
from discovery.recordings.file_signals import ARM_OUTPUTS, ARM_STEMS
from discovery.recordings.running_on import comes_back, counts_up, goes_back, runs_on
from discovery.rigs.kinds import Kind

#: Part of the way that a fall may leave of a parabola, and its acceleration over that of gravity: drag takes some.
_PARABOLA, _FALL = 0.02, (0.75, 1.1)
#: Which derivative of a coordinate is read, by the unit of the output.
_READ = {
    **{"m": "x", "m/s": "dot(x)", "m/s^2": "ddot(x)"},
    **{"rad": "angle", "1": "angle", "rad/s": "dot(angle)", "rad/s^2": "ddot(angle)"},
}


class Guess(NamedTuple):
    """A kind of system, and one clause that says why."""

    kind: str
    why: str


class Swing(NamedTuple):
    """A file that shows a swing about a place of rest, and its period [s]."""

    path: Path
    period: float


def has_columns_of_an_arm(names: Iterable[str]) -> bool:
    """Whether columns are those of a flexible arm: time, motor angle and tip."""
    found = {split[0] for name in names if (split := split_suffix(name, ARM_STEMS)) is not None}
    return {"time", "motor_angle"} <= found and any(found.issuperset(outputs) for outputs in ARM_OUTPUTS)


def fits(kind: Kind, found: Signals) -> bool:
    """Whether a built-in kind could have been recorded like this: with such an input, and an output in such a unit."""
    if kind.has_rod or kind.has_own_equations or kind.needs_input not in (None, found.input is not None):
        return False
    unit = si_symbol(found.output.unit)
    moved = None if found.input is None else si_symbol(found.input.unit)
    if kind.shaken and moved != unit and (moved, unit) != ("m", "rad"):
        return False
    return kind.unit in (None, unit)


def guess_kind(recordings: Sequence[Signals]) -> Guess:
    """Guess the kind of system from the signals of its recordings, and the name of the first file.

    Whether something pulls it back belongs to the system: any recording may show it.
    """
    found = recordings[0]
    unit, name = si_symbol(found.output.unit), found.path.name
    free = "no column is known to drive it" if found.unused else "nothing drives it"
    if is_seen_as_force(found):
        return Guess("drive", "a force is read, and the motion that takes it is given")
    if found.reads == "speed":
        return Guess("system", "a speed is read by a system in its own equations: docs/YOUR_SYSTEM.md")
    if found.input is None and unit == "m":
        if found.reads == "height" and swing_of([found]) is None:  # a bob on a spring has a height, too
            return Guess("falling_body", f"the output is a height, and {free}")
        if not found.output.guessed and _falls(found):
            return Guess("falling_body", f"it accelerates as what falls does, and {free}")
    if found.moved and found.input is not None and {unit, si_symbol(found.input.unit)} <= {"m", "rad", "1"}:
        return Guess("base_excited", f"{found.input.name!r} is the motion of a base")
    hanging = "pend" in f"{found.path.stem} {found.output.name}".lower()
    if not hanging and (one := next(filter(_goes_on, recordings), None)) is not None:
        if found.input is not None:
            return Guess("drive", "an input turns it on and on, and nothing pulls it back")
        goes = "an angle that turns on and on" if unit == "rad" else "it never turns back"
        where = "" if len(recordings) == 1 else f"in {one.path.name} "
        return Guess("system", f"{where}{goes}, and no input: in its own equations, docs/YOUR_SYSTEM.md")
    if found.input is None:
        if unit == "rad":
            if _turns_back_beyond_half_a_turn(found):
                return Guess("oscillator", "it turns back beyond half a turn to both sides, as on a torsion spring")
            again = f"discovery init {name} --kind oscillator"
            return Guess("pendulum", f"an angle, and {free}; on a torsion spring: `{again}`")
        return Guess("oscillator", free)
    if found.reads == "acceleration":
        return Guess("oscillator", "an acceleration does not tell whether anything pulls it back")
    swing, turned = swing_of(recordings), "pendulum" if unit == "rad" and hanging else "oscillator"
    if swing is None:
        if (one := next(filter(_comes_back, recordings), None)) is not None:
            return Guess(turned, f"in {one.path.name} it goes back while the input is zero")
        looked = name if len(recordings) == 1 else f"none of {len(recordings)} recordings"
        shows = "shows no swing" if len(recordings) == 1 else "shows a swing"
        return Guess("drive", f"an input moves it, and {looked} {shows} about a place of rest")
    back = f"in {swing.path.name} it swings about its rest, once in about {swing.period:.3g} s"
    return Guess(turned, back)


def _falls(found: Signals) -> bool:
    """Whether a place is read that moves along a parabola with the acceleration of gravity, or hardly less."""
    if found.reads in ("acceleration", "speed"):
        return False
    acceleration, left = acceleration_of(found.seconds, found.output.si)
    return left < _PARABOLA and _FALL[0] < abs(acceleration) / si_factor("g_0") < _FALL[1]


def _turns_back_beyond_half_a_turn(found: Signals) -> bool:
    """Whether an angle swings farther to both sides of its rest than a pendulum, which turns over there, and back."""
    off = found.output.si - centre_of(found.seconds, found.output.si).at
    return bool(min(np.nanmax(off), -np.nanmin(off)) > np.pi) and goes_back(off)


def _goes_on(found: Signals) -> bool:
    """Whether a place is read that only grows or only falls, as that of a rotor, so that nothing pulls it back."""
    unit, read = si_symbol(found.output.unit), found.output.si
    if unit == "rad":
        return runs_on(read)
    if found.reads in ("acceleration", "speed", "height") or unit not in _READ:
        return False
    return counts_up(read) or (found.input is None and runs_on(read, unit))


def _comes_back(found: Signals) -> bool:
    return found.input is not None and comes_back(found.output.si, found.input.si)


def swing_of(recordings: Sequence[Signals]) -> Swing | None:
    """Return how the first recording swings that swings about a place of rest, None where none does."""
    for found in recordings:
        period = own_period(found.seconds, found.output.si, None if found.input is None else found.input.si)
        if period is not None:
            return Swing(found.path, period)
    return None


class _Body(NamedTuple):
    """The words for what moves: its coordinate, and inertia and force with their units."""

    at: str
    unit: str
    inertia: str
    mass: str
    force: str
    loss: str


_SLIDES = _Body("x", "m", "mass", "kg", "N", "N s / m")


_TURNS = _Body("angle", "rad", "inertia", "kg m^2", "N m", "N m s / rad")


def equations(recordings: Sequence[Signals]) -> Iterator[str]:
    """Yield the lines of a table [system] that fits what was recorded, with numbers of the first recording.

    InputError for an output that is no motion of a body in an SI unit.
    """
    found = recordings[0]
    unit = si_symbol(found.output.unit)
    if unit not in _READ or (found.reads == "speed" and not unit.endswith("/s")):
        raise InputError(
            f"No equations can be drafted for the output {found.output.name!r} in {found.output.unit!r}, which is not "
            "a length, an angle, a speed or an acceleration. State its unit in its name, or write the table [system] "
            "yourself: docs/YOUR_SYSTEM.md shows how."
        )
    if unit == "rad/s" and found.input is not None and si_symbol(found.input.unit) == "V":
        return _motor(found)
    return _body(recordings, _READ[unit])


def _motor(found: Signals) -> Iterator[str]:
    assert found.input is not None
    d, b = rates_of(found.seconds, found.output.si, found.input.si, speed=True)
    lag, gain = (1.0 / d, b / d) if d > 0.0 and b != 0.0 else (0.1, 10.0)
    constant = 1.0 / gain
    yield "[system]"
    yield 'like = "dc_motor"   # a voltage turns it, its speed is read; docs/YOUR_SYSTEM.md'
    yield ""
    yield "[system.constants]"
    # A torque constant that is wrong but known would need negative losses, and effects would stand in for them.
    yield "# The recording tells no more than ratios. Without a data sheet, leave the lines, remove the marks:"
    yield "# what is missing is found, but inertia and torques count as at 1 ohm, and linear losses as torque constant."
    yield f'torque_constant = {{ guess = {constant:.3g}, unit = "N m / A" }}   # FILL IN value = that of the data sheet'
    yield 'resistance = { value = 1.0, unit = "ohm" }   # FILL IN value = that of the data sheet'
    yield f'inertia = {{ guess = {lag * constant**2:.3g}, unit = "kg m^2" }}'
    then = f"guess = {constant**2 / 10.0:.2g} beside a torque constant of the data sheet"
    yield f'loss = {{ value = 0.0, unit = "N m s" }}   # FILL IN {then}'


def _body(recordings: Sequence[Signals], output: str) -> Iterator[str]:
    found = recordings[0]
    body = _TURNS if "angle" in output else _SLIDES
    at, rate = body.at, f"dot({body.at})"
    unit = None if found.input is None else si_symbol(found.input.unit)
    base, force = found.moved and unit == body.unit, unit == si_symbol(body.force)
    given = None if found.input is None else found.input.si
    swing = None if output != at and given is not None else swing_of(recordings)
    springs = base or swing is not None
    steady = unit is None and output == at and not springs and _is_pushed(found)
    given = np.ones_like(found.seconds) if steady else given
    way, slip = (f"({at} - base)", f"({rate} - dot(base))") if base else (at, rate)
    yield "[system]   # each line is an example, guessed: correct it; docs/YOUR_SYSTEM.md"
    yield f'coordinates = {{ {at} = "{body.unit}" }}'
    if unit is not None:
        yield f'input = {{ {"base" if base else "drive"} = "{body.force if force else unit}" }}'
    yield f'kinetic = "{body.inertia}*{rate}^2/2"'
    yield f'{"" if springs else "# "}potential = "stiffness*{way}^2/2"   # of a spring'
    if body is _TURNS and unit is None:
        yield f'# potential = "-stiffness*cos({at})"   # of a pendulum, instead'
    yield f'dissipation = "damping*{slip}^2/2"'
    if unit is not None and not base:
        yield f'forces = {{ {at} = "{"drive" if force else "gain*drive"}" }}'
    elif steady:
        yield f'forces = {{ {at} = "steady_push" }}   # constant: it runs on, and no input was recorded'
    yield f'output = "{output}"'
    yield f'places = {{ {"spring" if springs else "body"} = "{way.strip("()")}" }}   # where effects may act'
    yield ""
    d, b = (
        (0.0, 0.0)
        if "ddot" in output or base
        else rates_of(found.seconds, found.output.si, given, speed=output == rate, spring=springs)
    )
    yield from _constants(
        body, (swing.period if swing else None) if springs else 0.0, d, b, None if base or force else unit, force
    )
    if steady:
        yield f'steady_push = {{ guess = {b:.3g}, unit = "{body.force}" }}'


def _is_pushed(found: Signals) -> bool:
    """Whether a place runs on as under a constant force along its way, and not as what only slows down."""
    read = found.output.si
    if not runs_on(read, "1"):
        return False
    push = rates_of(found.seconds, read, np.ones_like(read))[1]
    way = np.nanmean(read[read.size // 2 :]) - np.nanmean(read[: read.size // 2])
    return bool(push * way > 0.0)


def _constants(
    body: _Body, period: float | None, damping: float, gain: float, unit: str | None, force: bool
) -> Iterator[str]:
    """Yield the constants with what the recording tells of them; a `period` of 0 says that there is no spring."""
    inertia = 1.0 / gain if force and gain > 0.0 else 1.0
    stiffness = inertia * (2.0 * np.pi / (period or 1.0)) ** 2
    loss = inertia * damping if damping > 0.0 else 0.1 * np.sqrt(stiffness * inertia)
    yield "[system.constants]   # a value is known, a guess is fitted from there"
    known = (
        f'guess = {inertia:.3g}, unit = "{body.mass}" }}'
        if force
        else f'value = 1.0, unit = "{body.mass}" }}   # FILL IN what is known; only ratios to it are fitted'
    )
    yield f"{body.inertia} = {{ {known}"
    mark = "# " if period == 0.0 else ""
    yield f'{mark}stiffness = {{ guess = {stiffness:.3g}, unit = "{body.force} / {body.unit}" }}'
    yield f'damping = {{ guess = {loss:.3g}, unit = "{body.loss}" }}'
    if unit is not None:
        per = body.force if unit == "1" else f"{body.force} / ({unit})"
        yield f'gain = {{ guess = {gain or 1.0:.3g}, unit = "{per}" }}'
