"""Output-error estimation: bounded least squares on free-run trajectories of several recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.errors import ComputationError
from discovery.experiment import Experiment
from discovery.least_squares import Minimum, levenberg_marquardt, minimise
from discovery.model import Model
from discovery.problem import LIGHT_ROD, Bench, NaturalUnits, Problem, known_values, natural_units
from discovery.simulate import check_finite

__all__ = ["Fit", "answer_on", "choose_step", "declared_model", "fit", "fit_problems", "rig_uncertainty"]

FloatArray = NDArray[np.float64]
#: Trajectory error by default: rad for an arm, of the largest amplitude for an oscillator.
TOLERANCE = 1e-6
#: Rounds of simulation are cut into pieces of about this many numbers, so that memory stays bounded.
_CHUNK = 6e7


@dataclass(frozen=True)
class Fit:
    """Estimates of an output-error fit.

    Parameters
    ----------
    problem : Problem
        What was fitted on what.
    minimum : Minimum
        Where the minimisation ended.
    covariance : ndarray, shape (p, p)
        From the Jacobian, scaled by the reduced chi-square where that is above one; NaN rows where an interval is
        missing.
    reasons : mapping of str to str
        Why an interval is missing, by parameter.
    null_directions : tuple of mapping
        Combinations of parameters that the data do not determine.
    solver_shift : float
        Largest shift of the minimum against a solve with half the step, in standard deviations.
    """

    problem: Problem
    minimum: Minimum
    covariance: FloatArray
    reasons: Mapping[str, str]
    null_directions: tuple[Mapping[str, float], ...]
    solver_shift: float

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.problem.model

    @property
    def values(self) -> dict[str, float]:
        """Estimates by name, initial states included."""
        return dict(zip(self.problem.names, self.minimum.x.tolist(), strict=True))

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations by name; NaN where `reasons` says why."""
        with np.errstate(invalid="ignore"):
            return dict(zip(self.problem.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def chi2(self) -> float:
        """Sum of squared normalised residuals."""
        return 2 * self.minimum.cost

    @property
    def reduced_chi2(self) -> float:
        """Chi-square over degrees of freedom."""
        return self.chi2 / max(1, self.problem.bench.n_data - self.minimum.x.size)

    @property
    def status(self) -> str:
        """One sentence on how the fit ended."""
        if self.null_directions:
            return "The data leave a combination of parameters undetermined."
        if not self.minimum.converged:
            return f"The iteration stopped after {self.minimum.iterations} Jacobians without meeting its stopping rule."
        bound = [n for n, b in zip(self.problem.names, self.minimum.at_bound, strict=True) if b]
        return f"Converged; at a bound: {', '.join(bound)}." if bound else "Converged."

    def predict(
        self, experiments: Sequence[Experiment] | None = None, initial: FloatArray | None = None
    ) -> list[FloatArray]:
        """Return the fitted model's channels, each (n, c): on the fitted recordings, or from initial states (m, 2)."""
        parameters, fitted = self.problem.expand(self.minimum.x[:, None])
        if experiments is None:
            return [c[:, :, 0] for c in self.problem.bench.predict(parameters, fitted)]
        assert initial is not None
        bench = Bench(self.problem.bench.base, self.problem.bench.effects, experiments, self.problem.bench.step)
        return [c[:, :, 0] for c in bench.predict(parameters, np.asarray(initial, float)[:, :, None])]

    def specialised(self) -> Fit:
        """Return the same fit on a kernel that holds the model's own effects only: faster for many evaluations."""
        bench = self.problem.bench
        own = Bench(bench.base, self.model.effects, bench.experiments, bench.step)
        return replace(self, problem=Problem(self.model, own, self.problem.units, self.problem.gaussian))

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready report row."""
        declared = self.model.parameters
        return {
            "model": self.model.to_dict(),
            "parameters": {
                n: {
                    "value": v,
                    "sd": None if n in self.reasons else self.sd[n],
                    "unit": declared[n].unit if n in declared else "",
                    **({"reason": self.reasons[n]} if n in self.reasons else {}),
                }
                for n, v in self.values.items()
            },
            "chi2": self.chi2,
            "n_data": self.problem.bench.n_data,
            "reduced_chi2": self.reduced_chi2,
            "status": self.status,
            "solver_step_s": self.problem.bench.step,
            "solver_shift_sd": self.solver_shift,
            "null_directions": [dict(d) for d in self.null_directions],
        }


#: Retardation time of an ordinary rod's material [s]: loss factors of 1e-4 to 1e-3 at these frequencies.
RETARDATION = 1.5e-4


def rig_uncertainty(experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Return what the exact arm may move within its uncertainty: the rod's mass, and its slight internal damping.

    Returns
    -------
    dict of str to (mean, sd)
        Fitted with this prior and bounded at three standard deviations, so that it cannot swallow an effect.
    """
    rig = experiment.rig
    if not experiment.is_arm:
        return {}
    known = {"tau_r": (0.0, RETARDATION), "mu": (LIGHT_ROD, LIGHT_ROD)}
    if rig.beam_mass is not None and rig.tip_mass is not None and rig.beam_mass.value:
        mu = rig.beam_mass.value / rig.tip_mass.value
        spread = np.hypot(rig.beam_mass.sd / rig.beam_mass.value, rig.tip_mass.sd / rig.tip_mass.value)
        known["mu"] = (mu, mu * float(spread))
    return known


def declared_model(experiment: Experiment) -> Model:
    """Return the model that the rig file declares, on the base of its kind."""
    base = "constant_radius" if experiment.is_arm else "oscillator"
    return Model(base, tuple(experiment.rig.declared), known_values(experiment))


def fit_problems(
    problems: Sequence[Problem], starts: Sequence[FloatArray], *, iterations: int = 40, on_round=None
) -> list[Minimum]:
    """Fit several problems on one bench together, all residuals of a round in one simulation call."""
    requests = [
        levenberg_marquardt(x, *p.bounds, p.scale, iterations=iterations) for p, x in zip(problems, starts, strict=True)
    ]
    return minimise(requests, answer_on(problems), on_round=on_round)


def answer_on(problems: Sequence[Problem]) -> Callable[[list[tuple[int, FloatArray]]], list[FloatArray]]:
    """Return the function by which `minimise` gets residuals of problems that share one bench."""
    bench = problems[0].bench
    width = max(64, int(_CHUNK / max(1, bench.n_rows)))

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        expanded = [problems[i].expand(x) for i, x in wanted]
        parameters = np.concatenate([p for p, _ in expanded], axis=1)
        initial = np.concatenate([s for _, s in expanded], axis=2)
        edges = np.cumsum([0, *[x.shape[1] for _, x in wanted]])
        data = np.concatenate(
            [
                bench.residuals(parameters[:, a : a + width], initial[:, :, a : a + width])
                for a in range(0, parameters.shape[1], width)
            ],
            axis=1,
        )
        return [
            np.concatenate([data[:, edges[j] : edges[j + 1]], problems[i].prior_residuals(x)])
            for j, (i, x) in enumerate(wanted)
        ]

    return answer


def _covariance(problem: Problem, minimum: Minimum) -> tuple[FloatArray, dict[str, str], tuple[dict[str, float], ...]]:
    names = problem.names
    p = len(names)
    jacobian = minimum.jacobian
    reasons = {n: "at its bound" for n, b in zip(names, minimum.at_bound, strict=True) if b}
    size = np.sqrt(np.einsum("np,np->p", jacobian, jacobian))
    for n, z in zip(names, size, strict=True):
        if z == 0:
            reasons.setdefault(n, "the data do not depend on it")
    use = np.array([n not in reasons for n in names])
    covariance = np.full((p, p), np.nan)
    directions: list[dict[str, float]] = []
    if use.any():
        scaled = jacobian[:, use] / size[use]
        _, singular, rows = np.linalg.svd(scaled, full_matrices=False)
        # Below this, round-off of the differences decides.
        weak = singular < 1e-6 * singular[0]
        kept = [n for n, u in zip(names, use, strict=True) if u]
        for row in rows[weak]:
            direction = {n: float(v) for n, v in zip(kept, row, strict=True) if abs(v) > 0.1}
            directions.append(direction)
            for n in direction:
                reasons[n] = "not identifiable from these recordings"
        inverse = (rows[~weak].T / singular[~weak] ** 2) @ rows[~weak]
        variance = max(1.0, 2 * minimum.cost / max(1, problem.bench.n_data - p))
        covariance[np.ix_(use, use)] = inverse / np.outer(size[use], size[use]) * variance
        for n in reasons:
            k = names.index(n)
            covariance[k, :] = covariance[:, k] = np.nan
    return covariance, reasons, tuple(directions)


def choose_step(
    model: Model,
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    tolerance: float = TOLERANCE,
    effects: Sequence[str] | None = None,
) -> float:
    """Return the integration step whose trajectory error is at most `tolerance`, measured against half the step.

    Parameters
    ----------
    model : Model
        The model.
    experiments : sequence of Experiment
        Recordings.
    units : NaturalUnits
        Natural units.
    values : mapping of str to float
        Parameter values at which the error is measured.
    tolerance : float
        Largest error over all samples: rad for an arm (its readings divided by the length), of the natural coordinate
        for an oscillator.
    effects : sequence of str, optional
        Effects of the kernel; the model's own by default.

    Raises
    ------
    ComputationError
        If no step reaches the tolerance.
    """
    alpha = values.get("alpha", units.time**-2)
    fastest = np.sqrt(abs(alpha)) * model.mechanics.highest_frequency({**model.known, **values})
    gap = float(np.median(np.diff(experiments[0].recording.time)))
    # An input with content up to half the sampling rate must be resolved too.
    rough = experiments[0].drive is not None and not experiments[0].is_arm
    step = min(1.0 / fastest, 0.05 * units.time, gap if rough else np.inf)
    size = units.length if experiments[0].is_arm else units.coordinate
    for _ in range(12):
        bench = Bench(model.base, effects or model.effects, experiments, step)
        problem = Problem(model, bench, units, {})
        vector = problem.start(values)[:, None]
        coarse = bench.predict(*problem.expand(vector))
        fine = Bench.like(bench, step / 2).predict(*problem.expand(vector))
        with np.errstate(invalid="ignore", over="ignore"):
            # The error against half the step, a sixteenth of which the finer solve still has.
            error = max(float(np.linalg.norm(a - b, axis=1).max()) for a, b in zip(coarse, fine, strict=True)) / size
            error *= 16 / 15
        if error <= tolerance:
            return step
        # Order four: one adjustment is usually enough; never more than a factor eight at once.
        step *= float(np.clip(0.9 * (tolerance / error) ** 0.25, 0.125, 0.9)) if np.isfinite(error) else 0.25
    raise ComputationError(
        f"No step gives a trajectory error below {tolerance:g}; the last one tried was {step:.3g} s."
    )


def _shift(problem: Problem, minimum: Minimum, covariance: FloatArray) -> float:
    fine = Bench.like(problem.bench, problem.bench.step / 2)
    vector = minimum.x[:, None]
    change = (
        fine.residuals(*problem.expand(vector))[:, 0]
        - minimum.residual[: len(minimum.residual) - len(problem.prior_residuals(vector))]
    )
    rows = minimum.jacobian[: change.size]
    known = np.isfinite(np.diag(covariance))
    if not known.any():
        return float("nan")
    step, *_ = np.linalg.lstsq(rows[:, known], -change, rcond=None)
    return float(np.max(np.abs(step) / np.sqrt(np.diag(covariance)[known])))


def fit(
    model: Model,
    experiments: Sequence[Experiment],
    *,
    start: Mapping[str, float] | None = None,
    bench: Bench | None = None,
    units: NaturalUnits | None = None,
    gaussian: Mapping[str, tuple[float, float]] | None = None,
    tolerance: float = TOLERANCE,
) -> Fit:
    """Fit a model to recordings by free-run (output-error) least squares.

    Parameters
    ----------
    model : Model
        Any base with any sum of effects.
    experiments : sequence of Experiment
        Fitted together; each has its own initial state.
    start : mapping of str to float, optional
        Start values by name; the others come from the declarations and a scan of the stiffness.
    bench : Bench, optional
        Simulators to use; made here otherwise, with a step that keeps the trajectory error below `tolerance`.
    units : NaturalUnits, optional
        Natural units; from the recordings otherwise.
    gaussian : mapping, optional
        Parameters to free within the rig's uncertainty, see `rig_uncertainty`.
    tolerance : float
        Trajectory error, see `choose_step`.

    Returns
    -------
    Fit

    Raises
    ------
    SimulationFailure
        If the model blows up at every start.
    ComputationError
        If no step reaches the tolerance.
    """
    units = units or natural_units(experiments)
    gaussian = dict(gaussian or {})
    values = dict(start or {})
    if "alpha" in model.free and "alpha" not in values:
        values = first_guess(model, experiments, units, values)
    if bench is None:
        bench = Bench(model.base, model.effects, experiments, choose_step(model, experiments, units, values, tolerance))
    problem = Problem(model, bench, units, {n: g for n, g in gaussian.items() if n in model.parameters})
    if problem.gaussian:
        # First as the rig states it: the ringing of the rod has local minima in its mass while the stiffness is off.
        stiff = Problem(model, bench, units, {})
        (minimum,) = fit_problems([stiff], [stiff.start(values)])
        values = {**values, **dict(zip(stiff.names, minimum.x.tolist(), strict=True))}
    (minimum,) = fit_problems([problem], [problem.start(values)])
    if not np.isfinite(minimum.cost):
        parameters, initial = problem.expand(minimum.x[:, None])
        for e, channels in zip(experiments, bench.predict(parameters, initial), strict=True):
            check_finite(channels, e.recording.time, bench.names, parameters)
    covariance, reasons, directions = _covariance(problem, minimum)
    return Fit(problem, minimum, covariance, reasons, directions, _shift(problem, minimum, covariance))


def first_guess(
    model: Model, experiments: Sequence[Experiment], units: NaturalUnits, given: Mapping[str, float]
) -> dict[str, float]:
    """Return start values from a scan: linear stiffness around the dominant frequency, damping over decades.

    Free-run residuals have many minima in the stiffness (whole periods slip), so the scan simulates a grid of
    stiffnesses at once, coarsely, with the best input gain by linear regression where there is one, and polishes the
    best few.
    """
    from discovery.guess import scan

    return scan(model, experiments, units, given)
