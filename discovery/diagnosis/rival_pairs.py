r"""How far rival models lie apart on a manoeuvre, once the wrong one has absorbed what it can.

Let model A be right: on a new manoeuvre B then errs by d, of which B's free parameters can absorb a part, but only as
far as their bounds and the given recordings let them move. What is left,

.. math:: \Delta\chi^2 = \min_p\; |d - J p|^2 + |R p|^2,

is the chi-square by which A wins once both are refitted to the old and the new recording. d and the sensitivities J are
in units of the camera's noise; R is the root of the information that the given recordings, and the priors from the rig,
hold about B's parameters. The initial state of the new recording is free.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear
from scipy.sparse.csgraph import connected_components

from discovery.foundation.arrays import FloatArray, IntArray

#: Chi-square that is nothing: even with thirty times less noise, it would not decide.
NOTHING = 0.01


@dataclass(frozen=True)
class Distance:
    """How far the predictions of two rivals lie apart on one set of recordings.

    It is the root mean square difference over samples and channels [noise sds], parameters as they are (`plain`) and of
    what the wrong one cannot absorb (`projected`), the smaller of both directions; `chi2` is the one by which the right
    one is expected to win, in the worse direction.
    """

    plain: float
    projected: float
    chi2: float


@dataclass(frozen=True)
class Laws:
    """Which rivals are one law here: nothing that was tried tells them apart, whichever is right."""

    label: IntArray  # (r,): number of the law of each rival

    @classmethod
    def of(cls, count: int, tried: Iterable[Pairs]) -> Laws:
        """Return the laws of so many rivals by how far they lie apart on recordings; each its own without any.

        Examples
        --------
        >>> apart = np.array([[0.0, 1e-12, 40.0], [1e-9, 0.0, 38.0], [25.0, 24.0, 0.0]])
        >>> Laws.of(3, [Pairs(apart, apart, 100)]).label.tolist()
        [0, 0, 1]
        """
        known = [np.maximum(pairs.chi2, pairs.chi2.T) for pairs in tried]
        alike = np.max(known, axis=0) < NOTHING if known else np.eye(count, dtype=bool)
        return cls(np.asarray(connected_components(alike, directed=False)[1], np.int64))

    @property
    def several(self) -> bool:
        """Whether there is anything to tell apart."""
        return bool(np.ptp(self.label))

    def groups(self, names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
        """Return the names of the rivals by law, in their order."""
        laws = dict.fromkeys(self.label.tolist())
        return tuple(tuple(n for n, own in zip(names, self.label, strict=True) if own == law) for law in laws)


@dataclass(frozen=True)
class Pairs:
    """How far every rival lies from every other on some recordings, once the wrong one has absorbed what it can."""

    chi2: FloatArray  # (r, r): by which the first wins if it is right
    plain: FloatArray  # (r, r): the same where nothing is absorbed
    count: int  # numbers that are read

    @classmethod
    def none(cls, rivals: int, count: int = 1) -> Pairs:
        """Return the pairs of rivals that nothing tells apart."""
        return cls(np.zeros((rivals, rivals)), np.zeros((rivals, rivals)), count)

    @classmethod
    def of(
        cls, found: Sequence[tuple[FloatArray, FloatArray]], known: Sequence[tuple[FloatArray, FloatArray]], count: int
    ) -> Pairs:
        """Return the pairs by predictions with sensitivities (`found`), and by what is known with the room to move."""
        pairs = cls.none(len(found), count)
        for a, b in permutations(range(len(found)), 2):
            difference = found[a][0] - found[b][0]
            pairs.chi2[a, b] = absorbed(difference, found[b][1], *known[b])
            pairs.plain[a, b] = difference @ difference
        return pairs

    def nearest(self, laws: Laws) -> Distance:
        """Return the distance of the hardest pair of different laws, of any rivals where there is one law."""
        label = laws.label if laws.several else np.arange(len(self.chi2))
        apart = label[:, None] != label
        chi2, plain = min(zip(self.chi2[apart].tolist(), self.plain[apart].tolist(), strict=True))
        return Distance(float(np.sqrt(plain / self.count)), float(np.sqrt(chi2 / self.count)), chi2)


def absorbed(difference: FloatArray, jacobian: FloatArray, root: FloatArray, room: FloatArray) -> float:
    """Return min over p of |difference - jacobian p|^2 + |root p|^2 for p between the rows of `room` (2, m)."""
    matrix = np.concatenate([jacobian, root])
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    target = np.concatenate([difference, np.zeros(len(root))])
    # A triangle holds all that the bounded solver needs.
    triangle: Any = np.linalg.qr(np.column_stack([matrix / size, target]), mode="r")
    return 2 * float(lsq_linear(triangle[:, :-1], triangle[:, -1], room * size, method="bvls").cost)
