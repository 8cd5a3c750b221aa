"""The models of a run as formulas: what each effect adds to the equation of motion, or to the arm's energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from discovery.dynamic_reduction import DYNAMIC_REDUCTION
from discovery.mechanics import get_base
from discovery.mechanics.rod import rod_of
from discovery.registry import get_effect
from discovery.report.mathml import expression, number, power, row, symbol, total

if TYPE_CHECKING:
    import sympy as sp

    from discovery.effect import Effect
    from discovery.mechanics.base import Mechanics

__all__ = ["Formula", "discovered_equation", "effect_formula", "model_formulas"]

#: Letters of the energies, of the power of a load or a memory, and of the turn of the root in a joint.
_LETTERS = {"kinetic": "T", "potential": "V", "dissipation": "D", "load": "P", "memory": "P", "joint": "p"}


@dataclass(frozen=True)
class Formula:
    """One line of mathematics with the words before it.

    Parameters
    ----------
    words : str
        A clause that says what it is.
    body : str
        Presentation MathML without the enclosing element.
    """

    words: str
    body: str


def _coordinate(system: str) -> str:
    return "theta_t" if system == "flexible_arm" else "q"


def _equal(left: str, right: str) -> str:
    return row(left, "<mo>=</mo>", right)


def effect_formula(effect: Effect, system: str) -> str:
    """Return what an effect declares: its energy, power, law or what the instrument reports.

    Parameters
    ----------
    effect : Effect
        The effect.
    system : str
        Kind of system.
    """
    import sympy as sp

    name = _coordinate(system)
    if effect.kind in _LETTERS:
        letter = "F" if getattr(effect, "on", None) is not None else _LETTERS[effect.kind]
        lines = [_equal(symbol(letter), expression(effect.expression(), name))]  # type: ignore[attr-defined]
        if effect.kind in ("memory", "joint"):
            for state, rate in effect.states().items():  # type: ignore[attr-defined]
                lines.append(_equal(symbol(state.name, 1), expression(rate, name)))
        return row('<mo>,</mo><mspace width="1em"/>'.join(lines))
    if effect.kind == "shape":
        # Kappa_r is the curvature at the root.
        added = effect.rest_angle() + effect.root_turn() * sp.Symbol("kappa_r")  # type: ignore[attr-defined]
        return row(symbol("theta"), "<mo>→</mo>", symbol("theta"), "<mo>+</mo>", expression(added, name))
    if effect.kind == "closure":
        ratio = row(symbol("rho_t"), "<mo>/</mo>", symbol("l"))
        return _equal(ratio, expression(effect.expression(), name))  # type: ignore[attr-defined]
    if effect.kind == "drive":
        entered = symbol("theta_m" if system == "flexible_arm" else "u")
        return row(entered, "<mo>→</mo>", expression(effect.expression(), name))  # type: ignore[attr-defined]
    late = effect.lateness()  # type: ignore[attr-defined]
    if late != 0:
        return _equal(symbol("t_read"), row(symbol("t"), "<mo>−</mo>", expression(late, name)))
    if system == "flexible_arm":
        true = sp.symbols("tip_x tip_y", real=True)
        read = effect.arm_reading(*true)  # type: ignore[attr-defined]
        names = ("x_read", "y_read")
        lines = [_equal(symbol(n), expression(e, name)) for n, e in zip(names, read, strict=True)]
        return row('<mo>,</mo><mspace width="1em"/>'.join(lines))
    true_output = sp.Symbol("q", real=True)
    return _equal(symbol("q_read"), expression(effect.oscillator_reading(true_output), name))  # type: ignore[attr-defined]


def _push(effect: Effect, mechanics: Mechanics) -> sp.Expr:
    """Return what an effect adds to the left-hand side of an equation of one coordinate."""
    import sympy as sp

    from discovery import symbols as s

    declared = effect.expression()  # type: ignore[attr-defined]
    if effect.kind == "memory":
        return -sp.diff(declared, s.bend_dot)
    if effect.kind == "kinetic":
        end = mechanics.channels[s.slope_dot].value.subs(mechanics.rates[0], s.omega)
        momentum = sp.expand(sp.diff(declared.subs(s.slope_dot, end), s.omega))
        acceleration = sp.Symbol("acceleration", real=True)
        pairs = ((s.theta_m, s.omega_m), (s.omega_m, s.alpha_m), (s.theta, s.omega), (s.omega, acceleration))
        return sp.Add(*[sp.diff(momentum, a) * b for a, b in pairs]) - sp.diff(declared, s.theta)
    if getattr(effect, "on", None) is not None:
        return -declared * _lever(effect.on, mechanics)  # type: ignore[attr-defined]
    channels = s.POSITION_CHANNELS if effect.kind == "potential" else s.RATE_CHANNELS
    sign = -1 if effect.kind == "load" else 1
    added = sp.Integer(0)
    for channel in channels:
        force = sp.diff(declared, channel)
        if force != 0:
            added += sign * force * _lever(channel, mechanics)
    return added.subs({s.rho: 1, s.v2: s.omega**2, s.w2: s.delta_dot**2}).doit()


def _lever(channel: sp.Symbol, mechanics: Mechanics) -> sp.Expr:
    from discovery import symbols as s

    simple = {s.v2: 2 * s.omega, s.w2: 2 * s.delta_dot}
    if channel in simple:
        return simple[channel]
    jacobian, q = mechanics.channels[channel].jacobian[0], mechanics.coordinates[0]
    if channel in (s.U, s.U_4):
        return jacobian.subs(q, s.delta + q - mechanics.channels[s.delta].value)
    return jacobian.subs({q: s.theta, mechanics.rates[0]: s.omega})


def _rounded(value: sp.Expr) -> sp.Expr:
    """Return the expression with decimal factors to four digits."""
    import sympy as sp

    return value.xreplace({f: sp.Float(float(f), 4) for f in value.atoms(sp.Float)})


def _scalar_equation(model: Mapping, system: str) -> str:
    """Return the equation of motion of the paper's arm or of an oscillator."""
    mechanics = get_base(model["base"]).mechanics(rod_of(map(get_effect, model["effects"])))
    name = _coordinate(system)
    parts = [symbol(name, 2)]
    for effect_id in model["effects"]:
        effect = get_effect(effect_id)
        if effect.kind in _LETTERS:
            pushes = _rounded(_push(effect, mechanics)).as_ordered_terms()
            parts += [_signed(expression(push, name)) for push in pushes if push != 0]
    right = "<mn>0</mn>" if system == "flexible_arm" else row(symbol("g"), '<mspace width="0.12em"/>', symbol("u"))
    return _equal(row(*parts), right)


def _signed(body: str) -> str:
    """Return a term of a sum with its sign in front."""
    minus = "<mrow><mo>−</mo>"
    return f"<mo>−</mo><mrow>{body.removeprefix(minus)}" if body.startswith(minus) else f"<mo>+</mo>{body}"


def _exact_arm() -> list[Formula]:
    def at(*names: str) -> str:
        return row("<mo>(</mo>", "<mo>,</mo>".join(symbol(n) for n in names), "<mo>)</mo>")

    def partial(letter: str, dots: int) -> str:
        return f"<mfrac>{row('<mo>∂</mo>', symbol(letter))}{row('<mo>∂</mo>', symbol('q_k', dots))}</mfrac>"

    modes = row("<munder><mo>∑</mo><mi>k</mi></munder>", symbol("q_k"), at("t"), symbol("phi_k"), at("s"))
    shape = _equal(row(symbol("theta"), at("s", "t")), row(symbol("theta_m"), at("t"), "<mo>+</mo>", modes))
    lagrange = row(
        f"<mfrac><mi>d</mi>{row('<mi>d</mi>', symbol('t'))}</mfrac>", partial("T", 1), "<mo>−</mo>", partial("T", 0),
        "<mo>+</mo>", partial("V", 0), "<mo>+</mo>", partial("D", 1), "<mo>=</mo>", symbol("Q_k"),
    )  # fmt: skip
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
        Formula("Lagrange’s equations, T the kinetic energy of the rod and of the tip", lagrange),
        Formula(
            "Elastic energy of the rod per unit of stiffness, s in lengths of the arm", _equal(symbol("U"), energy)
        ),
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
    return [Formula(words, _equal(row(total(terms), "<mo>+</mo><mo>…</mo>"), number("0")))]


def model_formulas(model: Mapping, system: str) -> list[Formula]:
    """Return the formulas of a model.

    Parameters
    ----------
    model : mapping
        What `discovery.model.Model.to_dict` gave.
    system : str
        Kind of system.

    Returns
    -------
    list of Formula
        The equation of motion where the base has one coordinate, else Lagrange's equations and every effect's part in
        them; then what closures, drives and sensors say.
    """
    scalar = model["base"] in ("constant_radius", "oscillator")
    if scalar:
        found = [Formula("Equation of motion", _scalar_equation(model, system))]
        if system == "flexible_arm":
            found.append(
                Formula(
                    "with the deflection",
                    _equal(symbol("delta"), row(symbol("theta_t"), "<mo>−</mo>", symbol("theta_m"))),
                )
            )
    else:
        found = _reduced_arm() if model["base"] == "reduced" else _exact_arm()
    for effect_id in model["effects"]:
        effect = get_effect(effect_id)
        if not scalar or effect.kind not in _LETTERS or effect.kind == "memory":
            found.append(Formula(effect.title(), effect_formula(effect, system)))
    return found


def discovered_equation(terms: list[tuple[str, str]], inputs: list[tuple[str, str]], system: str) -> str:
    """Return an equation found by sparse regression, with its numbers.

    Parameters
    ----------
    terms, inputs : list of (str, str)
        Printed coefficient and MathML of each term on the left, and of the inputs on the right.
    system : str
        Kind of system.
    """
    return _equal(total([("", symbol(_coordinate(system), 2)), *terms]), total(inputs))
