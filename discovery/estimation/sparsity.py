"""Which residuals each free number moves: numbers that share none are differenced together.

The start of a recording moves that recording alone. Those of all recordings are moved at once, so that derivatives cost
as many simulations for ten recordings as for one (Curtis, Powell and Reid, Journal of the Institute of Mathematics and
its Applications 13 (1974) 117).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import FloatArray, IntArray

__all__ = ["Sparsity"]


@dataclass(frozen=True)
class Sparsity:
    """Which parts of a residual each of p free numbers moves.

    Parameters
    ----------
    groups : ndarray of int, shape (p,)
        Group of each; those of one group share no residual.
    parts : ndarray of int, shape (p,)
        Part of the residual that each moves; -1 for all of it.
    rows : tuple of slice
        Rows of each part.
    """

    groups: IntArray
    parts: IntArray
    rows: tuple[slice, ...] = ()

    @classmethod
    def dense(cls, count: int) -> Sparsity:
        """Return that of numbers that move all residuals."""
        return cls(np.arange(count), np.full(count, -1))

    def together(self, which: IntArray) -> IntArray:
        """Return the point at which each of some numbers is moved, counted from zero, shape of `which`."""
        return np.asarray(np.unique(self.groups[which], return_inverse=True)[1].reshape(-1), np.int64)

    def columns(self, differences: FloatArray, which: IntArray) -> FloatArray:
        """Return what each of some numbers changes (n, k) from the changes at their points (n, points)."""
        found = np.zeros((len(differences), which.size), order="F")
        for k, (number, point) in enumerate(zip(which, self.together(which), strict=True)):
            rows = self.rows[self.parts[number]] if self.parts[number] >= 0 else slice(None)
            found[rows, k] = differences[rows, point]
        return found
