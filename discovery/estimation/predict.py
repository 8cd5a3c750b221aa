"""Free-run predictions: from the static equilibrium or from fitted initial states, with standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discovery.declarations.effect import Sensor
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import principal_spread
from discovery.estimation.equilibrium import equilibrium, moving
from discovery.estimation.fit import Fit
from discovery.estimation.problem import Problem
from discovery.estimation.step import choose_step
from discovery.foundation.arguments import check_pair, expect
from discovery.foundation.arrays import FloatArray
from discovery.recordings.chosen import check_one_system
from discovery.recordings.experiment import Experiment
from discovery.simulation.simulate import check_finite

#: Standard deviations by which parameters are moved, to both sides, and the least where motions blow up.
_APART, _NEAR = 0.5, 1e-3
#: Rounds in which the state is sought that is read so, and the part of a motion over which a reading is differenced.
_ROUNDS, _LITTLE = 6, 1e-4


def predict(
    fit: Fit, experiment: Experiment, initial: tuple[float, float] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return what the instrument would read, and its standard deviation from the fit's covariance.

    What a recording has of its own, as a force, is that of the first one that was fitted; by how much the others differ
    is a part of the standard deviation.

    Parameters
    ----------
    fit : Fit
        The fitted model.
    experiment : Experiment
        Times and input.
    initial : tuple of float, optional
        Deflection and rate at the first time, of a system without a rod as the instrument reads them; by default the
        static equilibrium at rest, under a force in time only if training began so. Where the motion is prescribed
        there is none.

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
    single = Problem(fit.model, bench, problem.units, problem.gaussian, reference="")
    starts, centre = fit.model.mechanics.starts, fit.minimum.x[: len(names)]
    # Central differences along each principal axis of the covariance; then what the other recordings have of their own.
    spread = principal_spread(fit.covariance[: len(names), : len(names)])
    low, high = (bound[: len(names), None] for bound in single.bounds)
    others = _others(fit, single)
    m, part = len(names), _APART

    def read(part: float) -> FloatArray:
        moved = np.concatenate(
            [np.zeros((m, 1)), part * spread, -part * spread, np.zeros((m, others.shape[1]))], axis=1
        )
        points = np.clip(centre[:, None] + moved, low, high)
        # Coordinates that are not read begin where springs hold them beside the one that is, at rest.
        state = np.concatenate([np.zeros((len(single.states), 1 + 2 * m)), others], axis=1) + arrived(single)
        state[:starts] = _start_of(fit, experiment, points, drive, initial)[:starts]
        if initial is not None:
            state = _as_read(single, points, state)
        parameters, begins = single.expand(np.concatenate([points, state]))
        channels = bench.predict(parameters, begins)[0]
        check_finite(channels[:, :, :1], experiment.recording.time, bench.names, parameters)
        return channels

    # Far from the estimate the motion may blow up: a rod without any damping rings on.
    while not np.isfinite((channels := read(part))[:, :, : 1 + 2 * m]).all() and part > _NEAR:
        part /= 4
    slope = (channels[:, :, 1 : m + 1] - channels[:, :, m + 1 : 2 * m + 1]) / (2 * part)
    apart = channels[:, :, 2 * m + 1 :] - channels[:, :, :1]
    return channels[:, :, 0], np.sqrt(np.sum(slope**2, axis=2) + np.sum(apart**2, axis=2) / max(others.shape[1], 1))


def _others(fit: Fit, single: Problem) -> FloatArray:
    """Return what each other recording that was fitted has of its own beside the first one, (numbers of a start, k).

    None has, where no law of the model differs between recordings.
    """
    problem, bench = fit.problem, fit.problem.bench
    _, begun = problem.expand(fit.minimum.x[:, None])
    laws = [name not in fit.model.begins for name in bench.own]
    own = np.where([False, False, *laws], begun[:, :, 0], 0.0)
    kept = [bool(own.any()) and e.recording.name != problem.reference for e in bench.experiments]
    return own[kept][:, [state.row for state in single.states]].T


def arrived(problem: Problem) -> FloatArray:
    """Return what has arrived of an input that acted before, (numbers of all starts, 1): zero of all else."""
    begins = [n in problem.model.parameters and bool(problem.model.parameters[n].begins) for n in problem.bench.own]
    return np.array([s.guess if s.row > 1 and begins[s.row - 2] else 0.0 for s in problem.states], float)[:, None]


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


def _as_read(single: Problem, points: FloatArray, read: FloatArray) -> FloatArray:
    """Return the state (s, k) in which the instrument reads a deflection and a rate, by Newton's method."""
    (experiment,), bench = single.bench.experiments, single.bench
    told = any(isinstance(e, Sensor) for e in single.model.terms) and single.model.mechanics.reads_state
    if experiment.system.has_rod or not told or not len(read):
        return read
    begun = Bench(bench.base, bench.effects, [replace(experiment, fitted_samples=2)], bench.step)

    def reading(state: FloatArray) -> FloatArray:
        return begun.predict(*single.expand(np.concatenate([points, state])))[0][0, 0]

    state, little = read.copy(), np.zeros_like(read)
    little[0] = _LITTLE * single.units.read
    for _ in range(_ROUNDS):
        found = reading(state)
        slope = (reading(state + little) - found) / little[0]
        state[0] += (read[0] - found) / slope
    rate = slice(1, single.model.mechanics.starts)
    state[rate] = read[rate] / slope
    return state


def _began_under_force(fit: Fit) -> bool:
    """Return whether the first training recording began nearer to where its forces in time hold the system then."""
    first = fit.problem.bench.experiments[0]
    if not moving(fit.model) or first.drive is None:
        return True
    time, begun = first.recording.time[:1], float(fit.initial_states()["deflection"].iloc[0])
    drive = first.drive.evaluate(time)[:, 0].tolist()
    held, free = (equilibrium(fit.model, fit.values, fit.problem.units, drive, t) for t in (float(time[0]), None))
    return abs(begun - held) <= abs(begun - free)
