r"""Prior-data conflict: fitted values that the rig file excludes. What free parameters absorb leaves no residual.

Base compliance hides in alpha, a camera's scale in the length. So the log odds are asked that the rig file's statement
of a quantity is too narrow: the evidence that is gained where its prior is made `WIDE` times as wide,

.. math:: \log \frac{N(v;\, m,\, s^2 + w^2 \sigma^2)}{N(v;\, m,\, s^2 + \sigma^2)},

with m and :math:`\sigma` what is stated, and v and s what the recordings alone say (Evans and Moshonov, Bayesian
Analysis 1 (2006) 893). Tested are

* alpha of an exact arm against :math:`3EI / (m_\mathrm{eff} l^3)` of the rig, see `discovery.theory.prediction`;
* the rod's mass ratio mu and, where it is free, the length against what the rig states;
* the pull of gravity on a pendulum against its length;
* constants of a declared system that are stated with a standard deviation, against it. Where the declared model is far
  better with another value, its fit has it already, see `discovery.estimation.declared.first_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from discovery.diagnosis.other_constants import Instead, answering_for, stated_constants
from discovery.diagnosis.reconciliation import WIDE, Reconciliation, reconcile
from discovery.equations.lacking import candidates as possible
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import covariance_of
from discovery.estimation.fit import Fit, fit_near
from discovery.estimation.physical import stated_inertia
from discovery.estimation.problem import Problem
from discovery.estimation.residual import correlation_length
from discovery.foundation.errors import SimulationFailure
from discovery.mechanics.elastica import Elastica
from discovery.screening.refits import Refit
from discovery.selection.contender import contenders
from discovery.selection.context import Context
from discovery.theory.prediction import predict

#: Where a value that was held back by its bound is looked for, in these standard deviations.
_AWAY = (-20.0, -10.0, -5.0, 5.0, 10.0, 20.0)
#: What is missing of a model shifts the stiffness that it finds by a smaller factor.
_GROSS = 1.5
#: A value on quicker mechanics differs by at most this part of what is to be reconciled.
_ALIKE = 0.1


@dataclass(frozen=True)
class Check:
    """One fitted value against its predicted distribution."""

    #: parameter, unit: what is tested, and its unit.
    parameter: str
    unit: str
    #: value, sd: from the recordings alone, whose residual may be correlated.
    value: float
    sd: float
    #: predicted, predicted_sd: mean and standard deviation of the prediction.
    predicted: float
    predicted_sd: float
    z: float  # their difference over the root of the sum of both variances
    odds: float  # log odds that the prediction is too narrow [nats]
    source: str  # where the prediction comes from

    @property
    def gross(self) -> bool:
        """Whether it is a rod's stiffness so far beside its prediction that the rig file may be wrong.

        A pendulum is no such case: an extended body of the stated length may swing at any pace.
        """
        far = not self.predicted / _GROSS < self.value < self.predicted * _GROSS
        return far and self.parameter == "alpha"


def _check(parameter: str, unit: str, value: tuple[float, float], predicted: tuple[float, float], source: str) -> Check:
    """Return the log odds of a prior that is wider than the prediction."""
    (found, sd), (mean, spread) = value, predicted
    narrow, wide = math.hypot(sd, spread), math.hypot(sd, WIDE * spread)
    z = (found - mean) / narrow
    odds = 0.5 * z**2 * (1 - (narrow / wide) ** 2) - math.log(wide / narrow)
    told = {"value": found, "sd": sd, "predicted": mean, "predicted_sd": spread, "z": z, "odds": odds}
    return Check(parameter, unit, source=source, **told)


def against_length(fit: Fit) -> tuple[Check, ...]:
    """Test how strongly gravity pulls on a simple pendulum, k_g = sqrt(g_c^2 + g_s^2), against g / L of the rig.

    It is negative where gravity pushes away from where the pendulum swings, as on one that a spring holds upright.
    """
    first = fit.problem.bench.experiments[0]
    rig = first.rig
    names = ("g_c", "g_s")
    # Beside a spring that holds it at its bound, or another law that takes its part, gravity is not known.
    if rig.length is None or rig.gravity is None or not {*names} <= {*fit.problem.free} - {*fit.reasons}:
        return ()
    at = [fit.problem.names.index(n) for n in names]
    torque = fit.minimum.x[at]
    size = float(np.linalg.norm(torque))
    sd = math.sqrt(float(torque @ fit.covariance[np.ix_(at, at)] @ torque)) / size
    around = float(np.nanmedian(first.recording.output))
    if torque @ (math.cos(around), math.sin(around)) < 0.0:
        size = -size
    predicted = rig.gravity.value / rig.length.value
    spread = predicted * math.hypot(rig.gravity.sd / rig.gravity.value, rig.length.sd / rig.length.value)
    return (_check("k_g", "s^-2", (size, sd), (predicted, spread), "g / L of the rig"),)


def against_rig(fit: Fit) -> list[tuple[Check, Fit]]:
    """Test what the rig knows and the fit may move, each with the fit that is free of the rig's opinion."""
    first = fit.problem.bench.experiments[0]
    rig, units = first.rig, {n: p.unit for n, p in fit.model.parameters.items()}
    stated: dict[str, tuple[float, float, str]] = {}
    if rig.beam_mass is not None and rig.tip_mass is not None and rig.beam_mass.value:
        spread = math.hypot(rig.beam_mass.sd / rig.beam_mass.value, rig.tip_mass.sd / rig.tip_mass.value)
        ratio = rig.beam_mass.value / rig.tip_mass.value
        stated["mu"] = (ratio, ratio * spread, "the rig's masses")
    if rig.system is not None:
        stated = {n: (*own, "what the rig file states") for n, own in stated_constants(rig).items()}
    elif own := stated_inertia(first):
        name, mean, sd, units[name], key = own
        stated[name] = mean, sd, f"{key} of the rig file"
    elif rig.length is not None:
        stated["length"] = (rig.length.value, rig.length.sd, "the rig's length")
    found = []
    for name, (mean, sd, source) in stated.items():
        if not sd or name not in fit.problem.gaussian or name not in fit.problem.free:
            continue
        # What the recordings have overruled is free of it already.
        overruled = not first.system.has_rod and fit.problem.gaussian[name] != (mean, sd)
        freed = fit if overruled else _freed(fit, name, (mean, sd))
        if name in freed.reasons:
            continue
        value, spread = freed.values[name], freed.sd[name]
        if freed is not fit and abs(value - mean) > math.hypot(spread, sd):
            spread = _spread_by_ratio(fit, freed, name, (mean, sd))
        found.append((_check(name, units[name], (value, spread), (mean, sd), source), freed))
    return found


def _spread_by_ratio(fit: Fit, freed: Fit, name: str, stated: tuple[float, float]) -> float:
    """Return the standard deviation that the ratio of likelihoods of two fits gives a value far from the stated one.

    There the likelihood may be flatter than its curvature at the minimum says; nearby the ratio is lost in round-off.
    """
    (mean, sd), value, inside = stated, freed.values[name], fit.values[name]
    gain = 2 * (fit.minimum.cost - freed.minimum.cost) + ((inside - mean) / sd) ** 2
    gain -= ((inside - fit.problem.gaussian[name][0]) / fit.problem.gaussian[name][1]) ** 2
    # Samples whose residuals are correlated count for fewer.
    scale = max(1.0, freed.reduced_chi2) * correlation_length(freed.problem.bench.experiments, freed.predict())
    return math.sqrt(max(freed.sd[name] ** 2, scale * (value - mean) ** 2 / max(gain, 1e-9) - sd**2))


def _freed(fit: Fit, name: str, stated: tuple[float, float]) -> Fit:
    """Return the fit without what the rig says about one parameter."""
    old, (mean, sd) = fit.problem, stated
    problem = Problem(old.model, old.bench, old.units, {**old.gaussian, name: (mean, WIDE * sd)})
    starts = [fit.minimum.x]
    if name in fit.reasons or fit.minimum.at_bound[fit.problem.names.index(name)]:
        # Held back by a bound: the nearest minimum beyond it need not be the lowest, for the rod rings.
        for away in _AWAY:
            x = fit.minimum.x.copy()
            x[old.free.index(name)] = mean + away * sd
            starts.append(x)
    minimum = min(
        fit_problems([problem] * len(starts), starts, iterations=25, tolerance=1e-6, rough=True), key=lambda m: m.cost
    )
    covariance, reasons, directions = covariance_of(problem, minimum)
    return Fit(problem, minimum, covariance, reasons, directions, fit.solver_shift)


def against_stiffness(fit: Fit, rng: np.random.Generator) -> list[tuple[Check, Fit]]:
    """Test alpha of an exact arm against the rig, where it is known and states enough."""
    rig = fit.problem.bench.experiments[0].rig
    needed = (rig.length, rig.tip_mass, rig.beam_mass, rig.flexural_rigidity)
    known = "alpha" in fit.problem.free and "alpha" not in fit.reasons and None not in needed
    # A simpler base reads another stiffness from the same arm.
    if not known or not isinstance(fit.model.mechanics, Elastica):
        return []
    draws = predict(rig, rng).draws["rod_counted", "dynamic"]["alpha"]
    predicted = (float(np.mean(draws)), float(np.std(draws)))
    value = (fit.values["alpha"], fit.sd["alpha"])
    return [(_check("alpha", "s^-2", value, predicted, "3 EI / (m_eff l^3) of the rig"), fit)]


@dataclass(frozen=True)
class Contradiction:
    """A value that contradicts its prediction, and the effects that were tried, if any were sought, to reconcile them.

    Those that reconcile come first, the best or simplest of them at the head.
    """

    check: Check
    tried: tuple[Reconciliation, ...]
    sought: bool = True
    #: Of a constant of a declared system, whether the fit goes by the recordings and not by the rig file.
    overruled: bool | None = None
    instead: tuple[Instead, ...] = ()  # others that may be off in its place

    @property
    def reconciling(self) -> tuple[str, ...]:
        """Effects that reconcile; more than one are ambiguous."""
        return tuple(r.effect for r in self.tried if r.reconciles)


@dataclass(frozen=True)
class ContradictionReport:
    """All tests of a fit, and the contradictions among them: none where nothing is predicted or asks for a test."""

    checks: tuple[Check, ...] = ()
    contradictions: tuple[Contradiction, ...] = ()

    @property
    def gross(self) -> tuple[Contradiction, ...]:
        """Stiffnesses that lie far beside the rig, and that no effect reconciles with it."""
        return tuple(c for c in self.contradictions if c.check.gross and not c.reconciling)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        excluded = [c.check for c in self.contradictions]
        return {
            "checks": [{**asdict(c), "contradicts": c in excluded} for c in self.checks],
            "contradictions": [
                {
                    "parameter": c.check.parameter,
                    "gross": c in self.gross,
                    "reconciling": list(c.reconciling),
                    "tried": [r.summary() for r in c.tried],
                    "sought": c.sought,
                    "overruled": c.overruled,
                    "instead": [asdict(other) for other in c.instead],
                }
                for c in self.contradictions
            ],
        }


def check_contradictions(
    fit: Fit,
    rng: np.random.Generator,
    *,
    candidates: Sequence[str] | None = None,
    bench: Bench | None = None,
    context: Context,
) -> ContradictionReport:
    """Test a fit against the rig, and look for effects that reconcile what contradicts.

    `fit`: the final one of an arm, of a pendulum whose length the rig states, of a stated inertia, or of a declared
    system; of any other nothing is predicted. Its bench should hold the candidates, or another kernel is compiled.
    `rng`: source of the draws of the rig's quantities. `candidates`: effects that may reconcile, none to look for none;
    by default all that could be missing. `bench`: quicker mechanics, on which effects are tried where the fit is no
    worse on them; by default those of the fit.
    """
    experiments = fit.problem.bench.experiments
    arm = experiments[0].system.has_rod
    if candidates is None:
        candidates = possible(fit.model, experiments[0].coordinate_unit)
    found = [*against_rig(fit), *(against_stiffness(fit, rng) if arm else [(c, fit) for c in against_length(fit)])]
    contradictions = []
    for check, freed in found:
        if not check.odds > context.settings.nats:
            continue
        name, target = check.parameter, (check.predicted, check.predicted_sd)
        if not arm and name != "k_g":
            moved = abs(fit.values[name] - check.value) < abs(fit.values[name] - check.predicted)
            others = answering_for(fit, name) if moved else ()
            contradictions.append(Contradiction(check, (), sought=False, overruled=moved, instead=others))
            continue
        if arm:
            freed = _quicker(freed, bench, name, target[0], context)
        else:
            # Gravity is to pull as the rig says; its direction in the frame stays as it was found.
            share = fit.values["g_c"] / check.value
            name, target = "g_c", (share * check.predicted, abs(share) * check.predicted_sd)
        tried = reconcile(freed, name, target, candidates, context)
        contradictions.append(Contradiction(check, tried, sought=bool(candidates)))
    # Of constants that the recordings tell together, one that moved answers for the others.
    overruled = [c for c in contradictions if c.overruled]
    return ContradictionReport(tuple(c for c, _ in found), tuple(overruled or contradictions))


def _quicker(fit: Fit, bench: Bench | None, name: str, target: float, context: Context) -> Fit:
    """Return the fit on other mechanics where it is as likely there and contradicts as much, else as it is."""
    if bench is None:
        return fit
    problem = Problem(fit.model.on_base(bench.base), bench, fit.problem.units, fit.problem.gaussian)
    try:
        found = fit_near(problem, fit.values)
    except SimulationFailure:
        return fit
    if not abs(found.values[name] - fit.values[name]) < _ALIKE * abs(target - fit.values[name]):
        return fit
    added = context.added(fit.model)
    own, quick = (contenders(context, [(added, Refit("", f.problem, f.minimum))])[0].joint for f in (fit, found))
    return found if quick > own - context.settings.nats else fit
