"""Recordings that are read and from which nothing can be learned, refused with what to do."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import sympy as sp

from discovery.declarations.effect import Effect, Load, Potential
from discovery.declarations.registry import get_effect
from discovery.declarations.symbols import delta, delta_dot, omega, t, theta, v_x, x, x_g
from discovery.declarations.units import quoted, si_factor
from discovery.foundation.arrays import BoolArray
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.recordings.copies import scaled_copy
from discovery.recordings.experiment import Experiment, largest_deflection
from discovery.recordings.force_view import more_of_force

#: A rod bends where its deflections scatter by more than noise would, over the scatter of their steps.
_BENDS = 1.1
#: Readings that tell whether a body begins at rest.
_BEGINNING = 3
#: It does where they lie nearer to zero than this share of the largest, or than so many noise sds, ...
_AT_REST, _SEEN = 0.1, 3.0
#: ... and a position changes over them by less than this share of its fastest change.
_SLOW = 0.5
#: What laws are written in that pull on a body at rest, and its rates; by less than this share they hardly change.
_COORDINATES, _RATES, _HARDLY = (theta, delta, x, x_g), (omega, delta_dot, v_x), 0.1
#: Noise sds that a step must move it by.
_MOVES = 10.0


def refuse_unusable(recordings: Sequence[tuple[str, Experiment]]) -> None:
    """Refuse recordings, each with its role, from which nothing can be learned.

    Refused are a part without a measurement, a motion that rests in all that is fitted, an input that is a copy, or is
    dead in all of it, or could be a constant force, and an arm that bends in none of it.
    """
    for role, experiment in recordings:
        _refuse_one(role, experiment)
    fitted = [e for role, e in recordings if role == "train"]
    for refuse in (_refuse_unmoved, _refuse_undriven, _refuse_unbent):
        refuse(fitted)


def _refuse_one(role: str, experiment: Experiment) -> None:
    """Refuse a recording whose fitted or held-out part holds no measurement, or whose input is copied."""
    r = experiment.recording
    finite = np.asarray(np.isfinite(r.judged_output).all(axis=1))
    fitted = np.zeros(r.time.size, bool)
    fitted[experiment.fitted] = True
    parts = {"fitted": finite[fitted]} if role == "train" else {"held-out": finite}
    if role == "train" and not fitted.all():
        parts["held-out"] = finite[~fitted]
    fewest = experiment.rig.traits.fewest
    for name, part in parts.items():
        if part.sum() < fewest:
            raise _too_few(experiment, name, part, fewest, finite.size if len(parts) > 1 else None)
    given = experiment.rig.columns.input
    if r.input is not None and given is not None and any(scaled_copy(r.input, c) for c in r.output.T):
        raise InputError(
            f"{r.source}: the output is a copy of the input, column {given.name!r}, noise and all: no system does "
            "that. Write the column of each in [columns] of the rig file, or export the recording again."
        )


def _too_few(experiment: Experiment, name: str, part: BoolArray, fewest: int, divided: int | None) -> InputError:
    """Return the error of a part with too few readings; `divided` is the size of the recording that it is a part of."""
    r, view = experiment.recording, experiment.rig.view
    gaps, longer = part.size >= fewest, "give a longer recording"
    for flag in r.flags:
        if flag.code == "at_rest":
            longer = f"let it move for longer, it has come to rest at {flag.numbers['last']:.3g} s"
    ways = ["give a recording without so long a gap"] if gaps else [longer, "sample it more often"]
    if view is not None:
        # Of the force few readings are used, and none near its ends.
        ways = [longer, more_of_force(view, r.time, fewest, third=divided is not None)]
    if divided is not None:
        ways.append("name another recording to be held out, with --holdout or in [records] of the rig file")
    remedy, of = ", or ".join(ways), "" if divided is None else f", of {divided} in all"
    return InputError(
        f"{r.source}: its {name} part has {int(part.sum())} samples with an output{of}, and at least {fewest} are "
        f"needed. {remedy[0].upper()}{remedy[1:]}."
    )


def _refuse_unmoved(experiments: Sequence[Experiment]) -> None:
    """Refuse recordings in which all that is fitted is constant, or nearly all of it zero."""

    def moves(e: Experiment) -> bool:
        return bool((np.nanmax(e.recording.output[e.fitted], 0) > np.nanmin(e.recording.output[e.fitted], 0)).any())

    if any(map(moves, experiments)) and largest_deflection(experiments) > 0.0:
        return
    r = experiments[0].recording
    count = r.time[experiments[0].fitted].size
    part = f"the first {count} of {r.time.size} readings are fitted, and they" if count < r.time.size else "they"
    names = ", ".join(e.recording.source for e in experiments)
    raise InputError(
        f"{names}: {part} do not move, so nothing can be learned of a motion. Record the motion in more readings, or "
        "name parts that hold some as train and as holdout in [records] of the rig file, with samples = [start, stop]."
    )


def _refuse_undriven(experiments: Sequence[Experiment]) -> None:
    """Refuse an input that is the same throughout all that is fitted, unless it sets a body at rest moving."""
    first = experiments[0]
    inputs = [e.recording.input for e in experiments if e.recording.input is not None]
    if first.system.has_rod or not inputs:
        return
    given, values, reach = first.rig.columns.input, np.concatenate(inputs), largest_deflection(experiments)
    laws = () if np.ptp(values) > 0 else first.rig.declared
    constant = next((e for e in laws if _is_constant(get_effect(e), reach)), "")
    if not constant and any(map(_drives, experiments)):
        return
    # The levels of a force differ in what they do; those of a motion do nothing.
    if np.ptp(values) > 0 and get_base(first.rig.base).is_pushed:
        return
    value = f"{values[0]:g}" if given is None else quoted(float(values[0]), given.unit, 6)
    if constant:
        raise InputError(
            f"{first.recording.source}: the input is {value} throughout, and {constant} has a constant force of its "
            "own beside it: the two cannot be told apart, so the gain of the input cannot be found. Name recordings of "
            "other inputs in train as well, steps of several sizes, or remove the input from [columns] in the rig "
            f"file: {constant} then holds what it does."
        )
    # Where the first readings lie.
    y = first.recording.output[:, 0]
    level, zero = float(np.median(y[np.isfinite(y)][:_BEGINNING])), ""
    if get_base(first.rig.base).order == 0 and _drives(first, level):
        output = first.rig.columns.output
        begins = output.zero + level / (output.scale * si_factor(output.unit))
        zero = (
            f" It begins at rest: if the input is applied then, set zero = {begins:.6g} for the output in the rig file."
        )
    raise InputError(
        f"{first.recording.source}: the input is {value} throughout, so it drives nothing and its gain cannot be "
        f"found.{zero} Record an input that varies, steps of several sizes, or a step from rest at zero output. For a "
        "free decay, remove the input from [columns] in the rig file."
    )


def _is_constant(effect: Effect, reach: float) -> bool:
    """Whether a law holds a force of any size that hardly changes over deflections up to `reach`, and not in time."""
    if not isinstance(effect, Potential | Load):
        return False
    law, own = sp.sympify(effect.expression()), [sp.Symbol(p.name, real=True) for p in effect.parameters()]
    rest, far = ({**dict.fromkeys(_COORDINATES, q), **dict.fromkeys(_RATES, 0)} for q in (0, reach))
    for along, p in product(_COORDINATES if isinstance(effect, Potential) else _RATES, own):
        force = law.diff(along, p)
        if not force.has(t, *own) and force.subs(rest) != 0:
            return bool(abs(force.subs(far) / force.subs(rest) - 1) < _HARDLY)
    return False


def _drives(experiment: Experiment, level: float = 0.0) -> bool:
    """Whether the input of a recording varies, or is a force that sets a body at rest at this level moving.

    Where a rate is read that nothing pulls back, so does a force under which that grows: such a recording may begin on
    the way. A rate that hardly grows is steady, and drifts.
    """
    r, base = experiment.recording, get_base(experiment.rig.base)
    if r.input is None or np.ptp(r.input) > 0:
        return r.input is not None
    if not base.is_pushed or not r.input[0]:
        return False
    y = r.output[np.isfinite(r.output[:, 0]), 0] - level
    if y.size <= _BEGINNING:
        return False
    most, begins = float(np.max(np.abs(y))), float(np.median(np.abs(y[:_BEGINNING])))
    # Half of the readings are there: no single one that is wild.
    grown = float(np.median(np.abs(y[y.size // 2 :]))) - begins
    if base.order and base.starts == 1 and grown > max(_HARDLY * (grown + begins), _MOVES * r.noise[0]):
        return True
    rests = begins < max(_AT_REST * most, _SEEN * r.noise[0])
    steps = np.abs(y[_BEGINNING:] - y[:-_BEGINNING])
    # A decay about a constant begins elsewhere, or at speed; where rates are read, springs let it begin anywhere.
    tells = r.at_rest or (steps[0] < _SLOW * steps.max() if base.order == 0 else base.starts == 1)
    return bool(rests and tells and most > _MOVES * r.noise[0])


def _refuse_unbent(experiments: Sequence[Experiment]) -> None:
    """Refuse recordings of an arm that nowhere bends: nothing of how it does can be learned."""

    def bends(e: Experiment) -> bool:
        deflection = e.deflection[e.fitted]
        # What is noise alone scatters as its steps do.
        return bool(np.nanstd(deflection) > _BENDS * np.nanstd(np.diff(deflection)) / np.sqrt(2.0))

    if not experiments[0].system.has_rod or any(map(bends, experiments)):
        return
    names = ", ".join(e.recording.source for e in experiments)
    raise InputError(
        f"{names}: the tip never leaves the motor's line by more than its noise, so nothing of how the arm bends can "
        "be learned. Record faster moves, or check the columns of motor and tip."
    )
