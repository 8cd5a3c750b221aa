"""Flexible arms of rough cases: rigs and manoeuvres of the exact world, with errors of the model beside the effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from discovery_datasets.arm import ArmRig, TwinError
from discovery_datasets.cases import CaseDraw, draw_case
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.hidden import FAMILIES, draw_hidden
from discovery_datasets.quick import readings
from discovery_datasets.quick_effects import PowerFriction, Taper

from benchmarks.blind.generate import ANGLE_NOISE, rig_file, rounded
from benchmarks.blind.rough.ingredient import Action, Ingredient, Readings
from benchmarks.blind.rough.instruments import INSTRUMENT_ERRORS, instrument_error
from benchmarks.blind.rough.subject import Subject
from benchmarks.blind.truth import catalogue_values

FloatArray = np.ndarray
Generator = np.random.Generator
LAWS = ("taper", "power_friction")
#: Largest delay times the frequency of small swings: the catalogue's ends at 0.3 of the motion's own.
LATEST = 0.2


@dataclass(frozen=True)
class Arm(Subject):
    """A flexible arm and its recordings.

    Attributes
    ----------
    draw : CaseDraw
        Rig, manoeuvres, times and camera.
    rig : ArmRig
        The rig as its file states it.
    """

    draw: CaseDraw
    rig: ArmRig
    seed: tuple[int, ...]
    system: str = "arm"
    unit: str = "m"

    @property
    def noise(self) -> float:
        """White noise of the camera [m]."""
        return self.draw.noise

    @property
    def duration(self) -> float:
        """Length of a recording [s]."""
        return float(self.draw.time[-1])

    @property
    def time(self) -> FloatArray:
        """Samples [s]."""
        return self.draw.time

    @property
    def stems(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return ("train", *(f"train_{i}" for i in range(2, len(self.draw.train) + 1)), "holdout")

    def rig_file(self, name: str) -> str:
        """Text of the rig file."""
        return rig_file(name, self.rig, self.noise)

    def readings(self, stem: str, actions: Sequence[Action]) -> Readings:
        """Simulate one recording, free of scatter."""
        manoeuvre = (*self.draw.train, self.draw.holdout)[self.stems.index(stem)]
        effects: list[Disturbance] = [a.disturbance for a in actions if a.disturbance is not None]
        try:
            motion = readings(self.rig, manoeuvre, self.time, disturbances=effects)
        except TwinError as error:
            raise ArithmeticError(str(error)) from error
        table = np.column_stack([motion.reading_x, motion.reading_y])
        for action in actions:
            table = table if action.optics is None else action.optics(self.time, table)
        outputs = dict(zip(("tip_x_m", "tip_y_m"), table.T, strict=True))
        reach = float(np.abs(motion.deflection).max())
        return Readings(self.time, {"motor_angle_rad": motion.motor_angle}, outputs, reach)

    def measured(self, values: FloatArray, place: int) -> FloatArray:
        """Angle of the motor as its encoder has it."""
        source = np.random.default_rng([*self.seed, place, 1])
        return values + source.uniform(-ANGLE_NOISE, ANGLE_NOISE, values.size)

    def starts(self) -> dict[str, float]:
        """Values of the declared parameters."""
        mass, length = self.rig.effective_mass, self.rig.length
        return {"alpha": 3 * self.rig.flexural_rigidity / (mass * length**3), "xi": self.rig.disc_friction / mass}

    def known(self) -> dict[str, float]:
        """What the refit need not find."""
        return {"tau_r": self.rig.retardation}

    def effects(self, kind: str) -> tuple[str, ...]:
        """Effects that may be hidden, or outsiders."""
        return tuple(n for f, names in FAMILIES.items() for n in names if (f == "outside") == (kind == "outside"))

    def effect(self, name: str, rng: Generator) -> Ingredient:
        """Draw an effect or an outsider but for its strength."""
        hidden = draw_hidden(name, self.draw.scene, rng)
        family = next(f for f, members in FAMILIES.items() if name in members)

        def values(strength: float) -> Mapping[str, float]:
            return catalogue_values(name, asdict(hidden.make(strength)), asdict(self.rig))

        shape = asdict(hidden.make(1.0))
        most = min(hidden.most, LATEST / (self.draw.scene.frequency * shape.get("delay", 1e-9)))
        return Ingredient(
            name, lambda s: Action(disturbance=hidden.make(s)), most, family, hidden.accepted,
            catalogue=values, shape=shape,
        )  # fmt: skip

    def errors(self) -> tuple[str, ...]:
        """Errors of the model that the arm may have, those of its motion first."""
        return (*LAWS, *(n for n in INSTRUMENT_ERRORS if n != "interpolation"))

    def error(self, name: str, rng: Generator) -> Ingredient:
        """Draw an error of the model but for its strength."""
        scene = self.draw.scene
        if name == "taper":
            sign = float(rng.choice([-1.0, 1.0]))
            return Ingredient(
                name, lambda s: Action(disturbance=Taper(0.03 * sign * s)), 8.0, resembles=("material_nonlinearity",),
                shape={"sign": sign},
            )  # fmt: skip
        if name == "power_friction":
            power = rng.uniform(*((0.35, 0.65), (1.35, 1.65), (2.4, 3.0))[rng.integers(3)])
            unit = 0.01 * scene.force / scene.speed**power
            like = ("coulomb_friction", "stribeck_friction") if power < 1 else ("quadratic_drag",)
            return Ingredient(
                name, lambda s: Action(disturbance=PowerFriction(unit * s, power)), 10.0, resembles=like,
                shape={"power": power},
            )  # fmt: skip
        size = self.rig.length
        return instrument_error(name, rng, size=size, noise=self.noise, frequency=scene.frequency)

    def describe(self) -> Mapping[str, object]:
        """What else the sealed truth holds."""
        return {"rig": asdict(self.rig)}


def draw_arm(seed: Sequence[int]) -> Arm:
    """Draw an arm and its manoeuvres from a seed of its own; the same seed gives the same arm."""
    draw = draw_case(seed)
    return Arm(draw, rounded(draw.scene.rig), tuple(seed))
