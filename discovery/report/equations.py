"""The models of a run as formulas: what each effect adds to the equation of motion, or to the arm's energies.

Beside them what the sparse regression proposes, from smoothed derivatives alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import floor, log10
from typing import Any

import sympy as sp
from markupsafe import Markup

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Memory, Mode, Sensor
from discovery.declarations.registry import get_effect
from discovery.declarations.system import System
from discovery.equations.declared_terms import LETTERS
from discovery.equations.equation import MOVING_INPUT, equation_terms, motion_symbols
from discovery.equations.latex import LatexLine, in_sum, letter, number, term
from discovery.equations.model import Model
from discovery.mechanics import get_base
from discovery.mechanics.systems import declaration_of
from discovery.report import effect_formulas
from discovery.report.effect_formulas import expression
from discovery.report.numbers import significant, unit_text
from discovery.report.results import Run
from discovery.report.style import label
from discovery.report.tables import name_cell
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION


def undriven(model: Mapping) -> bool:
    """Return whether the recordings of a model have no input."""
    return bool(model.get("known", {}).get("g") == 0)


def _multiplied_out(term: sp.Expr, values: Mapping[str, float]) -> sp.Expr:
    """Return a term with a number for the product of two parameters or more before it."""
    factor, rest = term.as_independent(*[x for x in term.free_symbols if x.name not in values], as_Add=False)
    if len(factor.free_symbols) < 2:
        return term
    known = {x: sp.Float(values[x.name]) for x in factor.free_symbols}
    return effect_formulas.rounded_factors(factor.xreplace(known)) * rest


def _one_coordinate(model: Mapping, values: Mapping[str, float]) -> tuple[list[LatexLine], list[Effect]]:
    """Return the motion of one coordinate, its modes and what is read of it, and the effects that are told by that."""
    described = Model(model["base"], tuple(model["effects"]))
    system, terms = described.mechanics.system, equation_terms(described)
    # One coordinate has one set of states: their number is left out.
    states = [(z.name + dots, z.name.removesuffix("_0") + dots) for z, _ in terms.memory for dots in ("", "''")]
    plain = {sp.Symbol(long, real=True): sp.Symbol(short, real=True) for long, short in states}
    # The reference inertia of a force that is read is a power of ten: a number, where numbers are told.
    known = model.get("known", {}) if values else {}
    given = {sp.Symbol(n, real=True): sp.nsimplify(v) for n, v in known.items() if n == "m_0"}
    inertia = terms.inertia.xreplace(given)
    inertia = "" if inertia == 1 else rf"\left({expression(inertia, system)}\right) "
    left = [inertia + expression(terms.acceleration, system)]
    bent = {e.id(): e for e in described.terms if isinstance(e, Memory) and system.has_rod}
    for owner, added in terms.terms:
        shown = -sp.diff(bent[owner].expression(), s.bend_dot) if owner in bent else added.xreplace(plain)
        parts = [_multiplied_out(part, values) for part in effect_formulas.rounded_factors(shown).as_ordered_terms()]
        written = [expression(part, system) for part in parts]
        if owner in bent and bent[owner].local:
            # The static shape has the bending (1 - s) delta.
            written = [effect_formulas.along_the_rod("1 - s", *written)]
        left += written
    drive = (terms.drive.subs(sp.Symbol("g", real=True), 0) if undriven(model) else terms.drive).xreplace(given)
    found = [LatexLine("Equation of motion", f"{in_sum(*left)} = {expression(drive, system)}", needed=True)]
    told: list[Effect] = [e for e in described.terms if isinstance(e, Mode)]
    found += [LatexLine(mode.title(), effect_formulas.mode_formula(mode, drive)) for mode in told]
    read = terms.output
    if read is not None and read != motion_symbols(system)[0]:
        sensors = [e for e in described.terms if isinstance(e, Sensor) and e.lateness() == 0]
        for sensor in sensors:
            read = sensor.oscillator_reading(read)
        body = expression(read.xreplace(plain), system)
        found.append(LatexLine("What the instrument reads", f"{letter('y_read')} = {body}", needed=True))
        told += sensors
    return found, told


_ARM = [
    LatexLine(
        "Shape of the rod, inextensible, in a few curvature modes",
        r"\theta(s, t) = \theta_m(t) + \sum_k q_k(t)\, \varphi_k(s)",
    ),
    LatexLine(
        "Lagrange’s equations, T the kinetic energy of the rod and of the tip",
        r"\frac{\mathrm{d}}{\mathrm{d}t} \frac{\partial T}{\partial \dot{q}_k} - \frac{\partial T}{\partial q_k} "
        r"+ \frac{\partial V}{\partial q_k} + \frac{\partial D}{\partial \dot{q}_k} = Q_k",
        needed=True,
    ),
    LatexLine(
        "Elastic energy of the rod per unit of stiffness, s in lengths of the arm",
        r"U = \frac{1}{6} \int_0^1 \left(\frac{\partial \theta}{\partial s}\right)^2\, \mathrm{d}s",
    ),
]


_C = DYNAMIC_REDUCTION
_REDUCED_ARM = LatexLine(
    "Mass on the elastica’s radius law, to third order, without a free parameter; effects add",
    rf"\ddot{{\theta}}_t {float(_C.c1):+g} \delta \dot{{\theta}}_t^2 {float(_C.c2):+g} \delta \dot{{\delta}} "
    rf"\dot{{\theta}}_t {float(_C.c3):+g} \delta \dot{{\delta}}^2 {-float(_C.c_m):+g} \delta^2 \ddot{{\theta}}_m "
    rf"+ A \ddot{{\theta}}_m + \alpha \left(\delta {float(_C.beta):+.3g} \delta^3\right) + \dots = 0",
)


def model_formulas(model: Mapping, system: str, values: Mapping[str, float] | None = None) -> list[LatexLine]:
    """Return the formulas of what `discovery.equations.model.Model.to_dict` gave for a kind of system.

    First the equation of motion where the base has one coordinate, with the modes beside it and what is read where that
    is not the coordinate, else Lagrange's equations and every effect's part in them; then what closures, drives and
    sensors say. With `values`, the numbers of parameters and known quantities by name, each energy of an arm is one sum
    with them.
    """
    told: list[Effect] = []
    has_rod = get_base(model["base"]).system.has_rod
    scalar = not has_rod or model["base"] == "constant_radius"
    if "system" in model:
        found = effect_formulas.declared_formulas(model["base"], map(get_effect, model["effects"]), model["known"])
    elif scalar:
        found, told = _one_coordinate(model, values or {})
        if has_rod:
            found.append(LatexLine("with the deflection", r"\delta = \theta_t - \theta_m"))
    else:
        found = [_REDUCED_ARM] if model["base"] == "reduced" else [*_ARM]
    effects = [e for e in map(get_effect, model["effects"]) if e not in told]
    shown = [e for e in effects if not scalar or "system" in model or e.kind not in LETTERS or e.kind == "memory"]
    if values is not None and not scalar and "system" not in model:
        parts = [e for e in shown if effect_formulas.are_summed(e)]
        found += effect_formulas.summed(parts, system, values)
        shown = [e for e in shown if e not in parts]
    groups = effect_formulas.together(shown)
    return found + [LatexLine(". ".join(e.title() for e in group), _of(group, model, system)) for group in groups]


def shown_formulas(run: Run, when: str) -> list[LatexLine]:
    """Return the formulas of the model before or after the loop."""
    return model_formulas(run.loop["model"][when]["model"], run.results["rig"]["kind"])


def _of(group: Sequence[Effect], model: Mapping, system: str) -> str:
    if group[0].place or (len(group) == 1 and "system" not in model):
        return effect_formulas.effect_formula(group[0], system)
    return effect_formulas.laws(group, system, declaration_of(model["base"]))


def drive_symbols(model: Mapping[str, Any]) -> dict[str, str]:
    """Return what stands for the input in a `Model.to_dict`, by symbol: its gains, and u; nothing without an input."""
    base = get_base(model["base"])
    if base.system.has_rod or base.places() or undriven(model):
        return {}
    free = equation_terms(Model(model["base"], tuple(model["effects"]))).drive.free_symbols
    if not free & set(MOVING_INPUT):
        return {}
    names = {x.name for x in free}
    return {**{p.name: p.meaning for p in base.parameters() if p.name in names}, "u": "recorded input"}


def drive_words(run: Run) -> Markup:
    """Return what the symbols of the input mean, as part of a sentence; empty without one."""
    name, unit = run.input_name, unit_text(run.input_unit)
    found = [
        Markup("{} is the {}").format(name_cell(letter), label(f"recorded {name}", unit) if letter == "u" else meaning)
        for letter, meaning in drive_symbols(run.loop["model"]["before"]["model"]).items()
    ]
    return Markup(", ").join(found)


def regression_equation(equation: Mapping[str, Any], system: str) -> str:
    """Return an equation of the regression with its numbers, as many digits as their intervals deserve."""
    terms, inputs = [term(f"{System.of(system).coordinate}''")], list[str]()
    for name, value, sd in zip(equation["terms"], equation["coefficients"], equation["sd"], strict=True):
        factor = "" if name == "1" else f" {term(name)}"
        (inputs if name == "u" else terms).append(number(significant(value, _digits(value, sd))) + factor)
    return " = ".join(in_sum(*side) for side in (terms, inputs or ["0"]))


def found_terms(discovery: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return terms, coefficients and deviations of the discovered equation."""
    keys = {"terms": "term", "coefficients": "coefficient", "sd": "sd"}
    return {name: [t[key] for t in discovery["terms"]] for name, key in keys.items()}


def three_terms(discovery: Mapping[str, Any], system: str) -> Mapping[str, Any] | None:
    """Return the best equation of three terms where the discovered one has another size."""
    best = discovery.get("best_three")
    if not best or len(best["terms"]) == len(discovery["terms"]):
        return None
    return {"share": f"{100 * best['probability']:.0f} %", "equation": regression_equation(best, system)}


def _digits(value: float, sd: float | None) -> int:
    """Return the significant digits down to the first one of the standard deviation, between two and six."""
    if not value or not sd or sd <= 0:
        return 4
    return min(6, max(2, 1 + floor(log10(abs(value))) - floor(log10(sd))))


def standing(run: Run) -> str:
    """Return what the proposal is beside the final model, so that nobody takes what it leaves for what is missing."""
    words = (
        "This is an independent proposal, not the answer: a regression on smoothed derivatives, which knows sums of "
        "simple terms alone. It says which terms the motion shows before anything is assumed. "
    )
    if run.loop["verdict"] in ("explained", "nothing_missing"):
        return words + "What it leaves is what such a sum cannot say; the final model has it, and leaves noise."
    return words + "What it leaves is what such a sum cannot say; how much the final model leaves, the verdict states."
