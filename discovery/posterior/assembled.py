"""A posterior put together from chains that have converged, however they were made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray
from discovery.posterior.diagnostics import Convergence, tail_effective
from discovery.posterior.draws import Posterior
from discovery.posterior.ensembles import Ensemble
from discovery.posterior.independence import Chains
from discovery.posterior.likelihood import LogPosterior
from discovery.posterior.priors import prior_draws

#: Packages whose versions decide the draws.
PACKAGES = ("discovery", "numpy", "scipy", "numba", "emcee", "arviz-stats")
_PRIOR_DRAWS = 2000


def of_ensembles(
    fit: Fit, target: LogPosterior, group: Sequence[Ensemble], found: Convergence, draws: FloatArray, seed: int
) -> Posterior:
    """Return the posterior of ensembles of walkers; `draws` (ensembles, steps, walkers, d) are those after burn-in."""
    burn_in = len(group[0].chain) - draws.shape[1]
    z, log_density = (np.stack([getattr(e, name)[burn_in:] for e in group]) for name in ("chain", "log_prob"))
    moves = {name: [e.moves[name] for e in group if e.moves[name].proposed] for name in group[0].moves}
    acceptance = {n: sum(m.accepted for m in ms) / sum(m.proposed for m in ms) for n, ms in moves.items() if ms}
    told = {"method": "emcee", "seed": seed, "burn_in": burn_in}
    return _assembled(fit, target, (z, draws, log_density), found, acceptance, told)


def of_chains(fit: Fit, target: LogPosterior, chains: Chains, seed: int) -> Posterior:
    """Return the posterior of independence chains."""
    z = chains.points[:, :, None]
    told = {"method": "independence", "seed": seed, "burn_in": 0, "pareto_k": chains.pareto_k}
    parts = (z, target.values(z), chains.log_density[:, :, None])
    return _assembled(fit, target, parts, chains.found, {"independence": chains.accepted}, told)


def _assembled(
    fit: Fit,
    target: LogPosterior,
    parts: tuple[FloatArray, FloatArray, FloatArray],
    found: Convergence,
    acceptance: Mapping[str, float],
    told: Mapping[str, Any],
) -> Posterior:
    """Return the posterior of points, quantities and log densities of chains (chains, steps, walkers, ...)."""
    # Half an autocorrelation time apart, draws carry all there is to know.
    thin = max(1, int(found.tau.min() / 2))
    z, _, log_probability = (part[:, ::thin] for part in parts)
    log_prior = target.log_prior(target.vectors(z).reshape(-1, target.dimension)).reshape(log_probability.shape)
    problem, names, draws = target.problem, target.names, parts[1]

    def by_name(values: FloatArray) -> dict[str, float]:
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
        prior=prior_draws(target, _PRIOR_DRAWS, np.random.default_rng(told["seed"])),
        acceptance=acceptance,
        reference={name: (fit.values[name], fit.sd[name]) for name in problem.names} | target.noise_reference,
        stated_noise={part.name: part.noise for part in target.instruments},
        meanings=target.meanings,
        model=problem.model,
        natural=problem.units,
        gaussian=dict(problem.gaussian),
        step=problem.bench.shortest,
        provenance={
            **_origin(target),
            **told,
            **{"steps": draws.shape[1] + told["burn_in"], "thin": thin, "walkers": z.shape[2]},
            "solver_shift_sd": fit.solver_shift,
        },
    )


def _origin(target: LogPosterior) -> dict[str, object]:
    bench = target.problem.bench
    return {
        "noise": target.noise,
        "versions": {name: version(name) for name in PACKAGES},
        "rig": bench.experiments[0].rig.sha256,
        "recordings": {e.recording.name: e.recording.sha256 for e in bench.experiments},
        "n_data": bench.n_data,
    }
