"""A second look at a set of effects: shapes of its laws moved away and fitted again, for they have many minima."""

from __future__ import annotations

from collections.abc import Sequence

from discovery.refits import Refit, best_of, settled
from discovery.registry import catalogue

__all__ = ["shaken"]

#: What can only be positive is multiplied by these;
_FACTORS = (0.5, 0.7, 1.4, 2.0)
#: anything else, such as a phase, is moved by these shares of its range.
_SHIFTS = (-0.25, -0.125, 0.125, 0.25)


def shaken(found: Refit, effects: Sequence[str]) -> Refit:
    """Return the best refit of the same model from starts in which one shape parameter is elsewhere.

    Parameters
    ----------
    found : Refit
        The set so far.
    effects : sequence of str
        Effects whose shapes are moved.

    Returns
    -------
    Refit
        The same one where nothing better is found.
    """
    problem = found.problem
    lower, upper = problem.bounds
    starts = []
    for parameter in (p for effect in effects for p in catalogue()[effect].parameters() if p.shape):
        if parameter.name not in problem.free:
            continue
        i = problem.free.index(parameter.name)
        here = found.minimum.x[i]
        elsewhere = (
            [here * f for f in _FACTORS] if lower[i] >= 0 else [here + s * (upper[i] - lower[i]) for s in _SHIFTS]
        )
        for value in elsewhere:
            if lower[i] <= value <= upper[i]:
                start = found.minimum.x.copy()
                start[i] = value
                starts.append(start)
    return best_of([found, *settled([problem] * len(starts), starts)])[0]
