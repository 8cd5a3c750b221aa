"""Gradient samplers: NumPyro with diffrax, and nutpie on a compiled gradient. They come from an optional group."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numba import njit

from samplers.job import NOISE, TIME, Hub, Job, Result, bulk_effective, hub_acceleration


def numpyro_diffrax(job: Job, seconds: float) -> Result:
    """Run NUTS on diffrax's Dopri8, from the fit; time is that of all its gradients."""
    import diffrax
    import jax
    import jax.numpy as jnp
    import numpyro
    import numpyro.distributions as dist
    from numpyro.infer import MCMC, NUTS, init_to_value

    jax.config.update("jax_enable_x64", True)
    centre, factor, readings = (jnp.asarray(x) for x in (job.target.centre, job.target.factor, job.readings))
    controller = diffrax.PIDController(rtol=1e-8, atol=1e-10, jump_ts=jnp.asarray(Hub.kinks))

    def field(t: Any, y: Any, values: Any) -> Any:
        pull = -hub_acceleration(t, jnp) - values[0] * y[1] - values[1] * y[0] - values[2] * y[0] ** 3
        return jnp.stack([y[1], pull])

    def log_density(z: Any) -> Any:
        values = centre + factor @ z
        path = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8(),
            0.0,
            TIME[-1],
            0.01,
            jnp.zeros(2),
            values,
            saveat=diffrax.SaveAt(ts=jnp.asarray(TIME)),
            stepsize_controller=controller,
            max_steps=4096,
        )
        log_sigma = values[3] + jnp.log(NOISE)
        return -0.5 * jnp.sum((readings - path.ys[:, 0]) ** 2) * jnp.exp(-2 * log_sigma) - TIME.size * log_sigma

    def model() -> None:
        z = numpyro.sample("z", dist.ImproperUniform(dist.constraints.real_vector, (), (4,)))
        numpyro.factor("log_likelihood", log_density(z))

    gradient = jax.jit(jax.value_and_grad(log_density))
    gradient(jnp.zeros(4))[1].block_until_ready()
    begin = time.perf_counter()
    for _ in range(5):
        gradient(jnp.zeros(4))[1].block_until_ready()
    each = (time.perf_counter() - begin) / 5
    warmup = 150
    draws = int(np.clip(seconds / (6 * each) - warmup, 100, 2000))
    kernel = NUTS(model, init_strategy=init_to_value(values={"z": jnp.zeros(4)}))
    mcmc = MCMC(kernel, num_warmup=warmup, num_samples=draws, progress_bar=False)
    mcmc.warmup(jax.random.PRNGKey(0), extra_fields=("num_steps",), collect_warmup=True)
    calls = int(np.sum(mcmc.get_extra_fields()["num_steps"]))
    mcmc.run(jax.random.PRNGKey(1), extra_fields=("num_steps",))
    calls += int(np.sum(mcmc.get_extra_fields()["num_steps"]))
    kept = job.scaled(np.asarray(mcmc.get_samples()["z"], float))[None]
    return Result(
        "NumPyro NUTS + diffrax",
        calls * each,
        kept,
        calls,
        bulk_effective(kept),
        "time of the gradients alone",
        {"ms_per_evaluation": 1e3 * each},
    )


@njit
def _log_density_and_gradient(z, centre, factor, readings, hub, step):
    """Classical Runge-Kutta on delta, delta' and their derivatives to xi, alpha, beta; hub at start and middle."""
    xi, alpha, beta, log_sigma = centre + np.sum(factor * z, axis=1)
    y, k, gradient = np.zeros(8), np.zeros((4, 8)), np.zeros(4)
    at = np.zeros(8)
    total = (readings[0] - y[0]) ** 2
    for n in range(readings.size - 1):
        for stage in range(4):
            reach = 0.0 if stage == 0 else (step if stage == 3 else 0.5 * step)
            for i in range(8):
                at[i] = y[i] + (reach * k[stage - 1, i] if stage else 0.0)
            u = hub[2 * n + (stage + 1) // 2]
            d, v = at[0], at[1]
            k[stage, 0], k[stage, 1] = v, -u - xi * v - alpha * d - beta * d * d * d
            stiffness = alpha + 3 * beta * d * d
            for j in range(3):
                source = v if j == 0 else (d if j == 1 else d * d * d)
                k[stage, 2 + 2 * j] = at[3 + 2 * j]
                k[stage, 3 + 2 * j] = -source - xi * at[3 + 2 * j] - stiffness * at[2 + 2 * j]
        for i in range(8):
            y[i] += step / 6 * (k[0, i] + 2 * k[1, i] + 2 * k[2, i] + k[3, i])
        misfit = readings[n + 1] - y[0]
        total += misfit * misfit
        for j in range(3):
            gradient[j] += misfit * y[2 + 2 * j]
    weight = np.exp(-2 * log_sigma)
    gradient *= weight
    gradient[3] = total * weight - readings.size
    return -0.5 * total * weight - readings.size * log_sigma, np.sum(factor.T * gradient, axis=1)


def nutpie_compiled(job: Job, draws: int = 4000, chains: int = 2) -> Result:
    """Run nutpie, two chains on two cores, on a gradient by forward sensitivities compiled by numba."""
    import nutpie
    from nutpie.compiled_pyfunc import from_pyfunc

    step = TIME[1] - TIME[0]
    # Start and middle of every step; the kinks of the hub lie on samples.
    hub = hub_acceleration(np.arange(2 * TIME.size - 1) * 0.5 * step)
    centre = job.target.centre + np.array([0.0, 0.0, 0.0, np.log(NOISE)])
    factor, readings = np.ascontiguousarray(job.target.factor), job.readings

    def make_log_density() -> Any:
        return lambda z: _log_density_and_gradient(z, centre, factor, readings, hub, step)

    def make_expand(*_: Any) -> Any:
        return lambda z: {"z": np.asarray(z)}

    model = from_pyfunc(4, make_log_density, make_expand, [np.dtype(np.float64)], [(4,)], ["z"])
    log_density = make_log_density()
    log_density(np.zeros(4))
    begin = time.perf_counter()
    for _ in range(20):
        log_density(np.zeros(4))
    each = (time.perf_counter() - begin) / 20
    begin = time.perf_counter()
    trace = nutpie.sample(model, draws=draws, tune=400, chains=chains, cores=chains, seed=1, progress_bar=False)
    seconds = time.perf_counter() - begin
    kept = job.scaled(np.asarray(trace.posterior["z"]))
    calls = int(trace.sample_stats["n_steps"].sum() + trace.warmup_sample_stats["n_steps"].sum())
    return Result(
        "nutpie, compiled gradient",
        seconds,
        kept,
        calls,
        bulk_effective(kept),
        figures={"ms_per_evaluation": 1e3 * each},
    )
