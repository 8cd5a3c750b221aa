"""Independent ensembles of walkers that grow until they agree, on any log density that takes many points at once.

Each ensemble has a random stream of its own: emcee's samplers would otherwise all start from the state of numpy's
global generator. Growth happens in blocks, whose lengths depend on nothing but the number of steps done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import emcee
import numpy as np
from numpy.random import MT19937, Generator, RandomState, SeedSequence
from numpy.typing import NDArray

from discovery.errors import ComputationError

__all__ = ["Ensemble", "IndependenceMove", "check_walkers", "grow", "start_ensembles"]

FloatArray = NDArray[np.float64]
LogDensity = Callable[[FloatArray], FloatArray]

_LARGEST_CONDITION = 1e8
# Steps after which the independence move may adapt to the ensemble itself; then blocks grow by a part of the run.
_ADAPTATIONS, _WELL_ACCEPTED = (60, 200), 0.75
_GROWTH = 0.4
# Walkers start wider than the fit says, so that ensembles that agree have come together.
_START_WIDTH = 1.5
_ATTEMPTS = 100
# Ensembles at once: the log density does most of its work outside the interpreter's lock.
_THREADS = 2


class IndependenceMove(emcee.moves.Move):
    """Metropolis-Hastings with a proposal that ignores where the walker is: a multivariate Student t.

    In coordinates whitened by a fit it is nearly the posterior itself, and most steps are then new independent draws;
    where it is not, the acceptance corrects it (L. Tierney, Annals of Statistics 22 (1994) 1701).

    Parameters
    ----------
    dimension : int
        Dimension d.
    dof : float
        Degrees of freedom; tails heavier than those of the posterior keep walkers from sticking there.
    """

    def __init__(self, dimension: int, dof: float = 15.0) -> None:
        self.dof = dof
        #: Centre (d,) and lower triangular factor (d, d) of the proposal.
        self.centre: FloatArray = np.zeros(dimension)
        self.factor: FloatArray = np.eye(dimension)

    def adapt(self, points: FloatArray) -> None:
        """Take mean and covariance from points (k, d); steps taken before must then count as burn-in."""
        covariance = np.cov(points, rowvar=False).reshape(points.shape[1], -1)
        self.centre = np.asarray(points.mean(axis=0), np.float64)
        self.factor = np.asarray(np.linalg.cholesky(covariance), np.float64)

    def _log_density(self, points: FloatArray) -> FloatArray:
        # Not by BLAS here and below: its threads would spin for these few numbers.
        z = np.einsum("kj,ij->ki", points - self.centre, np.linalg.inv(self.factor))
        return -0.5 * (self.dof + z.shape[1]) * np.log1p(np.einsum("kd,kd->k", z, z) / self.dof)

    def propose(self, model: Any, state: emcee.State) -> tuple[emcee.State, NDArray[np.bool_]]:
        """Propose and accept for all walkers at once."""
        shape = state.coords.shape
        z = model.random.standard_normal(shape)
        z /= np.sqrt(model.random.chisquare(self.dof, shape[0]) / self.dof)[:, None]
        points = self.centre + np.einsum("kj,ij->ki", z, self.factor)
        log_prob, _ = model.compute_log_prob_fn(points)
        gain = log_prob - state.log_prob + self._log_density(state.coords) - self._log_density(points)
        accepted = -model.random.standard_exponential(shape[0]) < gain
        return self.update(state, emcee.State(points, log_prob=log_prob), accepted), accepted


class _Counted(emcee.moves.Move):
    """A move that counts how many of its proposals are accepted."""

    def __init__(self, move: emcee.moves.Move) -> None:
        self.move, self.proposed, self.accepted = move, 0, 0

    def propose(self, model: Any, state: emcee.State) -> tuple[emcee.State, NDArray[np.bool_]]:
        state, accepted = self.move.propose(model, state)
        self.proposed += accepted.size
        self.accepted += int(accepted.sum())
        return state, accepted


class Ensemble:
    """One ensemble of walkers with its own random stream.

    Parameters
    ----------
    log_density : callable
        Log density at points (k, d), minus infinity outside the support.
    coords : ndarray, shape (walkers, d)
        Where the walkers start.
    random_state : tuple
        State of a Mersenne twister, as `numpy.random.RandomState.get_state` gives it.

    Raises
    ------
    ComputationError
        If the walkers span less than all dimensions.
    """

    def __init__(self, log_density: LogDensity, coords: FloatArray, random_state: tuple[Any, ...]) -> None:
        check_walkers(coords)
        self.state = emcee.State(coords, log_prob=log_density(coords), random_state=random_state)
        self.proposal = IndependenceMove(coords.shape[1])
        self.moves = {
            "independence": _Counted(self.proposal),
            "differential_evolution": _Counted(emcee.moves.DEMove()),
            "snooker": _Counted(emcee.moves.DESnookerMove()),
            "stretch": _Counted(emcee.moves.StretchMove()),
        }
        weighted = list(zip(self.moves.values(), (0.6, 0.25, 0.05, 0.1), strict=True))
        self._sampler = emcee.EnsembleSampler(*coords.shape, log_density, moves=weighted, vectorize=True)
        #: Visited points (steps, walkers, d) and their log densities (steps, walkers).
        self.chain = np.empty((0, *coords.shape))
        self.log_prob = np.empty((0, len(coords)))
        #: Steps before the last adaptation of a move: burn-in at least.
        self.adapted = 0

    def advance(self, steps: int) -> None:
        """Continue by some steps; at first, adapt the independence move where it is hardly accepted."""
        self._sampler.reset()
        self.state = self._sampler.run_mcmc(self.state, steps, skip_initial_state_check=True)
        self.chain = np.concatenate([self.chain, self._sampler.get_chain()])
        self.log_prob = np.concatenate([self.log_prob, self._sampler.get_log_prob()])
        done, counted = len(self.chain), self.moves["independence"]
        if done in _ADAPTATIONS and counted.accepted < _WELL_ACCEPTED * counted.proposed:
            self.proposal.adapt(self.chain[-steps // 2 :].reshape(-1, self.chain.shape[2]))
            self.adapted = done


def check_walkers(coords: FloatArray) -> None:
    """Refuse walkers that could never leave the subspace in which they start.

    Parameters
    ----------
    coords : ndarray, shape (walkers, d)

    Raises
    ------
    ComputationError
        With the condition number of the walkers, or because they are fewer than 2 d.
    """
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
    """Return ensembles that start around the origin, each from a seed of its own.

    Parameters
    ----------
    log_density : callable
        Log density at whitened points (k, d).
    dimension : int
        Dimension d.
    walkers : int
        Walkers of each ensemble.
    seeds : sequence of SeedSequence
        One of each ensemble; two streams are spawned from it, one for the start and one for the chain.

    Raises
    ------
    ComputationError
        If hardly any start has a finite log density, or the walkers are degenerate.
    """
    ensembles = []
    for seed in seeds:
        # Not `spawn`, which counts up in the seed and would give another chain the next time.
        streams = [SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, i)) for i in range(2)]
        rng = Generator(MT19937(streams[0]))
        coords = np.empty((0, dimension))
        for _ in range(_ATTEMPTS):
            drawn = _START_WIDTH * rng.standard_normal((walkers, dimension))
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


def grow(ensembles: Sequence[Ensemble], max_steps: int) -> Iterator[int]:
    """Advance all ensembles block by block; yield the number of steps done after each, up to `max_steps`.

    The blocks depend on the number of steps alone: an interrupted run goes on as if it had not been.
    """
    done = len(ensembles[0].chain)
    if done:
        yield done
    while done < max_steps:
        ahead = [steps for steps in _ADAPTATIONS if steps > done]
        block = min(ahead[0] - done if ahead else int(_GROWTH * done), max_steps - done)
        with ThreadPoolExecutor(_THREADS) as pool:
            list(pool.map(lambda ensemble: ensemble.advance(block), ensembles))  # noqa: B023
        done += block
        yield done
