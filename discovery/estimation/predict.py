"""Free-run predictions: from the static equilibrium or from fitted initial states, with standard deviations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from scipy.optimize import brentq, root

from discovery.declarations import symbols as s
from discovery.declarations.effect import Load
from discovery.equations.model import Model
from discovery.equations.program import Program, build_program
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import principal_spread
from discovery.estimation.fit import Fit
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.step import choose_step
from discovery.foundation.arguments import check_pair, expect
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.recordings.chosen import check_one_system
from discovery.recordings.experiment import Experiment
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import check_finite

#: Standard deviations by which parameters are moved, to both sides, and the least where motions blow up.
_APART, _NEAR = 0.5, 1e-3

_NO_REST = "The model has no rest position in its range; give --initial-state POSITION,RATE."


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
        Deflection and rate at the first time; by default the static equilibrium at rest, under a force in time only if
        training began so. Where the motion is prescribed there is none.

    Returns
    -------
    ndarray, shape (n, c), and ndarray, shape (n, c)
        Channels and standard deviations (measurement noise not included).

    Raises
    ------
    InputError
        For a recording of another system, or an initial state that is no pair of numbers.
    ComputationError
        If the model has no rest position to start from, or its motion blows up.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> fit = fit_model(declared_model(data), data)
    >>> output, sd = predict_motion(fit, data.holdout[0], initial=(0.01, 0.0))  # from 10 mm at rest
    >>> output.shape, sd.shape, round(float(output[0, 0]), 3)
    ((800, 1), (800, 1), 0.01)
    """
    expect(fit, Fit, "fit", "Make one with fit_model(model, dataset).")
    expect(experiment, Experiment, "experiment", "Take one of dataset.train or dataset.holdout.")
    if initial is not None:
        initial = check_pair(initial, "initial", "the deflection and the rate at the first time")
    problem = fit.problem
    check_one_system([experiment], like=problem.bench.experiments[0])
    names = problem.free
    # The step is chosen for this manoeuvre: it may be far quicker than the fitted ones.
    still = dict.fromkeys(experiment.initial_names, 0.0)
    values = {**fit.own_values, **still}
    step = choose_step(fit.model, [experiment], problem.units, values, effects=problem.bench.effects)
    bench = Bench(problem.bench.base, problem.bench.effects, [experiment], step)
    begin = experiment.recording.time[:1]
    drive = [0.0] if experiment.drive is None else experiment.drive.evaluate(begin)[:, 0].tolist()
    single = Problem(fit.model, bench, problem.units, problem.gaussian)
    centre = fit.minimum.x[: len(names)]
    # Central differences along each principal axis of the covariance.
    spread = principal_spread(fit.covariance[: len(names), : len(names)])
    low, high = single.bounds

    def read(part: float) -> FloatArray:
        moved = np.concatenate([np.zeros((len(names), 1)), part * spread, -part * spread], axis=1)
        points = np.clip(centre[:, None] + moved, low[: len(names), None], high[: len(names), None])
        state = _start_of(fit, experiment, points, drive, initial)[: len(single.states)]
        parameters, starts = single.expand(np.concatenate([points, state]))
        channels = bench.predict(parameters, starts)[0]
        check_finite(channels[:, :, :1], experiment.recording.time, bench.names, parameters)
        return channels

    m, part = len(names), _APART
    # Far from the estimate the motion may blow up: a rod without any damping rings on.
    while not np.isfinite(channels := read(part)).all() and part > _NEAR:
        part /= 4
    slope = (channels[:, :, 1 : m + 1] - channels[:, :, m + 1 :]) / (2 * part)
    return channels[:, :, 0], np.sqrt(np.sum(slope**2, axis=2))


def _start_of(
    fit: Fit,
    experiment: Experiment,
    points: FloatArray,
    drive: Sequence[float],
    initial: tuple[float, float] | None,
) -> FloatArray:
    """Return deflection and rate (2, k) at the first time: given, or at rest; a prescribed motion does not ask."""
    if initial is not None or fit.model.mechanics.prescribed:
        return np.repeat(np.array(initial or (0.0, 0.0))[:, None], points.shape[1], axis=1)
    # The rest position moves little with the parameters: its derivative is taken along with theirs.
    names, units = fit.problem.free, fit.problem.units
    time = float(experiment.recording.time[0]) if _began_under_force(fit) else None
    rest = [equilibrium(fit.model, dict(zip(names, p, strict=True)), units, drive, time) for p in points.T]
    return np.array([rest, np.zeros(len(rest))])


def _began_under_force(fit: Fit) -> bool:
    """Return whether the first training recording began nearer to where its forces in time hold the system then."""
    first = fit.problem.bench.experiments[0]
    if not moving(fit.model) or first.drive is None:
        return True
    time, begun = first.recording.time[:1], float(fit.initial_states()["deflection"].iloc[0])
    drive = first.drive.evaluate(time)[:, 0].tolist()
    held, free = (equilibrium(fit.model, fit.values, fit.problem.units, drive, t) for t in (float(time[0]), None))
    return abs(begun - held) <= abs(begun - free)


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
    coordinates are zero, as does a body that nothing pulls back: they have no place where they rest.

    `values`: its parameters; missing ones are absent. `drive`: input at rest: motor angle [rad], or u. `time`: forces
    that depend on time are held as they are then [s]; by default they are left out. Raises ComputationError if there is
    no rest position within the range of the model.
    """
    if model.mechanics.places():
        return 0.0
    rest = _Rest.of(model, _held(model, values, units, time), drive, 0.0 if time is None else time)
    arm, n = model.mechanics.system.has_rod, rest.program.n_coordinates
    reach = np.linspace(0, 1.2 if arm else 5 * units.coordinate, 121)
    grid = np.concatenate([-reach[:0:-1], reach])
    force = np.array([rest.push(d) for d in grid])
    crossing = np.flatnonzero((force[:-1] >= 0) & (force[1:] < 0))
    if n == 1 and np.ptp(force) <= 1e-12 * np.abs(force).max():
        return 0.0
    if crossing.size == 0:
        # A root that turns with its load has memory: the rod and its root settle together.
        q = rest.settled(units.time)
        found = float(q[0]) - (drive[0] if arm else 0.0) if n == 1 else rest.angle(q)
        is_rest = True
    else:
        nearest = crossing[np.argmin(np.abs(grid[crossing]))]
        near = float(brentq(rest.push, grid[nearest], grid[nearest + 1], xtol=1e-12))
        if n == 1:
            return near
        # A force that no slow motion follows may hide where the rod rests near its straight shape.
        tried = [rest.beside(each) for each in (near, 0.0)]
        found, is_rest = min(tried, key=lambda each: (not each[1], abs(each[0])))
    if not is_rest or abs(found) > reach[-1]:
        raise ComputationError(_NO_REST)
    return found


def moving(model: Model) -> set[str]:
    """Return the names of the amplitudes of forces that depend on time."""
    loads = (e for e in model.terms if isinstance(e, Load))
    in_time = (e for e in loads if any(symbol.name == "t" for symbol in e.expression().free_symbols))
    return {p.name for e in in_time for p in e.parameters() if not p.shape}


def _held(model: Model, values: Mapping[str, float], units: NaturalUnits, time: float | None) -> dict[str, float]:
    """Return the values of all parameters, without the forces that depend on time unless it is given."""
    given = {**model.known, **values, **(dict.fromkeys(moving(model), 0.0) if time is None else {})}
    return {**{n: p.default * units.scale(p) for n, p in model.parameters.items() if n not in given}, **given}


@dataclass(frozen=True)
class _Rest:
    """A model under a constant input: what accelerates it where it does not move."""

    model: Model
    program: Program
    slopes: Callable[[FloatArray], FloatArray]
    output: Callable[[FloatArray], list[float]]
    start: tuple[float, float]
    form: tuple

    @classmethod
    def of(cls, model: Model, values: Mapping[str, float], drive: Sequence[float], time: float) -> _Rest:
        program, derivative, output = _statics(model.base, model.effects)
        parameters = [values[name] for name in program.parameters]
        recorded = (drive[0], 0.0, 0.0)
        return cls(
            model,
            program,
            slopes=lambda state: np.array(derivative(time, recorded, state, parameters), float),
            output=lambda q: output(*q, 0.0, *parameters),
            start=model.mechanics.system.still(drive[0]),
            form=program.form(parameters),
        )

    def coordinates(self, deflection: float, rate: float) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates of a slow motion through a deflection, and their rates."""
        q, tangent = self.model.mechanics.initial_coordinates(
            np.array([deflection]), np.array([rate]), self.start, self.form
        )
        return q[:, 0], tangent[:, 0]

    def acceleration(self, q: FloatArray) -> FloatArray:
        n = self.program.n_coordinates
        return self.slopes(np.concatenate([q, np.zeros(len(self.program.states) - n)]))[n : 2 * n]

    def push(self, deflection: float) -> float:
        """Return where a slow motion through this deflection is accelerated to."""
        q, tangent = self.coordinates(deflection, 1.0)
        return float(self.acceleration(q) @ tangent)

    def angle(self, q: FloatArray) -> float:
        tip = self.output(q)
        return float(np.arctan2(tip[1], tip[0]))

    def settled(self, time: float) -> FloatArray:
        """Return the coordinates in which the straight rod comes to rest, slowed down by a strong extra friction.

        Raises ComputationError if it does not come to rest.
        """
        from scipy.integrate import solve_ivp

        q, _ = self.coordinates(0.0, 0.0)
        n = q.size

        def slowed(_: float, state: FloatArray) -> FloatArray:
            change = self.slopes(state)
            change[n : 2 * n] -= 4.0 / time * state[n : 2 * n]
            return change

        first = np.concatenate([q, np.zeros(len(self.program.states) - n)])
        found = solve_ivp(slowed, (0.0, 60 * time), first, method="LSODA", rtol=1e-8, atol=1e-10)
        end = found.y[:, -1]
        if not (found.success and np.abs(slowed(0.0, end)[:n]).max() * time < 1e-5):
            raise ComputationError(_NO_REST)
        return end[:n]

    def beside(self, deflection: float) -> tuple[float, bool]:
        """Return the angle at which every coordinate rests, near a load at the tip alone, and whether it is found.

        The rod's own weight bends it otherwise than that load.
        """
        q, _ = self.coordinates(deflection, 0.0)

        # From zero on, for the solver's differences are relative to its unknowns.
        def around(away: FloatArray) -> FloatArray:
            return self.acceleration(q + away)

        found = root(around, np.zeros(q.size), options={"xtol": 1e-13})
        # Near its start it is one also where rounding keeps the solver from its last digits.
        return self.angle(q + found.x), bool(found.success or np.abs(found.x).max() < 0.1)
