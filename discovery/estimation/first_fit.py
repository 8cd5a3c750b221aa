"""The first fit of a declared model: where it blows up from its guesses, it is led from short parts to the whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.declared import declared_model, rig_uncertainty
from discovery.estimation.fit import Fit, fit
from discovery.estimation.problem import NaturalUnits
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment

__all__ = ["first_fit", "led"]

#: Parts of the recordings that are followed one after the other, and how many readings the first one has at least.
_PARTS, _FEWEST = tuple(2.0**-k for k in range(8, -1, -1)), 64


def first_fit(experiments: Sequence[Experiment], units: NaturalUnits) -> Fit:
    """Fit the model that the rig file declares, wherever its guesses lead.

    Parameters
    ----------
    experiments : sequence of Experiment
        Recordings to fit.
    units : NaturalUnits
        Natural units.

    Raises
    ------
    ComputationError
        If the model blows up from its guesses, and cannot be led to the end of the recordings either.
    """
    model = declared_model(experiments[0])
    gaussian = {} if experiments[0].system.has_rod else rig_uncertainty(experiments[0])
    try:
        return fit(model, experiments, units=units, gaussian=gaussian)
    except ComputationError as failure:
        values, part = led(model, experiments, units, gaussian)
        if part < 1.0:
            raise
        try:
            return fit(model, experiments, units=units, gaussian=gaussian, start=values)
        except ComputationError:
            raise failure from None


def led(
    model: Model,
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    gaussian: Mapping[str, tuple[float, float]],
) -> tuple[dict[str, float], float]:
    """Return the values that follow the longest first part of recordings, and which part that is.

    Over a short part no start blows up, and there its values become good enough for a part of twice that length.
    """
    values: dict[str, float] = {}
    followed, step = 0.0, float("inf")
    for part in _PARTS:
        first = [e.first(max(_FEWEST, round(part * e.recording.time[e.fitted].size))) for e in experiments]
        try:
            bench = Bench(model.base, model.effects, first, step) if values else None
            found = fit(model, first, units=units, gaussian=gaussian, start=values, bench=bench)
        except ComputationError:
            if values:
                break
            continue
        values, followed, step = found.values, part, found.problem.bench.step
    return values, followed
