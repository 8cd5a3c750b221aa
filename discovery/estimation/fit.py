"""Output-error estimation: bounded least squares on free-run trajectories of several recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import covariance_of, longest_leap, solver_shift
from discovery.estimation.guess import pushed, restoring, scan, staged_start, start_of_system
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits, natural_units
from discovery.estimation.physical import physical_parameters, physical_rows
from discovery.estimation.problem import Problem
from discovery.estimation.start_values import check_start, fitted_recordings, given_uncertainty
from discovery.estimation.step import TOLERANCE, choose_step
from discovery.estimation.step_control import tightened
from discovery.foundation.arguments import check_number
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError, SimulationFailure
from discovery.foundation.start_names import is_start
from discovery.plots.estimates import FitViews
from discovery.recordings.chosen import Recordings, training_of
from discovery.simulation.simulate import check_finite

#: Largest shift of an estimate that the solver may cause, in standard deviations.
SHIFT = 0.02
_REFINEMENTS = 3
#: From one minimum to the next, on finer steps, it is no farther than so many.
_NEAR = 15


@dataclass(frozen=True, repr=False)
class Fit(FitViews):
    """Estimates of an output-error fit.

    Parameters
    ----------
    problem : Problem
        What was fitted on what.
    minimum : Minimum
        Where the minimisation ended.
    covariance : ndarray, shape (p, p)
        From the Jacobian and the spectrum of the residual, see `discovery.estimation.covariance`; NaN rows where an
        interval is missing.
    reasons : mapping of str to str
        Why an interval is missing, by parameter.
    null_directions : tuple of mapping
        Combinations of parameters that the data do not determine.
    solver_shift : float
        Largest shift of the minimum against a solve with half the step, in standard deviations.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> fit = fit_model(declared_model(data), data)
    >>> fit.to_pandas()["value"].round(1).to_dict()  # s^-1, s^-2
    {'xi': 0.5, 'alpha': 399.9}
    >>> fit.initial_states()["deflection"].round(3).to_dict()  # m
    {'train_high': 0.042, 'train_low': 0.011}
    >>> [p.shape for p in fit.predict()], len(fit.plot_residuals())
    ([(800, 1), (800, 1)], 2)
    >>> fit.told("alpha")["unit"], len(fit.summary()["parameters"]), fit.specialised().values == fit.values
    ('s^-2', 6, True)
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
        return self.problem.named(self.minimum.x)

    @property
    def own_values(self) -> dict[str, float]:
        """Estimates that belong to the model and not to a recording, by name."""
        return {n: v for n, v in self.values.items() if not is_start(n)}

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations by name; NaN where `reasons` says why."""
        with np.errstate(invalid="ignore"):
            return self.problem.named(np.sqrt(np.diag(self.covariance)))

    @property
    def chi2(self) -> float:
        """Sum of squared normalised residuals."""
        return 2 * self.minimum.cost

    @cached_property
    def untold(self) -> dict[str, str]:
        """Why a value has no interval of its own: `reasons`, and shapes of laws that are as far as they may be."""
        shapes = {n for n, p in self.model.parameters.items() if p.shape} & {*self.minimum.bound(self.problem.names)}
        return {**dict.fromkeys(shapes, "at its bound"), **self.reasons}

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
        bound = self.minimum.bound(self.problem.names)
        ended = f"Converged; at a bound: {', '.join(bound)}." if bound else "Converged."
        if self.solver_shift > SHIFT:
            ended += f" The solver still shifts an estimate by {self.solver_shift:.2g} standard deviations."
        return ended

    def predict(self, experiments: Recordings | None = None, initial: FloatArray | None = None) -> list[FloatArray]:
        """Return the fitted model's channels, each (n, c): on the fitted recordings, or from initial states (m, 2)."""
        if experiments is None:
            return self.problem.predict(self.minimum.x)
        experiments = training_of(experiments)
        if initial is None or np.shape(initial) != (len(experiments), 2):
            raise InputError(
                "Give `initial`, the deflection and the rate at the start of each recording; predict_motion(fit, "
                "experiment) starts at rest."
            )
        parameters, _ = self.problem.expand(self.minimum.x[:, None])
        bench = self.problem.bench.of_others(experiments)
        return [c[:, :, 0] for c in bench.predict(parameters, np.asarray(initial, float)[:, :, None])]

    def specialised(self) -> Fit:
        """Return the same fit on a kernel that holds the model's own effects only: faster for many evaluations.

        Where a method of higher order shifts no estimate, it takes the steps.
        """
        whole, effects = self.problem.bench, self.model.effects
        own = replace(self.problem, bench=Bench(whole.base, effects, whole.experiments, whole.step))
        if (leap := longest_leap(own, self.minimum, 0.5 * SHIFT)) is not None:
            own = replace(own, bench=Bench(whole.base, effects, whole.experiments, whole.step, leap))
        return replace(self, problem=own)

    @cached_property
    def physical(self) -> dict[str, tuple[float, float, str]]:
        """Return what is known in kilograms and newtons, see `discovery.estimation.physical.physical_parameters`."""
        problem = self.problem
        parameters, _ = problem.expand(self.minimum.x[:, None])
        values = dict(zip(problem.bench.names, parameters[:, 0].tolist(), strict=True))
        return physical_parameters(self.model, values, problem.names, self.covariance, problem.bench.experiments[0])

    def told(self, name: str) -> dict[str, Any]:
        """Return value, sd and unit of a parameter or an initial state, JSON-ready, and why there is no sd."""
        first, parameter = self.problem.bench.experiments[0], self.model.parameters.get(name)
        states = {state.name: state for state in self.problem.states}
        unit = first.unit_of(parameter) if parameter else states[name].unit(first.coordinate_unit)
        row = {"value": self.values[name], "sd": self.sd[name], "unit": unit}
        return {**row, "sd": None, "reason": self.untold[name]} if name in self.untold else row

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready report row."""
        return {
            "model": self.model.free_parameter(*self.problem.free).to_dict(),
            "parameters": {n: self.told(n) for n in self.values},
            **({"physical": physical} if (physical := physical_rows(self.physical)) else {}),
            "chi2": self.chi2,
            "n_data": self.problem.bench.n_data,
            "reduced_chi2": self.reduced_chi2,
            "status": self.status,
            "solver_step_s": self.problem.bench.shortest,
            "solver_shift_sd": self.solver_shift,
            "null_directions": [dict(d) for d in self.null_directions],
        }


def fit(
    model: Model,
    experiments: Recordings,
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
    experiments : Dataset or sequence of Experiment
        The training recordings of a data set, or others: fitted together, each with an initial state of its own.
    start : mapping of str to float, optional
        Start values by name; the others come from the declarations and a scan of the stiffness.
    bench : Bench, optional
        Simulators to use as they are. Made here otherwise, with a step that keeps the trajectory error below
        `tolerance` and the solver's shift of every estimate below `SHIFT`.
    units : NaturalUnits, optional
        Natural units; from the recordings otherwise.
    gaussian : mapping, optional
        Parameters to free within the rig's uncertainty, see `rig_uncertainty`.
    tolerance : float
        Trajectory error, see `discovery.estimation.step.choose_step`.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        For recordings of another system, a name that the model lacks, or a value out of range.
    SimulationFailure
        If the model blows up at every start.
    ComputationError
        If no step reaches the tolerance.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> fit_model(declared_model(data), data).status
    'Converged.'
    """
    experiments = fitted_recordings(model, experiments)
    values, gaussian = check_start(model, experiments, start), given_uncertainty(model, gaussian)
    check_number(tolerance, "tolerance", above=0.0)
    units = units or natural_units(experiments)
    if (stiffness := restoring(model)) is not None and stiffness not in values:
        values = scan(model, experiments, units, values)
    own_step = bench is None
    if own_step and not values and any(model.parameters[n].physical for n in model.free):
        values = start_of_system(model, experiments, units, gaussian)
    if bench is None:
        bench = Bench(model.base, model.effects, experiments, choose_step(model, experiments, units, values, tolerance))
    problem = Problem(model, bench, units, {n: g for n, g in gaussian.items() if n in model.parameters})
    if problem.gaussian:
        values = staged_start(problem, values)
    (minimum,) = fit_problems([problem], [problem.start(values)])
    if own_step and not values and not np.isfinite(minimum.cost) and (told := pushed(model, experiments, units)):
        return fit(model, experiments, start=told, units=units, gaussian=gaussian, tolerance=tolerance)
    found = _at(problem, minimum)
    return refined(found) if own_step else found


def fit_near(problem: Problem, values: Mapping[str, float]) -> Fit:
    """Return the fit next to a start that is a good one already: quicker than `fit`, which searches.

    Raises SimulationFailure if the model blows up there.
    """
    (minimum,) = fit_problems([problem], [problem.start(values)], iterations=25, tolerance=1e-6, rough=True)
    return _at(problem, minimum)


def _at(problem: Problem, minimum: Minimum) -> Fit:
    """Return the fit that ended in a minimum; raise SimulationFailure if there is none, as the model blew up."""
    if not np.isfinite(minimum.cost):
        bench = problem.bench
        parameters, initial = problem.expand(minimum.x[:, None])
        for e, channels in zip(bench.experiments, bench.predict(parameters, initial), strict=True):
            check_finite(channels, e.recording.time, bench.names, parameters)
        named = dict(zip(bench.names, parameters[:, 0].tolist(), strict=True))
        end = bench.experiments[0].recording.time[-1]
        raise SimulationFailure(named, end, "the motion was a hundred times larger than what was measured.")
    covariance, reasons, directions = covariance_of(problem, minimum)
    return Fit(problem, minimum, covariance, reasons, directions, solver_shift(problem, minimum, covariance))


def refined(found: Fit) -> Fit:
    """Return a fit on steps so fine that the solver shifts no estimate by more than `SHIFT` standard deviations.

    Each round refits from the minimum of the last one. Where finer steps do not help, as for dry friction, or would be
    too many, the best round is returned; its `solver_shift` and `status` tell.
    """
    best = found
    for _ in range(_REFINEMENTS):
        shift, old = best.solver_shift, best.problem
        if (finer := tightened(old.bench, shift, SHIFT)) is None:
            break
        problem = replace(old, bench=finer)
        (minimum,) = fit_problems([problem], [best.minimum.x], iterations=_NEAR)
        if not np.isfinite(minimum.cost):
            break
        found = _at(problem, minimum)
        best = min(best, found, key=lambda f: f.solver_shift)
        if not found.solver_shift < 0.5 * shift:
            break
    return best
