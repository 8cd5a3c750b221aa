"""Motion of the arm with its coupling torque, under a prescribed motor or as it was fitted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, pairwise
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.paper.theory.coupling import Arm, effective_inertia
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError, SimulationFailure
from discovery.simulation.grid import DriveLike

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit
    from discovery.export import FittedModel
    from discovery.recordings.experiment import Experiment

_TOLERANCE = 1e-9
#: States beyond this size, or so many evaluations within one stretch, count as blown up.
_LIMIT, _EVALUATIONS = 1e9, 1_000_000


@dataclass(frozen=True)
class ArmMotion:
    """A motion of the arm under a prescribed motor at k times [s]: angles of the motor and, polar, of the tip [rad].

    x and y [m] are the position of the tip, `coupling_torque` is Gamma_c of eq. (10) [N m], and `states` (n, k) are
    coordinates, rates and memory of the model.
    """

    time: FloatArray
    theta_m: FloatArray
    theta_t: FloatArray
    x: FloatArray
    y: FloatArray
    coupling_torque: FloatArray
    states: FloatArray


def integrate(
    slopes: Callable[[float, FloatArray, bool], FloatArray], start: FloatArray, time: FloatArray, kinks: FloatArray
) -> FloatArray:
    """Integrate with LSODA, restarted at every kink [s], and return the states (n, k) at increasing times (k,) [s].

    `slopes` is a function of time, state and whether the limit from the left is meant (at the end of a stretch).

    Raises SimulationFailure if the motion blows up or the integrator gives up.
    """
    from scipy.integrate import solve_ivp

    states = np.empty((start.size, time.size))
    states[:, 0] = state = start
    inner = kinks[(kinks > time[0]) & (kinks < time[-1])]
    for begin, end in pairwise(np.unique([time[0], *inner, time[-1]])):
        inside = (time > begin) & (time <= end)
        left = count(_EVALUATIONS, -1)

        def checked(t: float, y: FloatArray, stop: float = end, left: Iterator[int] = left) -> FloatArray:
            if not np.all(np.abs(y) < _LIMIT) or not next(left):
                raise SimulationFailure({}, t, "the motion is not finite any more, or too fast to follow.")
            return slopes(t, y, t >= stop)

        path = solve_ivp(
            checked,
            (begin, end),
            state,
            "LSODA",
            t_eval=np.unique([*time[inside], end]),
            rtol=_TOLERANCE,
            atol=0.1 * _TOLERANCE,
        )
        if not path.success:
            raise SimulationFailure({}, float(path.t[-1]) if path.t.size else float(begin), str(path.message))
        states[:, inside] = path.y[:, : int(inside.sum())]
        state = path.y[:, -1]
    return states


def check_start(drive: DriveLike, time: FloatArray, deflection: float, rate: float) -> FloatArray:
    """Return the times as an array, once all can be used: a drive, finite increasing times, a finite initial state."""
    if drive is None:
        raise InputError("An arm moves with its hub: pass a drive, for a hub at rest one that is constant.")
    if not (hasattr(drive, "evaluate") and hasattr(drive, "kinks")):
        raise InputError(
            f"A drive is a function of time with its kinks; got {type(drive).__name__}. Make one from samples: by "
            "`discovery.recordings.smooth_input.smooth_motion(time, angle, noise)` from an encoder's readings, by "
            "`discovery.recordings.drive.spline_drive(time, angle)` from exact ones."
        )
    t = np.asarray(time, np.float64)
    if t.ndim != 1 or t.size < 2 or not np.isfinite(t).all() or not np.all(np.diff(t) > 0.0):
        raise InputError("A motion needs at least two finite times in increasing order; sort them, without repeats.")
    if not np.isfinite([deflection, rate]).all():
        raise InputError(
            f"A motion needs a finite initial deflection and rate, not {deflection:g} rad and {rate:g} rad/s."
        )
    return t


def move_arm(arm: Arm, drive: DriveLike, time: FloatArray, *, deflection: float = 0.0, rate: float = 0.0) -> ArmMotion:
    """Simulate the arm under a prescribed motion of its motor, with the coupling torque Gamma_c of (10), (11).

    Times (k,) increase [s]; deflection [rad] and rate [rad/s] are those at the first.

    Raises InputError if there is no drive, or times or initial state cannot be used. Raises SimulationFailure if the
    motion blows up.
    """
    time = check_start(drive, time, deflection, rate)
    size = len(arm.program.states)

    def slopes(t: float, state: FloatArray, left: bool) -> FloatArray:
        motor = drive.evaluate(t, side="left" if left else "right")[:, 0]
        return np.array(arm.rows(t, motor.tolist(), state.tolist())[:size], float)

    motor = drive.evaluate(time)
    states = integrate(slopes, arm.start(deflection, rate, motor[:2, 0]), time, np.asarray(drive.kinks, float))
    rows = [np.broadcast_to(np.asarray(row, float), time.shape) for row in arm.rows(time, motor, states)[size:]]
    return ArmMotion(
        time, motor[0], theta_t=rows[1], x=rows[2], y=rows[3], coupling_torque=arm.inertia * rows[0], states=states
    )


def fitted_coupling(
    fitted: Fit | FittedModel, experiments: Sequence[Experiment] | None = None, *, inertia: float | None = None
) -> list[ArmMotion]:
    """Return the motion of a fitted model with its coupling torque (10), on each recording.

    Parameters
    ----------
    fitted : Fit or FittedModel
        A fit on recordings of an arm, or its model as a finished run or `from_json` gives it.
    experiments : sequence of Experiment, optional
        Recordings; those of the fit otherwise, which a FittedModel does not hold. One that was not fitted, by its name,
        starts with the deflection and rate that its own first samples have.
    inertia : float, optional
        m_eff l^2 [kg m^2]; that of the rig file otherwise.

    Raises
    ------
    InputError
        For an oscillator, without recordings, if the masses are not known, or for what is no fitted model.
    """
    from discovery.estimation.fit import Fit

    values: Mapping[str, float]
    if isinstance(fitted, Fit):
        # All numbers as the fit used them: defaults of what it held are declared in natural units.
        bench = fitted.problem.bench
        parameters, states = fitted.problem.expand(fitted.minimum.x[:, None])
        values = dict(zip(bench.names, parameters[:, 0].tolist(), strict=True))
        initial = {
            e.recording.name: tuple(start[:2, 0].tolist()) for e, start in zip(bench.experiments, states, strict=True)
        }
        experiments = bench.experiments if experiments is None else experiments
    elif hasattr(fitted, "values") and hasattr(fitted, "initial"):
        values, initial = fitted.values, dict(fitted.initial)
    else:
        raise InputError(
            f"The torque is that of a Fit or a FittedModel, not of a {type(fitted).__name__}; take what `fit_model`, "
            "`from_json` or `discovery.export.read_fitted` returns."
        )
    if not experiments:
        raise InputError("A model moves on recordings; pass experiments, as `load_dataset(rig_path, files).train`.")
    motions = []
    for experiment in experiments:
        if experiment.drive is None:
            raise InputError(f"The recording {experiment.recording.name} has no motor.")
        arm = Arm(fitted.model, values, effective_inertia(experiment.rig) if inertia is None else inertia)
        deflection, rate = initial.get(experiment.recording.name) or experiment.initial_guess
        motions.append(move_arm(arm, experiment.drive, experiment.recording.time, deflection=deflection, rate=rate))
    return motions
