"""Fitted values against what the rig, the elastica or gravity predicts for them, one `Check` each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discovery.diagnosis.exact_counterpart import exact_counterpart
from discovery.estimation.batch import fit_problems
from discovery.estimation.covariance import covariance_of
from discovery.estimation.fit import Fit
from discovery.estimation.problem import Problem
from discovery.estimation.residual import correlation_length
from discovery.theory.prediction import predict

__all__ = ["LIMIT", "Check", "adjusted", "against_length", "against_mechanics", "against_rig"]


#: A difference of so many standard deviations is a contradiction.
LIMIT = 3.0
#: What is known of the rig alone is freed beyond so many of its standard deviations.
_WIDE = 30.0
#: Where a value that was held back by its bound is looked for, in these standard deviations.
_AWAY = (-20.0, -10.0, -5.0, 5.0, 10.0, 20.0)
#: What is missing of a model shifts the stiffness that it finds by a smaller factor.
_GROSS = 1.5
#: Standard deviation of what the exact arm predicts for beta / alpha and gamma of a model of another kind.
_LAW = 0.005


@dataclass(frozen=True)
class Check:
    """One fitted value against its predicted distribution.

    Parameters
    ----------
    parameter, unit : str
        What is tested; ``beta/alpha`` is the ratio.
    value, sd : float
        From the recordings alone, whose residual may be correlated.
    predicted, predicted_sd : float
        Mean and standard deviation of the prediction.
    z : float
        Their difference over the root of the sum of both variances.
    p : float
        Two-sided probability of such a difference, multiplied as Holm's method asks for the number of tests.
    source : str
        Where the prediction comes from.
    """

    parameter: str
    unit: str
    value: float
    sd: float
    predicted: float
    predicted_sd: float
    z: float
    p: float
    source: str

    @property
    def contradicts(self) -> bool:
        """Whether the value and its prediction exclude each other."""
        return self.p < math.erfc(LIMIT / math.sqrt(2))

    @property
    def gross(self) -> bool:
        """Whether it is a rod's stiffness so far beside its prediction that the rig file may be wrong.

        A pendulum is no such case: an extended body of the stated length may swing at any pace.
        """
        far = not self.predicted / _GROSS < self.value < self.predicted * _GROSS
        return far and self.contradicts and self.parameter == "alpha"


def _check(parameter: str, unit: str, value: tuple[float, float], predicted: tuple[float, float], source: str) -> Check:
    z = (value[0] - predicted[0]) / math.hypot(value[1], predicted[1])
    p = math.erfc(abs(z) / math.sqrt(2))
    return Check(parameter, unit, *value, *predicted, z=z, p=p, source=source)


def adjusted(checks: Sequence[Check]) -> list[Check]:
    """Return the checks with Holm's adjusted probabilities: k times the smallest, then k - 1 times the next, ..."""
    order = sorted(range(len(checks)), key=lambda i: checks[i].p)
    adjusted, largest = list(checks), 0.0
    for rank, i in enumerate(order):
        largest = min(1.0, max(largest, (len(checks) - rank) * checks[i].p))
        adjusted[i] = replace(checks[i], p=largest)
    return adjusted


def against_length(fit: Fit) -> tuple[Check, ...]:
    """Test how strongly gravity pulls on a simple pendulum, k_g = sqrt(g_c^2 + g_s^2), against g / L of the rig."""
    rig = fit.problem.bench.experiments[0].rig
    names = ("g_c", "g_s")
    # Beside a spring that holds it at its bound, or another law that takes its part, gravity is not known.
    if rig.length is None or rig.gravity is None or not {*names} <= {*fit.problem.free} - {*fit.reasons}:
        return ()
    at = [fit.problem.names.index(n) for n in names]
    torque = fit.minimum.x[at]
    size = float(np.linalg.norm(torque))
    sd = math.sqrt(float(torque @ fit.covariance[np.ix_(at, at)] @ torque)) / size
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
    problem = Problem(old.model, old.bench, old.units, {**old.gaussian, name: (mean, _WIDE * sd)})
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


def _stiffness(fit: Fit, rng: np.random.Generator, bias: float = 1.0) -> list[tuple[Check, Fit]]:
    """Test alpha against the rig, where it is known and states enough; the model reads `bias` times what it is."""
    rig = fit.problem.bench.experiments[0].rig
    needed = (rig.length, rig.tip_mass, rig.beam_mass, rig.flexural_rigidity)
    if "alpha" not in fit.problem.free or "alpha" in fit.reasons or None in needed:
        return []
    draws = predict(rig, rng).draws["rod_counted", "dynamic"]["alpha"]
    predicted = (bias * float(np.mean(draws)), bias * float(np.std(draws)))
    source = "3 EI / (m_eff l^3) of the rig"
    return [(_check("alpha", "s^-2", (fit.values["alpha"], fit.sd["alpha"]), predicted, source), fit)]


def against_mechanics(fit: Fit, rng: np.random.Generator) -> list[tuple[Check, Fit]]:
    """Test alpha against the rig, and the laws of bases with one coordinate against the exact arm."""
    rig = fit.problem.bench.experiments[0].rig
    exact = fit.model.base.startswith("elastica")
    laws = [n for n in ("beta", "gamma") if n in fit.problem.free and n not in fit.reasons]
    if not exact:
        same = exact_counterpart(fit)
        # A wrong length looks like another radius law.
        longer = exact_counterpart(fit, longer=0.0 if rig.length is None else rig.length.sd / rig.length.value)
        # Errors that the model has of its own are in the prediction too: only what is left beside them counts.
        left = math.sqrt(max(1.0, fit.reduced_chi2 - same.chi2 / fit.problem.bench.n_data) / max(1.0, fit.reduced_chi2))
    # A simpler base reads another stiffness from the same arm.
    found = _stiffness(fit, rng, 1.0 if exact else same.found["alpha"] / same.arm["alpha"])
    for law in () if exact else laws:
        ratio = law == "beta"
        name, unit = ("beta/alpha", "rad^-2") if ratio else (law, "1")
        compared = (fit.values, same.found, longer.found)
        value, mean, other = (v[law] / v["alpha"] if ratio else v[law] for v in compared)
        sd = left * fit.sd[law] / (fit.values["alpha"] if ratio else 1.0)
        predicted = (mean, math.hypot(_LAW, other - mean))
        found.append((_check(name, unit, (value, sd), predicted, "the elastica"), fit))
    return found
