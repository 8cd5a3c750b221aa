"""The quick way to a posterior: independent chains by Metropolis's rule, all from draws of one adapted proposal.

Importance sampling adapts a Student t, bent where the posterior is (`discovery.estimation.proposal`). Its draws become
chains by the rule of the independence sampler (L. Tierney, Annals of Statistics 22 (1994) 1701): they need no weights,
and R-hat, autocorrelation and effective samples say of them what they say of any chain. The mean of such a chain has a
finite variance where the weights have one, which is where their Pareto k is below 1/2: the limit here. Of what lies
where hardly a draw comes k knows nothing: what walkers saw of the flattened density tells of another peak.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, SeedSequence

from discovery.estimation.importance import LEAST_EFFECTIVE, Weighted, pooled, smoothed, weighed
from discovery.estimation.proposal import Proposal, enough
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.errors import ComputationError
from discovery.posterior.diagnostics import Convergence, convergence

LogDensity = Callable[[FloatArray], FloatArray]

#: Pareto k from which the variance of the weights is infinite.
LARGEST_K = 0.5
# Draws of the rounds that adapt, and the share of them that makes further ones needless, or their gain.
_ROUNDS = (1024, 1024, 2048, 2048, 4096, 4096, 8192, 8192)
_WELL, _GAIN = 0.6, 1.1
# Effective samples of the chains over those of the weights, as it is with a good proposal; parts in which chains grow,
# and how many more draws than foreseen are made before it is given up.
_OF_WEIGHTS, _PARTS, _PATIENCE = 0.5, 4, 3
# A point that walkers saw and that is so many times rarer among the draws than any of them refutes the proposal.
_MISSED = 10.0


@dataclass(frozen=True)
class Chains:
    """Independent chains: points (chains, steps, d), and log densities there (chains, steps).

    `accepted` is the share of the draws that were accepted, `pareto_k` the shape of the largest weights, and `found`
    has the diagnostics of the quantities.
    """

    points: FloatArray
    log_density: FloatArray
    accepted: float
    pareto_k: float
    found: Convergence


def independence_chains(
    log_density: LogDensity,
    frame: FloatArray,
    seen: tuple[FloatArray, FloatArray],
    *,
    seeds: Sequence[SeedSequence],
    values: Callable[[FloatArray], FloatArray],
    wanted: tuple[float, float],
    tell: Callable[[Convergence, float], None],
) -> Chains | None:
    """Return converged chains, or None where they cannot be trusted.

    The log density takes points (k, d), in coordinates that make it roughly standard normal; the matrix `frame` (d, d)
    leads to coordinates in which its valleys may bend. `seen` are points (k, d) at which walkers were, and the log
    densities there. There is a seed for each chain, and one more for the adaptation. `values` makes quantities of
    points (..., d), whose diagnostics count: `wanted` are effective samples of each, and the largest R-hat. `tell` gets
    the diagnostics of the chains so far, and how many seconds the rest takes.
    """
    adapting, *streams = [Generator(np.random.MT19937(seed)) for seed in seeds]
    try:
        proposal, drawn = _adapted(log_density, frame, adapting)
    except ComputationError:
        return None
    if not _trusted(drawn):
        return None
    per_draw = _OF_WEIGHTS * drawn.share
    part = math.ceil(wanted[0] / per_draw / len(streams) / _PARTS)
    starts = adapting.choice(drawn.points, len(streams), p=drawn.weights)
    made = [(starts[:, None], log_density(starts)[:, None] - proposal.log_density(starts)[:, None])]
    began = time.perf_counter()
    for rounds in range(1, _PATIENCE * _PARTS + 1):
        made.append(_drawn(log_density, proposal, streams, part))
        points, log_weights = (np.concatenate([each[i] for each in made], axis=1) for i in range(2))
        kept, accepted = _by_the_rule(log_weights, seeds)
        chosen = np.take_along_axis(points, kept[:, :, None], axis=1)
        found = convergence(values(chosen)[:, :, None])
        fresh = log_weights[:, 1:].ravel()
        pace = (time.perf_counter() - began) / rounds
        tell(found, pace * rounds * (found.times_longer(*wanted) - 1.0))
        if found.meets(*wanted):
            k = smoothed(fresh[np.isfinite(fresh)])[1]
            if k > LARGEST_K or _misses(seen, proposal, float(fresh.max())):
                return None
            density = np.take_along_axis(log_weights, kept, axis=1)
            density += proposal.log_density(chosen.reshape(-1, chosen.shape[2])).reshape(density.shape)
            return Chains(chosen, density, accepted, k, found)
    return None


def _adapted(log_density: LogDensity, frame: FloatArray, rng: Generator) -> tuple[Proposal, Weighted]:
    """Return the proposal that another round would hardly better, and its draws; else the last that can be trusted."""
    proposal, last = Proposal.standard(len(frame), frame), 0.0
    made: list[tuple[Proposal, Weighted]] = []
    for count in _ROUNDS:
        if made:
            every, last = pooled(made), made[-1][1].share
            proposal = proposal.adapted(every.points, every.flattened(enough(len(frame))))
        made.append((proposal, weighed(log_density, proposal, rng, count)))
        share = made[-1][1].share
        if _trusted(made[-1][1]) and (share > _WELL or share < _GAIN * last):
            break
    return next((one for one in reversed(made) if _trusted(one[1])), made[-1])


def _trusted(drawn: Weighted) -> bool:
    return drawn.pareto_k <= LARGEST_K and drawn.share >= LEAST_EFFECTIVE


def _drawn(
    log_density: LogDensity, proposal: Proposal, streams: Sequence[Generator], count: int
) -> tuple[FloatArray, FloatArray]:
    """Return draws (chains, count, d) and their log weights (chains, count)."""
    drawn = [proposal.draw(rng, count) for rng in streams]
    points = np.stack([each for each, _ in drawn])
    log_weights = log_density(points.reshape(-1, points.shape[2])).reshape(len(streams), count)
    return points, log_weights - np.stack([each for _, each in drawn])


def _by_the_rule(log_weights: FloatArray, seeds: Sequence[SeedSequence]) -> tuple[IntArray, float]:
    """Return where each chain is after each draw but the first, and the share of draws that were accepted."""
    chains, count = log_weights.shape
    kept = np.empty((chains, count - 1), np.int64)
    for chain, (own, seed) in enumerate(zip(log_weights.tolist(), seeds[1:], strict=True)):
        stream = Generator(np.random.MT19937(SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 0))))
        here = 0
        for i, chance in enumerate(np.log(stream.random(count - 1)).tolist(), start=1):
            if chance < own[i] - own[here]:
                here = i
            kept[chain, i - 1] = here
    return kept, float(np.mean(np.diff(kept, axis=1, prepend=0) != 0))


def _misses(seen: tuple[FloatArray, FloatArray], proposal: Proposal, largest: float) -> bool:
    """Return whether walkers saw a place that is far too rare among the draws."""
    points, log_density = seen
    return float(np.max(log_density - proposal.log_density(points))) > largest + math.log(_MISSED)
