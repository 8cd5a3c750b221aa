"""What a fit estimates of every recording beside the parameters of the system, and what it is given to begin with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.equations.model import Model, check_declared
from discovery.estimation.natural_units import NaturalUnits
from discovery.foundation.arguments import check_names, check_number, check_pair, expect
from discovery.foundation.start_names import start_name
from discovery.mechanics import get_base
from discovery.recordings.chosen import Recordings, check_model, training_of
from discovery.recordings.experiment import Experiment

#: An initial state is known from the data to this part of the amplitude.
_KNOWN = 0.01
#: Of its prior, what is left of a start at rest: little enough that a misfit of any size does not outweigh it.
_REST = 1e-9
#: States of a swing whose acceleration is read, over those of a linear one.
_BENT = (1.0, 0.7, 0.45, 1.4)


@dataclass(frozen=True)
class StartValue:
    """One number that belongs to one recording."""

    name: str  # with that of the recording in brackets
    experiment: int  # number of the recording
    row: int  # which of its numbers: 0 deflection, 1 rate, from 2 on what `own_parameters` lists
    scale: float  # typical size of a step
    width: float  # of its prior, around zero
    #: Where its fit may begin; none where the recording tells it.
    starts: tuple[float, ...] = field(default=(), kw_only=True)
    own_unit: str = field(default="", kw_only=True)  # SI unit of what is no state; empty for a state
    guess: float = field(default=0.0, kw_only=True)  # what its recording tells of it; zero where that tells nothing
    believed: bool = field(default=False, kw_only=True)  # its prior keeps a fit from what no reading tells
    still: bool = field(default=False, kw_only=True)  # at rest, as the rig file says

    def unit(self, coordinate: str) -> str:
        """Return its SI unit where the coordinate has this one."""
        return self.own_unit or (coordinate, f"{coordinate} s^-1")[self.row]


def own_parameters(base: str, effects: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters of which every recording has its own value, in the order of `names`."""
    own = {p.name for e in effects for p in get_effect(e).parameters() if p.own or p.begins}
    return tuple(n for n in names if n in {*own, *get_base(base).begins})


def start_values(
    model: Model, units: NaturalUnits, experiments: Sequence[Experiment], own: Sequence[str], reference: str
) -> tuple[StartValue, ...]:
    """Return what is free of every recording, one after the other.

    `model`: its mechanics tell how many numbers a start has. `own`: parameters of which recordings have their own
    values, those of other models among them. `reference`: name of the recording from whose values those of the others
    are counted.
    """
    q, time = units.coordinate, units.time
    sizes = (q, q / time)[: model.mechanics.starts]
    begins = model.begins
    rate = 0 if model.mechanics.order == 1 else 1  # which number of a start is the rate
    found = []
    for i, e in enumerate(experiments):
        told = _told(model, e)
        begin = model.mechanics.first_state(e.first_readings) or e.initial_state(time)
        for row, (size, guess) in enumerate(zip(sizes, begin, strict=False)):
            if e.recording.at_rest and row == rate:
                least = _REST * size
                found.append(StartValue(e.initial_names[row], i, row, least, least, believed=True, still=True))
                continue
            # A spring that hardens or softens makes another swing of an acceleration than a linear one.
            starts = tuple(f * guess for f in _BENT) if e.reads_acceleration and guess else ()
            found.append(StartValue(e.initial_names[row], i, row, _KNOWN * size, size, guess=guess, starts=starts))
        for row, parameter in enumerate((model.parameters.get(n) for n in own), 2):
            # What effects have counts from the reference, a coordinate's start from its rest.
            if parameter is None or (e.recording.name == reference and parameter.name not in begins):
                continue
            begun = told.get(parameter.name)
            unit, name = units.scale(parameter), start_name(parameter.name, e.recording.name)
            starts, width = tuple(s * unit for s in parameter.starts), parameter.prior.width * unit
            still = parameter.name in begins and e.recording.at_rest
            width *= _REST if still else 1.0
            # What a coordinate's reading tells may be anywhere; what has arrived of an input is not read.
            read = begun is not None and not parameter.begins
            believed = parameter.name in begins and (still or not read)
            value = StartValue(name, i, row, 0.1 * width, width, believed=believed, still=still)
            if begun is not None and not still:
                value = replace(value, width=float(np.hypot(width, begun)), guess=begun)
            found.append(replace(value, starts=starts, own_unit=e.unit_of(parameter)))
    return tuple(found)


def _told(model: Model, experiment: Experiment) -> dict[str, float]:
    """Return what a recording tells of where coordinates begin that are not read, and states of drives.

    An input that acted for long has arrived.
    """
    told = model.mechanics.begun(experiment.first_readings) if model.mechanics.begins else {}
    drive, names = experiment.drive, [p.name for p in model.parameters.values() if p.begins]
    if drive is None or not names:
        return told
    return {**told, **dict.fromkeys(names, float(drive.evaluate(experiment.recording.time[:1])[0, 0]))}


def fitted_recordings(model: Model, experiments: Recordings) -> tuple[Experiment, ...]:
    """Return the recordings to which a model is fitted.

    Raises InputError for what is no model, no recordings, or recordings of another system.
    """
    expect(model, Model, "model", "Take declared_model(dataset), or make a Model(base, effects).")
    found = training_of(experiments)
    check_model(model, found)
    return found


def check_start(
    model: Model, experiments: tuple[Experiment, ...], start: Mapping[str, float] | None
) -> dict[str, float]:
    """Return start values by name.

    Raises InputError for a name that is neither a parameter of the model nor an initial state, or a value that is no
    finite number.
    """
    if start is None:
        return {}
    expect(start, Mapping, "start", 'Name the parameters, as in start={"alpha": 400.0}.')
    states = [name for e in experiments for name in e.initial_names]
    own = own_parameters(model.base, model.effects, tuple(model.parameters))
    states += [start_name(n, e.recording.name) for e in experiments for n in own]
    check_names((n for n in start if n not in states), model.parameters, "The model", "parameter")
    return {name: check_number(value, f"start[{name!r}]") for name, value in start.items()}


def given_uncertainty(
    model: Model, gaussian: Mapping[str, tuple[float, float]] | None
) -> dict[str, tuple[float, float]]:
    """Return what is known within an uncertainty; parameters of effects that the model lacks are passed over.

    Raises InputError for a name that nothing declares, or what is no mean with a standard deviation.
    """
    if gaussian is None:
        return {}
    expect(gaussian, Mapping, "gaussian", 'Give mean and sd by name, as in gaussian={"mu": (0.15, 0.02)}.')
    check_declared(model, gaussian)
    found = {n: check_pair(pair, f"gaussian[{n!r}]", "a mean and its sd") for n, pair in gaussian.items()}
    for name, (_, sd) in found.items():
        check_number(sd, f"sd of gaussian[{name!r}]", 0.0)
    return found
