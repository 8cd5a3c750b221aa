"""Predictive bands: what a sampled model says of a recording, every draw through the kernel in one batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.held_states import fitted_states
from discovery.estimation.predict import arrived
from discovery.estimation.problem import Problem
from discovery.foundation.arguments import as_generator, check_names, check_pair, check_whole, expect
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.posterior.noise import errors_of
from discovery.posterior.noise.model import noise_names, own_of
from discovery.recordings.chosen import Recordings, check_model, training_of
from discovery.recordings.experiment import Experiment
from discovery.simulation.simulate import check_finite

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior

QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True, repr=False)
class Band:
    """Pointwise quantiles of one recording."""

    name: str  # of the recording
    time: FloatArray  # (n,) [s]
    channels: tuple[str, ...]
    units: tuple[str, ...]
    #: (3, n, c): 5, 50 and 95 % quantiles of the reading without noise: how uncertain the parameters leave it.
    motion: FloatArray
    reading: FloatArray  # (3, n, c), the same of what the instrument would read, noise included

    def __repr__(self) -> str:
        """Return name, size and channels."""
        channels = ", ".join(f"{name} [{unit}]" for name, unit in zip(self.channels, self.units, strict=True))
        return f"<Band of {self.name!r}: {self.time.size} times of {channels}>"

    def coverage(self, measured: FloatArray) -> FloatArray:
        """Return the share of measured values (n, c) within the 90 % band of the reading, shape (c,); NaN is no value.

        Where noise and model are right it is 0.9.
        """
        read = np.isfinite(measured)
        inside = read & (measured >= self.reading[0]) & (measured <= self.reading[2])
        with np.errstate(invalid="ignore"):
            return inside.sum(axis=0) / read.sum(axis=0)


def predictive(
    posterior: Posterior,
    experiments: Recordings,
    n: int = 200,
    *,
    seed: Generator | int = 1,
    initial: Mapping[str, tuple[float, ...]] | None = None,
) -> list[Band]:
    """Return predictive bands of recordings, free-run from the initial state on.

    Parameters
    ----------
    posterior : Posterior
        Draws, or what was read from their file.
    experiments : Dataset or sequence of Experiment
        The training recordings of a data set, or any others.
    n : int
        Number of draws.
    seed : int or Generator
        Of the choice of draws and of the noise.
    initial : mapping of str to (deflection, rate), optional
        Initial deflection [q] and rate [q/s] by name of the recording; otherwise the sampled ones of a recording that
        was fitted, and rest without deflection of any other.

    Returns
    -------
    list of Band
        In the order of `experiments`.

    Raises
    ------
    InputError
        If a recording has channels whose noise was not sampled, is of another system, or there are fewer draws; for an
        initial state of no recording.
    SimulationFailure
        If a draw's motion blows up.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> part = [data.train[0].first(100)]  # its first second
    >>> fit = fit_model(declared_model(data), part)
    >>> posterior = sample(fit, min_effective=500)
    >>> band = predict_bands(posterior, part, 50)[0]
    >>> band.units, band.reading.shape
    (('m',), (3, 100, 1))
    """
    if not hasattr(posterior, "flat"):
        raise InputError(f"`posterior` is a Posterior, but {posterior!r:.60} is none. Draw one with sample(fit).")
    experiments, rng = training_of(experiments), as_generator(seed)
    check_model(posterior.model, experiments)
    flat = posterior.flat()
    drawn = next(iter(flat.values())).size
    chosen = rng.choice(drawn, size=check_whole(n, "n", 1, drawn), replace=False)
    own = any(p.own or p.begins for p in posterior.model.parameters.values())
    _check_initial(initial, experiments, own=own)
    draws = {name: values[chosen] for name, values in flat.items()}
    bands, law = [], errors_of(posterior.noise)
    for experiment, channels in zip(experiments, simulated(posterior, experiments, draws, initial), strict=True):
        recording = experiment.recording
        factor = noise_factor(posterior, recording.channels, draws)
        unit = law.drawn(rng, channels.shape, own_of(recording.channels, draws))
        noise = recording.scatter[:, :, None] * factor * unit
        bands.append(
            Band(
                recording.name,
                recording.time,
                recording.channels,
                recording.units,
                np.quantile(channels, QUANTILES, axis=2),
                np.quantile(channels + noise, QUANTILES, axis=2),
            )
        )
    return bands


def _check_initial(initial: object, experiments: Sequence[Experiment], *, own: bool) -> None:
    """Refuse initial states of other recordings, and what is no deflection with a rate."""
    if initial is None:
        return
    expect(initial, Mapping, "initial", 'Name the recordings, as in {"holdout": (0.01, 0.0)}.')
    assert isinstance(initial, Mapping)
    check_names(initial, [e.recording.name for e in experiments], "The data set", "recording")
    for name, state in initial.items():
        # What a recording has of its own may follow.
        pair = state[:2] if own and isinstance(state, tuple) else state
        check_pair(pair, f"initial[{name!r}]", "the deflection and the rate at the start")


def simulated(
    posterior: Posterior,
    experiments: Sequence[Experiment],
    draws: Mapping[str, FloatArray],
    initial: Mapping[str, tuple[float, ...]] | None = None,
) -> list[FloatArray]:
    """Return the channels of recordings without noise by draw, each (n, c, k); see `predictive` for initial states.

    SimulationFailure if a draw's motion blows up.
    """
    bench = Bench(posterior.model.base, posterior.model.effects, experiments, posterior.step)
    problem = Problem(posterior.model, bench, posterior.natural, posterior.gaussian, reference="")
    n = next(iter(draws.values())).size
    rows = [draws[name] for name in problem.free]
    for state, (begun,) in zip(problem.states, arrived(problem), strict=True):
        given = (initial or {}).get(experiments[state.experiment].recording.name, ())
        known = state.row < len(given)
        rows.append(np.full(n, given[state.row]) if known else draws.get(state.name, np.full(n, begun)))
    parameters, states = problem.expand(np.array(rows))
    found = []
    for experiment, channels in zip(experiments, bench.predict(parameters, states), strict=True):
        check_finite(channels, experiment.recording.time, bench.names, parameters)
        found.append(channels)
    return found


def fitted_starts(posterior: Posterior, experiments: Sequence[Experiment]) -> dict[str, tuple[float, ...]]:
    """Return deflection [q], rate [q/s] and what `Bench.own` lists of recordings that were not fitted, by name.

    They are fitted to the readings with the parameters held at their posterior medians; a band that starts there holds
    no uncertainty of its start.
    """
    model = posterior.model
    if model.mechanics.prescribed or not experiments:
        return {}
    medians = {name: float(np.median(x)) for name, x in posterior.flat().items() if name in model.parameters}
    held = Model(model.base, model.effects, {**model.known, **medians})
    bench = Bench(model.base, model.effects, experiments, posterior.step)
    problem = Problem(held, bench, posterior.natural, {}, reference="")
    _, starts = problem.expand(fitted_states([problem])[0][:, None])
    return {e.recording.name: tuple(start[:, 0].tolist()) for e, start in zip(experiments, starts, strict=True)}


def noise_factor(posterior: Posterior, channels: tuple[str, ...], draws: Mapping[str, FloatArray]) -> FloatArray:
    """Return the noise of channels by draw, as a factor on what is stated; it must have been sampled."""
    for name in noise_names(channels):
        if name in posterior.stated_noise:
            return draws[name] / posterior.stated_noise[name]
    raise InputError(
        f"The noise of {', '.join(channels)} was not sampled, only {', '.join(posterior.stated_noise)}: "
        "predict recordings with the channels of those that were fitted."
    )
