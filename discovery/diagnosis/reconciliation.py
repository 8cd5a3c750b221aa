"""Which effect explains a fitted value that contradicts the rig, weighed against an error of the rig file.

Two hypotheses are compared by their log evidence: the rig's statement is wrong, its prior `WIDE` times as wide; or it
is right and an effect is missing. What could repair a small step towards the stated value is sought by the linear
score of the catalogue, sizes by a scan of finite ones with the value where the rig has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from discovery.declarations.registry import get_effect, simplicity
from discovery.declarations.units import in_coordinate
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit
from discovery.estimation.problem import Problem
from discovery.screening.attribution import Candidate, grid_of, screen
from discovery.screening.finite import MOST_SHAPES, FarStart
from discovery.screening.refits import Refit, refit
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context

#: A prior is made so many times as wide.
WIDE = 30.0
#: The step towards the stated value, in the parameter's own standard deviations: far above the noise, far below one
#: slip of phase; the part of its misfit that a candidate must remove, and how many are tried.
_STEP, _LINEAR, _SHORTLIST = 30.0, 0.5, 8
#: Sizes of the scan over those declared, and how many of them begin a fit.
_SIZES, _BEGUN = np.geomspace(0.03, 30.0, 60), 2


@dataclass(frozen=True)
class Reconciliation:
    """One effect that was given the chance to reconcile a parameter with its prediction."""

    effect: str  # id
    parameters: Mapping[str, tuple[float, float]]  # of the effect
    #: value, z: of the contradicting parameter with the effect in the model, and its distance from the prediction in
    #: sds.
    value: float
    z: float
    chi2: float  # of the recordings and the rig
    odds: float  # log odds of the effect against an error of the rig file [nats]
    reconciles: bool  # whether an error of the rig file is not likelier by what decides, nor is another effect

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        # What contradicts a rig file is an arm or a pendulum: the coordinate is an angle.
        units = {p.name: in_coordinate(p.unit, "rad") for p in get_effect(self.effect).parameters()}
        return {
            "id": self.effect,
            "parameters": {
                n: {"value": v, "sd": sd if np.isfinite(sd) else None, "unit": units[n]}
                for n, (v, sd) in self.parameters.items()
            },
            "value": self.value,
            "z": self.z,
            "chi2": self.chi2,
            "odds": self.odds,
            "reconciles": self.reconciles,
        }


def reconcile(
    fit: Fit, name: str, predicted: tuple[float, float], candidates: Sequence[str], context: Context
) -> tuple[Reconciliation, ...]:
    """Try effects that could reconcile a fitted parameter, free of its prediction, with the predicted mean and sd.

    Returned: those that reconcile first, the simplest ahead where the evidence decides nothing. Empty where none could.
    """
    if not candidates:
        return ()
    context.progress(f"looking for an effect that reconciles {name} with its prediction")
    mean, sd = predicted
    own = fit.problem
    effects = sorted({*own.bench.effects, *candidates})
    bench = (
        own.bench
        if {*effects} <= {*own.bench.effects}
        else Bench(own.bench.base, effects, own.bench.experiments, own.bench.step)
    )
    wide, stated = (replace(own, bench=bench, gaussian={**own.gaussian, name: (mean, s)}) for s in (WIDE * sd, sd))
    promising = _promising(fit, bench, name, mean, candidates)
    starts = [start for c in promising for start in _scanned(fit, stated, name, mean, c)]
    if not starts:
        return ()
    (at,) = fit_problems([wide], [fit.minimum.x], rough=True)
    (wrong,) = contenders(context, [((), Refit("", wide, at))])
    found = refit(at, stated, [], finite=starts, thorough=True)
    tried = contenders(context, [((r.effect,), r) for r in found])
    return _ranked([c for c in tried if np.isfinite(c.joint)], wrong, name, predicted, context)


def _promising(fit: Fit, bench: Bench, name: str, target: float, candidates: Sequence[str]) -> list[Candidate]:
    """Return the effects that repair a step of a parameter towards its target, to first order."""
    value, sd = fit.values[name], fit.sd[name]
    step = min(_STEP * sd, abs(target - value)) if np.isfinite(sd) else abs(target - value) / _STEP
    problem = _held(fit, bench, {name: value + float(np.copysign(step, target - value))})
    keep = [fit.problem.names.index(n) for n in problem.names]
    (spoilt,) = fit_problems([problem], [fit.minimum.x[keep]], iterations=8)
    excess = 2 * spoilt.cost - float(np.sum(fit.minimum.residual[: fit.problem.bench.n_rows] ** 2))
    scored = screen(spoilt, problem, candidates)
    return [c for c in scored if c.score > _LINEAR * excess][:_SHORTLIST]


def _held(fit: Fit, bench: Bench, held: Mapping[str, float]) -> Problem:
    """Return the problem with some values held, and with all that the rig knows."""
    known = {**{n: fit.values[n] for n in fit.problem.gaussian if n in fit.problem.free}, **held}
    model = Model(fit.model.base, fit.model.effects, {**fit.model.known, **known})
    return Problem(model, bench, fit.problem.units, {})


def _scanned(fit: Fit, stated: Problem, name: str, target: float, candidate: Candidate) -> list[FarStart]:
    """Return the sizes of an effect that explain most with a parameter at its target, all else as fitted."""
    effect, system = get_effect(candidate.effect), stated.model.mechanics.system
    sized = {p.name: p.bounds[0] < 0 for p in effect.parameters() if not p.shape}
    every = grid_of(effect, system, stated.units)
    grid = list({tuple(v for n, v in g.items() if n not in sized): g for g in every}.values())
    # Of very many shapes some, evenly: what matters may have none, as a clock that drifts beside its sawtooth.
    grid = grid[:: -(-len(grid) // MOST_SHAPES)]
    sizes = [*_SIZES, *(-_SIZES if any(sized.values()) else ())]
    points = [{n: v * s if n in sized else v for n, v in values.items()} for values in grid for s in sizes]
    names, where = stated.bench.names, stated.names.index(name)
    x = fit.minimum.x.copy()
    x[where] = target
    base, initial = stated.expand(x[:, None])
    columns = np.repeat(base, len(points), axis=1)
    for i, values in enumerate(points):
        for n, v in values.items():
            columns[names.index(n), i] = v
    cost = stated.bench.chi2(columns, np.repeat(initial, len(points), axis=2)).sum(axis=0)
    best = [i for i in np.argsort(cost)[:_BEGUN] if np.isfinite(cost[i])]
    order = [p.name for p in effect.fitted(system)]
    return [(candidate.effect, np.array([points[i][n] for n in order]), {name: target}) for i in best]


def _ranked(
    tried: Sequence[Contender], wrong: Contender, name: str, predicted: tuple[float, float], context: Context
) -> tuple[Reconciliation, ...]:
    """Return what reconciles first, the simplest ahead where the log evidence decides nothing between two."""
    (mean, sd), nats = predicted, context.settings.nats
    least = max([c.joint for c in tried] + [wrong.joint]) - nats
    system = wrong.model.mechanics.system
    found = []
    for c in sorted(
        tried, key=lambda c: (c.joint < least, simplicity(c.added[0], system) if c.joint >= least else (), -c.joint)
    ):
        spread = dict(zip(c.refit.problem.names, np.sqrt(np.diag(c.evidence.covariance)), strict=True))
        own = {p.name for p in get_effect(c.added[0]).parameters()}
        value = c.refit.values[name]
        found.append(
            Reconciliation(
                c.added[0],
                {n: (v, float(spread[n])) for n, v in c.refit.values.items() if n in own},
                value=value,
                z=(value - mean) / sd,
                chi2=c.chi2,
                odds=c.joint - wrong.joint,
                reconciles=c.joint >= least,
            )
        )
    return tuple(found)
