"""A model as LaTeX: equations that need amsmath, and a table of parameters with uncertainties and units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import ARM, Effect, Joint, Memory, Mode, Sensor, Shape
from discovery.declarations.registry import effect_name
from discovery.equations.contributions import radius_of
from discovery.equations.declared_terms import LETTERS
from discovery.equations.equation import EquationTerms, motion_symbols
from discovery.equations.latex import STATES, LatexLine, Writer, words_in_text
from discovery.equations.model import Model
from discovery.equations.program import RECORDED
from discovery.export.fitted import FittedModel, fitted_model, given_numbers, model_of
from discovery.export.latex_writer import declared_latex, model_writer, parameter_table
from discovery.export.source_text import origin
from discovery.export.symbolic import closed_form, received, to_sympy
from discovery.mechanics.elastica import Elastica
from discovery.mechanics.rod_shapes import reduced_shapes

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

_ROD = (
    ("shape of the rod, s in lengths of the arm", r"\theta(s, t) = \theta_m(t) + \sum_k q_k(t)\, \varphi_k(s)"),
    ("its bending curvature", r"\kappa(s, t) = \sum_k q_k(t)\, \varphi_k'(s)"),
    ("its path in lengths of the arm", r"\mathbf{r}(s, t) = \int_0^s (\cos\theta, \sin\theta)\, \mathrm{d}\sigma"),
    (
        "kinetic energy",
        r"T = \frac{1}{2 \left(1 + \frac{33}{140} \mu\right)} "
        r"\left(\mu \int_0^1 |\dot{\mathbf{r}}|^2\, \mathrm{d}s + |\dot{\mathbf{r}}(1, t)|^2\right)",
    ),
    ("bending energy", r"U = \frac{1}{6} \int_0^1 \kappa^2\, \mathrm{d}s"),
    ("damping form", r"w^2 = \frac{1}{3} \int_0^1 \dot{\kappa}^2\, \mathrm{d}s"),
    ("internal damping of the rod", r"D = \frac{1}{2} \alpha \tau_r w^2"),
)
_LAGRANGE = (
    "Lagrange's equations, sums over everything below",
    r"\frac{\mathrm{d}}{\mathrm{d}t} \frac{\partial T}{\partial \dot{q}_k} - \frac{\partial T}{\partial q_k} "
    r"+ \frac{\partial V}{\partial q_k} + \frac{\partial D}{\partial \dot{q}_k} "
    r"- \frac{\partial P}{\partial \dot{q}_k} = 0",
)


def _parameters_first(term: sp.Expr, write: Writer) -> str:
    """Return the LaTeX of a term as one writes it, its parameters before the motion."""
    moving = [x for x in term.free_symbols if x.name in STATES or x.name.endswith("'")]
    factor, motion = term.as_independent(*moving, as_Add=False)
    if factor.is_number or not motion.is_Mul | motion.is_Symbol | motion.is_Pow or sp.fraction(term)[1] != 1:
        return write(term)
    return f"{write(factor)} {write(motion)}"


def _equation(terms: EquationTerms, write: Writer, model: Model) -> list[LatexLine]:
    """Return the equation of motion, one line for the base and one for each effect."""
    inertia = "" if terms.inertia == 1 else f"\\left({write(terms.inertia)}\\right) "
    lines = [LatexLine("equation of motion", inertia + write(terms.acceleration))]
    titles = {e.id(): effect_name(e.id()) for e in model.terms}
    for name, term in terms.terms:
        body = _parameters_first(term, write)
        signed = body if body.startswith("-") else f"+ {body}"
        lines.append(LatexLine(titles.get(name, "inertia of the moving mass"), signed))
    last = lines[-1]
    lines[-1] = LatexLine(last.words, f"{last.latex} = {write(terms.drive)}")
    modes = {f"{z}_0": effect_name(e.id()) for e in model.terms if isinstance(e, Mode) for z in e.states()}
    lines += [
        LatexLine(modes.get(state.name, "memory"), write.slope(state, slope))
        for state, slope in terms.memory
        if not (state.name in modes and slope.is_Symbol)
    ]
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
    lines.append(LatexLine("tip", r"(x, y) = l\, \mathbf{r}(1, t), \quad \delta = \theta_t - \theta_m"))
    end = r"\mathbf{r}(1, t)"
    motion = rf"\theta_t = \arg {end}, \quad \bar{{\rho}} = |{end}|, \quad v_t = |\dot{{\mathbf{{r}}}}(1, t)|"
    lines.append(LatexLine("angle, radius and speed of the tip", motion))
    return lines


def _energy(effect: Effect, write: Writer) -> list[LatexLine]:
    """Return what an effect declares: its energy, power or force, and states of its own."""
    letter = "F" if getattr(effect, "on", None) is not None else LETTERS.get(effect.kind, "p")
    body = write(effect.expression())  # type: ignore[attr-defined]
    if isinstance(effect, Memory):
        body = (
            rf"3 \int_0^1 \left({body}\right) \mathrm{{d}}s, \quad b = \frac{{1}}{{3}} \kappa(s, t)"
            if effect.local
            else rf"\sum \left({body}\right), \quad U = \frac{{1}}{{2}} \sum b^{{2}}"
        )
    elif isinstance(effect, Joint):
        body += r", \quad P = - \alpha b \dot{p}, \quad b = \frac{1}{3} \kappa(0, t)"
    lines = [LatexLine(effect_name(effect.id()), f"{letter} = {body}")]
    return lines + [LatexLine("memory", write.slope(*state)) for state in effect.states().items()]


def _shape(effect: Shape, write: Writer) -> LatexLine:
    """Return what an effect of shape adds to the slope of the rod, and the spring at its root to the energy."""
    added = [] if effect.rest_angle() == 0 else [write(effect.rest_angle())]
    energy = ""
    if effect.root_turn() != 0:
        turn = write(effect.root_turn())
        added.append(rf"{turn} \kappa(0, t)")
        energy = rf", \quad \Delta U = \frac{{1}}{{6}} {turn} \kappa(0, t)^{{2}}"
    return LatexLine(effect_name(effect.id()), rf"\Delta\theta(s, t) = {' + '.join(added)}{energy}")


def _reading(model: Model, write: Writer) -> list[LatexLine]:
    """Return what the instrument reports."""
    terms = closed_form(model)
    sensors = [e for e in model.terms if isinstance(e, Sensor)]
    left: tuple[str, ...] = (r"x_{\mathrm{read}}", r"y_{\mathrm{read}}")
    if terms is None:
        shown: tuple[sp.Expr, ...] = sp.symbols("tip_x tip_y", real=True)
        for sensor in sensors:
            shown = sensor.arm_reading(*shown)
    elif terms.output is None:
        motor = {s.theta_m: motion_symbols(ARM)[0] - s.delta}
        shown = tuple(e.xreplace(motor) for e in to_sympy(model).reading)
    else:
        output = terms.output
        for sensor in sensors:
            output = sensor.oscillator_reading(output)
        shown = (output,)
        left = (r"q_{\mathrm{read}}" if model.mechanics.reads_state else r"y_{\mathrm{read}}",)
    lines = [LatexLine("reading", f"{a} = {write(e)}") for a, e in zip(left, shown, strict=True)]
    lateness = sp.Add(*[e.lateness() for e in sensors])
    if lateness != 0:
        lines.append(
            LatexLine("time of the state that is read at t", f"t_{{\\mathrm{{read}}}} = t - {write(lateness)}")
        )
    return lines


def latex_lines(model: Model) -> tuple[LatexLine, ...]:
    """Return the mathematics of a model in letters, line by line: motion, memory, radius law, drive, reading."""
    write = model_writer(model)
    terms = closed_form(model)
    lines: list[LatexLine] = []
    if model.mechanics.places():
        return (LatexLine(*_LAGRANGE), *declared_latex(model))
    if terms is not None:
        lines += _equation(terms, write, model)
        if model.mechanics.system.has_rod:
            lines.append(LatexLine("deflection", r"\delta = \theta_t - \theta_m"))
    else:
        lines.append(LatexLine(*_LAGRANGE))
        if isinstance(model.mechanics, Elastica):
            lines += _rod(model.mechanics)
        for effect in model.terms:
            if effect.kind in LETTERS or isinstance(effect, Joint):
                lines += _energy(effect, write)
    lines += [_shape(effect, write) for effect in model.terms if isinstance(effect, Shape)]
    closures = " + ".join(effect_name(effect.id()) for effect in model.terms if effect.kind == "closure")
    if (law := radius_of(model.terms)) is not None:
        shown = write(law) if law.func is not sp.Add else f"\\left({write(law)}\\right)"
        lines.append(LatexLine(closures, f"\\rho_t = l {shown}"))
    symbol, from_recorded = received(model)
    if from_recorded not in RECORDED:
        lines.append(LatexLine("what is received, from what is recorded", f"{write(symbol)} = {write(from_recorded)}"))
    return (*lines, *_reading(model, write))


def to_latex(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> str:
    r"""Return a model as LaTeX that stands in a document with amsmath as it is.

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

    Raises
    ------
    InputError
        For what has no model, a name that is not a parameter of it, or a value that is not a finite number.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    >>> values = {"xi": 0.16, "alpha": 400.0, "g": 0.0}  # s^-1, s^-2
    >>> to_latex(model, values).splitlines()[-2]
    '$\\alpha$ & $400$ & $\\mathrm{s}^{-2}$ & linear stiffness, held \\\\'
    """
    model = model_of(source)
    given_numbers(model, values)
    bare = isinstance(source, Model) and not source.parameters.keys() <= {*source.known, *(values or {})}
    found = None if bare else fitted_model(source, values)
    header = [f"% {line}" for line in (origin(found) if found is not None else [])]
    rows = [f"  & {line.latex} && \\text{{{words_in_text(line.words)}}}" for line in latex_lines(model)]
    equations = [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]
    table = [] if found is None else parameter_table(found, model_writer(model))
    return "\n".join([*header, *equations, *table]) + "\n"
