"""Intervals to first order that contradict the odds of their effect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.estimation.fit import Fit

#: Squared distance from none, in variances, up to which an interval of 90 % holds none.
_HOLDS = 1.645**2


def without_bent(fit: Fit, effects: Iterable[str]) -> Fit:
    """Return a fit without the intervals of effects that hold none of the effect, though it is known to be there.

    The odds compare with a refit that lacks the effect, an interval extrapolates to it from the slopes at the estimate.
    Where the two contradict each other the posterior is not normal: a law that saturates, a valley that ends before
    the amplitude vanishes.

    Parameters
    ----------
    fit : Fit
        With intervals to first order.
    effects : iterable of str
        Effects whose absence the odds exclude.
    """
    at = {n: i for i, n in enumerate(fit.problem.names)}
    reasons, covariance = dict(fit.reasons), fit.covariance.copy()
    for effect in effects:
        own = [p for p in get_effect(effect).parameters() if p.name in at and p.name not in fit.reasons]
        sizes = [at[p.name] for p in own if not p.shape]
        spread = np.sqrt(np.diag(fit.covariance)[sizes])
        away = fit.minimum.x[sizes] / spread
        known = fit.covariance[np.ix_(sizes, sizes)] / np.outer(spread, spread)
        if not sizes or not away @ np.linalg.pinv(known, hermitian=True) @ away < _HOLDS:
            continue
        for p in own:
            reasons[p.name] = "its posterior is too bent for an interval"
            covariance[at[p.name], :] = covariance[:, at[p.name]] = np.nan
    return replace(fit, reasons=reasons, covariance=covariance)
