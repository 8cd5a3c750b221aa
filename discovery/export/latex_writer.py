"""Mathematics as LaTeX in the field's letters."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Mode
from discovery.equations.model import Model

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
    "root": "b", "root_dot": r"\dot{b}", "r_0": r"\theta_{m,\mathrm{rec}}", "u'": r"\dot{u}", "u''": r"\ddot{u}",
}  # fmt: skip
#: Names of symbols that have a letter of their own, the parameters apart.
LETTERED = frozenset(_NAMES)


@dataclass(frozen=True)
class LatexLine:
    """One line of mathematics without delimiters, with plain words for what it is; empty where it goes on."""

    words: str
    latex: str


class Writer:
    """Writes expressions of one model: field symbols, parameters by their declared letters."""

    def __init__(self, model: Model) -> None:
        letters = {n: p.latex for n, p in model.parameters.items() if p.latex}
        self.names = {**_NAMES, **letters}
        if not model.mechanics.system.has_rod:
            self.names |= {"theta": "q", "omega": r"\dot{q}", "delta": "q", "delta_dot": r"\dot{q}"}
            self.names |= {"v_t": r"|\dot{q}|", "r_0": r"u_{\mathrm{rec}}"}
        for mode in (e for e in model.terms if isinstance(e, Mode)):
            z = mode.displacement()
            letter, rate = sp.latex(z), mode.states()[z]
            self.names |= {f"{z}_0": letter, f"{rate}_0": rf"\dot{{{letter}}}", f"{z}_0''": rf"\ddot{{{letter}}}"}

    def rate(self, state: sp.Symbol) -> str:
        """Return the LaTeX of the time derivative of a state."""
        letter = self(state)
        return letter.replace(r"\dot", r"\ddot") if letter.startswith(r"\dot") else rf"\dot{{{letter}}}"

    def __call__(self, expression: sp.Expr) -> str:
        """Return the LaTeX of an expression."""
        shown = sp.sympify(expression).subs(s.v2, _SPEED**2)
        rounded = shown.xreplace({f: sp.Float(float(f), 6) for f in shown.atoms(sp.Float)})
        known = {x: self.names[x.name] for x in rounded.free_symbols if x.name in self.names}
        return sp.latex(rounded, symbol_names=known, mul_symbol=None)
