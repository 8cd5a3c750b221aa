"""Which other stated constants would answer for one that the recordings overrule: often only a ratio is told."""

from __future__ import annotations

from dataclasses import dataclass, replace

from discovery.estimation.fit import Fit, fit_near
from discovery.foundation.errors import SimulationFailure
from discovery.rigs.rig import Rig

#: Another constant does as well where it leaves at most so much more of chi-square, in what is left of a reading.
_LEAST = 6.0


@dataclass(frozen=True)
class Instead:
    """A constant that may be off in the place of another one: its value then, its standard deviation and its unit."""

    name: str
    value: float
    sd: float
    unit: str


def stated_constants(rig: Rig) -> dict[str, tuple[float, float]]:
    """Return value and standard deviation of the constants of a declared system that are stated within one."""
    given = {} if rig.system is None else rig.system.constants
    return {n: (c.value, c.sd) for n, c in given.items() if c.sd is not None}


def answering_for(fit: Fit, name: str) -> tuple[Instead, ...]:
    """Return the other stated constants with which a fit is as good although one that it overrules is as stated.

    `fit`: has the overruled constant `name` free.
    """
    found, stated = [], stated_constants(fit.problem.bench.experiments[0].rig)
    mean, _ = stated.get(name, (0.0, 0.0))
    if not mean * fit.values[name]:
        return ()
    ratio = mean / fit.values[name]
    for other, (at, sd) in stated.items():
        if other == name or other not in fit.problem.gaussian or not at:
            continue
        known = {**fit.problem.gaussian, name: stated[name], other: (at, abs(at))}
        problem = replace(fit.problem, gaussian=known)
        for times in (ratio, 1.0 / ratio):
            try:
                again = fit_near(problem, {**fit.values, name: mean, other: at * times})
            except SimulationFailure:
                continue
            moved = abs(again.values[other] - at) > 3.0 * sd
            if moved and again.chi2 < fit.chi2 + _LEAST * max(1.0, fit.reduced_chi2) and other not in again.reasons:
                found.append(Instead(other, again.values[other], again.sd[other], fit.model.parameters[other].unit))
                break
    return tuple(found)
