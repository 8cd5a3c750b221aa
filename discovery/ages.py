"""What an instrument that is late does to a residual, to first order: one motion need not be read at every age."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from discovery.bench import Bench
from discovery.symbols import t

__all__ = ["ages_of", "ages_only", "per_age"]

FloatArray = NDArray[np.float64]
#: Half of the difference of ages over which a residual is differentiated [s]: far below a step, far above rounding.
_DIFFERENCE = 1e-5


def ages_only(bench: Bench, settings: Sequence[Mapping[str, float]]) -> NDArray[np.bool_]:
    """Return which changes of a parameter set alter the age of what is read and nothing else.

    None does so where readings pass a filter: it does not give a product with an age that changes.

    Parameters
    ----------
    bench : Bench
        Its simulators know every effect.
    settings : sequence of mapping
        Parameters that change.
    """
    if any(e.rig.view is not None for e in bench.experiments):
        return np.zeros(len(settings), dtype=np.bool_)
    ageing = bench.simulators[0].kernel.program.ageing
    return np.array([changed.keys() <= ageing for changed in settings], dtype=np.bool_)


def per_age(bench: Bench, fitted: tuple[FloatArray, FloatArray], motions: Sequence[FloatArray]) -> FloatArray:
    """Return how fast a residual changes as what is read grows older, shape (n, 1) [1/s].

    Parameters
    ----------
    bench : Bench
        Of the recordings.
    fitted : (ndarray, ndarray)
        Kernel parameters (p, 1) and initial states (experiments, 2, 1).
    motions : sequence of ndarray
        How these move.
    """
    older, younger = (bench.aged(age).residuals(*fitted, motions) for age in (_DIFFERENCE, -_DIFFERENCE))
    return (older - younger) / (2 * _DIFFERENCE)


def ages_of(bench: Bench, settings: Sequence[Mapping[str, float]]) -> NDArray[np.float32]:
    """Return how much older effects that were absent make each reading [s], shape (n, sets).

    Parameters
    ----------
    bench : Bench
        Of the recordings.
    settings : sequence of mapping
        Parameters of such effects, see `ages_only`.
    """
    return _ages(bench, tuple(tuple(changed.items()) for changed in settings))


# The same around every fit of the same recordings.
@lru_cache(maxsize=4)
def _ages(bench: Bench, settings: tuple[tuple[tuple[str, float], ...], ...]) -> NDArray[np.float32]:
    lateness = bench.simulators[0].kernel.program.lateness
    symbols = sorted(lateness.free_symbols - {t}, key=str)
    law = sp.lambdify([t, *symbols], lateness)
    values = [np.array([dict(changed).get(s.name, 0.0) for changed in settings]) for s in symbols]
    ages = np.empty((bench.n_rows, len(settings)), dtype=np.float32)
    for simulator, (rows, fitted) in zip(bench.simulators, bench.blocks(), strict=True):
        found = np.broadcast_to(law(simulator.time[:, None], *values), (len(fitted), len(settings)))
        ages[rows] = np.repeat(found, fitted.shape[1], axis=0)
    return ages
