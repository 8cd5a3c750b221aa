"""Readings of an arm with any effects, by the compiled engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigvalsh
from scipy.optimize import root

from discovery_datasets.arm import ArmRig, TwinError
from discovery_datasets.beam import curvature_shapes, discretise, integration_matrix
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.engine import GREASE, INPUTS, Physics, Rod, integrate, slope
from discovery_datasets.manoeuvres import Manoeuvre

FloatArray = NDArray[np.float64]
#: Converged to 0.003 mm on the paper's arm.
MODES, NODES = 5, 12
#: Steps times the fastest angular frequency, and times the fastest decay: both well inside the region of stability.
REACH, DECAY = 1.2, 1.6
CHUNK = 50_000  # steps tabulated at a time
MOST_STEPS = 250_000  # beyond, the fastest vibrations (stiffly damped, or of a stiff joint) are left out, down to three
EDGE = 1e-6  # of a step: inputs are taken this far inside it, for they may jump at its ends


@dataclass(frozen=True)
class Readings:
    """What perfect instruments report, and where the tip really is.

    Attributes
    ----------
    time, motor_angle : (n,) array
        Times [s], angle that a perfect encoder reports [rad].
    reading_x, reading_y : (n,) array
        What a perfect camera reports [m].
    tip : (n,) complex array
        Position of the tip x + 1j y [m].
    deflection : (n,) array
        Angle of the tip against the hub [rad].
    """

    time: FloatArray
    motor_angle: FloatArray
    reading_x: FloatArray
    reading_y: FloatArray
    tip: NDArray[np.complex128]
    deflection: FloatArray


def _rod(rig: ArmRig, disturbances: Sequence[Disturbance], modes: int, nodes: int, tip_moment: bool) -> Rod:
    beam = discretise(rig.length, rig.beam_mass, rig.tip_mass, modes=modes, nodes=nodes, tip_moment=tip_moment)
    position, integral = integration_matrix(nodes)
    mass = rig.beam_mass * beam.weights
    mass[-1] += rig.tip_mass
    levers = rig.length * integral[None] * beam.angle_shapes.T[:, None, :]
    return Rod(
        length=rig.length,
        rigidity=rig.flexural_rigidity,
        shapes=beam.angle_shapes,
        curvatures=curvature_shapes(position, modes, tip_moment=tip_moment),
        weights=beam.weights,
        integral=integral,
        levers=np.ascontiguousarray(levers),
        mass=mass,
        rest_angle=sum(d.rest_curvature() for d in disturbances) * rig.length * position,
        position=position,
    )


def _physics(rig: ArmRig, disturbances: Sequence[Disturbance]) -> Physics:
    found: dict[str, float] = {"viscous": rig.disc_friction}
    relaxing = [d.relaxation() for d in disturbances if d.relaxation()[0] != 0]
    for own in (
        *(d.physics() for d in disturbances),
        *({"relaxing": ratio, "relaxation_time": time} for ratio, time in relaxing),
    ):
        if twice := found.keys() & own.keys() - {"joint"}:
            raise ValueError(f"two disturbances set {', '.join(sorted(twice))}; give one of them")
        found.update(own)
    gravity = sum((d.gravity() for d in disturbances), 0j)
    return Physics(
        **found,
        retardation=rig.retardation + sum(d.retardation_time() for d in disturbances),
        gravity_x=gravity.real,
        gravity_y=gravity.imag,
    )


def _inputs(manoeuvre: Manoeuvre, disturbances: Sequence[Disturbance], time: FloatArray) -> FloatArray:
    """Tabulate what depends on time alone, shape (*time.shape, len(INPUTS))."""
    hub = manoeuvre(time)
    base: tuple[Any, Any, Any] = hub
    for d in disturbances:
        base = d.base_motion(*base)
    push = sum((d.push(time) for d in disturbances), np.zeros(time.shape, complex))
    table = {
        **dict(zip(INPUTS, base, strict=False)),
        "rigidity": np.prod([np.broadcast_to(d.stiffness_factor(time), time.shape) for d in disturbances], axis=0),
        "force_x": push.real,
        "force_y": push.imag,
        "friction": np.prod([d.friction_factor(time) for d in disturbances], axis=0),
        "lost_mass": sum(d.lost_mass(time) for d in disturbances),
        "tension": sum(d.tension(hub[0]) for d in disturbances),
    }
    return np.stack([np.broadcast_to(table[name], time.shape) for name in INPUTS], axis=-1)


def _size(modes: int, nodes: int) -> int:
    return 3 * modes + 3 + nodes


def _linear(rod: Rod, p: Physics) -> tuple[FloatArray, FloatArray]:
    """Mass and stiffness matrices of small vibrations about the straight rod, the root free where it may turn."""
    first = 0 if p.joint else 1
    jy = rod.levers.sum(axis=2)[first:]
    inertia = (
        jy @ (rod.mass[:, None] * jy.T) + p.rotary_inertia * np.outer(rod.shapes[-1], rod.shapes[-1])[first:, first:]
    )
    stiffness = np.diag(np.r_[0.0, np.full(rod.curvatures.shape[1], rod.rigidity / rod.length * (1 + p.relaxing))])
    stiffness[0, 0] = p.joint_stiffness + p.joint_moment / p.joint_yield
    bent = rod.curvatures.T @ (rod.weights[:, None] * rod.curvatures) * p.fibre_moment / p.fibre_yield / rod.length
    stiffness[1:, 1:] += bent
    return inertia, stiffness[first:, first:]


def _longest_step(rod: Rod, p: Physics) -> float:
    inertia, stiffness = _linear(rod, p)
    fastest = float(np.sqrt(eigvalsh(stiffness, inertia)[-1]))
    damping = np.zeros(rod.levers.shape[0])
    damping[0] = p.joint_damping
    damping[1:] = rod.rigidity / rod.length * p.retardation
    decay = float(eigvalsh(np.diag(damping)[-len(inertia) :, -len(inertia) :], inertia)[-1])
    return min(REACH / fastest, DECAY / max(decay, 1e-12))


def _at_rest(rod: Rod, p: Physics, inputs: FloatArray, size: int) -> FloatArray:
    """State in static equilibrium under constant inputs, hysteresis at zero."""
    modes = rod.curvatures.shape[1]
    work = np.empty((2 * rod.levers.shape[0] + 8, rod.weights.size))
    still = inputs.copy()
    still[1:3] = 0.0

    def state(unknown: FloatArray) -> FloatArray:
        s = np.zeros(size)
        s[0] = inputs[0] + unknown[0] if p.joint else inputs[0]
        s[1 : modes + 1] = unknown[1:]
        s[2 * modes + 2 : 3 * modes + 2] = unknown[1:]
        return s

    def pull(unknown: FloatArray) -> FloatArray:
        change = np.empty(size)
        slope(rod, p, still, state(unknown), change, work)
        out = change[modes + 1 : 2 * modes + 2].copy()
        if not p.joint:
            out[0] = unknown[0]
        return out

    guess = np.zeros(modes + 1)
    if p.joint_play:
        # Leaning on the contact where the load reaches across the play; held by the grease in it otherwise.
        tight = _at_rest(rod, p._replace(joint_play=0.0), inputs, size)
        guess[0], guess[1:] = tight[0] - inputs[0], tight[1 : modes + 1]
        if abs(guess[0]) > GREASE * p.joint_play:
            guess[0] += np.copysign(p.joint_play, guess[0])
        else:
            guess[0] /= GREASE

    def pull_beside(away: FloatArray) -> FloatArray:
        return pull(guess + away)

    # From zero on, for the solver's differences are relative to its unknowns.
    found = root(pull_beside, np.zeros(modes + 1), tol=1e-13)
    rest = guess + found.x
    # An acceleration that the stiffest coordinate has 1e-10 rad from its rest.
    if not np.abs(rest).max() < 1.5 or np.abs(pull(rest)).max() > 1e-10 / _longest_step(rod, p) ** 2:
        raise TwinError(f"no static equilibrium found: {found.message}")
    return state(rest)


def readings(
    rig: ArmRig,
    manoeuvre: Manoeuvre,
    time: ArrayLike,
    *,
    disturbances: Sequence[Disturbance] = (),
    modes: int = MODES,
    nodes: int = NODES,
    refine: float = 1.0,
) -> Readings:
    """Simulate an arm from its static equilibrium on, and return what its instruments report.

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
        Number of curvature coordinates, one more where the tip bears a moment, and of nodes.
    refine : float
        Steps are shorter by this factor than stability asks.

    Raises
    ------
    ValueError
        If two disturbances claim one coefficient.
    TwinError
        If no equilibrium is found or the motion grows beyond bounds.
    """
    t = np.asarray(time, dtype=float)
    effects = [*disturbances] or [Disturbance()]
    p = _physics(rig, effects)
    tip_moment = p.rotary_inertia != 0.0
    modes += tip_moment
    rod = _rod(rig, effects, modes, nodes, tip_moment)
    while modes > 3 and (t[-1] - t[0]) * refine / _longest_step(rod, p) > MOST_STEPS:
        modes -= 1
        rod = _rod(rig, effects, modes, nodes, tip_moment)
    late = t + sum(d.reading_time(t) - t for d in effects)
    late = np.clip(late, t[0], None)
    kinks = np.array([k for k in manoeuvre.kinks if t[0] < k < max(t[-1], late[-1])])
    instants = np.unique(np.round(np.concatenate([t, late, kinks]), 12))
    gap = np.diff(instants)
    pieces = np.ceil(gap * refine / _longest_step(rod, p)).astype(int)
    steps = np.repeat(gap / pieces, pieces)
    begin = np.repeat(instants[:-1], pieces) + steps * (
        np.arange(steps.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    )
    keep = np.zeros(steps.size, bool)
    keep[np.cumsum(pieces) - 1] = True
    state = _at_rest(rod, p, _inputs(manoeuvre, effects, instants[:1])[0], _size(modes, nodes))
    found = [state[None].copy()]
    for first in range(0, steps.size, CHUNK):
        part = slice(first, first + CHUNK)
        stages = begin[part, None] + steps[part, None] * np.array([EDGE, 0.5, 1 - EDGE])
        found.append(integrate(rod, p, state, steps[part], _inputs(manoeuvre, effects, stages), keep[part]))
    states = np.concatenate(found)
    if not np.isfinite(states).all():
        raise TwinError("the motion grew beyond all bounds")
    if not p.joint:
        states[:, 0] = _inputs(manoeuvre, effects, instants)[:, 0]
    theta = rod.rest_angle + states[:, : modes + 1] @ rod.shapes.T
    tip = rig.length * (np.exp(1j * theta) @ rod.weights)
    reading = tip[np.searchsorted(instants, np.round(late, 12))]
    for d in effects:
        reading = d.reading(reading)
    now = tip[np.searchsorted(instants, np.round(t, 12))]
    angle = manoeuvre(t)[0]
    return Readings(t, angle, reading.real, reading.imag, now, np.angle(now * np.exp(-1j * angle)))
