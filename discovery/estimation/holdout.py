"""Held-out data: they decide and judge, and nothing of them is fitted but initial states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit
from discovery.estimation.held_simulators import HeldSimulators
from discovery.estimation.held_states import held_out
from discovery.estimation.model_error import Channel
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.residual import errors
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.recordings.experiment import Experiment, largest_deflection
from discovery.recordings.parts import MOVES, motion_over_noise, two_thirds

#: What held-out recordings are called that were given as such.
SEPARATE = "separate recordings"
#: Readings so many times their noise, and derivatives, are those of a motion that blows up.
_WILD = 1e100


@dataclass(frozen=True)
class Constant:
    """What a constant leaves of a recording: one column a channel [noise sds]."""

    whole: list[Channel]  # of all of it: the end of a motion may scatter little
    held: list[Channel]  # of what is held out
    share: float  # of the readings that are held out

    def unless_finite(self, held: list[Channel], p: int) -> list[Channel]:
        """Return what is left of a recording; where the motion blows up, what the constant leaves, whatever the p."""
        if all_finite(held):
            return held
        return [replace(c, columns=np.insert(c.columns, [0] * p, 0.0, axis=1)) for c in self.held]


def all_finite(channels: Sequence[Channel]) -> bool:
    """Return whether no channel has a reading that is not finite, nor one whose square would not be."""
    with np.errstate(invalid="ignore"):
        return all((np.abs(c.columns) < _WILD).all() for c in channels)


class HoldOut:
    """Recordings, or parts of them, that decide and judge but are never fitted."""

    def __init__(
        self, train: Sequence[Experiment], separate: Sequence[Experiment], units: NaturalUnits, tolerance: float
    ) -> None:
        self.train, self.separate, self.units = train, separate, units
        self.continued = not separate
        reach = largest_deflection(train)
        self.inside = [largest_deflection([e]) <= 1.05 * reach for e in separate]
        inside = [i for i, within in enumerate(self.inside) if within] or range(len(separate))
        self._deciding = {i: separate[i].fitted_part for i in inside}
        self._simulators = HeldSimulators(separate, units, tolerance)

    @property
    def holds(self) -> bool:
        """Whether anything is held out."""
        return bool(self.separate) or any(e.fitted_samples is not None for e in self.train)

    @property
    def kind(self) -> str:
        """How the held-out data relate to the fitted ones."""
        if not self.continued:
            return SEPARATE
        whole = all(e.fitted_samples == two_thirds(e.recording.time.size) for e in self.train)
        return f"last third {'' if whole else 'of the motion '}of each training recording, continued"

    @cached_property
    def motion(self) -> float:
        """The largest scatter of a stretch of what is held out [noise sds]: how much it can tell."""
        first = (e.fitted_samples or 0 if self.continued else 0 for e in self.experiments)
        return max(map(motion_over_noise, (e.recording for e in self.experiments), first), default=0.0)

    def asked(self, share: float) -> float:
        """Return the share of the nats asked of what is held out; an end that does not move tells chance, and noise."""
        asked = share if not self.continued or self.motion >= MOVES else -1.0
        return asked if self.holds else -np.inf

    def predictions(
        self, bench: Bench, models: Sequence[tuple[Model, Mapping[str, float], list[FloatArray]]]
    ) -> list[list[FloatArray]]:
        """Return the predictions of the held-out recordings by each model (model, values, training predictions)."""
        if self.continued:
            return [on_train for _, _, on_train in models]
        sets = [(model, values) for model, values, _ in models]
        return held_out(sets, self.simulators(bench, sets, self.separate), self.units)

    def simulators(
        self, bench: Bench, models: Sequence[tuple[Model, Mapping[str, float]]], experiments: Sequence[Experiment]
    ) -> Bench:
        """Return simulators of held-out recordings for models on a bench, see `HeldSimulators.of`."""
        return self._simulators.of(bench, models, experiments)

    @property
    def experiments(self) -> Sequence[Experiment]:
        """Recordings that `predictions` refers to."""
        return self.train if self.continued else self.separate

    @property
    def noise_floor(self) -> float:
        """Rms error that a perfect model leaves of the held-out recordings, in the unit of the output.

        It holds what errors of the time stamps add.
        """
        recordings = [e.recording for e in self.experiments]
        variances = [r.noise_floor(np.isfinite(o)) ** 2 for r, o in zip(recordings, self.outputs(), strict=True)]
        return float(np.sqrt(np.average(variances, weights=[r.time.size for r in recordings])))

    def outputs(self) -> list[FloatArray]:
        """Return measured outputs, without what is read beside them, NaN where a sample was fitted."""
        found = []
        for e in self.experiments:
            out = e.recording.judged_output.copy()
            if self.continued:
                out[e.fitted] = np.nan
            found.append(out)
        return found

    def deciding(self) -> list[Experiment]:
        """Return the separate recordings that decide, as far as they move.

        They are those inside the trained deflection, or all where none is.
        """
        return list(self._deciding.values())

    @cached_property
    def parts(self) -> list[tuple[Experiment, BoolArray]]:
        """Return the recordings that decide, and which of their readings (n, c) do, none of some perhaps."""
        some = self.train if self.continued else self.deciding()
        return [(e, np.isfinite(e.recording.output) & ~(self.continued & (e.weights() > 0))) for e in some]

    @cached_property
    def places(self) -> list[tuple[int, BoolArray]]:
        """Return the numbers of the `parts` with readings that decide, and which of their readings do."""
        return [(i, present) for i, (_, present) in enumerate(self.parts) if present.any()]

    @cached_property
    def constants(self) -> list[Constant]:
        """Return what the mean of what is known leaves of every recording with readings that decide.

        Its own mean would tell the level that a separate recording holds.
        """
        known, found = np.concatenate([e.recording.output for e in self.train]), []
        for i, present in self.places:
            read = self.parts[i][0].recording
            level, whole = np.nanmean(read.output if self.continued else known, axis=0), np.isfinite(read.output)
            apart = ((read.output - level) / read.scatter)[:, :, None]
            every, held = (Channel.each(read.time, apart, part) for part in (whole, present))
            found.append(Constant(every, held, float(present.sum() / whole.sum())))
        return found

    @property
    def scatter(self) -> float:
        """Rms distance of the recordings that decide from the mean of each, in the unit of the output."""
        deciding = [e.recording.judged_output for e, present in self.parts if present.any()]
        whole = [output[np.isfinite(output).all(axis=1)] for output in deciding]
        squares = [np.square(part - part.mean(axis=0)).sum(axis=1) for part in whole if part.size]
        return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else float("nan")

    def held(self, fit: Fit, on_train: list[FloatArray]) -> list[FloatArray]:
        """Return a fit's predictions of the held-out recordings, from those of the training recordings."""
        return self.predictions(fit.problem.bench, [(fit.model, fit.values, on_train)])[0]

    def errors(self, predictions: Sequence[FloatArray]) -> dict[str, dict[str, float]]:
        """Return errors over all held-out recordings, and apart inside and outside the trained deflection.

        Where a free motion comes to rest, they are told apart for what decides, as far as it moves.
        """
        pairs = list(zip(predictions, self.outputs(), strict=True))

        def pooled(some: Sequence[tuple[FloatArray, FloatArray]]) -> dict[str, float]:
            return errors(*(np.concatenate(each) for each in zip(*some, strict=True)))

        result = {"holdout": pooled(pairs)}
        for place, sought in (("inside", True), ("outside", False)):
            if some := [pair for pair, within in zip(pairs, self.inside, strict=False) if within is sought]:
                result[f"holdout_{place}"] = pooled(some)
        moving = {i: e.recording.time.size for i, e in self._deciding.items()}
        if any(n < len(pairs[i][1]) for i, n in moving.items()):
            result["holdout_moving"] = pooled([(pairs[i][0][:n], pairs[i][1][:n]) for i, n in moving.items()])
        return result
