"""The twin: a geometrically exact flexible arm in motion, simulated to a stated error.

The equations of `arm` are integrated in time with LSODA (Petzold, SIAM J. Sci. Stat. Comput. 4, 1983), restarted at
every kink of the motor's acceleration. At the default modes, nodes and tolerance the tip of the paper's arm is
converged to better than 0.01 mm over 25 s, for deflections up to 1 rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import odeint

from discovery_datasets.arm import MODES, NODES, PAPER_RIG, Arm, ArmRig, ComplexArray, FloatArray, TwinError
from discovery_datasets.beam import solve_free
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.instrument import TwinMotion, record, write_csv
from discovery_datasets.manoeuvres import Manoeuvre

__all__ = ["PAPER_RIG", "ArmRig", "TwinError", "TwinMotion", "record", "simulate", "static_tip", "write_csv"]

TIME_DECIMALS = 12  # samples and kinks closer than this many decimals of a second are one instant


def static_tip(
    rig: ArmRig,
    *,
    base_angle: float = 0.0,
    tip_force: complex = 0j,
    disturbances: Sequence[Disturbance] = (),
    modes: int = MODES,
    nodes: int = NODES,
) -> complex:
    """Tip position ``x + 1j * y`` [m] of the arm at rest under a tip force [N] given the same way.

    Raises
    ------
    TwinError
        If no equilibrium is found.
    """
    arm = Arm.of(rig, disturbances, modes, nodes)
    q = arm.equilibrium(0.0, base_angle, tip_force)
    theta = arm.rest_angle + arm.beam.angle_shapes @ np.concatenate([[base_angle], q])
    return complex(rig.length * (np.exp(1j * theta) @ arm.beam.weights))


def simulate(
    rig: ArmRig,
    manoeuvre: Manoeuvre,
    time: ArrayLike,
    *,
    disturbances: Sequence[Disturbance] = (),
    modes: int = MODES,
    nodes: int = NODES,
    rtol: float = 1e-8,
    initial: tuple[FloatArray, FloatArray] | None = None,
) -> TwinMotion:
    """Motion of the arm under a manoeuvre of its motor.

    Parameters
    ----------
    rig : ArmRig
        The arm.
    manoeuvre : Manoeuvre
        Angle of the motor as the encoder reports it.
    time : (n,) array
        Times of the samples [s], strictly increasing.
    disturbances : sequence of Disturbance
        Effects to add.
    modes, nodes : int
        Number of curvature coordinates K and of quadrature nodes.
    rtol : float
        Relative tolerance of the integrator; the absolute one is a tenth of it, in rad and rad/s.
    initial : tuple of two (K,) arrays, optional
        Curvature coordinates [rad] and rates [rad/s] at ``time[0]``; the static equilibrium at rest if not given.

    Returns
    -------
    TwinMotion
        Arrays of length n.

    Raises
    ------
    ValueError
        If the times do not increase, or modes and nodes do not fit.
    TwinError
        If no equilibrium exists or the integrator gives up.
    """
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or t.size < 2 or not (np.diff(t) > 0).all():
        raise ValueError("the twin needs at least two times in strictly increasing order")
    arm = Arm.of(rig, disturbances, modes, nodes)
    start = arm.base(*(float(v) for v in manoeuvre(t[0])))
    if initial is None:
        q = arm.equilibrium(float(t[0]), start[0])
        initial = (q, np.zeros_like(q))
    state = np.concatenate([*initial, initial[0]] if arm.relaxation[0] else initial)
    late = np.maximum(t - sum(d.reading_delay() for d in disturbances), t[0])
    instants, back = np.unique(np.round(np.concatenate([t, late]), TIME_DECIMALS), return_inverse=True)
    states = _integrate(arm, manoeuvre, instants, state, rtol)
    motor = manoeuvre(instants)
    base = np.array([arm.base(*(float(v) for v in values)) for values in zip(*motor, strict=True)])
    tip = _tip(arm, base[:, 0], states[:, :modes])
    now = back[: t.size]
    reading = tip[back[t.size :]]
    for disturbance in disturbances:
        reading = disturbance.reading(reading)
    return _motion(arm, t, motor[0][now], base[now], states[now], tip[now], reading)


def _integrate(arm: Arm, manoeuvre: Manoeuvre, instants: FloatArray, state: FloatArray, rtol: float) -> FloatArray:
    """States (n, size) at the given instants, integrated stretch by stretch from the first one."""
    states = np.empty((instants.size, state.size))
    states[0] = state
    kinks = np.round(np.asarray(manoeuvre.kinks), TIME_DECIMALS)
    edges = np.unique(np.concatenate([instants[[0, -1]], kinks[(kinks > instants[0]) & (kinks < instants[-1])]]))
    for begin, end in pairwise(edges):
        inside = (instants > begin) & (instants <= end)
        stretch = int(np.searchsorted(kinks, (begin + end) / 2))
        stops = np.unique(np.concatenate([[begin], instants[inside], [end]]))
        path, info = odeint(
            arm.derivative(manoeuvre, stretch),
            state,
            stops,
            tfirst=True,
            rtol=rtol,
            atol=rtol / 10,
            mxstep=1_000_000,
            full_output=True,
        )
        if info["message"] != "Integration successful." or not np.isfinite(path).all():
            raise TwinError(f"the integrator gave up between {begin} s and {end} s: {info['message']}")
        states[inside] = path[np.isin(stops, instants[inside])]
        state = path[-1]
    return states


def _tip(arm: Arm, base_angle: FloatArray, q: FloatArray) -> ComplexArray:
    """Tip position x + 1j y [m] for base angles (n,) and curvature coordinates (n, K)."""
    theta = arm.rest_angle + base_angle[:, None] + q @ arm.beam.angle_shapes[:, 1:].T
    return arm.beam.length * (np.exp(1j * theta) @ arm.beam.weights)


def _motion(
    arm: Arm,
    time: FloatArray,
    motor_angle: FloatArray,
    base: FloatArray,
    states: FloatArray,
    tip: ComplexArray,
    reading: ComplexArray,
) -> TwinMotion:
    modes = arm.beam.angle_shapes.shape[1] - 1
    q, rate = states[:, :modes], states[:, modes : 2 * modes]
    relaxed = states[:, 2 * modes :] if arm.relaxation[0] else q
    coordinates, rates = np.column_stack([base[:, 0], q]), np.column_stack([base[:, 1], rate])
    kinetic, torque = np.empty(time.size), np.empty(time.size)
    for i in range(time.size):
        mass, load = arm.balance(float(time[i]), coordinates[i], rates[i], relaxed[i])
        acceleration = np.concatenate([[base[i, 2]], solve_free(mass, load, base[i, 2])])
        kinetic[i] = rates[i] @ mass @ rates[i] / 2
        torque[i] = mass[0] @ acceleration - load[0]
    return TwinMotion(
        time=time,
        motor_angle=motor_angle,
        base_angle=base[:, 0],
        tip_x=tip.real,
        tip_y=tip.imag,
        reading_x=reading.real,
        reading_y=reading.imag,
        tip_angle=np.unwrap(np.angle(tip)),
        coordinates=q,
        rates=rate,
        kinetic_energy=kinetic,
        elastic_energy=arm.rig.flexural_rigidity / (2 * arm.rig.length) * (q**2).sum(axis=1),
        base_torque=torque,
    )
