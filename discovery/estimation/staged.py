"""Starts of a model with what the rig states to be moved: first held, then free."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from discovery.estimation.batch import fit_problems
from discovery.estimation.problem import Problem

__all__ = ["staged_start"]

#: Starts of a parameter that the rig hardly knows, in its stated values.
_WIDE = (0.2, 0.5, 1.0, 1.5, 2.0, 3.0)


def staged_start(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    """Return start values from fits in which what the rig states is held.

    The ringing of the rod has local minima in its mass while the stiffness is off. Where the rig hardly knows the mass,
    several are tried and the best one is kept. Its damping is held at a usual size: undamped ringing has no smooth
    answer to a change of stiffness.
    """
    known = {**{n: mean for n, (mean, _) in problem.gaussian.items()}, **problem.model.known}
    vague = [n for n, (mean, sd) in problem.gaussian.items() if sd > 0.3 * mean]
    wide = [n for n in vague if n in problem.model.known and n not in values]
    grids = [{n: known[n] * f for n in wide} for f in (_WIDE if wide else (1.0,))]
    held = [
        Problem(replace(problem.model, known={**known, **grid}), problem.bench, problem.units, {}) for grid in grids
    ]
    minima = fit_problems(held, [p.start(values) for p in held])
    best = min(range(len(minima)), key=lambda i: minima[i].cost)
    return {**known, **values, **grids[best], **held[best].named(minima[best].x)}
