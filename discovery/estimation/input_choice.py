"""How an input ran between its samples, chosen on the recordings where the rig file leaves it open."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from discovery.equations.lacking import candidates
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.foundation.errors import DiscoveryError
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.flags import Flag

#: An input that is moved about needs an acceleration; a force may jump. The first is kept where nothing tells.
_MOTIONS = ("motion", "spline", "band_limited")
_FORCES = ("spline", "band_limited", "linear", "hold")
#: Samples of a recording that are fitted: enough to tell, and quick.
_SAMPLES = 8192
#: Smallest gain in chi-square, in units of the best fit's noise, that tells one from another, and in what the best fit
#: leaves beyond the noise: half a sample is a lag, and a law that lacks damping has one.
_GAIN, _LEFT = 10.0, 1.2
#: Laws that the declared one most often lacks.
_LAWS = ("coulomb_friction", "quadratic_drag", "cubic_stiffness")
_WORDS = {
    "motion": "a motion",
    "spline": "a smooth curve (spline)",
    "band_limited": "band limited",
    "linear": "straight (linear)",
    "hold": "held (hold)",
}


def choose_interpolation(dataset: Dataset) -> Dataset:
    """Settle an input's ``interpolation = "auto"`` by fits to the training recordings.

    Fitted is the declared model, with friction, drag and a cubic spring beside it where that can be.

    `dataset`: returned as it is where the rig file names an interpolation, or there is no input of that kind. Returned:
    with every input made smooth in the chosen way, and a note on the training recordings of what was chosen, or assumed
    where the declared model blows up from its guesses.
    """
    column = dataset.rig.columns.input
    if column is None or column.interpolation != "auto":
        return dataset
    if dataset.rig.view is not None:
        # Prescribed motion is differentiated: only a smooth curve can be.
        return _with(dataset, "spline")
    cost, samples = _costs(dataset)
    if not cost:
        # Its fit is led to the end of the recordings later, or fails there with a remedy.
        first = _ways(dataset)[0]
        return _told(dataset, first, Flag("input_assumed", numbers={"words": _WORDS[first]}))
    best = min(cost, key=lambda n: cost[n])
    first = next(iter(cost))
    needed = max(_GAIN * cost[best] / samples, _LEFT * (cost[best] - samples))
    kept = best != first and cost[first] - cost[best] < needed
    best = first if kept else best
    against = ", ".join(f"{_WORDS[n]} {(c / cost[best]) ** 0.5:.4g}" for n, c in cost.items() if n != best)
    numbers = {"words": _WORDS[best], "against": against, "interpolation": best, "kept": kept}
    return _told(dataset, best, Flag("input_chosen", numbers=numbers))


def _told(dataset: Dataset, interpolation: str, flag: Flag) -> Dataset:
    """Return the dataset with its inputs made smooth in a given way, which its training recordings tell."""
    train = (replace(e, recording=replace(e.recording, flags=(*e.recording.flags, flag))) for e in dataset.train)
    return _with(replace(dataset, train=tuple(train)), interpolation)


def _ways(dataset: Dataset) -> Sequence[str]:
    """Return the interpolations that are tried."""
    moved = dataset.rig.traits.interpolation == "motion"
    return _MOTIONS if moved else _FORCES[: 2 if dataset.train[0].reads_acceleration else None]


def _costs(dataset: Dataset) -> tuple[dict[str, float], int]:
    """Return the chi-square of a fit with each interpolation, and the number of readings that are fitted."""
    declared, wide, samples = dict[str, float](), dict[str, float](), 0
    for name in _ways(dataset):
        # Uneven steps are no band-limited input, and what does not fit such a kind of curve is not that.
        with suppress(DiscoveryError):
            whole = _with(dataset, name).train
            parts = [e.first(min(e.recording.time[e.fitted].size, _SAMPLES)) for e in whole]
            fitted = fit(declared_model(parts[0]), parts)
            declared[name], samples = fitted.chi2, fitted.problem.bench.n_data
            lacking = [e for e in candidates(fitted.model) if e.partition("_at_")[0] in _LAWS]
            wide[name] = fit(fitted.model.with_effect(*lacking), parts, start=fitted.values).chi2
    return wide if wide.keys() == declared.keys() else declared, samples


def _with(dataset: Dataset, interpolation: str) -> Dataset:
    """Return the dataset with its inputs made smooth in a given way."""
    columns = dataset.rig.columns
    assert columns.input is not None
    rig = replace(dataset.rig, columns=replace(columns, input=replace(columns.input, interpolation=interpolation)))

    def smoothed(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
        return tuple(make_experiment(e.recording, rig, fitted_samples=e.fitted_samples) for e in experiments)

    return Dataset(rig, smoothed(dataset.train), smoothed(dataset.holdout), smoothed(dataset.test))
