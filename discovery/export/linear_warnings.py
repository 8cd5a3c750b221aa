"""Where a tangent misleads: laws that are no smooth function of the motion, memory, an instrument that is ahead."""

from __future__ import annotations

import sympy as sp

from discovery.declarations.effect import Closure, Drive, Effect, Memory, Sensor, Shape
from discovery.equations.model import Model


def _sharp(effect: Effect) -> bool:
    """Return whether a law is no smooth function of the motion: friction, drag, play, whose tangent says little."""
    if isinstance(effect, Closure | Drive | Sensor | Shape):
        return False
    laws: list[sp.Expr] = [sp.sympify(effect.expression())]  # type: ignore[attr-defined]
    if isinstance(effect, Memory):
        laws += list(effect.states().values())
    return any(
        e.has(sp.Abs, sp.sign, sp.Min, sp.Max, sp.Piecewise)
        or any(not p.exp.is_Integer for p in e.atoms(sp.Pow) if not p.exp.free_symbols and not p.base.is_number)
        for e in laws
    )


def tangent_warnings(model: Model, averaged: bool, rate: float, late: float) -> tuple[str, ...]:
    """Return where a tangent misleads."""
    sharp = [e for e in model.terms if _sharp(e)]
    remembered = [e.id() for e in sharp if isinstance(e, Memory)]
    others = [e.id() for e in sharp if not isinstance(e, Memory)]
    said = []
    if others and not averaged and rate == 0:
        said.append(
            f"At rest the slope of {', '.join(others)} is that of its smoothed law, and holds for the smallest motions "
            "only; state a speed, or an amplitude and a frequency."
        )
    if remembered:
        said.append(f"{', '.join(remembered)} is linearised at its present memory; it depends on the motion before.")
    if late < 0:
        said.append(f"The instrument is {-late:g} s ahead, which no state-space model is; this is left out.")
    return tuple(said)
