"""A model that was fitted to a part of recordings, fitted to the whole of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit
from discovery.estimation.generalised import generalised

__all__ = ["fitted_to_all"]

_ITERATIONS = 25


def fitted_to_all(found: Fit, error: float, bench: Bench) -> Fit:
    """Return the same model fitted to other recordings by generalised least squares, from where it is.

    Intervals stay those of the part: a model error in a parameter's direction does not average out, and without one
    they are wider than all readings would give.

    Parameters
    ----------
    found : Fit
        On parts of the recordings; it is returned where the motion blows up beyond them.
    error : float
        Size of the model error [noise sds].
    bench : Bench
        Simulators of the recordings, of the same names.
    """
    problem = replace(found.problem, bench=bench)
    start = problem.start(found.values)
    (minimum,) = generalised([problem], [start], [error], iterations=_ITERATIONS, tolerance=1e-6)
    return replace(found, problem=problem, minimum=minimum) if np.isfinite(minimum.cost) else found
