"""Weigh an unknown force, smooth in position and rate, as one more candidate.

Beside it a named law can only be cheaper: its few constants replace many coefficients. Laws that are right do not
always gain beside it, such as a drag whose rest depends on the position. So the force takes no law out; it is told with
it, and it is the lead where it explains more than what could not be named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discovery.declarations.forces import SmoothForce
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.problem import Problem
from discovery.screening.refits import Refit
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context

#: Sizes of the force that are tried, each as likely as another [natural accelerations].
SIZES = (0.01, 0.1, 1.0)
_ITERATIONS = 10


@dataclass(frozen=True)
class Unknown:
    """What an unknown force explains beside a set of effects [nats]."""

    train: float  # what it gains beside the set in training
    held: float  # and on what is held out
    kept: dict[str, float]  # log odds of each added effect beside the force, if that alone does not blow up
    instead: dict[str, float]  # log odds of the force in the place of each of these, against the set as it is


def unknown_force(context: Context, found: Contender) -> Unknown:
    """Weigh the force beside a set of effects, and in the place of each of them."""
    models = [found.model, *(found.model.without([e]) for e in found.added)]
    problems = [_with_force(found.refit.problem, model) for model in models]
    every = [p for own in problems for p in own]
    starts = [p.start(found.refit.values) for p in every]
    minima = iter(fit_problems(every, starts, iterations=_ITERATIONS, tolerance=1e-4, rough=True))
    (train, joint), *others = [_integrated(context, [Refit("", p, next(minima)) for p in own]) for own in problems]
    without = {e: other for e, (_, other) in zip(found.added, others, strict=True) if np.isfinite(other)}
    kept = {e: joint - other for e, other in without.items()}
    instead = {e: other - found.joint for e, other in without.items()}
    # What a constant predicts as well gains nothing, and no round-off.
    return Unknown(train - found.evidence.train, round(joint - train - found.evidence.held, 9), kept, instead)


def _with_force(problem: Problem, model: Model) -> list[Problem]:
    """Return a model with a force of each size; the coefficients are known about zero, within that size."""
    unit = {p.name: problem.units.scale(p) for p in SmoothForce.parameters()}
    wider = Model(model.base, (*model.effects, SmoothForce.id()), model.known)
    known = [{n: (0.0, size * scale) for n, scale in unit.items()} for size in SIZES]
    return [replace(problem, model=wider, gaussian={**problem.gaussian, **own}) for own in known]


def _integrated(context: Context, refits: Sequence[Refit]) -> tuple[float, float]:
    """Return the log evidence in training and of all recordings, the size of the force integrated [nats]."""
    found = contenders(context, [(context.added(r.problem.model), r) for r in refits])
    each = np.array([(c.evidence.train, c.joint) for c in found])
    train, joint = np.logaddexp.reduce(each, axis=0) - np.log(len(found))
    return float(train), float(joint)
