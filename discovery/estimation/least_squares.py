"""Bounded Levenberg-Marquardt for many problems at once.

Each minimisation is a generator that asks for residuals of a handful of parameter vectors; `minimise` answers all of
them with one simulation call a round. Trial steps with three dampings and the central differences of the Jacobian are
therefore as cheap as one step, and refitting every candidate of a catalogue costs little more than refitting one.
Where few minimisations are left, derivatives where they may go next come along. Parameters that trade with each other
make valleys that are narrow and bent: there steps follow the bend.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np

from discovery.estimation.descent import Descent, Wanted
from discovery.foundation.arrays import BoolArray, FloatArray

Request = Generator[Wanted, FloatArray, "Minimum"]


@dataclass(frozen=True)
class Minimum:
    """Where a minimisation ended."""

    x: FloatArray  # (p,), the minimum
    cost: float  # half the sum of squares
    residual: FloatArray  # (n,), residuals there
    jacobian: FloatArray  # (n, p), their derivatives
    at_bound: BoolArray  # (p,), which parameters lie on a bound
    converged: bool  # whether the stopping rule was met before the iterations ran out
    iterations: int  # number of steps
    blown: bool = False  # whether a simulation on the way blew up

    def bound(self, names: Sequence[str]) -> list[str]:
        """Return which of the names of what was fitted are at a bound."""
        return [name for name, at in zip(names, self.at_bound, strict=True) if at]


def levenberg_marquardt(
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    scale: FloatArray,
    *,
    iterations: int = 40,
    tolerance: float = 1e-8,
    jacobian: FloatArray | None = None,
    rough: bool = False,
    is_behind: Callable[[float, int], bool] | None = None,
) -> Request:
    """Minimise half the sum of squared residuals within bounds.

    `start`, `lower`, `upper`, `scale` (p,): start (clipped into the bounds), bounds, and the typical size of each
    parameter. `iterations`: largest number of steps. `tolerance`: stop when a step lowers the cost by less than this
    share of it, or by far less than the noise. `is_behind`: asked before every step, with the cost and the number of
    steps so far, whether to give up. Yielded: vectors whose residuals (n, k) are wanted; those of `next` may follow,
    all or none.

    `jacobian` (n, p): derivatives near the start. With it, the search is a quick one: the Jacobian is carried along by
    Broyden's rank-one update (Math. Comp. 19 (1965) 577) and differenced anew only when a step fails; columns of zeros
    count as unknown and are differenced at the start. Without it, it is differenced at every step.

    `rough`: difference to one side only, and carry the Jacobian along as long as steps keep what it promises; the
    search ends on one that was differenced. A quick search also differences to one side. Both take derivatives at the
    middle trial wherever `minimise` sends them along, and carry these to where the step ends.
    """
    found = Descent(start, lower, upper, scale, tolerance=tolerance, quick=jacobian is not None, rough=rough)
    yield from found.begin(jacobian)
    while not found.converged and found.count < iterations and found.is_finite:
        if is_behind is not None and is_behind(found.cost, found.count):
            break
        yield from found.advance()
    return Minimum(
        found.x,
        found.cost,
        residual=found.residual,
        jacobian=found.jacobian,
        at_bound=(found.x <= lower) | (found.x >= upper),
        converged=found.converged,
        iterations=found.count,
        blown=found.blown,
    )


def minimise(
    requests: Sequence[Request],
    answer: Callable[[list[tuple[int, FloatArray]]], list[FloatArray]],
    at_once: int = 0,
) -> list[Minimum]:
    """Run several minimisations together.

    `requests`: from `levenberg_marquardt`. `answer`: given a list of (index of the problem, parameter vectors (p, k)),
    return the residuals (n, k) of each. `at_once`: so many points are answered in the time of one: those that nobody
    needs go to what may be wanted next. Returned: in the order of `requests`.
    """
    results: dict[int, Minimum] = {}
    pending = {i: next(request) for i, request in enumerate(requests)}
    while pending:
        asked = [(i, wanted.points) for i, wanted in pending.items()]
        left = at_once - sum(points.shape[1] for _, points in asked)
        for k, (i, points) in enumerate(asked):
            ahead = pending[i].next
            if 0 < ahead.shape[1] <= left:
                asked[k] = i, np.concatenate([points, ahead], axis=1)
                left -= ahead.shape[1]
        for (i, _), residuals in zip(asked, answer(asked), strict=True):
            try:
                pending[i] = requests[i].send(residuals)
            except StopIteration as stop:
                results[i] = stop.value
                del pending[i]
    return [results[i] for i in range(len(requests))]
