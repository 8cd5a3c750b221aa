"""What a rig file says of the signals: columns, the controller around a drive, the view of its force."""

from __future__ import annotations

from discovery.declarations.units import dimension, is_force, known_dimension, mistaken_for, si_factor, si_symbol
from discovery.foundation.errors import InputError
from discovery.rigs.kinds import KINDS
from discovery.rigs.rig import ARM_COLUMNS, Columns, Controller, ForceView, InputColumn, OutputColumn, TimeColumn
from discovery.rigs.rig_mistakes import RigText
from discovery.rigs.rig_schema import AlsoTable, ColumnsTable, RigTable, TimeTable

#: What a unit of an output certainly measures, by a unit of it; an angle is told from a pure number.
_MEASURED = {
    **{"kg": "a mass", "m": "a length", "rad": "an angle", "s": "a time", "N": "a force"},
    **{"m/s": "a speed", "rad/s": "a speed of turning"},
}
#: What an output cannot be measured in, by what is read, and what it is read as. The speed or the acceleration of a
#: linear body moves as its position does.
_REFUSED = {
    "position": (("kg",), "a position, as a length, an angle, or in volts"),
    "acceleration": (("kg", "m", "rad", "s", "N", "m/s", "rad/s"), "an acceleration, as in m/s^2, g_0 or volts"),
    "force": (("kg",), "a force or a torque, as in N, kgf or volts"),
}


def check_tables(file: RigText, table: RigTable) -> None:
    """Refuse tables that the kind of system does not have, or lacks."""
    kind, columns = KINDS[table.kind], table.columns
    if kind.has_rod:
        for name in ("columns", "controller", "view"):
            if getattr(table, name) is not None:
                raise InputError(
                    f"{file.at(name)}, declares [{name}], but the signals of an arm "
                    "are fixed (time_s, motor_angle_rad, tip_x_m, tip_y_m). Remove the table, or set kind to "
                    f"{', '.join(repr(other) for other in KINDS if other != kind.name)}."
                )
        return
    called = f"{'an' if kind.name[0] in 'aeiou' else 'a'} {kind.name}"
    if columns is None:
        raise InputError(f"{file} describes {called} but has no table [columns]. Declare time and output.")
    if kind.needs_input and columns.input is None:
        unknown = " Where it was not recorded, `discovery init --kind system` drafts a constant one."
        raise InputError(
            f"{file} describes {called}, whose input is the {kind.input}, but declares none. Add "
            f'input = {{ name = "...", unit = "..." }} to [columns].'
            f"{'' if kind.interpolation == 'motion' else unknown}"
        )
    if kind.needs_input is False and columns.input is not None:
        raise InputError(f"{file.at('columns', 'input')}, declares an input, but {called} has none. Remove it.")
    if columns.also and not kind.has_own_equations:
        raise InputError(
            f"{file.at('columns', 'also')}: {called} has one output. What is read beside it has an equation in a table "
            '[system], of the kind "system". Remove it, or declare the system there.'
        )
    _check_loop_and_view(file, table, called)
    if table.model is not None and not table.model.effects and not kind.may_be_bare:
        raise InputError(
            f"{file.at('model', 'effects')}: the key 'model.effects' is empty, but "
            f"{called} needs at least one effect. Name some, or remove the key for {', '.join(kind.declared)}."
        )


def _check_loop_and_view(file: RigText, table: RigTable, called: str) -> None:
    """Refuse a controller or a view where the mechanics with it are not those of the kind, and both at once."""
    driven = table.columns is not None and table.columns.input is not None
    for name, base in (("controller", "servo"), ("view", "inverse_dynamics")):
        kinds = [other.name for other in KINDS.values() if base in other.searched]
        if getattr(table, name) is not None and (table.kind not in kinds or not driven):
            raise InputError(
                f"{file.at(name)}: [{name}] belongs to {' or '.join(kinds)} with "
                f"an input, not to {called}. Remove the table."
            )
    if table.controller is not None and table.view is not None:
        raise InputError(
            f"{file.at('view')}: the force is seen without the controller. Keep one of [controller] and [view]."
        )


def _check_header(file: RigText, columns: ColumnsTable) -> None:
    also = (column.name for column in columns.also.values())
    named = [columns.time.name, columns.input and columns.input.name, columns.output.name, *also]
    for missing in (name for name in named if name and columns.header is not None and name not in columns.header):
        raise InputError(
            f"{file.at('columns', 'header')}: the header does not name the "
            f"column {missing!r}. Name every column of the file, from left to right."
        )


def columns_of(file: RigText, table: RigTable) -> Columns:
    """Return the declared columns in SI units.

    A unit that is not known or of the wrong kind, a time that is given twice or not at all, and a header that lacks a
    column are refused.
    """
    columns, kind = table.columns, KINDS[table.kind]
    if columns is None:
        return ARM_COLUMNS
    time = _time(file, columns.time)
    wanted = f"{kind.unit}/s^2" if kind.unit and columns.output.reads == "acceleration" else kind.unit
    scale = _factor(file, "output", columns.output.unit, None if table.view else wanted)
    _check_read(file, table, columns)
    if columns.input is not None:
        _factor(file, "input", columns.input.unit)
    _check_header(file, columns)
    given = columns.input.model_dump() if columns.input else {}
    if given and given["interpolation"] is None:
        given["interpolation"] = "spline" if table.view else kind.interpolation
    differentiated = table.view or kind.interpolation == "motion" or columns.output.reads == "acceleration"
    if differentiated and given and given["interpolation"] in ("linear", "hold"):
        raise InputError(
            f"{file.at('columns', 'input')}: the second derivative of this input is "
            f'needed; with interpolation = "{given["interpolation"]}" it has none. Set it to "spline", or remove it.'
        )
    found = Columns(
        time=time,
        input=InputColumn(**given) if given else None,
        output=_read(columns.output, scale),
        header=None if columns.header is None else tuple(columns.header),
        every=columns.every,
        also={name: _read(column, _factor(file, name, column.unit)) for name, column in columns.also.items()},
    )
    if kind.shaken and found.input is not None and not found.turns_by_shift:
        _refuse_unlike(file, found.input.unit, found.output.unit)
    return found


def _time(file: RigText, time: TimeTable) -> TimeColumn:
    """Return where the times come from: one of a column and a rate, which has no scale."""
    if (time.rate_hz is None) == (time.name is None) or (time.assumed and time.rate_hz is None):
        raise InputError(
            f"{file.at('columns', 'time')}: the time needs either a rate, "
            'time = { rate_hz = 100.0 }, or a column, time = { name = "t", unit = "ms" }; only a rate can be assumed.'
        )
    if time.rate_hz is not None and time.scale != 1.0:
        raise InputError(f"{file.at('columns', 'time')}: a rate has no scale. Remove it, or name a column.")
    second = _factor(file, "time", time.unit, "s")
    jitter = None if time.jitter is None else time.jitter * second
    return TimeColumn(time.name, time.unit, time.rate_hz, time.assumed, jitter=jitter, scale=time.scale)


def _read(column: AlsoTable, scale: float) -> OutputColumn:
    """Return a column of readings whose unit is so many of the SI one, its noise in SI units."""
    noise = column.noise * scale if isinstance(column.noise, float) else None
    return OutputColumn(**column.model_dump() | {"noise": noise})


def _check_read(file: RigText, table: RigTable, columns: ColumnsTable) -> None:
    """Refuse an output in a unit of something else than what is read; the equations of a system tell theirs."""
    if KINDS[table.kind].has_own_equations:
        return
    unit, reads = columns.output.unit, "force" if table.view else columns.output.reads
    refused, wanted = _REFUSED[reads]
    symbol = si_symbol(unit)
    # A unit that is none has the dimension of no other.
    measures = known_dimension(symbol)
    alike = (of for of in refused if symbol == of or (of != "rad" and measures == dimension(of.replace("/", " / "))))
    found = next(alike, None)
    if found is None:
        return
    remedy = mistaken_for(unit) or " Correct the unit, or what turns the readings into it: zero and scale."
    if reads == "position" and mistaken_for(unit):
        remedy += ' An accelerometer also needs reads = "acceleration".'
    if reads == "position" and found == "kg":
        weight = f"{unit}f" if unit in ("g", "kg") else "N"
        remedy += f" A force that a scale shows is in '{weight}', and the output of a [system] in its own equations."
    raise InputError(
        f"{file.at('columns', 'output', 'unit')}: the key 'columns.output.unit' is {unit!r}, {_MEASURED[found]}, but "
        f"the output is read as {wanted}.{remedy}"
    )


def _refuse_unlike(file: RigText, moved: str, read: str) -> None:
    """Refuse a base whose motion cannot be added to the deflection."""
    if si_symbol(moved) != si_symbol(read):
        raise InputError(
            f"{file.at('columns', 'input', 'unit')}: the base moves in {moved!r} and the deflection is in {read!r}, so "
            "that they cannot be added to the place in the fixed frame. Declare both as angles or both as lengths "
            "(scale = 1/l turns a small deflection into an angle), or a shift in m under a pendulum's angle in rad."
        )


def controller_of(file: RigText, table: RigTable) -> Controller | None:
    """Return the controller in SI units; `kv` and `limit` are stated in its unit and per unit of the output.

    A command's unit that is not known, and a reference that measures something else than the output, are refused.
    """
    given, columns = table.controller, table.columns
    if given is None or columns is None or columns.input is None:
        return None
    _factor(file, "input", columns.input.unit, columns.output.unit)
    try:
        unit = si_factor(given.unit)
    except InputError as error:
        raise InputError(f"{file.at('controller', 'unit')}, [controller]: {error}") from error
    return Controller(
        kp=given.kp,
        kv=given.kv * unit / si_factor(columns.output.unit),
        limit=None if given.limit is None else given.limit * unit,
        unit=given.unit,
        added=given.added,
    )


def view_of(file: RigText, table: RigTable) -> ForceView | None:
    """Return the view of the force.

    Input and output the wrong way round, and a motion that is smoothed more than the force that it explains, are
    refused.
    """
    given = table.view
    if given is None:
        return None
    _refuse_swapped(file, table.columns)
    if given.motion_cutoff_hz < given.cutoff_hz:
        raise InputError(
            f"{file.at('view', 'motion_cutoff_hz')}: the motion is smoothed below "
            f"{given.motion_cutoff_hz:g} Hz, but the force holds up to {given.cutoff_hz:g} Hz. Raise motion_cutoff_hz."
        )
    return ForceView(given.motion_cutoff_hz, given.cutoff_hz, given.decimation)


def _refuse_swapped(file: RigText, columns: ColumnsTable | None) -> None:
    """Refuse a recorded motion that is certainly a force, and a force that is certainly a position."""
    for name in ("input", "output"):
        column = getattr(columns, name)
        unit = si_symbol(column.unit)
        forced, placed = is_force(unit), unit in ("m", "rad")
        if forced if name == "input" else placed:
            is_what, wanted = ("a force or a torque", "motion") if forced else ("a position", "force")
            raise InputError(
                f"{file.at('columns', name, 'unit')}: the key 'columns.{name}.unit' is {column.unit!r}, {is_what}, but "
                f"with a table [view] the {name} is the {wanted}. Declare the recorded motion as input and the "
                "measured force or torque as output, or remove [view] to compare the motion."
            )


def _factor(file: RigText, column: str, unit: str, expected: str | None = None) -> float:
    try:
        return si_factor(unit, expected)
    except InputError as error:
        raise InputError(f"{file.at('columns', column, 'unit')}, column {column!r}: {error}") from error
