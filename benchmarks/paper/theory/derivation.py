r"""The third-order equation of the arm, derived with SymPy: where the numbers of `dynamic_reduction` come from.

`inertia` moves a point mass, and a rod, along the shapes of `static_series`; `third_order` writes Lagrange's equation
and expands it; `free_vibration_beta` says what a model of constant radius makes of it.

Energies are per :math:`m_\mathrm{eff} l^2` with :math:`m_\mathrm{eff} = m + \tfrac{33}{140} m_r`. All is exact:
rational numbers, and the mass ratio :math:`\mu = m_r / m` as a symbol. SymPy is imported by the functions alone.

**The rod is slow**: at every instant it takes the static shape of a force across the radius. Its tension and its second
bending mode are left out; `discovery.mechanics.elastica` has them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal

from benchmarks.paper.theory.elastica.shape_series import static_series, taylor

if TYPE_CHECKING:
    import sympy as sp

Rod = Literal["massless", "linear", "bent"]


@dataclass(frozen=True)
class Inertia:
    r"""Kinetic energy of a bending arm on a turning hub, per m_eff l^2: that of (7), (8) on the static path.

    .. math:: T = \tfrac12 a_0 \dot\theta_m^2 + a_1 \dot\theta_m \dot\delta + \tfrac12 a_2 \dot\delta^2

    Parameters
    ----------
    a0, a1, a2 : sympy.Expr
        Even polynomials of second order in the deflection [-].
    """

    a0: sp.Expr
    a1: sp.Expr
    a2: sp.Expr


@dataclass(frozen=True)
class ThirdOrder:
    r"""Coefficients of the third-order equation, which extends (15) of the paper; all dimensionless.

    .. math::
        \ddot\theta_t + \xi \dot\theta_t + \alpha \delta + \beta \delta^3 + c_1 \delta \dot\theta_t^2
        + c_2 \delta \dot\delta \dot\theta_t + c_3 \delta \dot\delta^2 + (A - c_m \delta^2) \ddot\theta_m = 0

    Parameters
    ----------
    beta : sympy.Expr
        The ratio :math:`\beta / \alpha`.
    c1, c2, c3, c_m, A : sympy.Expr
        As in the equation. All are numbers, or functions of `mu` where the rod has mass.
    """

    beta: sp.Expr
    c1: sp.Expr
    c2: sp.Expr
    c3: sp.Expr
    c_m: sp.Expr
    A: sp.Expr


def effective_mass() -> sp.Expr:
    r"""Return :math:`m_\mathrm{eff} / m = 1 + \tfrac{33}{140} \mu`, the mass that the tip feels.

    Rayleigh's estimate for the cubic static shape of small deflection (2); it is the m of (12), (13).
    """
    import sympy as sp

    shape = static_series()
    return 1 + sp.Symbol("mu", positive=True) * _moving(shape.x, shape.y, 0).a2


def _moving(x: sp.Expr, y: sp.Expr, order: int) -> Inertia:
    """Return the inertia, integrated over the arc, of unit mass on the path (x, y) that turns with the hub."""
    import sympy as sp

    shape = static_series()
    dx, dy = sp.diff(x, shape.delta), sp.diff(y, shape.delta)

    def average(density: sp.Expr) -> sp.Expr:
        return sp.integrate(taylor(sp.expand(density), shape.delta, order), (shape.arc, 0, 1))

    return Inertia(average(x**2 + y**2), average(x * dy - y * dx), average(dx**2 + dy**2))


@cache
def inertia(rod: Rod = "linear") -> Inertia:
    r"""Inertia of tip and rod on the elastica's shapes, the solutions of eq. (5) of the paper.

    Parameters
    ----------
    rod : {"massless", "linear", "bent"}
        ``massless``: a point mass at the tip. ``linear``: the mass m_eff at the tip, and what the rod has beside it at
        small deflection: the coupling to the motor. ``bent``: rod and tip mass apart, each to second order in delta.

    Notes
    -----
    The tip is at :math:`\rho (\cos\delta, \sin\delta)`, hence :math:`a_0 = a_1 = \rho^2` and
    :math:`a_2 = \rho^2 + \rho'^2`.
    """
    import sympy as sp

    shape, mu = static_series(), sp.Symbol("mu", positive=True)
    tip = _moving(shape.radius * sp.cos(shape.delta), shape.radius * sp.sin(shape.delta), 2)
    if rod == "massless":
        return tip
    whole = effective_mass()
    if rod == "bent":
        beam = _moving(shape.x, shape.y, 2)
        pairs = zip((tip.a0, tip.a1, tip.a2), (beam.a0, beam.a1, beam.a2), strict=True)
        return Inertia(*[sp.expand((t + mu * b) / whole) for t, b in pairs])
    beam = _moving(shape.x, shape.y, 0)
    rest = [sp.factor(mu * (b - beam.a2) / whole) for b in (beam.a0, beam.a1)]
    return Inertia(tip.a0 + rest[0], tip.a1 + rest[1], tip.a2)


@cache
def third_order(rod: Rod = "linear") -> ThirdOrder:
    r"""Lagrange's equation of the deflection, expanded: (13) and (15) with what they leave out.

    .. math:: \frac{d}{dt} \frac{\partial T}{\partial \dot\delta} - \frac{\partial T}{\partial \delta}
              + \alpha \frac{\partial U}{\partial \delta} =
              a_2 \ddot\theta_t + (a_1 - a_2) \ddot\theta_m + \tfrac12 a_2' \dot\delta^2
              - \tfrac12 a_0' (\dot\theta_t - \dot\delta)^2 + \alpha U' = 0

    is divided by a_2; rates and accelerations count as small as delta itself. The centrifugal and the Coriolis term
    both come from a_0, so that c2 = -2 c1 for any rod, and the same a_0 is part of c3 and of beta: these terms are one,
    and none of them has a meaning alone. Friction is added to the result, as the paper does in (13).

    Parameters
    ----------
    rod : {"massless", "linear", "bent"}
        As in `inertia`.
    """
    import sympy as sp

    shape, energy = static_series(), inertia(rod)
    delta, alpha = shape.delta, sp.Symbol("alpha", positive=True)
    d1, d2, m1, m2, t1, t2, eps = sp.symbols("delta_1 delta_2 m_1 m_2 t_1 t_2 epsilon", real=True)
    kinetic = energy.a0 * m1**2 / 2 + energy.a1 * m1 * d1 + energy.a2 * d1**2 / 2
    momentum = sp.diff(kinetic, d1)
    change = sp.Add(*[sp.diff(momentum, v) * rate for v, rate in ((delta, d1), (d1, d2), (m1, m2))])
    row = change - sp.diff(kinetic, delta) + alpha * sp.diff(shape.energy, delta)
    row = sp.expand(row.subs({d2: t2 - m2, m1: t1 - d1}, simultaneous=True))
    small = (delta, d1, t1, m2)
    rest = row.coeff(t2, 0).subs({v: eps * v for v in small}, simultaneous=True)
    mass = row.coeff(t2, 1).subs(delta, eps * delta)
    terms = sp.Poly(taylor(rest / mass, eps, 3).subs(eps, 1), *small)

    def coefficient(monomial: sp.Expr) -> sp.Expr:
        return sp.factor(terms.coeff_monomial(monomial))

    return ThirdOrder(
        beta=coefficient(delta**3) / alpha,
        c1=coefficient(delta * t1**2),
        c2=coefficient(delta * d1 * t1),
        c3=coefficient(delta * d1**2),
        c_m=-coefficient(delta**2 * m2),
        A=coefficient(m2),
    )


def free_vibration_beta(equation: ThirdOrder) -> sp.Expr:
    r"""Return the ratio beta / alpha of (15) that has the same frequency at a constant radius, by harmonic balance.

    With the motor at rest both angles have the same rate. Of :math:`\delta = a \cos \omega t` the fundamentals of
    :math:`\delta^3` and :math:`\delta \dot\delta^2` are :math:`\tfrac34 a^3` and :math:`\tfrac14 a^3 \omega^2`; at
    :math:`\omega^2 = \alpha` the rates count by a third.
    """
    import sympy as sp

    a, phase = sp.symbols("a phi", positive=True)
    delta, rate = a * sp.cos(phase), -a * sp.sin(phase)

    def fundamental(term: sp.Expr) -> sp.Expr:
        return sp.integrate(term * sp.cos(phase), (phase, 0, 2 * sp.pi)) / sp.pi

    weight = fundamental(delta * rate**2) / fundamental(delta**3)
    return sp.factor(equation.beta + weight * (equation.c1 + equation.c2 + equation.c3))
