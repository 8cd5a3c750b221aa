"""Whether a set of effects explains enough more than a smaller one to take its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discovery.case import Case
from discovery.covariance import covariance_of
from discovery.node import Node
from discovery.registry import catalogue
from discovery.simplicity import imitates

__all__ = ["Verdict", "determined", "is_needed", "weigh"]


@dataclass(frozen=True)
class Verdict:
    """Whether effects join, why, and the numbers behind it."""

    accepted: bool
    reason: str
    numbers: Mapping[str, float]


def weigh(
    case: Case,
    root: Node,
    smaller: Node,
    larger: Node,
    new: tuple[str, ...],
    chance: NDArray[np.float64] | None,
    *,
    strict: bool = False,
) -> Verdict:
    """Decide whether effects explain enough of both the training and the held-out recordings.

    Parameters
    ----------
    case : Case
        Thresholds.
    root, smaller, larger : Node
        The model without any added effect, the set so far, and the set with the new effects.
    new : tuple of str
        What the larger set has more.
    chance : ndarray or None
        Sorted gains that noise alone would give the best candidate, from `discovery.significance.chance_gains`.
    strict : bool
        Each of several effects must explain most of what the others leave.
    """
    s = case.settings
    gain, held_gain = smaller.chi2 - larger.chi2, smaller.held - larger.held
    excess, held_excess = case.excess(smaller.chi2), case.held_excess(smaller.held)
    least = s.least_gain if chance is None else max(s.least_gain, float(np.quantile(chance, 0.99)))
    # What is noise by the verdict already may be the base's own error: only what explains most of it is an effect, and
    # more than the laws before it may idealise.
    noise = smaller.held_rough <= s.limit(root.held_rough) and smaller.rough <= s.limit(root.rough)
    if noise:
        least = max(least, case.form(smaller.refit.problem.model) * (case.excess(root.chi2) - excess))
    if any(map(imitates, new)):
        # An explained residual may keep so much of its power: a law that imitates others must not live on that.
        least = max(least, s.relative_floor**2 * (case.excess(root.chi2) - excess))
    # In the company of a law that imitates others, every effect must explain most of what is left.
    company = len(larger.added) > 1 and any(map(imitates, larger.added))
    share = s.pair_share if noise or strict or company or len(new) > 1 else s.least_share
    if strict and not company and larger.held_rough > s.limit(root.held_rough):
        # Where something unknown is left, nothing explains most of what the others leave.
        share = s.kept_share
    blows_up = not np.isfinite(smaller.held)
    cured = blows_up and bool(np.isfinite(larger.held))
    if strict and (cured or held_gain > share * held_excess > 0):
        # It is needed to predict, however little it shows in training.
        share = s.least_share
    passes = {
        f"it removes {gain:.0f} of {excess:.0f} excess chi-square in training (required: at least {least:.0f})": gain
        > max(least, share * excess),
    }
    if blows_up:
        passes["without it the motion blows up on the held-out ones"] = cured
    else:
        told = f"it removes {held_gain:.0f} of {held_excess:.0f} on the held-out ones"
        passes[told] = held_gain > max(0.25 * s.least_gain, 0.5 * share * held_excess)
    # What has joined is judged by what its removal costs, however its amplitudes trade with what joined later.
    vague = [name for name in new if not strict and not determined(larger, name)]
    if vague:
        passes[f"no parameter of {' and '.join(vague)} is determined"] = False
    accepted = all(passes.values())
    failed = [reason for reason, passed in passes.items() if not passed]
    return Verdict(
        accepted,
        "; ".join(passes) if accepted else "not enough: " + "; ".join(failed),
        {
            "chi2_before": smaller.chi2,
            "chi2_after": larger.chi2,
            "n_data": float(larger.refit.problem.bench.n_data),
            "chi2_holdout_before": smaller.held,
            "chi2_holdout_after": larger.held,
            "n_holdout": float(case.n_held),
        },
    )


def is_needed(case: Case, root: Node, simpler: Node, richer: Node) -> bool:
    """Return whether a richer law removes more than a simpler one by what is asked of an effect, fitted or held out."""
    s = case.settings
    removed = case.excess(root.chi2) - case.excess(simpler.chi2)
    least = max(s.least_gain, case.form(simpler.refit.problem.model) * removed)
    return simpler.chi2 - richer.chi2 > least or simpler.held - richer.held > 0.25 * s.least_gain


def determined(node: Node, name: str) -> bool:
    """Return whether at least one amplitude of an effect is three standard deviations from zero."""
    problem, minimum = node.refit.problem, node.refit.minimum
    covariance, _, _ = covariance_of(problem, minimum)
    amplitudes = [p.name for p in catalogue()[name].parameters() if not p.shape]
    where = [problem.names.index(n) for n in amplitudes if n in problem.names]
    with np.errstate(invalid="ignore"):
        return any(abs(minimum.x[i]) > 3 * np.sqrt(covariance[i, i]) for i in where)
