"""Samplers on the kernel, many sets at once: this package and importance resampling; and emcee as users write it."""

from __future__ import annotations

import time
from collections.abc import Callable

import emcee
import numpy as np
from scipy.integrate import odeint, solve_ivp

from discovery.posterior.sampling import sample
from samplers.job import NOISE, TIME, Job, Result, bulk_effective, slope

WALKERS, STEPS, BURN_IN = 32, 4000, 1000


def ours(job: Job, effective: float, runs: int) -> Result:
    """Sample with `discovery.sample`; the median run of several."""
    sample(job.fitted, method="emcee", seed=0, min_effective=100)
    found = []
    for seed in range(runs):
        start = time.perf_counter()
        posterior = sample(job.fitted, method="emcee", seed=seed + 1, min_effective=effective)
        found.append((time.perf_counter() - start, posterior))
    seconds, posterior = sorted(found, key=lambda pair: pair[0])[len(found) // 2]
    values = posterior.draws.copy()
    values[..., 3] = np.log(values[..., 3] / NOISE)
    scaled = (values - job.target.centre) / np.linalg.norm(job.target.factor, axis=1)
    kept = scaled.swapaxes(1, 2).reshape(-1, scaled.shape[1], 4)
    p = posterior.provenance
    figures = {
        "acceptance": dict(posterior.acceptance),
        "own_effective": min(posterior.ess.values()),
        "tau": max(posterior.tau.values()),
        "steps": p["steps"],
        "walkers": p["walkers"],
        "all_seconds": [s for s, _ in found],
    }
    evaluations = len(scaled) * p["steps"] * p["walkers"]
    return Result("this package (emcee)", seconds, kept, evaluations, bulk_effective(kept), figures=figures)


def importance(job: Job, count: int = 200_000, dof: float = 8.0) -> Result:
    """Resample draws from the fit's Student t: sum w^2 / (sum w)^2 and the resampling add to the variance."""
    rng = np.random.default_rng(0)
    start = time.perf_counter()
    z = rng.standard_normal((count, 4)) / np.sqrt(rng.chisquare(dof, count) / dof)[:, None]
    log_weight = job.target(z) + 0.5 * (dof + 4) * np.log1p(np.einsum("kd,kd->k", z, z) / dof)
    weight = np.exp(log_weight - log_weight.max())
    chosen = rng.choice(count, count, p=weight / weight.sum())
    seconds = time.perf_counter() - start
    kept = job.scaled(z[chosen])[None]
    effective = 1 / ((weight**2).sum() / weight.sum() ** 2 + 1 / count)
    return Result("importance resampling, same kernel", seconds, kept, count, np.full(4, effective), "no Markov chain")


def _by_solve_ivp(values: np.ndarray) -> np.ndarray:
    path = solve_ivp(
        slope, (0.0, TIME[-1]), [0.0, 0.0], t_eval=TIME, rtol=1e-8, atol=1e-10, max_step=0.5, args=values[:3]
    )
    return path.y[0]


def _by_odeint(values: np.ndarray) -> np.ndarray:
    return odeint(slope, [0.0, 0.0], TIME, tuple(values[:3]), tfirst=True, rtol=1e-8, atol=1e-10, hmax=0.5)[:, 0]


def stretched(job: Job) -> tuple[np.ndarray, int]:
    """Return chains of emcee's default sampler from the fit, on the kernel; and its evaluations, burn-in included."""
    sampler = emcee.EnsembleSampler(WALKERS, 4, job.target, vectorize=True)
    start = np.random.default_rng(0).standard_normal((WALKERS, 4))
    sampler.run_mcmc(emcee.State(start, random_state=np.random.RandomState(0).get_state()), STEPS)
    return sampler.get_chain(discard=BURN_IN).swapaxes(0, 1), WALKERS * STEPS


def as_users_write_it(job: Job, seconds: float) -> list[Result]:
    """Measure emcee with 32 walkers and stretch moves on scipy's integrators.

    They are too slow to be run to the end: the time is that of an evaluation in a real run of bounded time, and the
    chain that of the very same sampler on the kernel, whose log density differs by what the result states.
    """
    z, evaluations = stretched(job)
    kept = job.scaled(z)
    effective = bulk_effective(kept)
    solvers: dict[str, Callable[[np.ndarray], np.ndarray]] = {"solve_ivp": _by_solve_ivp, "odeint": _by_odeint}
    results = []
    for name, solver in solvers.items():

        def log_density(point: np.ndarray, solver=solver) -> float:
            values = job.parameters(point)
            return job.log_density(values, solver(values))

        points = z[:8, -1]
        difference = np.array([log_density(point) for point in points]) - job.target(points)
        sampler, calls, begin = emcee.EnsembleSampler(WALKERS, 4, log_density), 0, time.perf_counter()
        for _ in sampler.sample(z[:, -1], iterations=STEPS):
            calls += WALKERS
            if time.perf_counter() - begin > seconds:
                break
        each = (time.perf_counter() - begin) / (calls + WALKERS)
        results.append(
            Result(
                f"emcee + {name}",
                each * evaluations,
                kept,
                evaluations,
                effective,
                f"extrapolated from {calls} evaluations",
                {"ms_per_evaluation": 1e3 * each, "largest_log_density_difference": float(np.ptp(difference))},
            )
        )
    return results
