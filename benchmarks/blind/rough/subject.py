"""The system of a rough case: what it is, and how its recordings are made with any ingredients."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.blind.rough.ingredient import Action, Ingredient, Readings


class Subject(ABC):
    """A system with its manoeuvres.

    Attributes
    ----------
    system : str
        "arm", or the kind of body.
    noise : float
        White noise of a reading [unit of the output].
    unit : str
        Unit of the output.
    seed : tuple of int
        Of the scatter, so that an ingredient's random part is the same at every strength.
    stems : tuple of str
        Names of the recordings, the hold-out last.
    """

    system: str
    unit: str
    seed: tuple[int, ...]

    @abstractmethod
    def rig_file(self, name: str) -> str:
        """Text of the rig file."""

    @abstractmethod
    def readings(self, stem: str, actions: Sequence[Action]) -> Readings:
        """Simulate one recording, free of scatter."""

    @abstractmethod
    def starts(self) -> dict[str, float]:
        """Values of the declared parameters, where a refit begins."""

    def known(self) -> dict[str, float]:
        """What the refit need not find."""
        return {}

    @abstractmethod
    def effects(self, kind: str) -> tuple[str, ...]:
        """Effects that may be hidden, or outsiders."""

    @abstractmethod
    def effect(self, name: str, rng: np.random.Generator) -> Ingredient:
        """Draw an effect or an outsider but for its strength."""

    @abstractmethod
    def errors(self) -> tuple[str, ...]:
        """Errors of the model that the system may have."""

    @abstractmethod
    def error(self, name: str, rng: np.random.Generator) -> Ingredient:
        """Draw an error of the model but for its strength."""

    @abstractmethod
    def describe(self) -> Mapping[str, object]:
        """What else the sealed truth holds."""

    def frame(
        self, stem: str, actions: Mapping[str, Action], *, noise: bool = False, scatter: bool = True
    ) -> pd.DataFrame:
        """Recording with the scatter of the ingredients, with or without the white noise.

        Each ingredient, by its name, and the noise have random numbers of their own in each recording.
        """
        motion = self.readings(stem, list(actions.values()))
        table = np.column_stack(list(motion.outputs.values()))
        place = 1 + self.stems.index(stem)
        for name, action in actions.items():
            if scatter and action.scatter is not None:
                source = np.random.default_rng([*self.seed, place, *name.encode()])
                table = action.scatter(motion.time, table, source)
        if noise:
            table = table + self.noise * np.random.default_rng([*self.seed, place]).standard_normal(table.shape)
        inputs = {k: self.measured(v, place) if noise else v for k, v in motion.inputs.items()}
        outputs = dict(zip(motion.outputs, table.T, strict=True))
        return pd.DataFrame({"time_s": motion.time, **inputs, **outputs})

    def measured(self, values: np.ndarray, place: int) -> np.ndarray:
        """Input as the recorder has it."""
        return values

    def write(self, folder: Path, name: str, actions: Mapping[str, Action], *, noise: bool) -> list[Path]:
        """Write the rig file and all recordings, and return the paths of the training ones."""
        (folder / "rig.toml").write_text(self.rig_file(name), encoding="utf-8")
        for stem in self.stems:
            # The hold-out has no part in a size.
            if noise or stem != "holdout":
                save(self.frame(stem, actions, noise=noise), folder / f"{stem}.csv")
        return [folder / f"{stem}.csv" for stem in self.stems if stem != "holdout"]


def save(frame: pd.DataFrame, path: Path) -> None:
    """Write a recording with nine digits."""
    frame.to_csv(path, index=False, float_format="%.9g", lineterminator="\n")
