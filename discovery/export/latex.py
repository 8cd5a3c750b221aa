"""A model as LaTeX: equations that need amsmath, and a table of parameters with uncertainties and units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from discovery import symbols as s
from discovery.effect import ARM, Effect, Sensor, Shape
from discovery.equation import EquationTerms, motion_symbols
from discovery.export.fitted import FittedModel, fitted_model
from discovery.export.header import origin
from discovery.export.latex_table import parameter_table, words_in_text
from discovery.export.symbolic import LETTERS, closed_form, to_sympy
from discovery.mechanics.elastica import Elastica
from discovery.mechanics.rod_shapes import reduced_shapes
from discovery.model import Model
from discovery.program import RECORDED, build_program, radius_of

if TYPE_CHECKING:
    from discovery.fit import Fit

__all__ = ["LatexLine", "latex_lines", "to_latex"]

#: The speed itself, so that its square root and its powers look as one writes them.
_SPEED = sp.Symbol("v_t", positive=True)
_NAMES = {
    "theta_t": r"\theta_t", "theta_t'": r"\dot{\theta}_t", "theta_t''": r"\ddot{\theta}_t", "theta_m": r"\theta_m",
    "theta_m'": r"\dot{\theta}_m",
    "theta_m''": r"\ddot{\theta}_m", "delta": r"\delta", "delta'": r"\dot{\delta}", "q": "q", "q'": r"\dot{q}",
    "q''": r"\ddot{q}", "theta": r"\theta_t", "omega": r"\dot{\theta}_t", "delta_dot": r"\dot{\delta}",
    "omega_m": r"\dot{\theta}_m", "alpha_m": r"\ddot{\theta}_m", "x": r"\bar{x}", "y": r"\bar{y}",
    "x_g": r"\bar{x}_g", "y_g": r"\bar{y}_g", "v_x": r"\dot{\bar{x}}", "v_y": r"\dot{\bar{y}}", "rho": r"\bar{\rho}",
    "v_t": "v_t", "bend": "b", "bend_dot": r"\dot{b}", "tip_x": "x", "tip_y": "y", "w2": "{w^{2}}", "length": "l",
    "slope": r"\theta(1, t)", "slope_dot": r"\dot{\theta}(1, t)", "arc": "s",
    "root": "b", "root_dot": r"\dot{b}", "r_0": r"\theta_{m,\mathrm{rec}}",
}  # fmt: skip
_ROD = (
    ("shape of the rod, s in lengths of the arm", r"\theta(s, t) = \theta_m(t) + \sum_k q_k(t)\, \varphi_k(s)"),
    ("path of the rod in lengths of the arm", r"p(s, t) = \int_0^s (\cos\theta, \sin\theta)\, \mathrm{d}\sigma"),
    (
        "kinetic energy",
        r"T = \frac{1}{2 \left(1 + \frac{33}{140} \mu\right)} "
        r"\left(\mu \int_0^1 |\dot{p}|^2\, \mathrm{d}s + |\dot{p}(1, t)|^2\right)",
    ),
    ("bending energy", r"U = \frac{1}{6} \int_0^1 \left(\frac{\partial \theta}{\partial s}\right)^2 \mathrm{d}s"),
    ("damping form", r"w^2 = \frac{1}{3} \int_0^1 \left(\frac{\partial \dot{\theta}}{\partial s}\right)^2 \mathrm{d}s"),
    ("internal damping of the rod", r"D = \frac{1}{2} \alpha \tau_r w^2"),
)
_LAGRANGE = (
    "Lagrange's equations, sums over everything below",
    r"\frac{\mathrm{d}}{\mathrm{d}t} \frac{\partial T}{\partial \dot{q}_k} - \frac{\partial T}{\partial q_k} "
    r"+ \frac{\partial V}{\partial q_k} + \frac{\partial D}{\partial \dot{q}_k} "
    r"- \frac{\partial P}{\partial \dot{q}_k} = 0",
)


@dataclass(frozen=True)
class LatexLine:
    """One line of mathematics.

    Parameters
    ----------
    words : str
        What it is, as plain words; empty where it goes on.
    latex : str
        Mathematics without delimiters.
    """

    words: str
    latex: str


class _Writer:
    """Writes expressions of one model: field symbols, parameters by their declared letters."""

    def __init__(self, model: Model) -> None:
        letters = {n: p.latex for n, p in model.parameters.items() if p.latex}
        self.names = {**_NAMES, **letters}
        if model.mechanics.system != ARM:
            self.names |= {"theta": "q", "omega": r"\dot{q}", "delta": "q", "delta_dot": r"\dot{q}"}
            self.names |= {"v_t": r"|\dot{q}|", "r_0": r"u_{\mathrm{rec}}"}

    def __call__(self, expression: sp.Expr) -> str:
        """Return the LaTeX of an expression."""
        shown = sp.sympify(expression).subs(s.v2, _SPEED**2)
        rounded = shown.xreplace({f: sp.Float(float(f), 6) for f in shown.atoms(sp.Float)})
        known = {x: self.names[x.name] for x in rounded.free_symbols if x.name in self.names}
        return sp.latex(rounded, symbol_names=known, mul_symbol=None)


def _parameters_first(term: sp.Expr, write: _Writer) -> str:
    """Return the LaTeX of a term as one writes it, its parameters before the motion."""
    moving = [x for x in term.free_symbols if x.name == "t" or x.name in _NAMES.keys() - {"length"}]
    factor, motion = term.as_independent(*moving, as_Add=False)
    if factor.is_number or not motion.is_Mul | motion.is_Symbol | motion.is_Pow or sp.fraction(term)[1] != 1:
        return write(term)
    return f"{write(factor)} {write(motion)}"


def _equation(terms: EquationTerms, write: _Writer, model: Model) -> list[LatexLine]:
    """Return the equation of motion, one line for the base and one for each effect."""
    inertia = "" if terms.inertia == 1 else f"\\left({write(terms.inertia)}\\right) "
    lines = [LatexLine("equation of motion", inertia + write(terms.acceleration))]
    titles = {e.id(): e.id().replace("_", " ") for e in model.terms}
    for name, term in terms.terms:
        body = _parameters_first(term, write)
        signed = body if body.startswith("-") else f"+ {body}"
        lines.append(LatexLine(titles.get(name, "inertia of the moving mass"), signed))
    last = lines[-1]
    lines[-1] = LatexLine(last.words, f"{last.latex} = {write(terms.drive)}")
    for state, slope in terms.memory:
        lines.append(LatexLine("memory", f"\\dot{{{write(state)}}} = {write(slope)}"))
    return lines


def _rod(base: Elastica) -> list[LatexLine]:
    """Return the exact arm: its shapes as polynomials, energies and tip."""
    lines = [LatexLine(*line) for line in _ROD]
    n = base.n_coordinates
    for k, row in enumerate(reduced_shapes(max(2, n))[:n], 1):
        # The polynomials (j + 1) s^j - j s^(j + 1), sorted by power.
        factors = np.zeros(row.size + 2)
        powers = np.arange(1, row.size + 1)
        factors[powers] += (powers + 1) * row
        factors[powers + 1] -= powers * row
        body = " ".join(
            f"{'-' if c < 0 else '+'} {f'{abs(c):.9g} '.removeprefix('1 ')}s" + (f"^{{{p}}}" if p > 1 else "")
            for p, c in enumerate(factors)
            if abs(c) > 1e-12
        )
        lines.append(LatexLine(f"shape {k}", f"\\varphi_{{{k}}}(s) = {body.removeprefix('+ ')}"))
    lines.append(LatexLine("tip", r"(x, y) = l\, p(1, t), \quad \delta = \theta_t - \theta_m"))
    motion = r"\theta_t = \arg p(1, t), \quad \bar{\rho} = |p(1, t)|, \quad v_t = |\dot{p}(1, t)|"
    lines.append(LatexLine("angle, radius and speed of the tip", motion))
    return lines


def _energy(effect: Effect, write: _Writer) -> list[LatexLine]:
    """Return what an effect declares: its energy, power or force, and states of its own."""
    letter = "F" if getattr(effect, "on", None) is not None else LETTERS[effect.kind]
    lines = [LatexLine(effect.id().replace("_", " "), f"{letter} = {write(effect.expression())}")]  # type: ignore[attr-defined]
    if effect.kind in ("memory", "joint"):
        rates = effect.states().items()  # type: ignore[attr-defined]
        lines += [LatexLine("memory", f"\\dot{{{write(z)}}} = {write(rate)}") for z, rate in rates]
    return lines


def _shape(effect: Shape, write: _Writer) -> LatexLine:
    """Return what an effect of shape adds to the slope of the rod, and the spring at its root to the energy."""
    added = [] if effect.rest_angle() == 0 else [write(effect.rest_angle())]
    energy = ""
    if effect.root_turn() != 0:
        turn = write(effect.root_turn())
        added.append(rf"{turn} \kappa(0, t)")
        energy = rf", \quad \Delta U = \frac{{1}}{{6}} {turn} \kappa(0, t)^{{2}}"
    return LatexLine(effect.id().replace("_", " "), rf"\Delta\theta(s, t) = {' + '.join(added)}{energy}")


def _reading(model: Model, write: _Writer) -> list[LatexLine]:
    """Return what the instrument reports."""
    lines = []
    arm = model.mechanics.system == ARM
    if closed_form(model) is None:
        shown: tuple[sp.Expr, ...] = sp.symbols("tip_x tip_y", real=True)
        for effect in model.terms:
            if isinstance(effect, Sensor):
                shown = effect.arm_reading(*shown)
    else:
        found = to_sympy(model)
        motor = {s.theta_m: motion_symbols(model.mechanics.system)[0] - s.delta}
        shown = tuple(e.xreplace(motor) for e in found.reading)
    left = (r"x_{\mathrm{read}}", r"y_{\mathrm{read}}") if arm else (r"q_{\mathrm{read}}",)
    lines = [LatexLine("reading", f"{a} = {write(e)}") for a, e in zip(left, shown, strict=True)]
    lateness = sp.Add(*[e.lateness() for e in model.terms if isinstance(e, Sensor)])
    if lateness != 0:
        lines.append(
            LatexLine("time of the state that is read at t", f"t_{{\\mathrm{{read}}}} = t - {write(lateness)}")
        )
    return lines


def latex_lines(model: Model) -> tuple[LatexLine, ...]:
    """Return the mathematics of a model, line by line: motion, memory, radius law, drive, reading.

    Parameters
    ----------
    model : Model
        The model; its parameters stay letters.
    """
    write = _Writer(model)
    terms = closed_form(model)
    lines: list[LatexLine] = []
    if terms is not None:
        lines += _equation(terms, write, model)
        if model.mechanics.system == ARM:
            lines.append(LatexLine("deflection", r"\delta = \theta_t - \theta_m"))
    else:
        lines.append(LatexLine(*_LAGRANGE))
        if isinstance(model.mechanics, Elastica):
            lines += _rod(model.mechanics)
        for effect in model.terms:
            if effect.kind in LETTERS:
                lines += _energy(effect, write)
    lines += [_shape(effect, write) for effect in model.terms if isinstance(effect, Shape)]
    closures = " + ".join(effect.id().replace("_", " ") for effect in model.terms if effect.kind == "closure")
    if (law := radius_of(model.terms)) is not None:
        shown = write(law) if law.func is not sp.Add else f"\\left({write(law)}\\right)"
        lines.append(LatexLine(closures, f"\\rho_t = l {shown}"))
    received, from_recorded = build_program(model.base, model.effects).drive[0]
    if from_recorded not in RECORDED:
        lines.append(
            LatexLine("what is received, from what is recorded", f"{write(received)} = {write(from_recorded)}")
        )
    return (*lines, *_reading(model, write))


def to_latex(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> str:
    """Return a model as LaTeX that stands in a document with amsmath as it is.

    Parameters
    ----------
    source : FittedModel, Fit or Model
        What to export; a bare model without all of its numbers gives the equations alone.
    values : mapping of str to float, optional
        Numbers that replace those of `source` [SI, radians].

    Returns
    -------
    str
        An align* environment (equation of motion, radius law, reading), then a table of the parameters: value with
        one standard deviation, unit, meaning.
    """
    bare = isinstance(source, Model) and not source.parameters.keys() <= {*source.known, *(values or {})}
    found = None if bare else fitted_model(source, values)
    model = source if isinstance(source, Model) else source.model
    header = [f"% {line}" for line in (origin(found) if found is not None else [])]
    rows = [f"  & {line.latex} && \\text{{{words_in_text(line.words)}}}" for line in latex_lines(model)]
    equations = [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]
    return "\n".join([*header, *equations, *([] if found is None else parameter_table(found, _Writer(model)))]) + "\n"
