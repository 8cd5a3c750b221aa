"""Residuals of fitted sets and their derivatives, on training and held-out recordings, all sets in one simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discovery.estimation.bench import Bench
from discovery.estimation.chatter import clear_of_chatter
from discovery.estimation.covariance import Probed, simulated
from discovery.estimation.held_motion import HeldMotion, held_motions
from discovery.estimation.holdout import all_finite
from discovery.estimation.laplace import belief_of
from discovery.estimation.linear_problem import Linearised
from discovery.estimation.model_error import Channel
from discovery.foundation.arrays import FloatArray
from discovery.screening.refits import Refit
from discovery.selection.context import Context

#: Differences are taken over so many standard deviations that the white noise alone would leave.
_APART = 0.3


@dataclass(frozen=True)
class Slopes:
    """A set linearised around its estimate."""

    problem: Linearised  # what its evidence is made of
    jacobian: FloatArray  # (rows of the bench, p): derivatives on the fitted samples [noise sds], zero in gaps


def linearised(context: Context, bench: Bench, refits: Sequence[Refit]) -> list[Slopes | None]:
    """Return refits of one bench, all with finite residuals, linearised; None for what blows up."""
    if not refits:
        return []
    problems, points = [r.problem for r in refits], [r.minimum.x for r in refits]
    with np.errstate(over="ignore", invalid="ignore"):
        sizes, train = clear_of_chatter(bench, problems, points, [_sizes(r) for r in refits])
        motions, held = held_motions(context.judge, bench, problems, points, sizes), train
        if not context.judge.continued:
            probes = [Probed.around(m.problem, m.point, m.size) for m in motions]
            held = simulated(motions[0].problem.bench, [m.problem for m in motions], probes)
        return [_slopes(context, *own) for own in zip(refits, train, motions, held, strict=True)]


def _sizes(refit: Refit) -> FloatArray:
    """Return by how much every parameter of a refit is moved."""
    scale = refit.problem.scale
    slope = np.linalg.norm(refit.minimum.jacobian, axis=0)
    return np.clip(_APART / np.maximum(slope, 1e-300), 1e-9 * scale, 1e-2 * scale)


def _slopes(
    context: Context, refit: Refit, train: list[FloatArray], motion: HeldMotion, held: list[FloatArray]
) -> Slopes | None:
    problem, x, judge = refit.problem, refit.minimum.x, context.judge
    more = [] if judge.continued else [s.width for s in motion.problem.states]
    p = x.size
    jacobian: list[FloatArray] = []
    fitted: list[Channel] = []
    for e, columns in zip(problem.bench.experiments, train, strict=True):
        weight, n = e.weights() > 0, len(e.fitted_part.recording.time)
        jacobian.append(np.where(weight[:n, :, None], columns[:n, :, :-1], 0.0).reshape(-1, p))
        fitted += Channel.each(e.recording.time, np.insert(columns, [p] * len(more), 0.0, axis=2), weight)
    if not all_finite(fitted):
        return None
    parts = (motion.placed(*place, held[place[0]], p + len(more)) for place in motion.parts)
    judged = [c.unless_finite(part, p + len(more)) for part, c in zip(parts, judge.constants, strict=True)]
    belief = belief_of(problem, x, refit.minimum.at_bound, more)
    scale, stated = context.settings.error_scale, context.stated_error(problem.model)
    form, time = context.settings.form_of(problem.model), context.units.time
    linear = Linearised(fitted, judged, belief, p, time, scale, stated, form, context.constant_scores, motion)
    return Slopes(linear, np.concatenate(jacobian))
