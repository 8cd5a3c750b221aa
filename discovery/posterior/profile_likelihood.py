r"""Profile likelihoods: how much worse the recordings are described when one parameter is held and all others refitted.

With :math:`\chi^2_p(\theta)` the smallest chi-square for a held value, over the n readings and relative to the noise
that the fit itself leaves, the statistic is that of the likelihood with the size of the noise refitted too,

.. math:: \lambda(\theta) = 2 \ln \frac{L_\max}{L_p(\theta)}
          = n \ln\left(1 + \frac{\chi^2_p(\theta) - \chi^2_\min}{n}\right)

and :math:`\lambda \le 2.706` is the 90 % interval of a large sample [1]_. What the rig states of a parameter counts as
a reading. Errors count as independent, as in the naive posterior; other priors have no part in it.

.. [1] S. A. Murphy and A. W. van der Vaart, "On profile likelihood", JASA 95 (2000) 449.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.posterior.likelihood import LogPosterior
from discovery.posterior.noise.model import instruments

#: Quantile 0.9 of chi-square with one degree of freedom.
CUT = 2.7055434540954
#: Held values of a parameter, and how far they reach in the fit's standard deviations.
_POINTS, _REACH = 13, 3.0
# Residuals at once.
_NUMBERS = 2e7


@dataclass(frozen=True)
class Profile:
    """Profile likelihood of one parameter, at held `values` (g,), increasing [SI]; `best` is the estimate [SI].

    The statistic (g,) is twice the log likelihood ratio against the best; infinite where no motion was found.
    """

    name: str
    values: FloatArray
    statistic: FloatArray
    best: float

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """90 % interval, None at an end that the held values do not reach (a bound)."""
        good = np.isfinite(self.statistic)
        values = self.values[good]
        # The signed root is nearly a straight line in the parameter.
        signed = np.sign(values - self.best) * np.sqrt(np.maximum(self.statistic[good], 0.0))

        def crossing(level: float) -> float | None:
            below = np.flatnonzero((signed[:-1] <= level) & (signed[1:] >= level))
            if not below.size:
                return None
            i = int(below[0] if level > 0 else below[-1])
            share = (level - signed[i]) / (signed[i + 1] - signed[i])
            return float(values[i] + share * (values[i + 1] - values[i]))

        return crossing(-(CUT**0.5)), crossing(CUT**0.5)


def profiles(target: LogPosterior, points: int = _POINTS) -> list[Profile]:
    """Return the profile likelihood, at so many held values, of every free physical parameter that has a spread.

    All held values of one parameter are refitted together, in common simulation calls. The minimum of `target` and its
    covariance give the range of held values and the starts.
    """
    problem = _at_its_own_noise(target.problem, target.centre)
    m = len(problem.names)
    best = target.centre[:m]
    covariance = target.factor[:m] @ target.factor[:m].T
    (minimum,) = fit_problems([problem], [best])
    best, least = minimum.x, 2 * minimum.cost
    found = []
    for k, name in enumerate(problem.free):
        sd = float(np.sqrt(covariance[k, k]))
        lower, upper = (float(edge[k]) for edge in problem.bounds)
        values = np.unique(np.clip(best[k] + sd * np.linspace(-_REACH, _REACH, points), lower, upper))
        chi2 = _refitted(problem, name, values, best, covariance[k] / covariance[k, k])
        n = problem.bench.n_data
        statistic = n * np.log1p(np.maximum(chi2 - least, 0.0) / n)
        found.append(Profile(name, values, statistic, float(best[k])))
    return found


def _at_its_own_noise(problem: Problem, x: FloatArray) -> Problem:
    """Return the problem with the noise of each instrument as large as what the fit leaves."""
    bench = problem.bench
    misfit = bench.chi2(*problem.expand(x[: len(problem.names), None]))
    experiments = list(bench.experiments)
    for part in instruments(experiments):
        size = float(np.sqrt(sum(misfit[i, 0] for i in part.experiments) / part.n))
        for i in part.experiments:
            recording = experiments[i].recording
            experiments[i] = replace(experiments[i], recording=replace(recording, noise=size * recording.noise))
    return replace(problem, bench=Bench(bench.base, bench.effects, experiments, bench.step))


def _refitted(problem: Problem, name: str, values: FloatArray, best: FloatArray, slope: FloatArray) -> FloatArray:
    """Return the smallest chi-square for every held value of a parameter."""
    held, starts = [], []
    rest = {n: g for n, g in problem.gaussian.items() if n != name}
    for value in values.tolist():
        model = Model(problem.model.base, problem.model.effects, {**problem.model.known, name: value})
        held.append(replace(problem, model=model, gaussian=rest))
        # Where the others go with the held one, to first order.
        there = dict(zip(problem.names, best + slope * (value - best[problem.names.index(name)]), strict=True))
        starts.append(np.array([there[n] for n in held[-1].names]))
    # Long recordings: only so many at once that their residuals fit into memory.
    together = max(1, int(_NUMBERS / (problem.bench.n_rows * (2 * best.size + 1))))
    parts = [slice(first, first + together) for first in range(0, len(held), together)]
    chi2 = 2 * np.array([m.cost for part in parts for m in fit_problems(held[part], starts[part])])
    mean, width = problem.gaussian.get(name, (0.0, np.inf))
    return chi2 + ((values - mean) / width) ** 2
