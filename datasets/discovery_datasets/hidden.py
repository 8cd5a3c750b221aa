"""What can be hidden in a case of the blind benchmark: every effect of the twin, drawn but for its strength."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from discovery_datasets import disturbances as plain
from discovery_datasets import outside
from discovery_datasets import quick_effects as quick
from discovery_datasets.arm import ArmRig
from discovery_datasets.disturbances import Disturbance

FloatArray = NDArray[np.float64]
Generator = np.random.Generator
#: Effects that act on a motion in a like way, for statistics; the last family is in no catalogue.
FAMILIES: dict[str, tuple[str, ...]] = {
    "friction": (
        "coulomb_friction", "stribeck_friction", "quadratic_drag", "structural_damping", "amplitude_dependent_damping",
        "nonlinear_structural_damping", "asymmetric_viscous_damping",
    ),
    "rod": (
        "material_nonlinearity", "quadratic_stiffness", "stiffness_drift", "initial_curvature", "tip_rotary_inertia",
    ),
    "memory": ("viscoelastic_relaxation", "hysteresis", "base_hysteresis"),
    "base and drive": ("base_compliance", "base_backlash", "encoder_ripple", "input_gain", "equilibrium_offset"),
    "environment": ("table_tilt", "periodic_disturbance"),
    "instrument": ("sensor_delay", "angle_offset", "position_scale", "camera_origin_offset", "time_base_error"),
    "outside": tuple(outside.OUTSIDE),
}  # fmt: skip


@dataclass(frozen=True)
class Scene:
    """Sizes that effects are measured by.

    Attributes
    ----------
    rig : ArmRig
        The arm.
    deflection, frequency : float
        Largest deflection [rad], and angular frequency of small swings [rad/s].
    force, speed : float
        Elastic force at the tip at that deflection [N], and speed of such a swing [m/s].
    duration : float
        Of the recordings [s].
    time, path, hub : (n,) array
        Times [s], undisturbed tip x + 1j y [m] and angle of the hub [rad] of the training recording.
    """

    rig: ArmRig
    deflection: float
    frequency: float
    force: float
    speed: float
    duration: float
    time: FloatArray
    path: NDArray[np.complex128]
    hub: FloatArray


@dataclass(frozen=True)
class Hidden:
    """One effect to hide.

    Attributes
    ----------
    id : str
        Its name.
    make : callable
        The disturbance of a given strength; about 1 is plainly seen.
    most : float
        Largest strength that a laboratory would not notice otherwise.
    accepted : tuple of str
        Ids that name the very same physics.
    """

    id: str
    make: Callable[[float], Disturbance]
    most: float
    accepted: tuple[str, ...]


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def random_sign(rng: Generator) -> float:
    """Draw 1 or -1."""
    return float(rng.choice([-1.0, 1.0]))


def draw_hidden(name: str, scene: Scene, rng: Generator) -> Hidden:
    """Draw everything of an effect but its strength.

    Raises
    ------
    KeyError
        If there is no such effect.
    """
    r = scene.rig
    mass, stiffness = r.effective_mass, r.flexural_rigidity / r.length
    swings = 2 * pi / scene.frequency
    moving = np.flatnonzero(np.abs(scene.path - scene.path[0]) > 0.2 * r.length * scene.deflection)
    spot = scene.path[rng.choice(moving)] * (1 + 0.02 * rng.standard_normal())
    start = float(scene.time[moving[0]] + rng.uniform(0.1, 0.6) * (scene.time[-1] - scene.time[moving[0]]))
    sign, turn = random_sign(rng), rng.uniform(0, 2 * pi)
    axis = np.exp(1j * turn)
    wave = log_uniform(rng, 0.3, 6.0) * scene.frequency
    ratio, time, yielding = rng.uniform(0.5, 2.0), log_uniform(rng, 0.1, 8.0) * swings, log_uniform(rng, 0.05, 0.8)
    slipping = yielding * scene.deflection
    phase, cycles, soft = rng.uniform(0, 2 * pi), rng.uniform(3.0, 25.0), log_uniform(rng, 0.02, 0.06)
    burst = log_uniform(rng, 0.1, 1.0) if rng.random() < 0.5 else 0.0
    near, far = rng.uniform(0.02, 0.05) * r.length, rng.uniform(0.15, 0.4) * r.length
    anchor = 1.5 * r.length * np.exp(1j * turn)
    slack = float(np.quantile(np.abs(scene.hub), rng.uniform(0.2, 0.6)))
    waves = scene.frequency * np.exp(rng.uniform(np.log(0.1), np.log(1.7), 9))
    drips = np.sort(rng.uniform(0.15, 0.8, 3)) * scene.duration
    makers: dict[str, tuple[Callable[[float], Disturbance], float]] = {
        "coulomb_friction": (lambda s: plain.CoulombFriction(0.01 * s * scene.force, 2e-3), 4),
        "stribeck_friction": (
            lambda s: quick.StribeckFriction(
                0.006 * s * scene.force, 0.006 * ratio * s * scene.force, 0.15 * ratio * scene.speed
            ),
            4,
        ),
        "quadratic_drag": (lambda s: plain.QuadraticDrag(0.05 * s * mass / r.length), 40),
        "structural_damping": (lambda s: plain.StructuralDamping(0.003 * s / scene.frequency), 15),
        "amplitude_dependent_damping": (
            lambda s: quick.AmplitudeDependentDamping(0.02 * s * mass * scene.frequency), 60
        ),
        "nonlinear_structural_damping": (
            lambda s: quick.NonlinearStructuralDamping(0.02 * s * mass * scene.frequency), 60
        ),
        "asymmetric_viscous_damping": (lambda s: quick.AsymmetricViscousDamping(0.3 * sign * s * r.disc_friction), 3),
        "material_nonlinearity": (lambda s: quick.MaterialNonlinearity(0.05 * s * sign * r.length**2), 4),
        "quadratic_stiffness": (lambda s: quick.QuadraticStiffness(0.03 * s * sign * r.length), 6),
        "stiffness_drift": (lambda s: plain.StiffnessDrift(2e-3 * sign * s / scene.duration), 60),
        "initial_curvature": (lambda s: plain.InitialCurvature(0.01 * sign * s / r.length), 20),
        "tip_rotary_inertia": (lambda s: quick.TipRotaryInertia(0.002 * s * mass * r.length**2), 20),
        "viscoelastic_relaxation": (lambda s: plain.ViscoelasticRelaxation(0.02 * s, time), 20),
        "hysteresis": (
            lambda s: quick.Hysteresis(0.02 * s * stiffness * yielding, 2 * yielding * scene.deflection / r.length), 20
        ),
        "base_hysteresis": (
            lambda s: quick.BaseHysteresis(
                stiffness / (0.02 * s), 0.5 * stiffness * slipping, 0.02 * s * slipping
            ),
            8,
        ),
        "base_compliance": (lambda s: quick.BaseCompliance(stiffness / (0.01 * s)), 15),
        "base_backlash": (
            lambda s: quick.BaseBacklash(
                0.002 * s, stiffness / soft, stiffness / soft / (400 * np.sqrt(stiffness / (r.beam_mass * r.length**2)))
            ),
            30,
        ),
        "encoder_ripple": (lambda s: plain.EncoderRipple(1e-3 * s, cycles, phase), 30),
        "input_gain": (lambda s: quick.InputGain(2e-3 * sign * s), 30),
        "equilibrium_offset": (lambda s: quick.EquilibriumOffset(2e-3 * sign * s), 30),
        "table_tilt": (lambda s: plain.TableTilt(x=1e-4 * s * axis.real, y=1e-4 * s * axis.imag), 400),
        "periodic_disturbance": (
            lambda s: plain.PeriodicDisturbance(
                0.005 * s * scene.force * abs(1 - (wave / scene.frequency) ** 2), wave, phase, turn
            ),
            60,
        ),
        "sensor_delay": (lambda s: plain.SensorDelay(3e-3 * s), 30),
        "angle_offset": (lambda s: quick.AngleOffset(2e-3 * sign * s), 30),
        "position_scale": (lambda s: plain.PositionScale(2e-3 * sign * s), 30),
        "camera_origin_offset": (
            lambda s: plain.CameraOriginOffset(1e-3 * s * axis.real, 1e-3 * s * axis.imag), 60
        ),
        "time_base_error": (
            (lambda s: quick.TimeBaseError(wait=3e-3 * s, period=burst)) if burst else
            (lambda s: quick.TimeBaseError(drift=2e-4 * sign * s)), 60
        ),
        "magnet": (lambda s: outside.Magnet(spot.real, spot.imag, far / 2, 0.02 * s * scene.force), 60),
        "rough_place": (lambda s: outside.RoughPlace(spot.real, spot.imag, far, 0.02 * s * scene.force), 60),
        "sticky_place": (lambda s: outside.StickyPlace(spot.real, spot.imag, near, 0.05 * s * scene.force), 60),
        "cable": (lambda s: outside.Cable(anchor.real, anchor.imag, slack, 0.02 * s * scene.force), 60),
        "bump": (lambda s: outside.Bump(start, 0.04, 0.2 * s * scene.force, turn), 60),
        "gust": (lambda s: outside.Gust(start, 0.5, 0.02 * s * scene.force, turn), 60),
        "dripping_mass": (lambda s: outside.DrippingMass(2e-3 * s * r.tip_mass, tuple(drips)), 60),
        "pulsing_air": (
            lambda s: outside.PulsingAir(
                0.004 * s * scene.force, turn, tuple(waves), tuple(rng.uniform(0, 2 * pi, 1) + np.arange(9.0) ** 2)
            ),
            60,
        ),
    }  # fmt: skip
    make, most = makers[name]
    same = {
        # A rod clamped at an angle is a turned camera: nothing but a force from outside tells them apart.
        "equilibrium_offset": ("equilibrium_offset", "angle_offset", "input_offset"),
        "angle_offset": ("angle_offset", "equilibrium_offset", "input_offset"),
    }
    return Hidden(name, make, float(most), same.get(name, (name,)))


def clash(first: Hidden, second: Hidden) -> bool:
    """Return whether two effects are one physics, or act through the same coefficients of the engine."""
    if set(first.accepted) & set(second.accepted):
        return True
    ours, theirs = first.make(1.0).physics(), second.make(1.0).physics()
    return bool(ours.keys() & theirs.keys())
