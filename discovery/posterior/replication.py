"""Readings that draws of a posterior would make again, and how likely each makes the readings that were made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator
from scipy import stats
from scipy.special import log_ndtr

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.start_names import start_of
from discovery.posterior.noise import GAUSSIAN, is_independent, words_of
from discovery.posterior.noise.quantised import Quantised
from discovery.posterior.noise.student_t import StudentT
from discovery.posterior.predictive import degrees, errors, noise_factor, simulated
from discovery.recordings.reading_noise import quantum

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior
    from discovery.recordings.experiment import Experiment


@dataclass(frozen=True)
class Replicated:
    """The n fitted readings of one recording beside what k draws make of them.

    `time` [s] and `channel` say when and by which channel each was `observed`. `again` (n, k) is what the instrument
    would have read, noise included, and `log_likelihood` (n, k) the log density of each reading; NaN where it is not
    defined.
    """

    name: str
    time: FloatArray
    channel: tuple[str, ...]
    observed: FloatArray
    again: FloatArray
    log_likelihood: FloatArray


def check_pointwise(noise: str) -> None:
    """Refuse a log likelihood of single readings where errors depend on each other."""
    if not is_independent(noise):
        raise InputError(
            f"Errors are taken as {words_of(noise)}, so that readings are not independent given the parameters: a log "
            "likelihood of single readings, and leave-one-out with it, means nothing. Ask for pointwise=False, and "
            "compare models by their evidence, with discovery.posterior.model_comparison.compare_models."
        )


def replicated(
    posterior: Posterior, experiments: Sequence[Experiment], draws: Mapping[str, FloatArray], rng: Generator
) -> list[Replicated]:
    """Return the fitted readings of recordings beside what draws (k,) of every quantity make of them.

    Raises
    ------
    InputError
        For a recording that was not fitted, or channels whose noise was not sampled.
    """
    for experiment in experiments:
        _check_fitted(posterior, experiment)
    parts = [experiment.fitted_part for experiment in experiments]
    found = []
    for experiment, motion in zip(parts, simulated(posterior, parts, draws), strict=True):
        r = experiment.recording
        seen = experiment.weights() > 0
        shape = (*motion.shape[:2], next(iter(draws.values())).size)
        motion = np.broadcast_to(motion, shape)
        scale = np.broadcast_to(r.scatter[:, :, None] * noise_factor(posterior, r.channels, draws), shape)
        half = np.broadcast_to(0.5 * np.array([quantum(column) for column in r.output.T])[:, None], shape)
        again = motion + scale * errors(r.channels, draws, shape, rng)
        score = _log_density(posterior.noise, r.output[:, :, None] - motion, scale, half, degrees(r.channels, draws))
        rows, columns = np.nonzero(seen)
        channel = tuple(r.channels[c] for c in columns)
        found.append(Replicated(r.name, r.time[rows], channel, r.output[seen], again[seen], score[seen]))
    return found


def _check_fitted(posterior: Posterior, experiment: Experiment) -> None:
    name = experiment.recording.name
    if posterior.model.mechanics.prescribed or experiment.initial_names[0] in posterior.names:
        return
    known = [found[1] for found in map(start_of, posterior.names) if found and found[0] == "delta"]
    raise InputError(f"The recording {name!r} was not fitted: the posterior is of {', '.join(known)}. Give those.")


def _log_density(
    noise: str, error: FloatArray, scale: FloatArray, half: FloatArray, nu: FloatArray | None
) -> FloatArray:
    """Return the log density of errors (n, c, k), NaN where they depend on each other."""
    if noise == StudentT.name and nu is not None:
        return np.asarray(stats.t.logpdf(error / scale, nu) - np.log(scale))
    if noise == Quantised.name:
        # The probability of the cell, from the tail in which both its ends lie.
        near, far = log_ndtr((half - np.abs(error)) / scale), log_ndtr((-half - np.abs(error)) / scale)
        return np.asarray(near + np.log1p(-np.exp(far - near)) - np.log(2.0 * half))
    return np.asarray(stats.norm.logpdf(error, scale=scale)) if noise == GAUSSIAN else np.full(error.shape, np.nan)
