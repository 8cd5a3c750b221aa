"""Fitted values against what the rig file states or implies of them, one `Check` each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from discovery.estimation.batch import fit_problems
from discovery.estimation.covariance import covariance_of
from discovery.estimation.fit import Fit
from discovery.estimation.problem import Problem
from discovery.estimation.residual import correlation_length
from discovery.mechanics.elastica import Elastica
from discovery.theory.prediction import predict

#: A prior is made so many times as wide.
WIDE = 30.0
#: Where a value that was held back by its bound is looked for, in these standard deviations.
_AWAY = (-20.0, -10.0, -5.0, 5.0, 10.0, 20.0)
#: What is missing of a model shifts the stiffness that it finds by a smaller factor.
_GROSS = 1.5


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
    return Check(
        parameter, unit, value=found, sd=sd, predicted=mean, predicted_sd=spread, z=z, odds=odds, source=source
    )


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
    rig = fit.problem.bench.experiments[0].rig
    stated: dict[str, tuple[float, float, str]] = {}
    if rig.beam_mass is not None and rig.tip_mass is not None and rig.beam_mass.value:
        spread = math.hypot(rig.beam_mass.sd / rig.beam_mass.value, rig.tip_mass.sd / rig.tip_mass.value)
        ratio = rig.beam_mass.value / rig.tip_mass.value
        stated["mu"] = (ratio, ratio * spread, "the rig's masses")
    if rig.length is not None:
        stated["length"] = (rig.length.value, rig.length.sd, "the rig's length")
    found = []
    for name, (mean, sd, source) in stated.items():
        if not sd or name not in fit.problem.gaussian or name not in fit.problem.free:
            continue
        freed = _freed(fit, name, (mean, sd))
        if name in freed.reasons:
            continue
        value, spread = freed.values[name], freed.sd[name]
        if abs(value - mean) > math.hypot(spread, sd):
            spread = _spread_by_ratio(fit, freed, name, (mean, sd))
        found.append((_check(name, fit.model.parameters[name].unit, (value, spread), (mean, sd), source), freed))
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
