"""The posterior of a fitted model: parameters, initial states and noise, sampled until independent ensembles agree."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np
from numpy.random import SeedSequence

from discovery.estimation.fit import Fit
from discovery.foundation.arguments import check_seed, expect
from discovery.foundation.errors import InputError, NotConverged
from discovery.foundation.progress import Progress, Tell, teller
from discovery.posterior.checkpoint import fingerprint, restore, save
from discovery.posterior.diagnostics import LENGTH_IN_TAU, Convergence, convergence, tail_effective
from discovery.posterior.draws import Posterior
from discovery.posterior.ensembles import Ensemble, grow, start_ensembles
from discovery.posterior.likelihood import LogPosterior, log_posterior
from discovery.posterior.noise import GAUSSIAN
from discovery.posterior.prior_draws import prior_draws

__all__ = ["sample"]

FEWEST_ENSEMBLES = 4
_FEWEST_WALKERS, _WALKERS_A_DIMENSION, _MOST_WALKERS, _LANES = 64, 4, 2048, 32
# Effective samples that a walker yields in the shortest run that can converge: more walkers are better than more steps.
_YIELD = 40
# Part of the chain that counts as burn-in.
_BURN_IN = 0.25
# Steps after burn-in with which no chain can have converged, and steps that leave more in any case.
_FEWEST_STEPS, _SHORTEST_RUN = LENGTH_IN_TAU, 250
_PRIOR_DRAWS = 2000
_PACKAGES = ("discovery", "numpy", "scipy", "numba", "emcee", "arviz-stats")


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
    progress: Tell | None = None,
    backend_path: str | os.PathLike[str] | None = None,
) -> Posterior:
    """Sample the posterior of a fitted model until independent ensembles agree.

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
    progress : callable, optional
        Receives one sentence after every block, a `discovery.foundation.progress.Progress`: its ``done`` of ``total``
        effective samples are there, and ``seconds_left`` is how long the others take.
    backend_path : path, optional
        HDF5 checkpoint: written every few seconds, and continued from if it is there, to the very same draws.

    Returns
    -------
    Posterior

    Raises
    ------
    NotConverged
        With autocorrelation times, effective samples and R-hat when `max_steps` were not enough.
    NotIdentifiable
        If the data leave a combination of parameters undetermined.
    ComputationError
        If no start near the fit has a finite density, or the walkers are degenerate.
    InputError
        For fewer than four ensembles or 250 steps, or if `backend_path` holds another run.

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
    _refuse(fit, seed, ensembles, max_steps)
    target = log_posterior(fit, noise=noise)
    if walkers is None:
        walkers = _walkers(target.dimension, min_effective / ensembles)
    seeds = SeedSequence(seed).spawn(ensembles)
    group = start_ensembles(target, target.dimension, walkers=walkers, seeds=seeds)
    run = _run_of(target, [ensemble.state.coords for ensemble in group])
    if backend_path is not None:
        restore(backend_path, group, run)
    began, before = time.perf_counter(), len(group[0].chain)

    def keep() -> None:
        if backend_path is not None:
            save(backend_path, group, run)

    for steps in grow(group, max_steps, keep):
        burn_in = max(int(_BURN_IN * steps), *(ensemble.adapted for ensemble in group))
        short = steps - burn_in < _FEWEST_STEPS
        if short and steps < max_steps:
            continue
        # Given up while the moves still adapt, a run is refused with what its second half says.
        draws = target.values(np.stack([ensemble.chain[steps // 2 if short else burn_in :] for ensemble in group]))
        found = convergence(draws)
        pace = (time.perf_counter() - began) / (steps - before) if steps > before else math.nan
        tell(_progress(found, steps, min_effective, pace))
        if not short and found.meets(min_effective, r_hat_max):
            return _posterior(fit, target, group, found, draws, seed)
    raise _refusal(target.names, found, max_steps, min_effective, r_hat_max)


def _refuse(fit: object, seed: object, ensembles: int, max_steps: int) -> None:
    expect(fit, Fit, "fit", "Make one with fit_model(model, dataset); a loop has two, `before` and `after`.")
    check_seed(seed)
    if ensembles < FEWEST_ENSEMBLES:
        raise InputError(f"{ensembles} ensembles cannot tell whether they agree; use at least {FEWEST_ENSEMBLES}.")
    if max_steps < _SHORTEST_RUN:
        raise InputError(f"{max_steps} steps are too few to tell anything; allow at least {_SHORTEST_RUN}.")


def _walkers(dimension: int, effective: float) -> int:
    """Return the walkers of an ensemble that has to yield so many effective samples, in whole lanes of the kernel."""
    wanted = max(_WALKERS_A_DIMENSION * dimension, min(effective / _YIELD, _MOST_WALKERS), _FEWEST_WALKERS)
    return math.ceil(wanted / _LANES) * _LANES


def _progress(found: Convergence, steps: int, wanted: float, pace: float) -> Progress:
    """Return how far a run is, at a pace [s] of its steps."""
    effective, tau = float(found.ess.min()), float(found.tau.max())
    return Progress.counting(
        "sampling the posterior",
        effective,
        wanted,
        "effective samples",
        beside=f"R-hat {found.r_hat.max():.3f} after {steps} steps",
        seconds_left=pace * _steps_left(steps, effective / wanted, tau),
    )


def _steps_left(steps: int, share: float, tau: float) -> float:
    """Return the steps to go where a share of the effective samples is there, which grow with the steps."""
    wanted = max(steps / share if share > 0 else math.inf, LENGTH_IN_TAU * tau / (1 - _BURN_IN))
    return max(wanted - steps, 0.0)


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
        "packages": {name: version(name) for name in _PACKAGES},
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
        "quantity. Allow more steps, or free fewer parameters."
    )
    tau, ess, r_hat = (dict(zip(names, a.tolist(), strict=True)) for a in (found.tau, found.ess, found.r_hat))
    return NotConverged(message, tau=tau, ess=ess, r_hat=r_hat)


def _posterior(
    fit: Fit, target: LogPosterior, group: Sequence[Ensemble], found: Convergence, draws: np.ndarray, seed: int
) -> Posterior:
    # Half an autocorrelation time apart, draws carry all there is to know.
    thin = max(1, int(found.tau.min() / 2))
    steps = len(group[0].chain)
    kept = slice(steps - draws.shape[1], None, thin)
    z = np.stack([ensemble.chain[kept] for ensemble in group])
    log_probability = np.stack([ensemble.log_prob[kept] for ensemble in group])
    log_prior = target.log_prior(target.vectors(z).reshape(-1, target.dimension)).reshape(log_probability.shape)
    problem, names = target.problem, target.names

    def by_name(values: np.ndarray) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    return Posterior(
        names=names,
        units=dict(zip(names, target.units, strict=True)),
        draws=draws[:, ::thin],
        log_probability=log_probability,
        log_likelihood=log_probability - log_prior,
        r_hat=by_name(found.r_hat),
        tau=by_name(found.tau),
        ess=by_name(found.ess),
        ess_tail=by_name(tail_effective(draws)),
        prior=prior_draws(target, _PRIOR_DRAWS, np.random.default_rng(seed)),
        acceptance=_acceptance(group),
        reference={name: (fit.values[name], fit.sd[name]) for name in problem.names} | target.noise_reference,
        stated_noise={part.name: part.noise for part in target.instruments},
        meanings=target.meanings,
        model=problem.model,
        natural=problem.units,
        gaussian=dict(problem.gaussian),
        step=problem.bench.shortest,
        provenance={
            **_origin(target, seed),
            "steps": steps,
            "burn_in": steps - draws.shape[1],
            "thin": thin,
            "walkers": z.shape[2],
            "solver_shift_sd": fit.solver_shift,
        },
    )


def _acceptance(group: Sequence[Ensemble]) -> dict[str, float]:
    """Return the share of the proposals that was accepted, by move."""
    moves = {name: [e.moves[name] for e in group if e.moves[name].proposed] for name in group[0].moves}
    return {n: sum(m.accepted for m in ms) / sum(m.proposed for m in ms) for n, ms in moves.items() if ms}


def _origin(target: LogPosterior, seed: int) -> dict[str, object]:
    bench = target.problem.bench
    return {
        "seed": seed,
        "noise": target.noise,
        "versions": {name: version(name) for name in _PACKAGES},
        "rig": bench.experiments[0].rig.sha256,
        "recordings": {e.recording.name: e.recording.sha256 for e in bench.experiments},
        "n_data": bench.n_data,
    }
