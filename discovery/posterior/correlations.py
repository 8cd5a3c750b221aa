"""Correlations of a posterior's parameters, and what those that depend on each other share physically."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from discovery.foundation.start_names import is_start
from discovery.posterior.parameter_roles import shared

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior

__all__ = ["NOTABLE", "Correlations", "correlations", "quantities"]

FloatArray = NDArray[np.float64]
#: Correlations of at least this size are told.
NOTABLE = 0.3


@dataclass(frozen=True)
class Correlations:
    """Correlations of the physical parameters and of the noise.

    Parameters
    ----------
    names : tuple of str
        The quantities.
    matrix : ndarray, shape (d, d)
        Correlation coefficients of the draws.
    meanings : mapping of (str, str) to str
        What two parameters share, of those pairs whose correlation is at least `NOTABLE`, the strongest first.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    meanings: dict[tuple[str, str], str]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        at = {name: i for i, name in enumerate(self.names)}
        return {
            "names": list(self.names),
            "matrix": self.matrix.tolist(),
            "pairs": [
                {"pair": [a, b], "correlation": float(self.matrix[at[a], at[b]]), "meaning": meaning}
                for (a, b), meaning in self.meanings.items()
            ],
        }


def quantities(posterior: Posterior) -> tuple[str, ...]:
    """Return the names of the sampled quantities but for the initial states."""
    return tuple(n for n in posterior.names if not is_start(n))


def correlations(posterior: Posterior) -> Correlations:
    """Return the correlations of a posterior; initial states are left out."""
    names = quantities(posterior)
    flat = posterior.flat()
    matrix = np.atleast_2d(np.corrcoef(np.array([flat[n] for n in names])))
    size = {(names[i], names[j]): abs(matrix[i, j]) for i, j in combinations(range(len(names)), 2)}
    told = sorted((pair for pair, r in size.items() if r >= NOTABLE), key=lambda pair: -size[pair])
    return Correlations(names, matrix, {pair: _meaning(posterior, *pair) for pair in told})


def _meaning(posterior: Posterior, first: str, second: str) -> str:
    physical = posterior.model.parameters
    if first in physical and second in physical:
        return shared(posterior.model, first, second)
    if first not in physical and second not in physical:
        return "both describe the noise"
    return "the size of the noise should not depend on the motion: a sign that what is left is no noise"
