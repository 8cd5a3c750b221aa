"""Simulation of the general dynamic model, equations (7) to (9) of the paper, on a given motion of the hub."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.massless_arm.model import GeneralModel, GeneralMotion
from benchmarks.paper.theory.massless_arm.potential import DEFLECTION_LIMIT, RADIAL_LIMITS, tip_potential
from benchmarks.paper.theory.massless_arm.radau import STAGES, integrate_tip
from discovery.foundation.errors import InputError, SimulationFailure
from discovery.simulation.grid import DriveLike, Grid

FloatArray = npt.NDArray[np.float64]

_ITERATIONS = 20  # each gains two digits


def simulate_general(
    model: GeneralModel,
    drive: DriveLike | None,
    time: FloatArray,
    *,
    deflection: float = 0.0,
    rate: float = 0.0,
    step: float = 0.01,
    retardation: float = 0.01,
) -> GeneralMotion:
    """Simulate the arm by equations (7), (8) of the paper, started without radial ringing.

    Parameters
    ----------
    model : GeneralModel
        The arm.
    drive : DriveLike or None
        Hub angle [rad]; steps end at its kinks. None holds it at 0.
    time : ndarray, shape (n,)
        Times of the output [s], increasing.
    deflection, rate : float
        ``theta_t - theta_m`` [rad] and ``theta_t'`` [rad/s] at the first time.
    step : float
        Longest step [T]. With the default the tip is converged to 1 um over 25 s of every motion in the table below.
    retardation : float
        Retardation time ``tau_r`` of the straight rod under radial load [T], see `massless_arm.radau`.

    Returns
    -------
    GeneralMotion
        At the given times.

    Raises
    ------
    InputError
        If times, drive, step, retardation or the initial deflection and rate cannot be used.
    SimulationFailure
        If the tip leaves the deflections and radial forces that `massless_arm.potential` covers.

    Notes
    -----
    What `retardation` does to the paper's arm over 25 s. The hub moves 1 rad with a trapezoidal speed whose ramps take
    12 % of the time each (its acceleration jumps), or smoothly (minimum jerk). Least is the retardation below which the
    radial force leaves its domain, shift the largest one of the tip between 0.01 and 0.02.

    =============  ================  =================  =================
    speed [rad/s]  deflection [rad]  least retardation  shift of tip [mm]
    =============  ================  =================  =================
    1.0            0.66              0                  0.04
    1.25           0.77              0.001              0.06
    1.4            0.81              0.001              0.07
    1.6            0.85              0.002              0.16
    1.8            0.87              0.006              0.5
    2.2            0.90              0.01               2.4
    1.0, smooth    0.84              0.0002             0.09
    =============  ================  =================  =================

    At 1 rad/s, and in smooth motion, the shift is proportional to the retardation. Harder ramps excite radial ringing,
    of which the model without retardation has ever more near the straight arm: there is no limit then, and the tip
    depends on the retardation by as much as the table says.
    """
    t = np.asarray(time, np.float64)
    _refuse(t, drive, deflection=deflection, rate=rate, step=step, retardation=retardation)
    unit = model.time_scale
    grid = Grid.build(t, drive, step * unit)
    stage_times = grid.times[:, None] + grid.steps[:, None] * STAGES
    hub = np.zeros(stage_times.shape) if drive is None else drive.evaluate(stage_times.ravel())[0].reshape(-1, 3)
    start = _start(deflection, rate * unit, grid.drive[0, 0] * unit ** np.arange(3), model.xi * unit)
    path = integrate_tip(hub, grid.steps / unit, start, model.xi * unit, retardation)
    if path.reached < grid.steps.size:
        raise SimulationFailure(
            {"EI": model.flexural_rigidity, "m": model.tip_mass, "l": model.length, "xi": model.xi},
            float(grid.times[path.reached]),
            "the tip leaves the deflections and radial forces that the elastica's potential covers; "
            "a longer retardation calms radial ringing.",
        )
    return _motion(model, t, grid.out_drive[:, 0], *path.at(grid.out_step, grid.out_fraction))


def _refuse(
    t: FloatArray, drive: DriveLike | None, *, deflection: float, rate: float, step: float, retardation: float
) -> None:
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0.0) or not np.isfinite(t).all():
        raise InputError("A simulation needs at least two finite times in increasing order.")
    if drive is not None and not (hasattr(drive, "evaluate") and hasattr(drive, "kinks")):
        raise InputError(
            f"A drive is a function of time with its kinks; got {type(drive).__name__}. Make one from samples: by "
            "`discovery.recordings.smooth_input.smooth_motion(time, angle, noise)` from an encoder's readings, by "
            "`discovery.recordings.drive.spline_drive(time, angle)` from exact ones."
        )
    usable = step > 0.0 and 0.0 <= retardation < np.inf and abs(deflection) <= DEFLECTION_LIMIT and np.isfinite(rate)
    if not usable:
        raise InputError(
            "A simulation of the general model needs a positive step, a retardation of at least 0, a deflection of at "
            f"most {DEFLECTION_LIMIT} rad and a finite rate; got {step:.6g} T, {retardation:.6g} T, {deflection:.6g} "
            f"rad and {rate:.6g} rad/s."
        )


def _motion(
    model: GeneralModel, t: FloatArray, theta_m: FloatArray, states: FloatArray, radial: FloatArray
) -> GeneralMotion:
    """Return a path in SI units."""
    theta, momentum, rho, rho_rate, load = states
    _, rho_d, _, moment, *_ = tip_potential().tip(theta - theta_m, load)
    length, force, unit = model.length, model.force_scale, model.time_scale
    return GeneralMotion(
        model=model,
        time=t,
        theta_m=theta_m,
        theta_t=theta,
        rho=rho * length,
        theta_rate=momentum / rho**2 / unit,
        rho_rate=rho_rate * length / unit,
        radial=radial * force,
        tangential=(moment - (radial - load) * rho_d) / rho * force,
        load=load * force,
    )


def _start(deflection: float, rate: float, hub: FloatArray, xi: float) -> FloatArray:
    """Return ``theta_t, L, rho, rho', G`` of a motion without ringing, normalised.

    Its radial load changes slowly: its rates are left out of the radial acceleration, which has the load as result.
    """
    load = 0.0
    for _ in range(_ITERATIONS):
        tip = tip_potential().tip(np.array([deflection]), np.array([load]))[:, 0]
        rho, rho_d, _, moment, _, rho_dd, _ = tip
        change = rate - hub[1]
        rho_rate = rho_d * change
        turning = -(moment / rho + 2.0 * rho_rate * rate) / rho - xi * rate
        load = rho * rate**2 - xi * rho_rate - rho_dd * change**2 - rho_d * (turning - hub[2])
        load = min(max(load, RADIAL_LIMITS[0]), RADIAL_LIMITS[1])
    return np.array([hub[0] + deflection, rho**2 * rate, rho, rho_rate, load])
