"""What is left when the catalogue fails: the missing force in time, what it depends on, and a patch.

Where the reconstructed force depends on one or two variables, a sparse polynomial (pysindy's STLSQ; Brunton, Proctor,
Kutz, PNAS 113 (2016) 3932) and a penalised spline are fitted to it, together with the forces that imitate changes of
the fitted parameters: a law comes with the parameters that go with it. Each is run freely on the held-out recordings
and is accepted only where it lowers their error by `MARGIN`. A patch describes; it says nothing of where the force
comes from.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from discovery.declarations.units import in_coordinate
from discovery.diagnosis.force_dependence import ForceDependence, Sites, Smooth, dependences, depends_on, with_imitated
from discovery.diagnosis.latent_force import LatentForce, close, reconstruct
from discovery.diagnosis.multiple_shooting import Chain
from discovery.diagnosis.slow_model import Law
from discovery.estimation.fit import Fit
from discovery.estimation.held_states import fitted_states
from discovery.estimation.problem import Problem
from discovery.estimation.residual import errors
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.errors import ComputationError, DiscoveryError
from discovery.recordings.experiment import Experiment

#: Part of the held-out rms error that a patch must remove.
MARGIN = 0.2
#: Terms of a sparse law explain at least this share of the force's variance each.
LEAST_TERM = 0.01
#: Degree of a sparse law in one variable, and in two.
_DEGREES = {1: 5, 2: 3}
#: Twice the logarithm of the likelihood ratio from which there is a force at all, as for an effect of the catalogue.
LEAST_GAIN = 40.0
#: Sets of variables, of those that cannot be told apart, whose laws are tried.
_MOST_SETS = 2


@dataclass(frozen=True)
class Patch:
    """A law of the missing force, tried on held-out recordings."""

    kind: str  # "sparse law" or "spline"
    variables: tuple[str, ...]  # what it depends on; beyond the range seen it is constant
    formula: str  # the law in words of a formula [s^-2 q]
    parameters: Mapping[str, float]  # the model's parameters that go with it
    #: before, after: root mean square of the held-out error without and with the patch, in the unit of the output; None
    #: if not known.
    before: float | None
    after: float | None
    accepted: bool  # whether it removes `MARGIN` of that error
    reason: str  # why, as a sentence
    #: The law over the range of its variable, where there is one: the variable, and ``force``.
    curve: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class TrainedLaw:
    """A law as the training recordings give it, with the changes of the fitted parameters that go with it."""

    kind: str
    formula: str
    law: Law
    changes: Mapping[str, float]
    smooth: Smooth


def spline_law(sites: Sites, depends: ForceDependence, names: Sequence[str]) -> TrainedLaw:
    """Return a penalised spline in the variables of a dependence; `names` are the fitted parameters."""
    smooth = Smooth.over(depends.variables, sites.variables)
    columns, penalty = with_imitated(sites, smooth.evaluate(sites.variables), smooth.penalty)
    gram = columns.T @ columns + depends.penalty * penalty
    gram += 1e-10 * np.trace(gram) / len(gram) * np.eye(len(gram))
    solution = np.asarray(np.linalg.solve(gram, columns.T @ sites.force), np.float64)
    constant, weights = solution[0] * sites.scale[0], solution[sites.imitated.shape[1] :]

    def force(variables: Mapping[str, FloatArray]) -> FloatArray:
        return constant + smooth.evaluate(variables) @ weights

    law = Law(smooth.names, force)
    return TrainedLaw(
        "spline", f"spline in {' and '.join(smooth.names)}", law, _changes(sites, solution, names), smooth
    )


def _changes(sites: Sites, solution: FloatArray, names: Sequence[str]) -> dict[str, float]:
    """Return the changes of the fitted parameters in a regression that starts with the imitated forces."""
    return {n: float(solution[i + 1] * sites.scale[i + 1]) for i, n in enumerate(names)}


def sparse_law(sites: Sites, depends: ForceDependence, names: Sequence[str]) -> TrainedLaw:
    """Return a sparse polynomial in the variables of a dependence; `names` are the fitted parameters."""
    import pysindy

    smooth = Smooth.over(depends.variables, sites.variables)
    degree, count = _DEGREES[len(smooth.names)], len(smooth.names)
    powers = np.array([p for p in product(range(degree + 1), repeat=count) if 0 < sum(p) <= degree])

    def monomials(variables: Mapping[str, FloatArray], which: IntArray) -> FloatArray:
        values = np.column_stack(list(smooth.clipped(variables).values()))
        return np.prod(values[:, None, :] ** powers[which], axis=2)

    columns = monomials(sites.variables, np.arange(len(powers)))
    # What the parameters can imitate is taken off both sides first; then coefficients are shares of the deviation.
    away = np.linalg.qr(sites.imitated)[0]
    free, target = columns - away @ (away.T @ columns), sites.force - away @ (away.T @ sites.force)
    sizes, size = np.sqrt(np.mean(free**2, axis=0)), np.sqrt(np.mean(target**2))
    optimiser = pysindy.STLSQ(threshold=np.sqrt(LEAST_TERM), alpha=1e-4 * len(target))
    with warnings.catch_warnings():
        # It warns where no term passes: the law is then a constant.
        warnings.simplefilter("ignore")
        optimiser.fit(free / sizes, target[:, None] / size)
    kept = np.flatnonzero(np.asarray(optimiser.coef_)[0])
    beside = np.column_stack([sites.imitated, columns[:, kept]])
    solution = np.asarray(np.linalg.lstsq(beside, sites.force, rcond=None)[0], np.float64)
    constant, weights = float(solution[0] * sites.scale[0]), solution[sites.imitated.shape[1] :]
    terms = [
        " ".join(f"{n}^{p}" if p > 1 else n for n, p in zip(smooth.names, powers[k], strict=True) if p) for k in kept
    ]

    def force(variables: Mapping[str, FloatArray]) -> FloatArray:
        return constant + monomials(variables, kept) @ weights

    formula = " ".join([f"{constant:.4g}", *(f"{w:+.4g} {t}" for w, t in zip(weights, terms, strict=True))])
    return TrainedLaw("sparse law", formula, Law(smooth.names, force), _changes(sites, solution, names), smooth)


class Judge:
    """Held-out recordings, or the held-out parts of the fitted ones, and how far the model alone misses them.

    `before` is the rms error of the model alone, in the unit of the output; NaN where nothing is held out.
    """

    def __init__(self, fit: Fit, holdout: Sequence[Experiment]) -> None:
        bench, self.values = fit.problem.bench, fit.own_values
        self.experiments = tuple(holdout) or bench.experiments
        self.problem, x = fit.problem, fit.minimum.x
        if holdout:
            model = replace(fit.model, known={**fit.model.known, **self.values})
            self.problem = Problem(model, bench.of_others(holdout), fit.problem.units, {}, reference="")
            x = fitted_states([self.problem])[0]
        self.starts = self.problem.expand(x[:, None])[1][:, :, 0]
        self.outputs = []
        for e in self.experiments:
            out = e.recording.judged_output.copy()
            if not holdout:
                out[e.fitted] = np.nan
            self.outputs.append(out)
        self.before = self._error(self.problem.predict(x))

    def _error(self, predictions: Sequence[FloatArray]) -> float:
        return errors(np.concatenate(predictions), np.concatenate(self.outputs))["rms"]

    def error(self, values: Mapping[str, float], law: Law) -> float:
        """Return the rms error with a law and the parameters that go with it."""
        runs = [
            close(Chain(self.problem, values, e, start), law)
            for e, start in zip(self.experiments, self.starts, strict=True)
        ]
        return self._error(runs)


def tried(trained: TrainedLaw, fit: Fit, judge: Judge) -> Patch:
    """Return the patch that a law makes, as the held-out recordings judge it."""
    lower, upper = fit.problem.bounds
    values = {
        n: float(np.clip(judge.values[n] + trained.changes[n], lower[i], upper[i]))
        for i, n in enumerate(fit.problem.free)
    }
    after, accepted = None, False
    if not np.isfinite(judge.before):
        reason = "nothing was held out to try it on"
    else:
        try:
            after = judge.error(values, trained.law)
            accepted = after <= (1 - MARGIN) * judge.before
            share = 1 - after / judge.before
            reason = f"it removes {100 * share:.1f} % of the held-out error, {'at least' if accepted else 'less than'} "
            reason += f"the {100 * MARGIN:.0f} % asked for"
        except DiscoveryError as failure:
            reason = f"it could not be run on the held-out recordings: {failure}"
    curve: dict[str, tuple[float, ...]] = {}
    if len(trained.smooth.names) == 1:
        (name,) = trained.smooth.names
        grid = np.linspace(trained.smooth.low[0], trained.smooth.high[0], 121)
        curve = {name: tuple(grid.tolist()), "force": tuple(trained.law.force({name: grid}).tolist())}
    before = judge.before if np.isfinite(judge.before) else None
    law = (trained.kind, trained.smooth.names, trained.formula, values)
    return Patch(*law, before, after, accepted=accepted, reason=reason, curve=curve)


@dataclass(frozen=True)
class MissingForce:
    """What is left unexplained: as a force in time by fitted recording, what it depends on, and patches.

    `dependence` has the best first and is empty where there is no force; `depends` has the simplest sets that predict
    nearly as much, of which more than one cannot be told apart here. Of the patches tried, the best on the held-out
    recordings is first. The force is per unit inertia, the coordinate in an SI unit.
    """

    forces: tuple[LatentForce, ...]
    dependence: tuple[ForceDependence, ...]
    depends: tuple[ForceDependence, ...]
    patches: tuple[Patch, ...]
    coordinate: str = "rad"

    @property
    def patch(self) -> Patch | None:
        """The patch that is offered."""
        return next((p for p in self.patches if p.accepted), None)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {
            "unit": in_coordinate("q s^-2", self.coordinate),
            "recordings": [f.summary() for f in self.forces],
            "dependence": [asdict(d) for d in self.dependence],
            "depends_on": [list(d.variables) for d in self.depends],
            "patches": [asdict(p) for p in self.patches],
            "result": "patch" if self.patch else "no patch",
            "held_parameters": list(self.forces[0].equivalent),
        }


def missing_force(fit: Fit, holdout: Sequence[Experiment] = ()) -> MissingForce:
    """Return what a fitted model leaves unexplained as a force, what the force depends on, and patches for it.

    The parameters are held while the force is reconstructed. Patches are tried on the held-out recordings, or on the
    parts of the training recordings that were not fitted if there are none.

    Raises ComputationError if no motion beside a fitted run is found.
    """
    period = 2 * np.pi * fit.problem.units.time
    coordinate = fit.problem.bench.experiments[0].coordinate_unit
    try:
        forces = tuple(reconstruct(fit, i) for i in range(len(fit.problem.bench.experiments)))
    except ComputationError as failure:
        why = f"{str(failure)[:1].lower()}{str(failure)[1:]}"
        raise ComputationError(
            f"The missing force could not be reconstructed: {why} The answer does not depend on it; shorter "
            "recordings, with samples = [start, stop], may have one."
        ) from failure
    if max(f.gain for f in forces) < LEAST_GAIN:
        return MissingForce(forces, (), (), (), coordinate)
    sites = Sites.of(forces, period)
    found = dependences(sites)
    depends = depends_on(found)
    known = [d for d in depends if "time" not in d.variables]
    patches: list[Patch] = []
    if known:
        judge = Judge(fit, holdout)
        laws = [law(sites, d, fit.problem.free) for d in known[:_MOST_SETS] for law in (sparse_law, spline_law)]
        patches = [tried(law, fit, judge) for law in laws]
        patches.sort(key=lambda p: np.inf if p.after is None else p.after)
    return MissingForce(forces, found, depends, tuple(patches), coordinate)
