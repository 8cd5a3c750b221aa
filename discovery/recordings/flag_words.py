"""The words of flags: what is unusual about a recording, one entry a code."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from discovery.recordings.running_on import DRIVEN
from discovery.recordings.time_words import TIMES, Words

UNDERSTATED, OVERSTATED, MISREAD = "noise_understated", "noise_overstated", "columns_misread"
REPEATED = "readings_repeated"
#: Severity of a flag that refutes what the rig file declares.
IMPOSSIBLE = "impossible"
_BENT = 0.9  # rms deflection of a rod [rad]

_STATED = (
    " beside its motion, but the rig file states a noise of {stated:unit}, which is used (with --estimate-noise, "
    "the scatter is). "
)
#: Words of a stated noise that the scatter contradicts, after the scatter itself.
NOISE = {
    UNDERSTATED: _STATED + "If that is too small, the rest of the noise may be taken for something missing.",
    OVERSTATED: _STATED
    + "If that is too large, small effects stay unseen; if the readings were smoothed, take raw ones.",
}
#: Severity and words of each code.
CODES: dict[str, Words] = {
    **TIMES,
    "encoding_guessed": (
        "note",
        "The file is not UTF-8: its text is read as {encoding}. Numbers do not depend on it; where a name or a unit "
        "looks wrong, export the file as UTF-8.",
    ),
    "held": (
        "left_out",
        "{column!r} stands still at {level:unit} until {until:time} s and then leaves: something holds the body until "
        "then. The recording is taken from its release on, as with samples = {part}.",
    ),
    "held_long": (
        "doubt",
        "{column!r} stands still at {level:unit} until {until:time} s and then leaves: something holds the body until "
        "then, and little is left after its release. Record more of the motion, and take it with samples = {part}.",
    ),
    "runs_on": (
        "doubt",
        "{column!r} stands still until {until:time} s and then runs on in one direction to the end, as what is driven "
        f"does and nothing pulls back. {DRIVEN}",
    ),
    MISREAD: ("doubt", lambda n: _misread(n)),
    "cells_empty": (
        "left_out",
        lambda n: (
            "{column!r} has {count:empty cell|empty cells} in {rows} rows, "
            + ("up to {longest} in a row, from" if n["longest"] > 1 else "the first at")
            + " {start:time} s: gaps, which are not compared."
        ),
    ),
    "swings_few": (
        "doubt",
        "{column!r} holds about {swings:.2g} swings ({duration:.3g} s): few to tell damping and weak forces apart. "
        "Better record ten.",
    ),
    "swing_cut": (
        "doubt",
        "{column!r} holds about {swings:.1g} of a swing ({duration:.3g} s): frequency, damping and the form of the "
        "force are hardly told apart. If it swings at all, record several swings, better ten: without a hold-out, the "
        "last third judges.",
    ),
    "readings_coarse": (
        "note",
        "{column!r} reads in steps of {step:unit4}: its noise is taken as at least {rounding:unit}, the standard "
        "deviation of rounding.",
    ),
    REPEATED: (
        "left_out",
        lambda n: (
            "{column!r} repeats the reading before in {share:.0%} of the rows in which it moves: it was asked "
            "{polled:.4g} times a second, and has a new reading {rate:.4g} times. The repeats are left out"
            + (
                ", and the others are taken at the times of the sensor's own steady clock."
                if n["moved"]
                else ". The others may be older than their stamps by up to {step:.2g} s: ask no more often than that."
            )
        ),
    ),
    "readings_stuck": (
        "left_out",
        lambda n: (
            "{column!r} is stuck "
            + ("for" if n["stretches"] == 1 else "in {stretches} stretches, {total} samples in all, the longest of")
            + " {length} samples from {start:time} s, while the system moves. They are left out."
        ),
    ),
    "readings_lost": (
        "left_out",
        "{count} readings of {column!r} are exactly 0 between readings far from that, the first at {start:time} s: the "
        "instrument read nothing. They are left out.",
    ),
    "readings_clipped": (
        "left_out",
        lambda n: (
            "{column!r} saturates at "
            + " and ".join(f"{{limits[{k}]:unit4}}" for k in range(len(n["limits"])))
            + ": {count} clipped samples are left out. Widen the instrument's range."
        ),
    ),
    "spikes": (
        "note",
        "{column!r} has {count:spike|spikes}, far from where the readings beside them would put them, the first at "
        "{start:time} s. They are kept.",
    ),
    "mean_creeps": (
        "doubt",
        "The mean of {column!r} creeps by {creep:unit} over the record: a drifting instrument, or a rest position that "
        "moves. The effect zero_drift is a steady drift; another may be taken for a force.",
    ),
    UNDERSTATED: ("doubt", "{column!r} scatters by {scatter:unit}" + NOISE[UNDERSTATED]),
    OVERSTATED: ("doubt", "{column!r} scatters by {scatter:unit}" + NOISE[OVERSTATED]),
    "angle_spikes": (
        "left_out",
        lambda n: (
            "{count:spike|spikes}, first at sample {first} (counted from 0), more than {jump:unit} from the readings "
            "before and after, which agree: no pendulum does that. "
            + ("It is" if n["count"] == 1 else "They are")
            + " left out."
        ),
    ),
    "angle_turned": (
        "left_out",
        "{count:reading|readings}, first at sample {first} (counted from 0) with {value:unit6}, more than a turn from "
        "those before and after: no pendulum does that. Left out.",
    ),
    "turns_joined": (
        "note",
        "The angle {column!r} jumps by full turns in {count:place|places}, first at sample {first}, counted from 0: "
        "the turns are joined.",
    ),
    "turns_away": (
        "note",
        "The angle {column!r} lies {count:full turn|full turns} from where a pendulum hangs: it is counted from there.",
    ),
    "angle_unit": (
        IMPOSSIBLE,
        "The period grows with the amplitude as that of a pendulum whose angle is in {right}: by {slower:.2g} % up to "
        "{amplitude:unit}, where it would grow by {due:.2g} % if the unit were as the rig file has it. Is the unit of "
        'the output right? For {right}, set unit = "{right}". If it is, declare the law that bends the period, such as '
        "cubic_stiffness, in [model].",
    ),
    "fall_rate": (
        IMPOSSIBLE,
        lambda n: (
            "The fall begins with {found:.3g} m/s^2 where gravity is {gravity:.4g} m/s^2, "
            + (
                "and drag never makes a fall faster"
                if n["found"] > n["gravity"]
                else "and drag is small as long as it is slow"
            )
            + ". Are the units of height and time right, and gravity?"
            + ("" if n["found"] > n["gravity"] else " Where the body floats in part, state gravity_m_s2 less buoyancy.")
            + (' Heights in {right} would fit: set unit = "{right}" for the output.' if n["right"] else "")
        ),
    ),
    "noise_alike": (
        "note",
        "Neighbouring readings of {column!r} err alike: their noise is {sd:unit}, of which {scatter:unit} shows from "
        "one to the next, as after a filter that ends near {cutoff:.3g} Hz. About {alike:.2g} of them tell as much as "
        "one of independent noise.",
    ),
    "noise_alternates": (
        "doubt",
        "Neighbouring readings of {column!r} err in opposite directions, as differences of counts do: over several of "
        "them noise is at least {ratio:.2g} times smaller. Give averages of neighbours, or what was counted.",
    ),
    "noise_uneven": (
        "doubt",
        "The noise of {column!r} is {sd:unit} here by its readings, and {larger:unit} in {other!r}, of one sensor. "
        "Where readings are held or smoothed they hide it, and count far too much: state the noise of that column in "
        "the rig file.",
    ),
    "alike_kept": (
        "doubt",
        "About {alike:.2g} neighbouring readings err alike, and are not averaged, which takes {least} of them: the "
        "motion or the input needs more, or too few would be left. They count for more than they tell: effects may be "
        "named that are none, and intervals are too narrow. Record longer, or without the filter.",
    ),
    "averaged": (
        "note",
        "{count} readings every {step:.3g} s were averaged by {length} to {kept} every {apart:.3g} s: nothing of the "
        "motion that stands out of the noise needs more. The motion begins before the first of them, where none is.",
    ),
    "force_thinned": (
        "note",
        "{kept} of {count} readings of the force are compared: one in {every}, and none within three periods of "
        "{cutoff:.3g} Hz, its cutoff, of an end.",
    ),
    "own_constant": ("note", "its {column} is {value:unit}, as the rig file says of it alone."),
    "at_rest": (
        "note",
        "the motion has ended before the recording has: its first {kept} of {count} readings are used, up to "
        "{last:time} s of {end:time} s.",
    ),
    "rate_as_position": (
        "doubt",
        "{column!r}, {what}, is taken as the position of a body: springs, losses and friction are then not what they "
        "are called. Declare a system in its own equations (docs/YOUR_SYSTEM.md); of a force beside a recorded motion "
        'a [view]; of an acceleration reads = "acceleration".',
    ),
    "third_apart": (
        "note",
        "nothing in the declared model pulls what is read back to a place, so what a prediction misses adds up: the "
        "last {held} of {count} readings are held out as a recording of their own, of which the start is fitted.",
    ),
    "searched_in_part": (
        "note",
        "effects are searched on the first {searched} of {count} readings; the models before and after are fitted to "
        "all of them.",
    ),
    "input_assumed": (
        "note",
        "the input between its samples was taken as {words}: however it runs there, the declared model blows up from "
        "its guesses.",
    ),
    "input_chosen": (
        "note",
        lambda n: (
            "the input between its samples was taken as {words}; error of the declared model with another, in units of "
            "this one's: {against}. "
            + (
                "A smaller one does not count: half a sample of lag, or a damping that the model lacks, gains as much. "
                if n.get("kept")
                else ""
            )
            + 'Set interpolation = "{interpolation}" in the rig file to keep it so.'
        ),
    ),
}


def _misread(numbers: Mapping[str, Any]) -> str:
    more = ", more than a rod bends in use" if numbers["bend"] > _BENT else ""
    likely = " With {likely} it would lie {left:.2g} rad beside it on average, not {aside:.2g}."
    return (
        f"The tip lies {{bend:.2g}} rad beside the motor's direction (rms){more}.{likely if numbers['likely'] else ''} "
        "Are its columns exchanged, is one of opposite sign, or is an angle in another unit than its column's name "
        "says?"
    )
