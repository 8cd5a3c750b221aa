r"""The shape of the rod under a tip force across its radius, by powers of the deflection: where the derivations begin.

Lengths are in lengths of the arm, arcs s run from 0 (clamp) to 1 (tip), angles in rad, numbers are exact. SymPy is
imported by the functions alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from benchmarks.paper.theory.elastica.series import elastica_series

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True)
class StaticSeries:
    r"""The elastica under a tip force across the radius, in powers of the deflection `delta`.

    Parameters
    ----------
    arc, delta : sympy.Symbol
        Arc length s [-] and deflection of the tip [rad].
    slope, x, y : sympy.Expr
        Shape in the frame of the hub: slope to third order, position x to second and y to third.
    force : sympy.Expr
        :math:`F_n = F l^2 / EI = 3 \delta + \tfrac{13}{70} \delta^3` [-].
    radius : sympy.Expr
        :math:`\rho_t / l = 1 - \tfrac{1}{10} \delta^2` [-].
    energy : sympy.Expr
        Bending energy over :math:`3 EI / l`, that is over :math:`\alpha\, m_\mathrm{eff} l^2`, to fourth order [rad^2].
    """

    arc: sp.Symbol
    delta: sp.Symbol
    slope: sp.Expr
    x: sp.Expr
    y: sp.Expr
    force: sp.Expr
    radius: sp.Expr
    energy: sp.Expr


def taylor(expression: sp.Expr, symbol: sp.Symbol, order: int) -> sp.Expr:
    """Return the Taylor polynomial of an expression in one symbol, to this order and expanded."""
    import sympy as sp

    return sp.expand(sp.series(expression, symbol, 0, order + 1).removeO())


@cache
def static_series() -> StaticSeries:
    r"""Solve :math:`\theta'' = F_n \sin(\theta - \varphi)`, eq. (5), for :math:`\varphi = \delta + \pi/2`.

    Force, radius and energy are those of `elastica.series`. With :math:`F_n = 3 \delta + f_3 \delta^3`
    and :math:`\theta = \delta g_1 + \delta^3 g_3` the powers of delta give :math:`g_1'' = -3` and
    :math:`g_3'' = -f_3 + \tfrac32 (g_1 - 1)^2`, each with :math:`g(0) = 0,\ g'(1) = 0`.
    """
    import sympy as sp

    series = elastica_series(3, 0)
    delta = series.delta
    s, r = sp.symbols("s r", real=True)

    def from_clamp(integrand: sp.Expr) -> sp.Expr:
        return sp.integrate(sp.expand(integrand).subs(s, r), (r, 0, s))

    def bent(second: sp.Expr) -> sp.Expr:
        return from_clamp(-sp.integrate(sp.expand(second).subs(s, r), (r, s, 1)))

    g1 = bent(-series.tangential.coeff(delta, 1))
    g3 = bent(-series.tangential.coeff(delta, 3) + sp.Rational(3, 2) * (g1 - 1) ** 2)
    theta = sp.expand(delta * g1 + delta**3 * g3)
    return StaticSeries(
        arc=s,
        delta=delta,
        slope=theta,
        x=from_clamp(taylor(sp.cos(theta), delta, 2)),
        y=from_clamp(taylor(sp.sin(theta), delta, 3)),
        force=series.tangential,
        radius=taylor(series.radius, delta, 2),
        energy=taylor(series.energy / 3, delta, 4),
    )
