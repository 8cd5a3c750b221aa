"""The posterior of a fitted model: parameters, initial states and noise, sampled until independent ensembles agree."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version

import numpy as np
from numpy.random import SeedSequence

from discovery.estimation.fit import Fit
from discovery.foundation.arguments import as_path, check_number, check_seed, check_whole, expect
from discovery.foundation.errors import InputError, NotConverged
from discovery.foundation.progress import Progress, Tell, teller
from discovery.posterior.assembled import PACKAGES, of_chains, of_ensembles
from discovery.posterior.checkpoint import Remembered, fingerprint, restore, save
from discovery.posterior.diagnostics import LENGTH_IN_TAU, Convergence, convergence
from discovery.posterior.draws import Posterior
from discovery.posterior.ensembles import TEMPERED, Ensemble, grow, start_ensembles
from discovery.posterior.independence import Chains, independence_chains
from discovery.posterior.likelihood import LogPosterior, log_posterior
from discovery.posterior.noise import GAUSSIAN

FEWEST_ENSEMBLES = 4
_FEWEST_WALKERS, _WALKERS_A_DIMENSION, _MOST_WALKERS, _LANES = 64, 4, 2048, 32
# Effective samples that a walker yields in the shortest run that can converge: more walkers are better than more steps.
_YIELD = 40
# Part of the chain that counts as burn-in.
_BURN_IN = 0.25
# Steps after burn-in with which no chain can have converged, and steps that leave more in any case.
_FEWEST_STEPS, _SHORTEST_RUN = LENGTH_IN_TAU, 250
#: Methods by name: see `sample`.
QUICKEST, EMCEE = METHODS = ("quickest", "emcee")


def sample(
    fit: Fit,
    *,
    seed: int = 1,
    noise: str = GAUSSIAN,
    ensembles: int = FEWEST_ENSEMBLES,
    walkers: int | None = None,
    min_effective: float = 4000,
    r_hat_max: float = 1.01,
    max_steps: int = 20_000,
    method: str = QUICKEST,
    progress: Tell | None = None,
    backend_path: str | os.PathLike[str] | None = None,
) -> Posterior:
    """Sample the posterior of a fitted model until independent chains agree.

    Independent proposals around the fit are tried first, with Metropolis's rule. Where their weights, or what the first
    few steps of walkers saw, refute them, ensembles of walkers go on from these steps.

    Parameters
    ----------
    fit : Fit
        The fit: its minimum and covariance are where the walkers start, never what they end at.
    seed : int
        Seed; the same one gives the same draws.
    noise : str
        Noise model, see `discovery.posterior.likelihood.log_posterior`.
    ensembles : int
        Number of independent ensembles, at least four.
    walkers : int, optional
        Walkers of each; by default as many as give the effective samples in the fewest steps, at least 64 and four a
        dimension, at most 2048: a posterior that is dear to evaluate costs no more than was asked for.
    min_effective : float
        Effective samples wanted of every quantity, over all ensembles.
    r_hat_max : float
        Largest R-hat between the ensembles.
    max_steps : int
        Steps of every ensemble after which the run is given up.
    method : str
        ``"quickest"``, or ``"emcee"``: walkers in any case.
    progress : callable, optional
        Receives one sentence after every block, a `discovery.foundation.progress.Progress`: its ``done`` of ``total``
        effective samples are there, and ``seconds_left`` is how long the others take.
    backend_path : path, optional
        HDF5 checkpoint: written every few seconds, and continued from if it is there, to the very same draws.

    Raises
    ------
    NotConverged
        With autocorrelation times, effective samples and R-hat when `max_steps` were not enough.
    NotIdentifiable
        If the data leave a combination of parameters undetermined.
    ComputationError
        If no start near the fit has a finite density, or the walkers are degenerate.
    InputError
        For fewer than four ensembles or 250 steps, a number out of range, or if `backend_path` holds another run.

    Notes
    -----
    The errors of the readings are taken as the noise model has them, the Gaussian one as independent. Where the model
    leaves a systematic residual, the noise absorbs it, and `Posterior.status` says so.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> part = [data.train[0].first(100)]  # its first second
    >>> fit = fit_model(declared_model(data), part)
    >>> posterior = sample(fit, min_effective=500)
    >>> [(row["name"], round(row["mean"], 1)) for row in posterior.summary()[:2]]
    [('xi', 0.4), ('alpha', 400.0)]
    """
    tell = teller(progress)
    _refuse(fit, seed, ensembles, max_steps, walkers, method)
    wanted = check_number(min_effective, "min_effective", above=0.0), check_number(r_hat_max, "r_hat_max", above=1.0)
    if backend_path is not None:
        backend_path = as_path(backend_path, "backend_path", "Give the path of an HDF5 file.")
    target = log_posterior(fit, noise=noise)
    if walkers is None:
        walkers = _walkers(target.dimension, min_effective / ensembles)
    seeds = SeedSequence(seed).spawn(ensembles)
    group = start_ensembles(target, target.dimension, walkers=walkers, seeds=seeds)
    run = _run_of(target, [ensemble.state.coords for ensemble in group])
    asked = Remembered(target, keep=lambda: keep())
    if backend_path is not None and (known := restore(backend_path, group, run)) is not None:
        asked.values = known

    def keep() -> None:
        if backend_path is not None:
            save(backend_path, group, run, asked.values)

    if method == QUICKEST:
        for _ in grow(group, TEMPERED, keep):
            pass
        chains = _by_proposals(target, asked, group, seed, wanted, tell)
        keep()
        if chains is not None:
            return of_chains(fit, target, chains, seed)
    return _by_walkers(fit, target, group, keep, seed=seed, max_steps=max_steps, wanted=wanted, tell=tell)


def _by_proposals(
    target: LogPosterior,
    asked: Remembered,
    group: Sequence[Ensemble],
    seed: int,
    wanted: tuple[float, float],
    tell: Tell,
) -> Chains | None:
    """Return chains of independent proposals, told by what the walkers saw of the flattened density; None for none."""
    seen = [np.concatenate([getattr(e, name)[:TEMPERED] for e in group]) for name in ("chain", "log_prob")]

    def told(found: Convergence, seconds_left: float) -> None:
        tell(_progress(found, found.steps, wanted, seconds_left))

    return independence_chains(
        asked,
        target.factor,
        (seen[0].reshape(-1, target.dimension), seen[1].ravel()),
        # The walkers have the streams before.
        seeds=SeedSequence(seed).spawn(2 * len(group) + 1)[len(group) :],
        values=target.values,
        wanted=wanted,
        tell=told,
    )


def _by_walkers(
    fit: Fit,
    target: LogPosterior,
    group: Sequence[Ensemble],
    keep: Callable[[], None],
    *,
    seed: int,
    max_steps: int,
    wanted: tuple[float, float],
    tell: Tell,
) -> Posterior:
    """Grow ensembles of walkers until they agree."""
    began, before = time.perf_counter(), len(group[0].chain)
    for steps in grow(group, max_steps, keep):
        burn_in = max(int(_BURN_IN * steps), *(ensemble.adapted for ensemble in group))
        short = steps - burn_in < _FEWEST_STEPS
        if short and steps < max_steps:
            continue
        # Given up while the moves still adapt, a run is refused with what its second half says.
        draws = target.values(np.stack([ensemble.chain[steps // 2 if short else burn_in :] for ensemble in group]))
        found = convergence(draws)
        pace = (time.perf_counter() - began) / (steps - before) if steps > before else math.nan
        tell(_progress(found, steps, wanted, pace * steps * (found.times_longer(*wanted) - 1.0)))
        if not short and found.meets(*wanted):
            return of_ensembles(fit, target, group, found, draws, seed)
    raise _refusal(target.names, found, max_steps, *wanted)


def _refuse(fit: object, seed: object, ensembles: int, max_steps: int, walkers: int | None, method: str) -> None:
    expect(fit, Fit, "fit", "Make one with fit_model(model, dataset); a loop has two, `before` and `after`.")
    check_seed(seed)
    check_whole(ensembles, "ensembles")
    check_whole(max_steps, "max_steps")
    if walkers is not None:
        check_whole(walkers, "walkers", 1)
    if method not in METHODS:
        raise InputError(f"There is no method {method!r} of sampling; there are {', '.join(METHODS)}.")
    if ensembles < FEWEST_ENSEMBLES:
        raise InputError(f"{ensembles} ensembles cannot tell whether they agree; use at least {FEWEST_ENSEMBLES}.")
    if max_steps < _SHORTEST_RUN:
        raise InputError(f"{max_steps} steps are too few to tell anything; allow at least {_SHORTEST_RUN}.")


def _walkers(dimension: int, effective: float) -> int:
    """Return the walkers of an ensemble that has to yield so many effective samples, in whole lanes of the kernel."""
    wanted = max(_WALKERS_A_DIMENSION * dimension, min(effective / _YIELD, _MOST_WALKERS), _FEWEST_WALKERS)
    return math.ceil(wanted / _LANES) * _LANES


def _progress(found: Convergence, steps: int, wanted: tuple[float, float], seconds_left: float) -> Progress:
    """Return how far a run is.

    Effective samples are told from too few autocorrelation times too large: no more count than the slowest criterion
    leaves.
    """
    return Progress.counting(
        "sampling the posterior",
        min(float(found.ess.min()), wanted[0] / found.times_longer(*wanted)),
        wanted[0],
        "effective samples",
        beside=f"R-hat {found.r_hat.max():.3f}, {found.steps / found.tau.max():.0f} of {LENGTH_IN_TAU} autocorrelation "
        f"times after {steps} steps",
        seconds_left=seconds_left,
    )


def _run_of(target: LogPosterior, starts: Sequence[np.ndarray]) -> str:
    """Return the fingerprint of a run: data, model, step, whitening and start, which holds the seed."""
    problem = target.problem
    description = {
        "model": problem.model.to_dict(),
        "names": target.names,
        "noise": target.noise,
        "step": problem.bench.step,
        "leap": problem.bench.leap,
        "data": [e.recording.sha256 for e in problem.bench.experiments],
        "fitted": [e.fitted_samples for e in problem.bench.experiments],
        "packages": {name: version(name) for name in PACKAGES},
    }
    paces = [None if e.pace is None else e.pace.clock.tolist() for e in problem.bench.experiments]
    if any(paces):
        description["paces"] = paces
    arrays = [target.centre, target.factor, *starts]
    return fingerprint(json.dumps(description), *(np.ascontiguousarray(a).tobytes() for a in arrays))


def _refusal(
    names: Sequence[str], found: Convergence, max_steps: int, min_effective: float, r_hat_max: float
) -> NotConverged:
    message = (
        f"The ensembles did not converge in {max_steps} steps: wanted are R-hat of at most {r_hat_max:g}, at least "
        f"{min_effective:g} effective samples and {LENGTH_IN_TAU} autocorrelation times after burn-in, for every "
        "quantity. Free fewer parameters, or allow more steps (`max_steps` of `sample`)."
    )
    tau, ess, r_hat = (dict(zip(names, a.tolist(), strict=True)) for a in (found.tau, found.ess, found.r_hat))
    return NotConverged(message, tau=tau, ess=ess, r_hat=r_hat)
