"""From a contender to the fit that is reported: conventions free, generalised least squares, honest intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from discovery.estimation.batch import fit_problems
from discovery.estimation.beginning import from_declared
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import covariance_of, given, solver_shift
from discovery.estimation.fit import SHIFT, Fit
from discovery.estimation.generalised import generalised
from discovery.estimation.model_error import ModelError
from discovery.estimation.step_control import tightened
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context

_ITERATIONS = 25
#: Rounds of more accurate simulators where the solver still shifts an estimate.
_FINER = 3


def on_mechanics(contender: Contender, base: str, context: Context) -> Contender | None:
    """Return a set refitted on other mechanics from where it is; None where no step is fine enough or it blows up."""
    problem = contender.refit.problem
    bench = context.bench_on(base, problem.bench, problem.model, contender.refit.values)
    if bench is None:
        return None
    other = replace(problem, model=problem.model.on_base(base), bench=bench)
    (minimum,) = fit_problems([other], [other.start(contender.refit.values)], iterations=_ITERATIONS, rough=True)
    if not np.isfinite(minimum.cost):
        return None
    return contenders(context, [(contender.added, replace(contender.refit, problem=other, minimum=minimum))])[0]


def settled(contender: Contender, context: Context, bench: Bench | None = None) -> Contender:
    """Return a set at the estimates of generalised least squares, what its laws hold by convention free.

    `bench`: other simulators of its recordings. Where more than noise is left, a fit from what is declared is led there
    as well. Where the motion blows up, the set is returned as it is.
    """
    problem, values = contender.refit.problem, contender.refit.values
    known = {**problem.gaussian, **context.conventions(problem.model)}
    problem = replace(problem, gaussian=known, bench=bench or problem.bench)
    starts = [problem.start(values)]
    if not contender.leaves_noise(context):
        starts.append(from_declared(problem, values, contender.added))
    sizes = [contender.error_size] * len(starts)
    minimum, *others = generalised([problem] * len(starts), starts, sizes, iterations=_ITERATIONS, tolerance=1e-6)
    minimum = next((m for m in others if m.cost < minimum.cost - context.settings.nats), minimum)
    refit = replace(contender.refit, problem=problem, minimum=minimum)
    (found,) = contenders(context, [(contender.added, refit)])
    return found if np.isfinite(found.joint) else contender


def finished(found: Contender, context: Context) -> tuple[Fit, Contender]:
    """Return the fit of a settled set, on steps that shift no estimate, and the set there.

    Intervals are those of the posterior under the model error.
    """
    fitted = _fit(found)
    for _ in range(_FINER):
        bench = tightened(found.refit.problem.bench, fitted.solver_shift, SHIFT)
        if bench is None:
            break
        closer = settled(found, context, bench)
        again = _fit(closer)
        if not again.solver_shift < fitted.solver_shift:
            break
        found, fitted = closer, again
    return fitted, found


def _fit(contender: Contender) -> Fit:
    problem, minimum = contender.refit.problem, contender.refit.minimum
    _, reasons, directions = covariance_of(problem, minimum)
    held = [i for i, n in enumerate(problem.names) if n in reasons and minimum.at_bound[i]]
    covariance = given(contender.evidence.covariance, held)
    lost = [problem.names.index(n) for n in reasons]
    covariance[lost, :] = covariance[:, lost] = np.nan
    weighted = replace(problem, error=ModelError.of(contender.error_size, problem.units.time))
    return Fit(problem, minimum, covariance, reasons, directions, solver_shift(weighted, minimum, covariance))
