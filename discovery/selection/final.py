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
from discovery.estimation.local_steps import resolving
from discovery.estimation.model_error import ModelError
from discovery.estimation.step_control import tightened
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context

_ITERATIONS = 25
_FINER = 3  #: Rounds of more accurate simulators where the solver still shifts an estimate.


def on_mechanics(contender: Contender, base: str, context: Context) -> Contender | None:
    """Return a set refitted on other mechanics from where it is; None where no step is fine enough or it blows up."""
    problem = contender.refit.problem
    bench = context.bench_on(base, problem.bench, problem.model, contender.refit.values)
    if bench is None:
        return None
    other = replace(problem, model=problem.model.on_base(base), bench=bench)
    (minimum,) = fit_problems([other], [other.start(contender.refit.values)], iterations=_ITERATIONS, rough=True)
    moved = replace(contender.refit, problem=other, minimum=minimum)
    return contenders(context, [(contender.added, moved)])[0] if np.isfinite(minimum.cost) else None


def settled(contender: Contender, context: Context, bench: Bench | None = None) -> Contender:
    """Return a set at the estimates of generalised least squares, what its laws hold by convention free.

    `bench`: other simulators of its recordings; by default its own, or finer ones that it needs now. Where more than
    noise is left, a fit from what is declared is led there as well. Where it blows up, the set is returned as it is.
    """
    problem, values = contender.refit.problem, contender.refit.values
    problem = replace(context.freed(problem), bench=bench or problem.bench)
    led = [] if contender.leaves_noise(context) else [from_declared(problem, values, contender.added)]
    starts = [problem.start(values), *led]
    sizes = [contender.error_size] * len(starts)
    minimum, *others = generalised([problem] * len(starts), starts, sizes, iterations=_ITERATIONS, tolerance=1e-6)
    minimum = next((m for m in others if m.cost < minimum.cost - context.settings.nats), minimum)
    refit = replace(contender.refit, problem=problem, minimum=minimum)
    finer = resolving(problem.bench, [(problem, minimum.x)]) if bench is None else problem.bench
    if finer is not problem.bench:
        return settled(replace(contender, refit=refit), context, finer)
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
