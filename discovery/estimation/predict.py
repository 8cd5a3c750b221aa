"""Free-run predictions: from the static equilibrium or from fitted initial states, with standard deviations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import brentq, root

from discovery.declarations import symbols as s
from discovery.declarations.effect import ARM, Load
from discovery.equations.model import Model
from discovery.equations.program import Program, build_program
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import principal_spread
from discovery.estimation.fit import Fit
from discovery.estimation.problem import NaturalUnits, Problem
from discovery.estimation.starts import fitted_states
from discovery.estimation.step import choose_step
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import check_finite

__all__ = ["equilibrium", "held_out", "predict"]

FloatArray = NDArray[np.float64]
_NO_REST = "The model has no rest position in its range; give --initial-state ANGLE,RATE."
_FREE = "No force of the model depends on the position: it rests {}; give --initial-state POSITION,RATE."


@lru_cache(maxsize=64)
def _statics(base: str, effects: tuple[str, ...]) -> tuple[Program, Callable[..., list], Callable[..., list]]:
    """Return a model's program, its slopes, and the true output for coordinates, motor angle and parameters."""
    program = build_program(base, effects)
    output = Model(base, effects).mechanics.reading(None, program.rod)
    parameters = [sp.Symbol(p, real=True) for p in program.parameters]
    known = [*program.states[: program.n_coordinates], s.theta_m, *parameters]
    return program, numpy_derivative(program), sp.lambdify(known, list(output))


def equilibrium(
    model: Model, values: Mapping[str, float], units: NaturalUnits, drive: Sequence[float], time: float | None = None
) -> float:
    """Return the deflection at which the model rests under a constant input.

    Of several rest positions the one nearest to zero is returned. A declared system begins at rest where its
    coordinates are zero: many have no place where they rest.

    Parameters
    ----------
    model : Model
        The model.
    values : mapping of str to float
        Its parameters; missing ones are absent.
    units : NaturalUnits
        Natural units.
    drive : sequence of float
        Input at rest: motor angle [rad], or u.
    time : float, optional
        Forces that depend on time are held as they are then [s]; by default they are left out.

    Raises
    ------
    ComputationError
        If there is no rest position within the range of the model, or no restoring force at all.
    """
    if model.mechanics.places():
        return 0.0
    program, derivative, output = _statics(model.base, model.effects)
    moving = {
        p.name
        for effect in model.terms
        if isinstance(effect, Load) and any(symbol.name == "t" for symbol in effect.expression().free_symbols)
        for p in effect.parameters()
        if not p.shape
    }
    known = {**model.known, **values, **(dict.fromkeys(moving, 0.0) if time is None else {})}
    when = 0.0 if time is None else time
    parameters = [
        known.get(n, model.parameters[n].default * units.scale(model.parameters[n])) for n in program.parameters
    ]
    recorded = (drive[0], 0.0, 0.0)
    n = program.n_coordinates
    start = (drive[0], 0.0) if model.mechanics.system == ARM else (0.0, 0.0)
    form = program.form(parameters)

    def acceleration(q: FloatArray) -> FloatArray:
        state = [*q, *np.zeros(len(program.states) - n)]
        return np.array(derivative(when, recorded, state, parameters)[n : 2 * n], float)

    def push(deflection: float) -> float:
        q, tangent = model.mechanics.initial_coordinates(np.array([deflection]), np.array([1.0]), start, form)
        # Where a slow motion through this deflection is accelerated to.
        return float(acceleration(q[:, 0]) @ tangent[:, 0])

    reach = np.linspace(0, 1.2 if model.mechanics.system == ARM else 5 * units.coordinate, 121)
    grid = np.concatenate([-reach[:0:-1], reach])
    force = np.array([push(d) for d in grid])
    crossing = np.flatnonzero((force[:-1] >= 0) & (force[1:] < 0))
    if n == 1 and np.ptp(force) <= 1e-12 * np.abs(force).max():
        raise ComputationError(_FREE.format("nowhere" if force.any() else "anywhere"))
    if crossing.size == 0:
        # A root that turns with its load has memory: the rod and its root settle together.
        straight, _ = model.mechanics.initial_coordinates(np.zeros(1), np.zeros(1), start, form)
        first = np.concatenate([straight[:, 0], np.zeros(len(program.states) - n)])
        q = _settled(lambda state: np.array(derivative(when, recorded, state, parameters), float), first, n, units.time)
        rest = float(q[0]) - (drive[0] if n == 1 and model.mechanics.system == ARM else 0.0)
        rest = rest if n == 1 else _angle(output(*q, 0.0, *parameters))
        if abs(rest) > reach[-1]:
            raise ComputationError(_NO_REST)
        return rest
    nearest = crossing[np.argmin(np.abs(grid[crossing]))]
    near = float(brentq(push, grid[nearest], grid[nearest + 1], xtol=1e-12))
    if n == 1:
        return near
    # The rod's own weight bends it otherwise than a load at its tip: every coordinate must rest.
    q, _ = model.mechanics.initial_coordinates(np.array([near]), np.array([0.0]), start, form)

    def beside(away: FloatArray) -> FloatArray:
        return acceleration(q[:, 0] + away)

    # From zero on, for the solver's differences are relative to its unknowns.
    found = root(beside, np.zeros(n), options={"xtol": 1e-13})
    rest = _angle(output(*(q[:, 0] + found.x), 0.0, *parameters))
    # Near its start it is one also where rounding keeps the solver from its last digits.
    near_start = np.abs(found.x).max() < 0.1
    if not (found.success or near_start) or abs(rest) > reach[-1]:
        raise ComputationError(_NO_REST)
    return rest


def _angle(tip: Sequence[float]) -> float:
    return float(np.arctan2(tip[1], tip[0]))


def _settled(slopes: Callable[[FloatArray], FloatArray], first: FloatArray, n: int, time: float) -> FloatArray:
    """Return the coordinates in which a model comes to rest, its motion slowed down by a strong extra friction.

    Raises
    ------
    ComputationError
        If it does not come to rest.
    """
    from scipy.integrate import solve_ivp

    def slowed(_: float, state: FloatArray) -> FloatArray:
        change = slopes(state)
        change[n : 2 * n] -= 4.0 / time * state[n : 2 * n]
        return change

    found = solve_ivp(slowed, (0.0, 60 * time), first, method="LSODA", rtol=1e-8, atol=1e-10)
    end = found.y[:, -1]
    still = found.success and np.abs(slowed(0.0, end)[:n]).max() * time < 1e-5
    if not still:
        raise ComputationError(_NO_REST)
    return end[:n]


def predict(
    fit: Fit, experiment: Experiment, initial: tuple[float, float] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return what the instrument would read, and its standard deviation from the fit's covariance.

    Parameters
    ----------
    fit : Fit
        The fitted model.
    experiment : Experiment
        Times and input.
    initial : tuple of float, optional
        Deflection and rate at the first time; by default the static equilibrium at rest. Where the motion is prescribed
        there is none.

    Returns
    -------
    ndarray, shape (n, c), and ndarray, shape (n, c)
        Channels and standard deviations (measurement noise not included).
    """
    problem = fit.problem
    names = problem.free
    # The step is chosen for this manoeuvre: it may be far quicker than the fitted ones.
    still = {f"{n}[{experiment.recording.name}]": 0.0 for n in ("delta_0_init", "rate_0_init")}
    values = {**{n: v for n, v in fit.values.items() if "[" not in n}, **still}
    step = choose_step(fit.model, [experiment], problem.units, values, effects=problem.bench.effects)
    bench = Bench(problem.bench.base, problem.bench.effects, [experiment], step)
    drive = (
        [0.0] if experiment.drive is None else experiment.drive.evaluate(experiment.recording.time[:1])[:, 0].tolist()
    )
    single = Problem(fit.model, bench, problem.units, problem.gaussian)
    centre = fit.minimum.x[: len(names)]
    # Central differences along each principal axis of the covariance.
    spread = principal_spread(fit.covariance[: len(names), : len(names)])
    low, high = single.bounds
    points = np.concatenate([centre[:, None], centre[:, None] + 0.5 * spread, centre[:, None] - 0.5 * spread], axis=1)
    points = np.clip(points, low[: len(names), None], high[: len(names), None])
    if fit.model.mechanics.prescribed:
        state = np.empty((0, points.shape[1]))
    elif initial is None:
        # The rest position moves little with the parameters: its derivative is taken along with theirs.
        first = float(experiment.recording.time[0])
        rest = [equilibrium(fit.model, dict(zip(names, p, strict=True)), problem.units, drive, first) for p in points.T]
        state = np.array([rest, np.zeros(len(rest))])
    else:
        state = np.repeat(np.array(initial)[:, None], points.shape[1], axis=1)
    parameters, starts = single.expand(np.concatenate([points, state]))
    channels = bench.predict(parameters, starts)[0]
    check_finite(channels, experiment.recording.time, bench.names, parameters)
    m = len(names)
    slope = channels[:, :, 1 : m + 1] - channels[:, :, m + 1 :]
    return channels[:, :, 0], np.sqrt(np.sum(slope**2, axis=2))


def held_out(
    candidates: Sequence[tuple[Model, Mapping[str, float]]],
    experiments: Sequence[Experiment],
    bench: Bench,
    units: NaturalUnits,
) -> list[list[FloatArray]]:
    """Return predictions of recordings that were not fitted: parameters held, only the initial state is fitted.

    Parameters
    ----------
    candidates : sequence of (Model, values)
        Fitted models on the bench's base.
    experiments : sequence of Experiment
        The bench's recordings.
    bench : Bench
        Simulators of these recordings.
    units : NaturalUnits
        Natural units.

    Returns
    -------
    list of list of ndarray, shape (n, c)
        For each candidate, its prediction of each recording.
    """
    problems = []
    for model, values in candidates:
        known = {**model.known, **{n: v for n, v in values.items() if n in model.parameters}}
        problems.append(Problem(Model(model.base, model.effects, known), bench, units, {}))
    starts = fitted_states(problems)
    vectors = [p.expand(x[:, None]) for p, x in zip(problems, starts, strict=True)]
    parameters = np.concatenate([v[0] for v in vectors], axis=1)
    initial = np.concatenate([v[1] for v in vectors], axis=2)
    channels = bench.predict(parameters, initial)
    return [[c[:, :, i] for c in channels] for i in range(len(candidates))]
