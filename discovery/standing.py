"""The evidence for one effect of a set: how much it explains, against chance and against its rivals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from discovery.branch import Branch
from discovery.case import Case
from discovery.likeness import similarity
from discovery.node import Node

__all__ = ["evidence", "rivals"]


def rivals(case: Case, branch: Branch, smaller: Node, larger: Node, effect: str) -> tuple[str, ...]:
    """Return the effects that explain as well in the place of one, however many parameters they have.

    Parameters
    ----------
    case : Case
        Thresholds.
    branch : Branch
        What the catalogue offers beside the set without the effect.
    smaller, larger : Node
        The set without the effect, and with it.
    effect : str
        Its id.
    """
    margin = case.margin(larger.chi2, smaller.chi2 - larger.chi2)
    return tuple(r.effect for r in branch.refits if r.effect != effect and r.chi2 <= larger.chi2 + margin)


def evidence(
    case: Case,
    branch: Branch,
    smaller: Node,
    larger: Node,
    effect: str,
    tied: Sequence[str],
    chance: NDArray[np.float64],
) -> dict[str, float]:
    """Return the numbers of the report's table of evidence.

    Arguments as for `rivals`, whose answer is `tied`, and the gains of chance.
    """
    gain = smaller.chi2 - larger.chi2
    excess = case.excess(smaller.chi2)
    others = [r.chi2 for r in branch.refits if r.effect != effect]
    own = branch.scored[effect]
    likeness = {n: similarity(own.sensitivity, c.sensitivity) for n, c in branch.scored.items() if n != effect}
    predicted = zip(case.train, smaller.refit.predict(), larger.refit.predict(), strict=True)
    moved = [(a - b)[e.fitted] for e, a, b in predicted]
    return {
        "delta_chi2_train": gain,
        "delta_chi2_holdout": smaller.held - larger.held,
        "share_of_excess": gain / excess if excess else 0.0,
        "share_of_residual_power": gain / smaller.chi2,
        "effect_rms": float(np.sqrt(np.mean(np.concatenate([np.sum(m**2, axis=1) for m in moved])))),
        "chance_gain_99": float(np.quantile(chance, 0.99)),
        "p_value": float((1 + np.sum(chance >= gain)) / (1 + chance.size)),
        "runner_up_delta_chi2": smaller.chi2 - min(others, default=smaller.chi2),
        "linear_score": own.score,
        "largest_similarity": max(likeness.values(), default=0.0),
        **{f"similarity_{n}": likeness.get(n, 0.0) for n in tied},
    }
