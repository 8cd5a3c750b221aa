"""Values of a fit that end where they may not be believed: at the edge of their range, or far from their guess."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from discovery.declarations.registry import get_effect, sizes_of
from discovery.diagnosis.caution import Caution
from discovery.equations.losses import is_passive
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.declared import strayed
from discovery.estimation.fit import Fit
from discovery.estimation.generalised import BENT
from discovery.estimation.problem import STATED
from discovery.estimation.told import as_read
from discovery.foundation.start_names import start_of

#: Standard deviations by which a constant would go beyond zero.
_BEYOND = 3.0
#: Share of the way to where a stated value may end, within which it is there.
_AT_END = 1e-3
_TOLD = 2.0  # of those by which a gain is told from zero
_AS_WELL = 1.2  # times the chi-square that is left, with which a model without its input serves as well
#: Widths of what is believed of a coordinate that nothing reads, beyond which it begins far off.
_FARTHER = 3.0


def at_edges(fitted: Fit, added: Iterable[str]) -> list[Caution]:
    """Return the parameters of a fit at an edge that is no zero, see `discovery.estimation.problem.Problem.edges`.

    Of several of one added effect the first is told, the others beside it.
    """
    owner = {p.name: e for e in {*added}.intersection(fitted.model.effects) for p in get_effect(e).parameters()}
    at_edge: dict[str, list[str]] = {}
    for name in fitted.problem.edges(fitted.minimum.x):
        at_edge.setdefault(owner.get(name, name), []).append(name)
    found = []
    for of, (name, *others) in at_edge.items():
        numbers = {"value": fitted.values[name], "unit": fitted.told(name)["unit"], "others": others}
        found.append(Caution("declared_edge" if of == name else "effect_edge", name, owner.get(name, ""), numbers))
    return found


def stated_edges(fitted: Fit) -> list[Caution]:
    """Return what the rig file states within an uncertainty and the fit ends as far away as it may."""
    found, known = [], {n: given for n, given in fitted.problem.gaussian.items() if n in fitted.values}
    for name, (stated, sd) in known.items():
        told = fitted.told(name)
        if abs(sds := (told["value"] - stated) / sd) > (1.0 - _AT_END) * STATED:
            numbers = {"value": told["value"], "unit": told["unit"], "sds": sds, "stated": stated, "sd": sd}
            found.append(Caution("stated_edge", name, numbers=numbers))
    return found


def strayed_constant(fitted: Fit) -> Caution | None:
    """Return the constant of a declared system that ends farthest from its guess; None where none is far from it.

    One that is told together with others only may be anywhere, see `combined`.
    """
    together = {name for found in combined(fitted) for name in (found.about, *found.numbers["others"])}
    far = {n: x for n, x in strayed(fitted).items() if n not in together}
    if not far:
        return None
    name, *others = sorted(far, key=lambda n: -abs(math.log(far[n])))
    guess, unit = fitted.model.parameters[name].default, fitted.told(name)["unit"]
    numbers = {"value": fitted.values[name], "guess": guess, "unit": unit, "others": others}
    return Caution("strayed", name, numbers=numbers)


def combined(fitted: Fit) -> list[Caution]:
    """Return the constants of a declared system that are told together with other parameters only."""
    found = []
    for together in fitted.null_directions:
        names = [n for n in together if n in fitted.problem.free and n not in fitted.problem.gaussian]
        first, *others = sorted(names, key=lambda n: not fitted.model.parameters[n].physical) or [""]
        if others and fitted.model.parameters[first].physical:
            found.append(Caution("combined", first, numbers={"others": others}))
    return found


def held_sign(declared: Fit, final: Fit) -> Caution | None:
    """Return the constant that the sign of its guess holds at zero; None where the readings do not ask for the other.

    They ask by the standard deviations by which it would go beyond, to first order, where readings scatter as much as
    what is left. `declared`: the model without what was added. `final`: with it; where that tells the constant from
    zero, what was added was missing.
    """
    problem, found = declared.problem, declared.minimum
    scatter, most, named = math.sqrt(max(1.0, declared.reduced_chi2)), _BEYOND, None
    others = found.jacobian[:, ~found.at_bound]
    for name, value, slope, stopped in zip(problem.free, found.x, found.jacobian.T, found.at_bound, strict=False):
        parameter = problem.model.parameters[name]
        guessed = parameter.physical and name not in problem.gaussian
        if not (stopped and guessed and abs(value) < abs(parameter.default)):
            continue
        if name not in final.values or abs(final.values[name]) > _BEYOND * final.sd.get(name, math.inf):
            continue
        alone = slope - others @ np.linalg.lstsq(others, slope, rcond=None)[0]
        beyond = float(slope @ found.residual) * np.sign(value) / max(scatter * float(np.linalg.norm(alone)), 1e-300)
        if beyond > most:
            most, named = beyond, name
    if named is None:
        return None
    guess, unit = problem.model.parameters[named].default, declared.told(named)["unit"]
    numbers = {"guess": guess, "unit": unit, "passive": guess > 0 and is_passive(problem.model, named)}
    return Caution("held_sign", named, numbers=numbers)


def gain_untold(declared: Fit, final: Fit) -> Caution | None:
    """Return the gain of the input that the final model does not tell from zero; None without.

    Where the declared one did, what was added does as the input does, or as the losses that the input makes up for.
    Beside a second mode the gain is a share of what the input does.
    """
    if any(get_effect(e).kind == "mode" for e in final.model.effects):
        return None
    for name in sorted(final.model.mechanics.gains() & {*declared.problem.free} & {*final.problem.free}):
        before, after = declared.told(name), final.told(name)
        if after["sd"] is not None and abs(after["value"]) >= _TOLD * after["sd"]:
            continue
        numbers = {k: after[k] for k in ("value", "sd", "unit")}
        if before["sd"] is not None and abs(before["value"]) >= _BEYOND * before["sd"]:
            return Caution("lost_gain", name, numbers={**numbers, "before": before["value"], "before_sd": before["sd"]})
        if after["sd"] is not None and _serves_without(final, name):
            return Caution("no_gain", name, numbers=numbers)
    return None


def _serves_without(final: Fit, gain: str) -> bool:
    """Return whether a model explains its recordings about as well without its input.

    An interval that holds zero may be that of a gain that is told together with a loss only, and is none without it.
    """
    model = final.model
    without = Model(model.base, model.effects, {**model.known, gain: 0.0})
    problem = replace(final.problem, model=without)
    (found,) = fit_problems([problem], [problem.start(final.values)], rough=True)
    return bool(found.cost < _AS_WELL * final.minimum.cost)


def far_start(final: Fit) -> Caution | None:
    """Return the coordinate that nothing reads and that begins farthest off: no motion is known to have led it there.

    It would begin by more than so many times as far as a displacement that is as heavy as what is read.
    """
    unread = {s.name: s for s in final.problem.states if s.believed and not s.still}
    far = {name: abs(final.values[name]) / s.width for name, s in unread.items()}
    name = max(far, key=lambda n: far[n], default="")
    if not name or far[name] < _FARTHER:
        return None
    told = as_read(final, name)
    numbers = {"value": told["value"], "sd": told["sd"], "unit": told["unit"], "times": far[name]}
    return Caution("far_start", name, numbers=numbers)


def untold(final: Fit, added: Iterable[str]) -> list[Caution]:
    """Return the added effects none of whose sizes lies 3 sds from zero.

    They are told from none by how they move together. A shape, as a width or a frequency, has no zero. Of what is too
    bent for an interval nothing is said.
    """
    found = []
    for effect in (e for e in added if e in final.model.effects):
        sizes = sizes_of(effect)
        told = {n: as_read(final, n) for n in final.values if (start_of(n) or (n,))[0] in sizes}
        if not told or any(final.reasons.get(name) == BENT for name in told):
            continue
        if not any(q["sd"] is not None and abs(q["value"]) >= _BEYOND * q["sd"] for q in told.values()):
            name, first = next(iter(told.items()))
            found.append(Caution("untold", name, effect, {k: first[k] for k in ("value", "sd", "unit")}))
    return found
