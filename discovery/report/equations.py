"""The models of a run as formulas: what each effect adds to the equation of motion, or to the arm's energies.

Beside them what the sparse regression proposes, from smoothed derivatives alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import sympy as sp
from markupsafe import Markup

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Memory, Mode, Sensor
from discovery.declarations.registry import get_effect
from discovery.equations.equation import MOVING_INPUT, equation_terms, motion_symbols
from discovery.equations.model import Model
from discovery.mechanics import get_base
from discovery.report import effect_formulas
from discovery.report.effect_formulas import LETTERS, coordinate_name, equal, signed
from discovery.report.mathml import block, formula, latex, number, power, row, symbol, total
from discovery.report.mathml_expression import expression
from discovery.report.numbers import significant, unit_text
from discovery.report.results import Run
from discovery.report.style import label
from discovery.report.tables import name_cell
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION


@dataclass(frozen=True)
class Formula:
    """One line of mathematics in presentation MathML without its enclosing element, with the words before it.

    The equation is incomplete without one that is `needed`, although no parameter may stand in it.
    """

    words: str
    body: str
    needed: bool = False

    @property
    def shown(self) -> tuple[str, Markup, str]:
        """Its words, its mathematics on a line of its own, and the same as LaTeX."""
        return self.words, Markup(block(self.body)), latex(self.body)


def undriven(model: Mapping) -> bool:
    """Return whether the recordings of a model have no input."""
    return bool(model.get("known", {}).get("g") == 0)


def _multiplied_out(term: sp.Expr, values: Mapping[str, float]) -> sp.Expr:
    """Return a term with a number for the product of two parameters or more before it."""
    factor, rest = term.as_independent(*[x for x in term.free_symbols if x.name not in values], as_Add=False)
    if len(factor.free_symbols) < 2:
        return term
    return sp.Float(float(factor.xreplace({x: sp.Float(values[x.name]) for x in factor.free_symbols})), 4) * rest


def _one_coordinate(model: Mapping, values: Mapping[str, float]) -> tuple[list[Formula], list[Effect]]:
    """Return the motion of one coordinate, its modes and what is read of it, and the effects that are told by that."""
    described = Model(model["base"], tuple(model["effects"]))
    system, terms = described.mechanics.system, equation_terms(described)
    name = coordinate_name(system)
    # One coordinate has one set of states: their number is left out.
    states = [(z.name + dots, z.name.removesuffix("_0") + dots) for z, _ in terms.memory for dots in ("", "''")]
    plain = {sp.Symbol(long, real=True): sp.Symbol(short, real=True) for long, short in states}
    left = [expression(terms.acceleration)]
    if terms.inertia != 1:
        left.insert(0, row("<mo>(</mo>", expression(terms.inertia, name), "<mo>)</mo>"))
    bent = {e.id(): e for e in described.terms if isinstance(e, Memory) and system.has_rod}
    for owner, term in terms.terms:
        shown = -sp.diff(bent[owner].expression(), s.bend_dot) if owner in bent else term.xreplace(plain)
        parts = [_multiplied_out(part, values) for part in effect_formulas.rounded_factors(shown).as_ordered_terms()]
        written = [expression(part, name) for part in parts]
        if owner in bent and bent[owner].local:
            # The static shape has the bending (1 - s) delta.
            written = [effect_formulas.along_the_rod(row("<mn>1</mn><mo>−</mo>", symbol("s")), *written)]
        left += map(signed, written)
    drive = terms.drive.subs(sp.Symbol("g", real=True), 0) if undriven(model) else terms.drive
    found = [Formula("Equation of motion", equal(row(*left), expression(drive, name)), needed=True)]
    told: list[Effect] = [e for e in described.terms if isinstance(e, Mode)]
    found += [Formula(mode.title(), effect_formulas.mode_formula(mode, drive)) for mode in told]
    read = terms.output
    if read is not None and read != motion_symbols(system)[0]:
        sensors = [e for e in described.terms if isinstance(e, Sensor) and e.lateness() == 0]
        for sensor in sensors:
            read = sensor.oscillator_reading(read)
        body = expression(read.xreplace(plain), name)
        found.append(Formula("What the instrument reads", equal(symbol("y_read"), body), needed=True))
        told += sensors
    return found, told


def _exact_arm() -> list[Formula]:
    def at(*names: str) -> str:
        return row("<mo>(</mo>", "<mo>,</mo>".join(symbol(n) for n in names), "<mo>)</mo>")

    def partial(letter: str, dots: int) -> str:
        return f"<mfrac>{row('<mo>∂</mo>', symbol(letter))}{row('<mo>∂</mo>', symbol('q_k', dots))}</mfrac>"

    modes = row("<munder><mo>∑</mo><mi>k</mi></munder>", symbol("q_k"), at("t"), symbol("phi_k"), at("s"))
    shape = equal(row(symbol("theta"), at("s", "t")), row(symbol("theta_m"), at("t"), "<mo>+</mo>", modes))
    rate = f"<mfrac><mi>d</mi>{row('<mi>d</mi>', symbol('t'))}</mfrac>"
    sum_of = row(rate, partial("T", 1), "<mo>−</mo>", partial("T", 0), "<mo>+</mo>", partial("V", 0))
    lagrange = row(sum_of, "<mo>+</mo>", partial("D", 1), "<mo>=</mo>", symbol("Q_k"))
    curvature = f"<mfrac>{row('<mo>∂</mo>', symbol('theta'))}{row('<mo>∂</mo>', symbol('s'))}</mfrac>"
    energy = row(
        "<mfrac><mn>1</mn><mn>6</mn></mfrac>",
        "<msubsup><mo>∫</mo><mn>0</mn><mn>1</mn></msubsup>",
        power(row("<mo>(</mo>", curvature, "<mo>)</mo>"), "<mn>2</mn>"),
        "<mi>d</mi>",
        symbol("s"),
    )
    return [
        Formula("Shape of the rod, inextensible, in a few curvature modes", shape),
        Formula("Lagrange’s equations, T the kinetic energy of the rod and of the tip", lagrange, needed=True),
        Formula("Elastic energy of the rod per unit of stiffness, s in lengths of the arm", equal(symbol("U"), energy)),
    ]


def _reduced_arm() -> list[Formula]:
    c = DYNAMIC_REDUCTION
    delta, delta_dot, theta_dot, motor = symbol("delta"), symbol("delta", 1), symbol("theta_t", 1), symbol("theta_m", 2)
    spring = total([("", delta), (f"{float(c.beta):.3g}", power(delta, "<mn>3</mn>"))])
    terms = [
        ("", symbol("theta_t", 2)),
        (f"{float(c.c1):g}", row(delta, power(theta_dot, "<mn>2</mn>"))),
        (f"−{-float(c.c2):g}", row(delta, delta_dot, theta_dot)),
        (f"{float(c.c3):g}", row(delta, power(delta_dot, "<mn>2</mn>"))),
        (f"−{float(c.c_m):g}", row(power(delta, "<mn>2</mn>"), motor)),
        ("", row(symbol("A"), motor)),
        ("", row(symbol("alpha"), "<mo>(</mo>", spring, "<mo>)</mo>")),
    ]
    words = "Mass on the elastica’s radius law, to third order, without a free parameter; effects add"
    return [Formula(words, equal(row(total(terms), "<mo>+</mo><mo>…</mo>"), number("0")))]


def model_formulas(model: Mapping, system: str, values: Mapping[str, float] | None = None) -> list[Formula]:
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
        found = [
            Formula(*line)
            for line in effect_formulas.declared_formulas(model["base"], map(get_effect, model["effects"]))
        ]
    elif scalar:
        found, told = _one_coordinate(model, values or {})
        if has_rod:
            deflection = equal(symbol("delta"), row(symbol("theta_t"), "<mo>−</mo>", symbol("theta_m")))
            found.append(Formula("with the deflection", deflection))
    else:
        found = _reduced_arm() if model["base"] == "reduced" else _exact_arm()
    effects = [e for e in map(get_effect, model["effects"]) if e not in told]
    shown = [e for e in effects if not scalar or "system" in model or e.kind not in LETTERS or e.kind == "memory"]
    if values is not None and not scalar and "system" not in model:
        parts = [e for e in shown if effect_formulas.are_summed(e)]
        found += [Formula(*line, needed=True) for line in effect_formulas.summed(parts, system, values)]
        shown = [e for e in shown if e not in parts]
    groups = effect_formulas.together(shown)
    return found + [Formula(". ".join(e.title() for e in group), _of(group, model, system)) for group in groups]


def shown_formulas(run: Run, when: str) -> list[tuple[str, Markup, str]]:
    """Return the formulas of the model before or after the loop as the page shows them, see `Formula.shown`."""
    return [f.shown for f in model_formulas(run.loop["model"][when]["model"], run.results["rig"]["kind"])]


def _of(group: Sequence[Effect], model: Mapping, system: str) -> str:
    if group[0].place:
        return effect_formulas.placed_formula(group[0])
    if "system" in model:
        return effect_formulas.fault_formula(group, model["base"], system)
    return effect_formulas.effect_formula(group[0], system) if len(group) == 1 else effect_formulas.laws(group, system)


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


def regression_equation(equation: Mapping[str, Any], system: str) -> Markup:
    """Return an equation of the regression with its numbers, as many digits as their intervals deserve."""
    terms = [("", symbol(coordinate_name(system), 2))]
    inputs: list[tuple[str, str]] = []
    for term, value, sd in zip(equation["terms"], equation["coefficients"], equation["sd"], strict=True):
        side = inputs if term == "u" else terms
        side.append((significant(value, _digits(value, sd)), "" if term == "1" else formula(term)))
    return Markup(block(equal(total(terms), total(inputs))))


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
