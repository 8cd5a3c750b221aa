"""What every part of one search shares: recordings, settings, simulators, and the effects in question."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discovery.declarations.forces import SmoothForce
from discovery.equations.lacking import candidates, eventual_candidates
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.holdout import HoldOut
from discovery.estimation.log_evidence import constant_score
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem, conventions
from discovery.estimation.step_control import affordable_bench, unequal_bench
from discovery.foundation.progress import Tell
from discovery.recordings.experiment import Experiment
from discovery.recordings.parts import course
from discovery.selection.settings import LoopSettings

#: Seven tenths of the prior of the model error lie below so many times its scale: what is there counts as none.
_CREDIBLE = 2.0


@dataclass(frozen=True)
class Context:
    """What every part of one search shares.

    Parameters
    ----------
    train : sequence of Experiment
        Recordings to fit.
    judge : HoldOut
        Recordings, or parts of them, that are held out.
    settings : LoopSettings
        The numbers that decide, and the budget.
    units : NaturalUnits
        Natural units.
    progress : callable
        Receives one sentence before every longer piece of work.
    """

    train: Sequence[Experiment]
    judge: HoldOut
    settings: LoopSettings
    units: NaturalUnits
    progress: Tell

    @cached_property
    def constant_scores(self) -> list[float]:
        """Return how well a constant predicts each recording that is held out [nats]."""
        time, scale = self.units.time, self.settings.error_scale
        return [c.share * constant_score(c.whole, time, scale) for c in self.judge.constants]

    @cached_property
    def period(self) -> float:
        """Natural period of the motion [s]."""
        return 2 * np.pi * self.units.time

    def candidates(self, model: Model, *, which: Callable[..., tuple[str, ...]] = candidates) -> tuple[str, ...]:
        """Return the effects that a model of these recordings could lack."""
        first = self.train[0]
        return which(model, first.coordinate_unit, first.rig.declared, **course(self.train))

    def kernel_effects(self, model: Model) -> tuple[str, ...]:
        """Return every effect that may come into question on the base, also where what was added is taken out."""
        ever = self.candidates(model.without(self.added(model)), which=eventual_candidates)
        return tuple(sorted({*model.effects, *ever, SmoothForce.id()}))

    def added(self, model: Model) -> tuple[str, ...]:
        """Return the effects of a model that are not declared."""
        return tuple(e for e in model.effects if e not in self.train[0].rig.declared)

    def freed(self, problem: Problem) -> Problem:
        """Return a problem with what its added effects hold by convention free, see `estimation.problem`."""
        return replace(problem, gaussian={**problem.gaussian, **conventions(self.added(problem.model), self.units)})

    def stated_error(self, model: Model) -> float:
        """Return the error that mechanics state of themselves, over the smallest noise of any channel [noise sds]."""
        read = [both for e in self.train for both in zip(e.recording.units, e.recording.noise, strict=True)]
        sizes = (model.mechanics.accuracy * (1.0 if unit == "rad" else self.units.length) / sd for unit, sd in read)
        return float(max(sizes))

    def least_error(self, model: Model) -> float:
        """Return the model error up to which a model counts as complete [noise sds]."""
        return max(_CREDIBLE * self.settings.error_scale, self.stated_error(model))

    def bench(self, model: Model, values: Mapping[str, float]) -> Bench:
        """Return simulators with the whole catalogue of a base, on steps that keep the tolerance at some values."""
        effects, tolerance = self.kernel_effects(model), self.settings.tolerance
        return unequal_bench(model, effects, self.train, self.units, values, tolerance)

    def bench_on(self, base: str, like: Bench, model: Model, values: Mapping[str, float]) -> Bench | None:
        """Return simulators on other mechanics; None where they do not keep the tolerance at a bounded cost."""
        other, tolerance = model.on_base(base), self.settings.tolerance
        effects = self.kernel_effects(other)
        return affordable_bench(other, effects, self.train, self.units, values, tolerance=tolerance, like=like)

    def fit(self, model: Model, values: Mapping[str, float], gaussian: Mapping[str, tuple[float, float]]) -> Fit:
        """Fit a model with the kernel that holds the whole catalogue of its base."""
        bench = self.bench(model, values)
        values = {n: v for n, v in values.items() if n in model.parameters or n.endswith("]")}
        return fit(model, self.train, start=values, bench=bench, units=self.units, gaussian=gaussian)
