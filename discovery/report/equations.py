"""The models of a run as formulas: what each effect adds to the equation of motion, or to the arm's energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from discovery.declarations.effect import Mode, Sensor
from discovery.declarations.registry import get_effect
from discovery.mechanics import get_base
from discovery.mechanics.rod import rod_of
from discovery.report.declared_formulas import declared_formulas, fault_formula, placed_formula
from discovery.report.effect_formulas import (
    LETTERS,
    along_the_rod,
    coordinate_name,
    effect_formula,
    equal,
    laws,
    mode_formula,
    rounded_factors,
    signed,
    together,
)
from discovery.report.energies import are_summed, summed
from discovery.report.mathml import number, power, row, symbol, total
from discovery.report.mathml_expression import expression
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION

if TYPE_CHECKING:
    import sympy as sp

    from discovery.declarations.effect import Effect
    from discovery.mechanics.base import Mechanics

__all__ = ["Formula", "discovered_equation", "model_formulas", "undriven"]


@dataclass(frozen=True)
class Formula:
    """One line of mathematics in presentation MathML without its enclosing element, with the words before it.

    The equation is incomplete without one that is `needed`, although no parameter may stand in it.
    """

    words: str
    body: str
    needed: bool = False


def _push(effect: Effect, mechanics: Mechanics) -> sp.Expr:
    """Return what an effect adds to the left-hand side of an equation of one coordinate."""
    import sympy as sp

    from discovery.declarations import symbols as s

    declared = effect.expression()  # type: ignore[attr-defined]
    if effect.kind == "memory":
        return -sp.diff(declared, s.bend_dot)
    if effect.kind == "kinetic":
        end = mechanics.channels[s.slope_dot].value.subs(mechanics.rates[0], s.omega)
        momentum = sp.expand(sp.diff(declared.subs(s.slope_dot, end), s.omega))
        acceleration = sp.Symbol("acceleration", real=True)
        pairs = ((s.theta_m, s.omega_m), (s.omega_m, s.alpha_m), (s.theta, s.omega), (s.omega, acceleration))
        return sp.Add(*[sp.diff(momentum, a) * b for a, b in pairs]) - sp.diff(declared, s.theta)
    simple = {s.rho: 1, s.v2: s.omega**2, s.w2: s.delta_dot**2}
    if getattr(effect, "on", None) is not None:
        return (-declared * _lever(effect.on, mechanics)).subs(simple)  # type: ignore[attr-defined]
    channels = s.POSITION_CHANNELS if effect.kind == "potential" else s.RATE_CHANNELS
    sign = -1 if effect.kind == "load" else 1
    added = sp.Integer(0)
    for channel in channels:
        force = sp.diff(declared, channel)
        if force != 0:
            added += sign * force * _lever(channel, mechanics)
    return added.subs(simple).doit()


def _lever(channel: sp.Symbol, mechanics: Mechanics) -> sp.Expr:
    from discovery.declarations import symbols as s

    simple = {s.v2: 2 * s.omega, s.w2: 2 * s.delta_dot}
    if channel in simple:
        return simple[channel]
    jacobian, q = mechanics.channels[channel].jacobian[0], mechanics.coordinates[0]
    if channel in (s.U, s.U_4):
        return jacobian.subs(q, s.delta + q - mechanics.channels[s.delta].value)
    return jacobian.subs({q: s.theta, mechanics.rates[0]: s.omega})


def _scalar_equation(model: Mapping) -> str:
    """Return the equation of motion of the paper's arm."""
    mechanics = get_base(model["base"]).mechanics(rod_of(map(get_effect, model["effects"])))
    name = "theta_t"
    parts = [symbol(name, 2)]
    for effect_id in model["effects"]:
        effect = get_effect(effect_id)
        if effect.kind in LETTERS:
            pushes = rounded_factors(_push(effect, mechanics)).as_ordered_terms()
            written = [expression(push, name) for push in pushes if push != 0]
            if getattr(effect, "local", False):
                # The static shape has the bending (1 - s) delta.
                written = [along_the_rod(row("<mn>1</mn><mo>−</mo>", symbol("s")), *written)]
            parts += [signed(body) for body in written]
    return equal(row(*parts), "<mn>0</mn>")


def undriven(model: Mapping) -> bool:
    """Return whether the recordings of a model have no input."""
    return bool(model.get("known", {}).get("g") == 0)


def _multiplied_out(term: sp.Expr, values: Mapping[str, float]) -> sp.Expr:
    """Return a term with a number for the product of two parameters or more before it."""
    import sympy as sp

    factor, rest = term.as_independent(*[x for x in term.free_symbols if x.name not in values], as_Add=False)
    if len(factor.free_symbols) < 2:
        return term
    return sp.Float(float(factor.xreplace({x: sp.Float(values[x.name]) for x in factor.free_symbols})), 4) * rest


def _on_a_line(model: Mapping, values: Mapping[str, float]) -> tuple[list[Formula], list[Effect]]:
    """Return the equation of motion of a system with one coordinate on a line, its modes, and what is read of it.

    The effects that need no formula any more come second.
    """
    import sympy as sp

    from discovery.equations.equation import equation_terms, motion_symbols
    from discovery.equations.model import Model

    base, described = get_base(model["base"]), Model(model["base"], tuple(model["effects"]))
    terms = equation_terms(described)
    # One coordinate has one set of states: their number is left out.
    states = [(z.name + dots, z.name.removesuffix("_0") + dots) for z, _ in terms.memory for dots in ("", "''")]
    plain = {sp.Symbol(long, real=True): sp.Symbol(short, real=True) for long, short in states}
    left = [expression(terms.acceleration)]
    if terms.inertia != 1:
        left.insert(0, row("<mo>(</mo>", expression(terms.inertia, "q"), "<mo>)</mo>"))
    for _, term in terms.terms:
        parts = rounded_factors(term.xreplace(plain)).as_ordered_terms()
        left += [signed(expression(_multiplied_out(part, values), "q")) for part in parts]
    drive = terms.drive.subs(sp.Symbol("g", real=True), 0) if undriven(model) else terms.drive
    found = [Formula("Equation of motion", equal(row(*left), expression(drive, "q")), needed=True)]
    told: list[Effect] = [e for e in described.terms if isinstance(e, Mode)]
    found += [Formula(mode.title(), mode_formula(mode, drive)) for mode in told]
    read = terms.output
    if read is not None and read != motion_symbols(base.system)[0]:
        sensors = [e for e in described.terms if isinstance(e, Sensor) and e.lateness() == 0]
        for sensor in sensors:
            read = sensor.oscillator_reading(read)
        body = expression(read.xreplace(plain), "q")
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
    scalar = not get_base(model["base"]).system.has_rod or model["base"] == "constant_radius"
    if "system" in model:
        found = [Formula(*line) for line in declared_formulas(model["base"], map(get_effect, model["effects"]))]
    elif not get_base(model["base"]).system.has_rod:
        found, told = _on_a_line(model, values or {})
    elif scalar:
        deflection = equal(symbol("delta"), row(symbol("theta_t"), "<mo>−</mo>", symbol("theta_m")))
        equation = Formula("Equation of motion", _scalar_equation(model), needed=True)
        found = [equation, Formula("with the deflection", deflection)]
    else:
        found = _reduced_arm() if model["base"] == "reduced" else _exact_arm()
    effects = [e for e in map(get_effect, model["effects"]) if e not in told]
    shown = [e for e in effects if not scalar or "system" in model or e.kind not in LETTERS or e.kind == "memory"]
    if values is not None and not scalar and "system" not in model:
        parts = [e for e in shown if are_summed(e)]
        found += [Formula(*line, needed=True) for line in summed(parts, system, values)]
        shown = [e for e in shown if e not in parts]
    groups = together(shown)
    return found + [Formula(". ".join(e.title() for e in group), _of(group, model, system)) for group in groups]


def _of(group: Sequence[Effect], model: Mapping, system: str) -> str:
    if group[0].place:
        return placed_formula(group[0])
    if "system" in model:
        return fault_formula(group, model["base"], system)
    return effect_formula(group[0], system) if len(group) == 1 else laws(group, system)


def discovered_equation(terms: list[tuple[str, str]], inputs: list[tuple[str, str]], system: str) -> str:
    """Return an equation found by regression, from the printed coefficient and the MathML of each term and input."""
    return equal(total([("", symbol(coordinate_name(system), 2)), *terms]), total(inputs))
