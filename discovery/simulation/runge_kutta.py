"""Explicit Runge-Kutta methods as data."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache


@dataclass(frozen=True)
class Method:
    """A method y1 = y0 + h sum_i b_i k_i with k_i = f(t0 + c_i h, y0 + h sum_j a_ij k_j)."""

    order: int  # the error of a step is of this order plus one
    nodes: tuple[float, ...]  # c, the first one zero
    stages: tuple[tuple[float, ...], ...]  # rows of a, each as long as there are stages before it
    weights: tuple[float, ...]  # b

    @property
    def times(self) -> tuple[float, ...]:
        """Where in a step the input is needed: at each different node, and at the end."""
        return tuple(sorted({*self.nodes, 1.0}))


#: The classical method of order four.
CLASSICAL = Method(4, (0.0, 0.5, 0.5, 1.0), ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6))


@cache
def dormand_prince() -> Method:
    """Return the method of order eight with twelve stages of Dormand and Prince.

    E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd edition (1993), section II.5.
    """
    from scipy.integrate import DOP853

    stages = tuple(tuple(DOP853.A[i, :i].tolist()) for i in range(DOP853.n_stages))
    return Method(8, tuple(DOP853.C.tolist()), stages, tuple(DOP853.B.tolist()))
