"""Student's t of three degrees of freedom folded at zero, by scipy."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
from scipy import stats


def folded_t(scale: float) -> SimpleNamespace:
    """Return its distribution and log density with a scale."""
    law = stats.t(3, scale=scale)
    return SimpleNamespace(
        cdf=lambda x: 2 * law.cdf(np.maximum(x, 0.0)) - 1,
        ppf=lambda p: law.ppf((1 + np.asarray(p)) / 2),
        logpdf=lambda x: np.where(np.asarray(x) >= 0, law.logpdf(x) + math.log(2), -math.inf),
    )
