"""How held-out recordings move around an estimate, beyond where a linear model of their readings holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discovery.estimation.bench import Bench
from discovery.estimation.covariance import Probed
from discovery.estimation.held_states import fitted_states, known_problem
from discovery.estimation.holdout import HoldOut
from discovery.estimation.model_error import Channel
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray, IntArray

_PART = 1e-2  #: Starts are moved by this part of their scale.


@dataclass(frozen=True, eq=False)
class HeldMotion:
    """The readings that decide of held-out recordings, or of parts of those of training, and where they are asked."""

    problem: Problem  # of the whole recordings
    point: FloatArray  # (m,), what is free of it, from where steps are counted
    size: FloatArray  # (m,), by how much each is moved for derivatives
    #: Of each recording that decides: its number on the bench, and which of its readings (n, c) do.
    parts: Sequence[tuple[int, BoolArray]]
    own: IntArray  # (m,), which numbers of a step it takes

    def residuals(self, number: int, steps: FloatArray) -> list[FloatArray]:
        """Return what a recording leaves at steps (p, k): (n, k) for each of its channels [noise sds]."""
        low, high = self.problem.bounds
        points = np.clip(self.point[:, None] + steps[self.own], low[:, None], high[:, None])
        at, present = self.parts[number]
        recording = self.problem.bench.experiments[at].recording
        left = (self._read(at, points) - recording.output[:, :, None]) / recording.scatter[:, :, None]
        return [left[here, c] for c, here in enumerate(present.T) if here.any()]

    def channels(self, number: int, step: FloatArray) -> list[Channel]:
        """Return its channels linearised at a step (p,): derivatives by all of a step, then the residual."""
        at, present = self.parts[number]
        low, high = self.problem.bounds
        probe = Probed.around(self.problem, np.clip(self.point + step[self.own], low, high), self.size)
        experiment = self.problem.bench.experiments[at]
        return self.placed(at, present, probe.columns(at, experiment, self._read(at, probe.points)), step.size)

    def placed(self, at: int, present: BoolArray, columns: FloatArray, p: int) -> list[Channel]:
        """Return the channels of columns (n, c, m + 1) among those of all p numbers of a step."""
        wide = np.zeros((*columns.shape[:2], p + 1))
        wide[:, :, np.append(self.own, p)] = columns
        return Channel.each(self.problem.bench.experiments[at].recording.time, wide, present)

    def _read(self, at: int, points: FloatArray) -> FloatArray:
        bench = self.problem.bench
        (channels,) = bench.predict(*self.problem.expand(points), slice(at, at + 1))
        return channels


def held_motions(
    judge: HoldOut, bench: Bench, problems: Sequence[Problem], points: Sequence[FloatArray], sizes: Sequence[FloatArray]
) -> list[HeldMotion]:
    """Return the motions of what a `judge` holds out around fitted points of one bench, from starts of their own.

    `sizes`, each (p,): by how much what is fitted is moved for derivatives.
    """
    fitted = [*zip(problems, points, sizes, strict=True)]
    if judge.continued:
        return [HeldMotion(*each, judge.places, np.arange(each[1].size)) for each in fitted]
    values = [p.named(x) for p, x in zip(problems, points, strict=True)]
    held = judge.simulators(bench, [(p.model, v) for p, v in zip(problems, values, strict=True)], judge.deciding())
    alone = [known_problem(p.model, v, held, p.units) for p, v in zip(problems, values, strict=True)]
    found = []
    for (problem, x, size), state in zip(fitted, fitted_states(alone), strict=True):
        own, free = replace(problem, bench=held), len(problem.free)
        moved = np.concatenate([size[:free], own.scale[free:] * _PART])
        numbers = np.r_[:free, x.size : x.size + state.size]
        found.append(HeldMotion(own, np.concatenate([x[:free], state]), moved, judge.places, numbers))
    return found
