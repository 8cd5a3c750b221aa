"""Instruments: which readings share one noise, and what is stated of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from discovery.recordings.experiment import Experiment


@dataclass(frozen=True)
class Instrument:
    """Readings that share one noise factor: those of recordings with the same channels.

    `name` is that of the noise parameter, ``"sigma"``, or ``"sigma[tip_angle]"`` where there are several instruments.
    It made the `n` readings of `experiments`. `noise` is the stated standard deviation of a reading in `unit`; 1 where
    the channels or recordings differ, and the parameter is a factor. `log_weights` sums log(1/noise) over all readings.
    """

    name: str
    experiments: tuple[int, ...]
    n: int
    noise: float
    unit: str
    log_weights: float

    def named(self, quantity: str) -> str:
        """Return the name of another quantity of this instrument's noise: as `name`, with another symbol."""
        return quantity + self.name.removeprefix("sigma")


def noise_names(channels: Sequence[str]) -> tuple[str, str]:
    """Return the names that the noise of these channels may have: one of several instruments, or the only one."""
    return f"sigma[{'+'.join(channels)}]", "sigma"


def instruments(experiments: Sequence[Experiment]) -> tuple[Instrument, ...]:
    """Return the instruments of experiments, in order of appearance."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for i, experiment in enumerate(experiments):
        groups.setdefault(experiment.recording.channels, []).append(i)
    found = []
    for channels, members in groups.items():
        weights = np.concatenate([experiments[i].weights().ravel() for i in members])
        weights = weights[weights > 0]
        noise = np.concatenate([experiments[i].recording.noise for i in members])
        units = {unit for i in members for unit in experiments[i].recording.units}
        common = len(units) == 1 and bool(np.allclose(noise, noise[0], rtol=1e-9, atol=0.0))
        found.append(
            Instrument(
                name=noise_names(channels)[len(groups) == 1],
                experiments=tuple(members),
                n=weights.size,
                noise=float(noise[0]) if common else 1.0,
                unit=units.pop() if common else "1",
                log_weights=float(np.log(weights).sum()),
            )
        )
    return tuple(found)
