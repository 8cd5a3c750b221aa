"""Systems with one coordinate: their mechanics, motions and rig files, drawn at random."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from discovery_datasets.one_coordinate import INPUTS, STATES, Laws, follow, integrate
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from benchmarks.blind.rough import body_effects, body_errors
from benchmarks.blind.rough.ingredient import Action, Ingredient, Readings, log_uniform
from benchmarks.blind.rough.subject import Subject
from benchmarks.blind.rough.waves import Waves, draw_waves

FloatArray = NDArray[np.float64]
Generator = np.random.Generator
#: Steps in a period of the quickest thing that moves; friction's sign changes within one of them.
STEPS = 700


@dataclass(frozen=True)
class Layout:
    """What the recordings of a kind of body look like.

    Attributes
    ----------
    kind : str
        Word of the rig file.
    input, output : (name, unit)
        Columns; the input may be missing.
    declared : tuple of str
        Effects of the declared model.
    clearness : (low, high)
        Reach of the readings over their noise.
    """

    kind: str
    input: tuple[str, str] | None
    output: tuple[str, str]
    declared: tuple[str, ...]
    clearness: tuple[float, float] = (200.0, 2000.0)


#: Every kind of body.
BODIES: Mapping[str, Layout] = {
    "oscillator": Layout("oscillator", ("force_N", "N"), ("position_m", "m"), ("viscous_damping", "linear_stiffness")),
    "decay": Layout("oscillator", None, ("position_m", "m"), ("viscous_damping", "linear_stiffness"), (300.0, 2000.0)),
    "pendulum": Layout("pendulum", None, ("angle_rad", "rad"), ("viscous_damping", "gravity_torque"), (300.0, 2000.0)),
    "bench": Layout(
        "drive", ("position_m", "m"), ("force_N", "N"), ("viscous_damping", "linear_stiffness"), (100.0, 800.0)
    ),
    "drive": Layout("drive", ("force_N", "N"), ("position_m", "m"), ("viscous_damping",)),
    "servo": Layout("drive", ("reference_m", "m"), ("position_m", "m"), ("viscous_damping",), (2e4, 2e5)),
}


@dataclass(frozen=True)
class Body(Subject):
    """A body with one coordinate and its recordings.

    Attributes
    ----------
    laws : Laws
        Mechanics that the rig file declares, and nothing else.
    mass : float
        Force per acceleration, for a bench.
    frequency : float
        Angular frequency that is typical of the motion [rad/s].
    reach, speed, force : float
        Largest deflection, speed, and acceleration by what moves the body, in the training recordings.
    waves : tuple of Waves or None
        Input of each recording.
    release : tuple of float
        Deflection at which each recording begins.
    time : (n,) array
        Samples [s].
    every : int
        Steps between two samples.
    """

    system: str
    laws: Laws
    mass: float
    frequency: float
    reach: float
    speed: float
    force: float
    waves: tuple[Waves | None, ...]
    release: tuple[float, ...]
    time: FloatArray
    every: int
    noise: float
    seed: tuple[int, ...]
    stems: tuple[str, ...]

    @property
    def layout(self) -> Layout:
        """Columns of the recordings."""
        return BODIES[self.system]

    @property
    def unit(self) -> str:
        """Unit of the output."""
        return self.layout.output[1]

    @property
    def duration(self) -> float:
        """Length of a recording [s]."""
        return float(self.time[-1])

    def place(self, share: float) -> float:
        """Deflection that lies at a share of the way from the least to the largest one of the first recording."""
        waves = self.waves[0]
        given = self.system == "bench" and waves is not None
        path = waves(self.time) if given else self.motion("train", [])[:, 0]
        return float(path.min() + share * np.ptp(path))

    def motion(self, stem: str, actions: Sequence[Action]) -> FloatArray:
        """States (n, 6) of one recording, or the force (n,) that a given motion takes, over the mass."""
        place = self.stems.index(stem)
        waves = self.waves[place]
        laws = _joined(self.laws, actions)
        fine = np.linspace(0.0, self.duration, self.every * (self.time.size - 1) + 1)
        step = fine[1] - fine[0]
        stages = fine[:-1, None] + step * np.array([0.0, 0.5, 1.0])
        inputs = np.zeros((*stages.shape, len(INPUTS)))
        inputs[..., 2] = 1.0
        for action in actions:
            inputs[..., 1] += 0.0 if action.push is None else action.push(stages)
            inputs[..., 2] *= 1.0 if action.inertia is None else action.inertia(stages)
        if self.system == "bench":
            assert waves is not None
            path = np.stack(waves.motion(stages), axis=-1)
            return follow(laws, fine, path, inputs, self.every)
        inputs[..., 0] = 0.0 if waves is None else waves(stages)
        first = np.zeros(len(STATES))
        first[0] = self.release[place]
        return integrate(laws, first, fine, inputs, self.every)

    def readings(self, stem: str, actions: Sequence[Action]) -> Readings:
        """Simulate one recording, free of scatter."""
        moved = self.motion(stem, actions)
        value = self.mass * moved if self.system == "bench" else moved[:, 0]
        if not np.isfinite(value).all():
            raise ArithmeticError("the motion grew beyond all bounds")
        reach = float(np.abs(value).max())
        late = self.time
        for action in actions:
            late = late if action.late is None else late + action.late(self.time) - self.time
        if late is not self.time:
            value = CubicSpline(self.time, value)(np.clip(late, 0.0, self.duration))
        table = value[:, None]
        for action in actions:
            table = table if action.optics is None else action.optics(self.time, table)
        waves = self.waves[self.stems.index(stem)]
        inputs = {} if waves is None or self.layout.input is None else {self.layout.input[0]: waves(self.time)}
        return Readings(self.time, inputs, {self.layout.output[0]: table[:, 0]}, reach)

    def rig_file(self, name: str) -> str:
        """Text of the rig file."""
        kind = self.layout
        lines = [f'name = "{name}"', f'kind = "{kind.kind}"', "", "[columns]", 'time = { name = "time_s", unit = "s" }']
        if kind.input:
            lines.append(f'input = {{ name = "{kind.input[0]}", unit = "{kind.input[1]}" }}')
        lines.append(f'output = {{ name = "{kind.output[0]}", unit = "{kind.output[1]}", noise = {self.noise:.6g} }}')
        if self.system == "bench":
            swings = self.frequency / (2 * np.pi)
            lines += ["", "[view]", 'output = "force"']
            lines += [f"motion_cutoff_hz = {25 * swings:.4g}", f"cutoff_hz = {12 * swings:.4g}"]
        if self.system == "servo":
            lines += ["", "[controller]", f"kp = {self.laws.k_p:.9g}", f"kv = {self.laws.k_v:.9g}"]
        names = ", ".join(f'"{e}"' for e in kind.declared)
        return "\n".join([*lines, "", "[model]", f"effects = [{names}]", ""])

    def starts(self) -> dict[str, float]:
        """Values of the declared parameters."""
        own = {"xi": self.laws.viscous}
        if self.laws.linear:
            own["alpha"] = self.laws.linear
        if self.laws.gravity:
            own |= {"g_c": self.laws.gravity, "g_s": 0.0}
        if self.system == "bench":
            own["m"] = self.mass
        elif self.layout.input:
            own["g"] = self.laws.gain
        return own

    def effects(self, kind: str) -> tuple[str, ...]:
        """Effects that may be hidden, or outsiders."""
        return body_effects.names(self.system, kind)

    def effect(self, name: str, rng: Generator) -> Ingredient:
        """Draw an effect or an outsider but for its strength."""
        return body_effects.draw(name, self, rng)

    def errors(self) -> tuple[str, ...]:
        """Errors of the model that the body may have."""
        return body_errors.names(self.system)

    def error(self, name: str, rng: Generator) -> Ingredient:
        """Draw an error of the model but for its strength."""
        return body_errors.draw(name, self, rng)

    def describe(self) -> Mapping[str, object]:
        """What else the sealed truth holds."""
        own = {k: v for k, v in self.laws._asdict().items() if v != Laws._field_defaults[k]}
        return {"laws": own, "mass": self.mass, "frequency": self.frequency, "reach": self.reach}


def _joined(laws: Laws, actions: Sequence[Action]) -> Laws:
    """Return laws with those of the actions; a coefficient that is there already is added to.

    What adds up are the declared spring and friction; every other coefficient has one owner.
    """
    found = laws._asdict()
    for action in actions:
        for name, value in action.laws.items():
            shared = name in ("linear", "viscous") and found[name]
            found[name] = found[name] + value if shared else value
    return Laws(**found)


def _times(rng: Generator, frequency: float, periods: float, rate: float) -> tuple[FloatArray, int]:
    """Samples of so many periods, about `rate` in each, and the steps between two."""
    step = float(f"{2 * np.pi / frequency / rate:.3g}")
    return np.arange(round(periods * 2 * np.pi / frequency / step) + 1) * step, int(np.ceil(STEPS / rate))


def _laws(system: str, rng: Generator, frequency: float) -> Laws:
    """Draw the declared mechanics."""
    gain, square = 1 / log_uniform(rng, 0.1, 5.0), frequency**2
    loss = 2 * frequency * log_uniform(rng, 0.004, 0.03)
    match system:
        case "oscillator" | "bench":
            return Laws(gain=gain, viscous=loss, linear=square)
        case "decay":
            return Laws(viscous=loss, linear=square)
        case "pendulum":
            return Laws(viscous=0.5 * loss, gravity=square)
        case "drive":
            return Laws(gain=gain, viscous=frequency * rng.uniform(0.2, 1.0))
    quick = frequency * rng.uniform(15.0, 30.0)
    k_p = float(f"{frequency * rng.uniform(4.0, 8.0):.4g}")
    return Laws(gain=gain, viscous=frequency * rng.uniform(0.2, 1.0), k_p=k_p, k_v=float(f"{quick / gain:.4g}"))


def _inputs(system: str, rng: Generator, frequency: float, count: int) -> tuple[Waves | None, ...]:
    """Draw the input of each recording, of about unit size."""
    spans = {"oscillator": (0.2, 2.0), "bench": (0.15, 1.2), "drive": (0.15, 1.5), "servo": (0.1, 1.0)}
    if system not in spans:
        return (None,) * count
    low, high = (frequency * s for s in spans[system])
    return tuple(draw_waves(rng, low, high, int(rng.integers(8, 16)), 4 / frequency) for _ in range(count))


def _periods(system: str, rng: Generator, laws: Laws, frequency: float) -> float:
    """Draw the length of a recording; a decay is followed to about a tenth."""
    if system in ("decay", "pendulum"):
        return float(np.clip(rng.uniform(1.5, 2.5) / (np.pi * laws.viscous / frequency), 12.0, 40.0))
    return float(rng.uniform(20.0, 40.0))


def draw_body(system: str, seed: Sequence[int]) -> Body:
    """Draw a body and its motions from a seed of its own; the same seed gives the same body.

    Parameters
    ----------
    system : str
        Key of `BODIES`.
    seed : sequence of int
        Seed.
    """
    rng = np.random.default_rng(seed)
    frequency = 2 * np.pi * log_uniform(rng, 0.4, 3.0)
    laws = _laws(system, rng, frequency)
    reach = rng.uniform(0.3, 1.2) if system == "pendulum" else log_uniform(rng, 0.01, 0.2)
    stems = ("train", "train_2", "holdout") if rng.random() < 0.3 else ("train", "holdout")
    scales = (1.0, *rng.uniform(0.6, 0.9, len(stems) - 2), rng.uniform(0.65, 1.1))
    time, every = _times(rng, frequency, _periods(system, rng, laws, frequency), 100 if system == "bench" else 36)
    free = system in ("decay", "pendulum")
    body = Body(
        system, laws, log_uniform(rng, 0.1, 5.0), frequency, 1.0, 1.0, 1.0,
        _inputs(system, rng, frequency, len(stems)), tuple(free * reach * s for s in scales), time, every, 1.0,
        tuple(seed), stems,
    )  # fmt: skip
    body = replace(body, waves=_sized(body, reach, scales))
    measured = _measured(body)
    output = body.mass * measured[2] if system == "bench" else measured[0]
    noise = float(f"{output / log_uniform(rng, *body.layout.clearness):.3g}")
    return replace(body, reach=measured[0], speed=measured[1], force=measured[2], noise=noise)


def _sized(body: Body, reach: float, scales: Sequence[float]) -> tuple[Waves | None, ...]:
    """Return the inputs at which each recording reaches as far as wanted: the declared mechanics are linear."""
    found: list[Waves | None] = []
    for stem, waves, scale in zip(body.stems, body.waves, scales, strict=True):
        if waves is not None:
            path = waves(body.time) if body.system == "bench" else body.motion(stem, [])[:, 0]
            waves = waves.scaled(float(scale * reach / np.abs(path).max()))
        found.append(waves)
    return tuple(found)


def _measured(body: Body) -> tuple[float, float, float]:
    """Largest deflection, speed and acceleration in the first recording."""
    waves = body.waves[0]
    if body.system == "bench":
        assert waves is not None
        path, rate, _ = waves.motion(body.time)
        return float(np.abs(path).max()), float(np.abs(rate).max()), float(np.abs(body.motion("train", [])).max())
    state = body.motion("train", [])
    push = np.gradient(state[:, 1], body.time)
    springs = body.laws.linear + body.laws.gravity
    force = springs * np.abs(state[:, 0]).max() if springs else np.abs(push).max()
    return float(np.abs(state[:, 0]).max()), float(np.abs(state[:, 1]).max()), float(force)
