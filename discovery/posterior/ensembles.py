"""Independent ensembles of walkers that grow until they agree, on any log density that takes many points at once.

Each ensemble has a random stream of its own: emcee's samplers would otherwise all start from the state of numpy's
global generator. Growth happens in blocks, whose lengths depend on nothing but the number of steps done.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import emcee
import numpy as np
from numpy.random import MT19937, Generator, RandomState, SeedSequence

from discovery.estimation.proposal import Proposal
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.foundation.workers import single_algebra
from discovery.posterior.moves import Counted, IndependenceMove

LogDensity = Callable[[FloatArray], FloatArray]

_LARGEST_CONDITION = 1e8
# Steps after which the proposal may adapt to the walkers, and blocks end; then blocks grow by a part of the run.
_ADAPTATIONS, _STOPS = (40, 80, 160, 320), (20, 40, 80, 120, 160, 320)
_GROWTH = 0.4
#: The first block sees the density's 16th root: walkers spread over all peaks within some ten standard deviations.
TEMPERED, _TEMPERATURE = 20, 16.0
# Proposals accepted less often than this, or a walker that rejects so many of them in a row, ask for a better proposal.
_WELL_ACCEPTED, _STICKING = 0.5, 10.0
# How often each move is made, while it is unknown whether the proposal resembles the posterior, and where it does.
_EXPLORING = {"independence": 0.6, "differential_evolution": 0.2, "jump": 0.1, "stretch": 0.1}
_INFORMED = {"independence": 0.94, "differential_evolution": 0.02, "jump": 0.02, "stretch": 0.02}
_ATTEMPTS = 100
# Seconds after which what was done is kept, also within a block.
_KEPT_AFTER = 2.0
# Ensembles at once: the log density does most of its work outside the interpreter's lock.
_THREADS = 2


class Ensemble:
    """One ensemble of walkers with its own random stream.

    The log density takes points (k, d), and is minus infinity outside the support; the walkers start at `coords`
    (walkers, d). The random state is that of a Mersenne twister, as `numpy.random.RandomState.get_state` gives it.
    ComputationError if the walkers span less than all dimensions.
    """

    def __init__(self, log_density: LogDensity, coords: FloatArray, random_state: tuple[Any, ...]) -> None:
        check_walkers(coords)
        self.state = emcee.State(coords, log_prob=log_density(coords), random_state=random_state)
        d = coords.shape[1]
        self.independence = IndependenceMove(Proposal(np.zeros(d), math.sqrt(_TEMPERATURE) * np.eye(d)))
        self.moves = {
            "independence": Counted(self.independence),
            "differential_evolution": Counted(emcee.moves.DEMove()),
            # As far as one walker is from another: from peak to peak (C. ter Braak, Statistics and Computing 16 (2006)
            # 239).
            "jump": Counted(emcee.moves.DEMove(gamma0=1.0)),
            "stretch": Counted(emcee.moves.StretchMove()),
        }
        #: Whether the proposal is known to resemble the posterior.
        self.informed = False
        #: Visited points (steps, walkers, d) and their log densities (steps, walkers).
        self.chain = np.empty((0, *coords.shape))
        self.log_prob = np.empty((0, len(coords)))
        #: Steps before the last adaptation of a move: burn-in at least.
        self.adapted = 0
        self._log_density = log_density

    def advance(self, steps: int) -> None:
        """Continue by some steps, which must not go beyond the next stop."""
        temperature = _TEMPERATURE if len(self.chain) < TEMPERED else 1.0
        self.state.log_prob = self.state.log_prob / temperature
        chances = _INFORMED if self.informed else _EXPLORING
        sampler = emcee.EnsembleSampler(
            *self.state.coords.shape,
            lambda points: self._log_density(points) / temperature,
            moves=[(move, chances[name]) for name, move in self.moves.items()],
            vectorize=True,
        )
        self.state = sampler.run_mcmc(self.state, steps, skip_initial_state_check=True)
        self.state.log_prob *= temperature
        self.chain = np.concatenate([self.chain, sampler.get_chain()])
        self.log_prob = np.concatenate([self.log_prob, temperature * sampler.get_log_prob()])

    def adapt(self) -> None:
        """Fit the proposal to the walkers where it is hardly accepted; make it often where it is well accepted."""
        done, standard = len(self.chain), Proposal.standard(self.chain.shape[2])
        if done == TEMPERED:
            self._propose(standard)
        elif done in _ADAPTATIONS:
            recent = slice(3 * done // 4, None)
            points = self.chain[recent].reshape(-1, self.chain.shape[2])
            well = self._well_accepted(points, self.log_prob[recent].ravel())
            if not well:
                self._propose(standard.adapted(points, np.full(len(points), 1 / len(points))))
            elif not self.informed:
                self._propose(self.independence.proposal)
            self.informed = well

    def _propose(self, proposal: Proposal) -> None:
        self.independence.proposal, self.adapted = proposal, len(self.chain)
        for move in self.moves.values():
            move.proposed = move.accepted = 0

    def _well_accepted(self, points: FloatArray, log_prob: FloatArray) -> bool:
        """Tell whether the proposal resembles the density at recent points: nowhere is it far too rare."""
        counted = self.moves["independence"]
        gain = log_prob - self.independence.proposal.log_density(points)
        sticking = float(gain.max() - np.median(gain)) > math.log(_STICKING)
        return counted.accepted >= _WELL_ACCEPTED * counted.proposed and not sticking


def check_walkers(coords: FloatArray) -> None:
    """Refuse walkers (walkers, d) that are fewer than 2 d, or could never leave the subspace in which they start."""
    walkers, d = coords.shape
    if walkers < 2 * d:
        raise ComputationError(f"{walkers} walkers cannot explore {d} dimensions; use at least {2 * d}.")
    centred = coords - coords.mean(axis=0)
    size = np.linalg.norm(centred, axis=0)
    condition = np.linalg.cond(centred / size) if np.isfinite(size).all() and (size > 0).all() else np.inf
    if not condition <= _LARGEST_CONDITION:
        raise ComputationError(
            f"The walkers start in a subspace and could never leave it: their condition number is {condition:.3g}. "
            "Start them from a covariance of full rank."
        )


def start_ensembles(
    log_density: LogDensity, dimension: int, *, walkers: int, seeds: Sequence[SeedSequence]
) -> list[Ensemble]:
    """Return ensembles that start around the origin of whitened coordinates, each from a seed of its own.

    Two streams are spawned from each seed, one for the start and one for the chain. ComputationError if hardly any
    start has a finite log density, or the walkers are degenerate.
    """
    ensembles = []
    for seed in seeds:
        # Not `spawn`, which counts up in the seed and would give another chain the next time.
        streams = [SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, i)) for i in range(2)]
        rng = Generator(MT19937(streams[0]))
        coords = np.empty((0, dimension))
        for attempt in range(_ATTEMPTS):
            # As wide as the first block spreads them; less where bounds or blow-ups leave little room.
            width = max(1.0, math.sqrt(_TEMPERATURE) * 0.9**attempt)
            drawn = width * rng.standard_normal((walkers, dimension))
            coords = np.concatenate([coords, drawn[np.isfinite(log_density(drawn))]])[:walkers]
            if len(coords) == walkers:
                break
        else:
            raise ComputationError(
                f"Only {len(coords)} of {_ATTEMPTS * walkers} starts around the fit have a finite posterior density; "
                "the fit lies outside the bounds, or its motion blows up."
            )
        state: Any = RandomState(MT19937(streams[1])).get_state()
        ensembles.append(Ensemble(log_density, coords, state))
    return ensembles


def grow(ensembles: Sequence[Ensemble], max_steps: int, keep: Callable[[], None] = lambda: None) -> Iterator[int]:
    """Advance all ensembles block by block; yield the number of steps done after each, up to `max_steps`.

    The blocks depend on the number of steps alone: an interrupted run goes on as if it had not been. `keep` is called
    after every block, and every few seconds within one.
    """
    began = done = len(ensembles[0].chain)
    ahead = TEMPERED
    for stop in _stops(max(max_steps, began)):
        while done < stop:
            steps, start = min(ahead, stop - done), time.perf_counter()
            with single_algebra(), ThreadPoolExecutor(_THREADS) as pool:
                list(pool.map(lambda ensemble: ensemble.advance(steps), ensembles))  # noqa: B023
            ahead = max(1, int(_KEPT_AFTER * steps / max(time.perf_counter() - start, 1e-6)))
            done += steps
            if done == stop:
                for ensemble in ensembles:
                    ensemble.adapt()
            keep()
        if stop >= began:
            yield stop


def _stops(max_steps: int) -> Iterator[int]:
    """Yield the numbers of steps at which blocks end."""
    done = 0
    while done < max_steps:
        ahead = [steps for steps in _STOPS if steps > done]
        done = min(ahead[0] if ahead else done + int(_GROWTH * done), max_steps)
        yield done
