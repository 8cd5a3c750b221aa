"""What a fit is asked for, checked before anything is computed from it."""

from __future__ import annotations

from collections.abc import Mapping

from discovery.equations.known_names import check_declared
from discovery.equations.model import Model
from discovery.estimation.start_values import own_parameters
from discovery.foundation.arguments import check_names, check_number, check_pair, expect
from discovery.foundation.start_names import start_name
from discovery.recordings.chosen import Recordings, check_model, training_of
from discovery.recordings.experiment import Experiment


def fitted_recordings(model: Model, experiments: Recordings) -> tuple[Experiment, ...]:
    """Return the recordings to which a model is fitted.

    Raises
    ------
    InputError
        For what is no model, no recordings, or recordings of another system.
    """
    expect(model, Model, "model", "Take declared_model(dataset), or make a Model(base, effects).")
    found = training_of(experiments)
    check_model(model, found)
    return found


def check_start(
    model: Model, experiments: tuple[Experiment, ...], start: Mapping[str, float] | None
) -> dict[str, float]:
    """Return start values by name.

    Raises
    ------
    InputError
        For a name that is neither a parameter of the model nor an initial state, or a value that is no finite number.
    """
    if start is None:
        return {}
    expect(start, Mapping, "start", 'Name the parameters, as in start={"alpha": 400.0}.')
    states = [name for e in experiments for name in e.initial_names]
    own = own_parameters(model.effects, tuple(model.parameters))
    states += [start_name(n, e.recording.name) for e in experiments for n in own]
    check_names((n for n in start if n not in states), model.parameters, "The model", "parameter")
    return {name: check_number(value, f"start[{name!r}]") for name, value in start.items()}


def given_uncertainty(
    model: Model, gaussian: Mapping[str, tuple[float, float]] | None
) -> dict[str, tuple[float, float]]:
    """Return what is known within an uncertainty; parameters of effects that the model lacks are passed over.

    Raises
    ------
    InputError
        For a name that nothing declares, or what is no mean with a standard deviation.
    """
    if gaussian is None:
        return {}
    expect(gaussian, Mapping, "gaussian", 'Give mean and sd by name, as in gaussian={"mu": (0.15, 0.02)}.')
    check_declared(model, gaussian)
    found = {n: check_pair(pair, f"gaussian[{n!r}]", "a mean and its sd") for n, pair in gaussian.items()}
    for name, (_, sd) in found.items():
        check_number(sd, f"sd of gaussian[{name!r}]", 0.0)
    return found
