r"""Which effect lets a fitted parameter take the value that it should have, without spoiling the fit.

The parameter is moved from its fitted value to the predicted one in small stages, every candidate effect making room
for it as well as it can. A candidate that keeps the fit all the way is freed together with the parameter at last, under
the predicted distribution as a Gaussian prior. What cannot make room for the first stage cannot for the last: there the
linear score is exact enough to leave most of the catalogue out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.registry import get_effect
from discovery.declarations.units import in_coordinate
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import covariance_of
from discovery.estimation.fit import Fit
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.screening.attribution import screen
from discovery.screening.refits import Refit, refit
from discovery.selection.simplicity import simplicity

__all__ = ["Reconciliation", "reconcile"]

FloatArray = NDArray[np.float64]

#: First stage, in the parameter's own standard deviations: far above the noise, far below one slip of phase.
_FIRST = 30.0
#: Longest later stage, as a part of the parameter, and the fewest and most of them.
_STAGE, _FEWEST, _MOST = 0.02, 3, 12
#: Share of the misfit of the first stage that a candidate must remove, linearly and refitted.
_LINEAR, _REFITTED = 0.5, 0.9
#: So many candidates are refitted.
_SHORTLIST = 8
#: Chi-square, in that of the fit and in least gains, beyond which a candidate does not follow any more.
_LOST = 2.0, 10.0
#: Gain of total chi-square below which the simpler effect is taken.
_TIE = 10.0
#: A parameter agrees with its prediction within so many standard deviations.
_AGREES = 2.0


@dataclass(frozen=True)
class Reconciliation:
    """One effect that was given the chance to reconcile a parameter with its prediction.

    Parameters
    ----------
    effect : str
        Id.
    parameters : mapping of str to (value, sd)
        Of the effect; sd is NaN where there is no interval.
    value, z : float
        Of the contradicting parameter with the effect in the model, and its distance from the prediction in sds.
    chi2 : float
        Of the recordings, with the other priors.
    total : float
        With the prior of the contradicting parameter.
    evidence : float
        Drop of the total against the fit without the effect.
    reconciles : bool
        Whether z is within two, the recordings are fitted no worse than before, and no other effect does this clearly
        better.
    """

    effect: str
    parameters: Mapping[str, tuple[float, float]]
    value: float
    z: float
    chi2: float
    total: float
    evidence: float
    reconciles: bool

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {
            "id": self.effect,
            "parameters": {
                n: {"value": v, "sd": sd if np.isfinite(sd) else None, "unit": _unit(self.effect, n)}
                for n, (v, sd) in self.parameters.items()
            },
            "value": self.value,
            "z": self.z,
            "chi2": self.chi2,
            "total_chi2": self.total,
            "evidence": self.evidence,
            "reconciles": self.reconciles,
        }


def _unit(effect: str, name: str) -> str:
    # What contradicts a rig file is an arm or a pendulum: the coordinate is an angle.
    return next(in_coordinate(p.unit, "rad") for p in get_effect(effect).parameters() if p.name == name)


def _repairs(
    model: Model, spoilt: Minimum, problem: Problem, candidates: Sequence[str], excess: float
) -> Sequence[Refit]:
    """Return refits of the effects that promise, and manage, to take away most of an excess of chi-square."""
    scored = screen(model, spoilt, problem, candidates)
    shortlist = [c for c in scored if c.score > _LINEAR * excess][:_SHORTLIST]
    refits = refit(model, spoilt, problem, shortlist) if shortlist else ()
    return [r for r in refits if 2 * spoilt.cost - r.chi2 > _REFITTED * excess]


def reconcile(
    fit: Fit,
    name: str,
    predicted: tuple[float, float],
    candidates: Sequence[str],
    *,
    z: float,
    least_gain: float = 40.0,
    progress: Callable[[str], None] | None = None,
) -> tuple[Reconciliation, ...]:
    """Try effects that could reconcile a fitted parameter with its prediction.

    Parameters
    ----------
    fit : Fit
        The fit, its parameter free of the prediction.
    name : str
        The contradicting parameter, free in the fit.
    predicted : (float, float)
        Mean and standard deviation that were predicted.
    candidates : sequence of str
        Effects to try.
    z : float
        Distance of the fitted value from the prediction, in combined standard deviations: what it costs to believe
        both, without any effect.
    least_gain : float
        Chi-square by which a reconciled fit may be worse than before, and than that with the best effect.
    progress : callable, optional
        Receives one sentence before every longer piece of work.

    Returns
    -------
    tuple of Reconciliation
        Those that followed the parameter all the way: reconciling ones first, by total chi-square, but simplest first
        where that ties. Empty where none did.
    """
    bench = fit.problem.bench
    if not candidates:
        return ()
    if not set(candidates) <= set(bench.effects):
        bench = Bench(bench.base, sorted({*bench.effects, *candidates}), bench.experiments, bench.step)
    if progress is not None:
        progress(f"looking for an effect that reconciles {name} with its prediction")
    path = _path(fit, name, predicted[0])
    # The first stage without any effect: what it spoils is to be repaired.
    model, problem = _frozen(fit, bench, {name: path[1]})
    keep = [fit.problem.names.index(n) for n in problem.names]
    (spoilt,) = fit_problems([problem], [fit.minimum.x[keep]], iterations=8)
    data = _data_chi2(fit.problem, fit.minimum)
    excess = 2 * spoilt.cost - data
    if excess < least_gain:
        return ()
    repaired = _repairs(model, spoilt, problem, candidates, excess)
    lost = _LOST[0] * data + _LOST[1] * least_gain
    followed = _follow(fit, name, path, repaired, lost) if repaired else []
    if not followed:
        return ()
    tried = _finish(
        fit,
        bench,
        name=name,
        predicted=predicted,
        followed=followed,
        without=2 * fit.minimum.cost + z**2,
        least_gain=least_gain,
    )
    return _ranked(tried, fit.model.mechanics.system, least_gain)


def _data_chi2(problem: Problem, minimum: Minimum) -> float:
    """Return chi-square of the recordings, without priors."""
    return float(np.sum(minimum.residual[: problem.bench.n_rows] ** 2))


def _path(fit: Fit, name: str, target: float) -> FloatArray:
    """Return the stages from the fitted value to the target: a small first one, then equal ones."""
    value, sd = fit.values[name], fit.sd[name]
    away = target - value
    first = min(_FIRST * sd, abs(away)) if np.isfinite(sd) else abs(away) / _MOST
    count = int(np.clip(np.ceil(abs(away) / (_STAGE * abs(value))), _FEWEST, _MOST))
    return np.array([value, *np.linspace(value + np.copysign(first, away), target, count + 1)])


def _frozen(fit: Fit, bench: Bench, held: Mapping[str, float], *effects: str) -> tuple[Model, Problem]:
    """Return the model, with effects added, and its problem: some values held, with all that the rig knows."""
    known = {**{n: fit.values[n] for n in fit.problem.gaussian if n in fit.problem.free}, **held}
    model = Model(fit.model.base, (*fit.model.effects, *effects), {**fit.model.known, **known})
    return model, Problem(model, bench, fit.problem.units, {})


def _follow(fit: Fit, name: str, path: FloatArray, repaired: Sequence[Refit], lost: float) -> list[Refit]:
    """Take repaired fits from the first stage to the last, each from where the two before it point.

    Those whose chi-square exceeds `lost` on the way are left behind.
    """
    here = {r.effect: r for r in repaired}
    before = {}
    for r in repaired:
        # Absent at the fitted value, with the shape that it has now.
        shapes = {p.name for p in get_effect(r.effect).parameters() if p.shape}
        before[r.effect] = np.array([fit.values.get(n, v if n in shapes else 0.0) for n, v in r.values.items()])
    for k in range(2, path.size):
        if not here:
            break
        reach = (path[k] - path[k - 1]) / (path[k - 1] - path[k - 2]) if path[k - 1] != path[k - 2] else 0.0
        problems = [_frozen(fit, r.problem.bench, {name: float(path[k])}, effect)[1] for effect, r in here.items()]
        starts = [r.minimum.x + reach * (r.minimum.x - before[effect]) for effect, r in here.items()]
        minima = fit_problems(problems, starts, iterations=8)
        before = {effect: r.minimum.x for effect, r in here.items()}
        moved = [Refit(effect, p, m) for effect, p, m in zip(here, problems, minima, strict=True)]
        here = {r.effect: r for r in moved if r.chi2 <= lost}
    return list(here.values())


def _finish(
    fit: Fit,
    bench: Bench,
    name: str,
    predicted: tuple[float, float],
    followed: Sequence[Refit],
    without: float,
    least_gain: float,
) -> list[Reconciliation]:
    """Free what was held, the parameter under its predicted distribution, and weigh against the total `without`."""
    mean, sd = predicted
    gaussian = {**fit.problem.gaussian, name: predicted}
    problems = [Problem(fit.model.with_effect(r.effect), bench, fit.problem.units, gaussian) for r in followed]
    values = [{**fit.values, **r.values, name: mean} for r in followed]
    starts = [np.array([own[n] for n in p.names]) for p, own in zip(problems, values, strict=True)]
    limit = _data_chi2(fit.problem, fit.minimum) + least_gain
    minima = fit_problems(problems, starts, iterations=25)
    found = []
    for r, problem, minimum in zip(followed, problems, minima, strict=True):
        if not np.isfinite(minimum.cost):
            continue
        value, own = _estimated(problem, minimum, name, r.effect)
        z, chi2, total = (value - mean) / sd, _data_chi2(problem, minimum), 2 * minimum.cost
        found.append(
            Reconciliation(
                r.effect,
                own,
                value=value,
                z=z,
                chi2=chi2,
                total=total,
                evidence=without - total,
                reconciles=abs(z) <= _AGREES and chi2 <= limit,
            )
        )
    return found


def _estimated(
    problem: Problem, minimum: Minimum, name: str, effect: str
) -> tuple[float, dict[str, tuple[float, float]]]:
    """Return the value of a parameter, and those of an effect with their deviations, NaN where they are not known."""
    covariance, reasons, _ = covariance_of(problem, minimum)
    values = problem.named(minimum.x)
    with np.errstate(invalid="ignore"):
        spread = problem.named(np.sqrt(np.diag(covariance)))
    own = {p.name for p in get_effect(effect).parameters()}
    found = {n: (v, float("nan") if n in reasons else spread[n]) for n, v in values.items() if n in own}
    return values[name], found


def _ranked(tried: Sequence[Reconciliation], system: str, least_gain: float) -> tuple[Reconciliation, ...]:
    """Return those that reconcile first, simplest first where their totals tie; a much better one excludes others."""
    best = min((r.total for r in tried if r.reconciles), default=0.0)
    tried = [replace(r, reconciles=r.reconciles and r.total <= best + least_gain) for r in tried]
    agreeing = [r for r in tried if r.reconciles]
    tied = sorted((r for r in agreeing if r.total <= best + _TIE), key=lambda r: simplicity(r.effect, system))
    others = sorted((r for r in agreeing if r.total > best + _TIE), key=lambda r: r.total)
    failed = sorted((r for r in tried if not r.reconciles), key=lambda r: r.total)
    return (*tied, *others, *failed)
