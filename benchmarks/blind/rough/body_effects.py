"""What can be hidden in a body with one coordinate: effects of the catalogue by other laws, and outsiders.

Each has its own law, see `discovery_datasets.one_coordinate`: near to that of the catalogue, or the same computed
otherwise. A strength of 1 is plainly seen.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.blind.rough.ingredient import Action, Ingredient, log_uniform

if TYPE_CHECKING:
    from benchmarks.blind.rough.bodies import Body

FloatArray = NDArray[np.float64]
Generator = np.random.Generator
Draw = Callable[["Body", Generator], Ingredient]
#: Relative width of the sign of dry friction.
SIGN = 1e-3


def _sign(rng: Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _coulomb(b: Body, rng: Generator) -> Ingredient:
    """Dry friction whose sign is an arc tangent of the speed."""
    free = b.system in ("decay", "pendulum")
    return Ingredient(
        "coulomb_friction",
        lambda s: Action({"dry": 0.003 * s * b.force, "dry_speed": SIGN * b.speed}),
        5.0 if free else 30.0,
        catalogue=lambda s: {"f_c": 0.003 * s * b.force},
    )


def _stribeck(b: Body, rng: Generator) -> Ingredient:
    """Dry friction that falls from creep on as exp(-v/v_s), after Tustin."""
    ratio, slow = rng.uniform(0.8, 2.5), rng.uniform(0.08, 0.3) * b.speed
    free = b.system in ("decay", "pendulum")

    def act(s: float) -> Action:
        dry = 0.002 * s * b.force
        return Action({"dry": dry, "creep": ratio * dry, "creep_speed": slow, "dry_speed": SIGN * b.speed})

    near = lambda s: {"f_k": 0.002 * s * b.force, "f_b": 0.0015 * ratio * s * b.force, "v_s": 1.2 * slow}  # noqa: E731
    shape = {"ratio": ratio, "creep_speed": slow}
    return Ingredient("stribeck_friction", act, 5.0 if free else 30.0, catalogue=near, exact=False, shape=shape)


def _drag(b: Body, rng: Generator) -> Ingredient:
    """Drag that is viscous where the flow is slow."""
    unit = 0.02 * b.force / b.speed**2
    return Ingredient(
        "quadratic_drag",
        lambda s: Action({"drag": s * unit, "drag_rest": 0.03 * b.speed}),
        20.0,
        catalogue=lambda s: {"c_2": s * unit},
    )


def _amplitude(b: Body, rng: Generator) -> Ingredient:
    """Damper that stands across the motion at rest."""
    reach, unit = 3.0 * b.reach, 0.2 * b.force / b.speed
    return Ingredient(
        "amplitude_dependent_damping",
        lambda s: Action({"loss": s * unit, "loss_reach": reach}),
        20.0,
        catalogue=lambda s: {"xi_2": 0.94 * s * unit / reach**2},
        exact=False,
    )


def _asymmetric(b: Body, rng: Generator) -> Ingredient:
    """Friction that is greater one way."""
    share = 0.3 * _sign(rng)
    return Ingredient(
        "asymmetric_viscous_damping",
        lambda s: Action({"asymmetry": s * share * b.laws.viscous}),
        3.0,
        catalogue=lambda s: {"a_v": s * share},
    )


def _cubic(b: Body, rng: Generator) -> Ingredient:
    """Two springs across the motion, slack at rest."""
    reach, unit = 4.0 * b.reach, 0.32 * _sign(rng) * b.force / b.reach
    return Ingredient(
        "cubic_stiffness",
        lambda s: Action({"across": s * unit, "across_reach": reach}),
        12.0,
        catalogue=lambda s: {"beta": 0.96 * s * unit / reach**2},
        exact=False,
    )


def _quadratic(b: Body, rng: Generator) -> Ingredient:
    """Spring whose force grows exponentially to one side."""
    reach, unit = 6.0 * _sign(rng) * b.reach, 0.24 * b.force / b.reach
    return Ingredient(
        "quadratic_stiffness",
        lambda s: Action({"exponential": s * unit, "exponential_reach": reach}),
        12.0,
        catalogue=lambda s: {"k_2": s * unit / (2 * reach)},
        exact=False,
    )


def _quintic(b: Body, rng: Generator) -> Ingredient:
    """Spring of fifth order."""
    unit = 0.03 * _sign(rng) * b.force / b.reach**5
    return Ingredient(
        "quintic_stiffness", lambda s: Action({"quintic": s * unit}), 12.0, catalogue=lambda s: {"k_5": s * unit}
    )


def _hinge(b: Body, rng: Generator) -> Ingredient:
    """Flexure in the hinge of a pendulum."""
    unit = 0.05 * b.laws.gravity
    return Ingredient(
        "linear_stiffness", lambda s: Action({"linear": s * unit}), 12.0, catalogue=lambda s: {"alpha": s * unit}
    )


def _hysteresis(b: Body, rng: Generator) -> Ingredient:
    """Bouc-Wen force with a softer knee."""
    share = rng.uniform(0.08, 0.6)
    reach, stiffness = share * b.reach, 0.02 * b.force / b.reach
    return Ingredient(
        "hysteresis",
        lambda s: Action({"slip_force": s * stiffness * reach, "slip_reach": reach, "slip_knee": 1.6}),
        15.0,
        catalogue=lambda s: {"h_b": s * stiffness / b.laws.linear, "w_h": reach},
        exact=False,
        shape={"reach": reach},
    )


def _relaxation(b: Body, rng: Generator) -> Ingredient:
    """Maxwell branch beside the spring."""
    time = log_uniform(rng, 0.1, 3.0) * 2 * np.pi / b.frequency
    return Ingredient(
        "viscoelastic_relaxation",
        lambda s: Action({"relaxing": 0.02 * s * b.laws.linear, "relaxing_time": time}),
        40.0,
        catalogue=lambda s: {"v": 0.02 * s, "tau_v": time},
        shape={"time": time},
    )


def _drift(b: Body, rng: Generator) -> Ingredient:
    """Spring that warms up: its drift grows slower and slower."""
    unit, late = 0.004 * _sign(rng) / b.duration, 10.0 * b.duration
    return Ingredient(
        "stiffness_drift",
        lambda s: Action({"drift": s * unit * late, "drift_time": late}),
        30.0,
        catalogue=lambda s: {"r": 0.95 * s * unit},
        exact=False,
    )


def _offset(b: Body, rng: Generator) -> Ingredient:
    """Steady force: the spring rests elsewhere, which is what an instrument with another zero reads, too."""
    unit = 0.01 * _sign(rng) * b.force
    return Ingredient(
        "equilibrium_offset",
        lambda s: Action(push=lambda t: np.full(t.shape, s * unit)),
        20.0,
        accepted=("equilibrium_offset", "angle_offset"),
        catalogue=lambda s: {"delta_0": s * unit / b.laws.linear},
    )


def _periodic(b: Body, rng: Generator) -> Ingredient:
    """Rotating unbalance with a little of its second harmonic."""
    wave = log_uniform(rng, 0.35, 0.8) if rng.random() < 0.5 else log_uniform(rng, 1.25, 4.0)
    phase, wave = rng.uniform(0, 2 * np.pi), wave * b.frequency
    unit = 0.004 * b.force

    def act(s: float) -> Action:
        return Action(push=lambda t: s * unit * (np.sin(wave * t + phase) + 0.02 * np.sin(2 * wave * t)))

    def values(s: float) -> dict[str, float]:
        return {"a_s": s * unit * np.cos(phase), "a_c": s * unit * np.sin(phase), "Omega": wave}

    return Ingredient("periodic_disturbance", act, 120.0, catalogue=values, shape={"frequency": wave, "phase": phase})


def _delay(b: Body, rng: Generator) -> Ingredient:
    """Instrument that is late."""
    unit = 0.003 / b.frequency
    return Ingredient(
        "sensor_delay", lambda s: Action(late=lambda t: t - s * unit), 70.0, catalogue=lambda s: {"tau": s * unit}
    )


def _clock(b: Body, rng: Generator) -> Ingredient:
    """Clock of the instrument that drifts against that of the input."""
    unit = 0.005 * _sign(rng) / (b.frequency * b.duration)
    return Ingredient(
        "time_base_error",
        lambda s: Action(late=lambda t: (1 - s * unit) * t),
        200.0,
        catalogue=lambda s: {"d_t": s * unit},
    )


def _second(b: Body, rng: Generator) -> Ingredient:
    """A second body on the first by a spring: what is read is a sum of two modes."""
    own = b.frequency * (log_uniform(rng, 0.35, 0.7) if rng.random() < 0.4 else log_uniform(rng, 1.4, 2.5))
    loss = 2 * own * log_uniform(rng, 0.01, 0.04)

    def act(s: float) -> Action:
        share = 0.003 * s
        return Action({"coupling": share * own**2, "share": share, "ground_loss": loss})

    near = lambda s: {"g_2": 0.01 * s, "omega_2": own, "zeta_2": loss / (2 * own)}  # noqa: E731
    return Ingredient("second_mode", act, 30.0, catalogue=near, exact=False, shape={"frequency": own})


def _bump(b: Body, rng: Generator) -> Ingredient:
    """Something runs into the body once."""
    start, last = rng.uniform(0.2, 0.7) * b.duration, rng.uniform(0.1, 0.3) * 2 * np.pi / b.frequency

    def act(s: float) -> Action:
        return Action(push=lambda t: 0.05 * s * b.force * _half_sine((t - start) / last))

    return Ingredient("bump", act, 60.0, shape={"start": start, "duration": last})


def _gust(b: Body, rng: Generator) -> Ingredient:
    """A door is opened for some periods."""
    start, last = rng.uniform(0.1, 0.5) * b.duration, rng.uniform(2.0, 6.0) * 2 * np.pi / b.frequency

    def act(s: float) -> Action:
        return Action(push=lambda t: 0.01 * s * b.force * _half_sine((t - start) / last))

    return Ingredient("gust", act, 60.0, shape={"start": start, "duration": last})


def _half_sine(phase: FloatArray) -> FloatArray:
    return np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)), 0.0)


def _sticky(b: Body, rng: Generator) -> Ingredient:
    """Tape on the track: dry friction at one place."""
    place, width = b.place(rng.uniform(0.25, 0.75)), rng.uniform(0.03, 0.08) * b.reach

    def act(s: float) -> Action:
        laws = {"place": place, "place_width": width, "place_friction": 0.02 * s * b.force}
        return Action({**laws, "dry_speed": SIGN * b.speed})

    return Ingredient("sticky_place", act, 40.0, shape={"place": place, "width": width})


def _magnet(b: Body, rng: Generator) -> Ingredient:
    """A screw that attracts the body where it passes."""
    place, width = b.place(rng.uniform(0.2, 0.8)), rng.uniform(0.05, 0.12) * b.reach

    def act(s: float) -> Action:
        return Action({"place": place, "place_width": width, "place_pull": 0.02 * s * b.force})

    return Ingredient("magnet", act, 40.0, shape={"place": place, "width": width})


def _stop(b: Body, rng: Generator) -> Ingredient:
    """A soft stop on one side, met near the ends of the motion."""
    at = b.place(rng.uniform(0.75, 0.9))
    return Ingredient(
        "stop", lambda s: Action({"stop": 0.1 * s * b.force / b.reach, "stop_at": at}), 40.0, shape={"at": at}
    )


def _pulsing(b: Body, rng: Generator) -> Ingredient:
    """Air supply that pulses irregularly."""
    waves = b.frequency * np.exp(rng.uniform(np.log(0.1), np.log(2.0), 11))
    phases = rng.uniform(0, 2 * np.pi, 11)

    def act(s: float) -> Action:
        return Action(push=lambda t: 0.004 * s * b.force * sum(np.sin(w * t + p) for w, p in zip(waves, phases)))  # noqa: B905

    return Ingredient("pulsing_air", act, 60.0, shape={"frequencies": waves.tolist()})


def _dripping(b: Body, rng: Generator) -> Ingredient:
    """Body that loses mass now and then."""
    times = np.sort(rng.uniform(0.15, 0.8, 3)) * b.duration

    def act(s: float) -> Action:
        return Action(inertia=lambda t: 1 - 0.003 * s * np.searchsorted(times, t))

    return Ingredient("dripping_mass", act, 40.0, shape={"times": times.tolist()})


_FAMILIES: dict[str, dict[str, Draw]] = {
    "friction": {
        "coulomb_friction": _coulomb, "stribeck_friction": _stribeck, "quadratic_drag": _drag,
        "amplitude_dependent_damping": _amplitude, "asymmetric_viscous_damping": _asymmetric,
    },
    "spring": {
        "cubic_stiffness": _cubic, "quadratic_stiffness": _quadratic, "quintic_stiffness": _quintic,
        "linear_stiffness": _hinge, "stiffness_drift": _drift, "equilibrium_offset": _offset,
    },
    "memory": {"hysteresis": _hysteresis, "viscoelastic_relaxation": _relaxation, "second_mode": _second},
    "environment": {"periodic_disturbance": _periodic},
    "instrument": {"sensor_delay": _delay, "time_base_error": _clock},
}  # fmt: skip
#: Every effect, and every outsider, by its name.
EFFECTS: dict[str, Draw] = {name: draw for family in _FAMILIES.values() for name, draw in family.items()}
OUTSIDERS: dict[str, Draw] = {
    "bump": _bump, "gust": _gust, "sticky_place": _sticky, "magnet": _magnet, "stop": _stop, "pulsing_air": _pulsing,
    "dripping_mass": _dripping,
}  # fmt: skip
_RUBBING = ("coulomb_friction", "stribeck_friction", "quadratic_drag", "asymmetric_viscous_damping")
_SPRINGS = ("cubic_stiffness", "quadratic_stiffness", "stiffness_drift", "equilibrium_offset", "hysteresis")
_ALIKE = (*_RUBBING, "amplitude_dependent_damping", *_SPRINGS, "periodic_disturbance")
#: What shows in each kind of body: a free decay has no clock but its own, a drive has no spring.
_HIDDEN: dict[str, tuple[str, ...]] = {
    "oscillator": (
        *_ALIKE, "quintic_stiffness", "viscoelastic_relaxation", "second_mode", "sensor_delay", "time_base_error"
    ),
    "decay": _ALIKE,
    "pendulum": (*_RUBBING, "amplitude_dependent_damping", "linear_stiffness", "periodic_disturbance"),
    "bench": (*_ALIKE, "quintic_stiffness", "viscoelastic_relaxation"),
    "drive": (*_RUBBING, "periodic_disturbance", "sensor_delay", "time_base_error"),
    "servo": (*_RUBBING, "periodic_disturbance"),
}  # fmt: skip


def names(system: str, kind: str) -> tuple[str, ...]:
    """Effects, or outsiders where that is the kind of case, that show in a kind of body."""
    if kind != "outside":
        return _HIDDEN[system]
    # What hangs keeps its period when it loses mass.
    return tuple(n for n in OUTSIDERS if n != "dripping_mass" or system != "pendulum")


def draw(name: str, body: Body, rng: Generator) -> Ingredient:
    """Draw everything of an effect or outsider but its strength."""
    from dataclasses import replace

    family = next((f for f, members in _FAMILIES.items() if name in members), "outside")
    found = (EFFECTS | OUTSIDERS)[name](body, rng)
    return replace(found, family=family, accepted=found.accepted or (name,))
