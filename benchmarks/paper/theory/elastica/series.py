r"""Exact series of the elastica for small deflections, with a force along the radius beside the one across it.

In the frame of the tip's radius, with :math:`\psi = \theta - \delta`, eq. (5) of the paper and the tip's position are

.. math:: \psi'' = F_r \sin\psi - F_t \cos\psi, \quad \psi(0) = -\delta, \quad \psi'(1) = 0, \quad
          \int_0^1 \sin\psi\, ds = 0, \quad \rho = \int_0^1 \cos\psi\, ds.

Every coefficient of :math:`\delta^i F_r^j` in :math:`\psi` is a polynomial in s; the orders follow one from another, in
rational arithmetic. The leading terms are

.. math:: F_t = \left(3 + \tfrac15 F_r\right) \delta + \tfrac{13}{70} \delta^3, \quad
          \rho = 1 - \left(\tfrac1{10} - \tfrac1{175} F_r\right) \delta^2:

those in :math:`F_r` say how far tension moves the tip off any law :math:`\rho(\delta)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from discovery.foundation.errors import InputError

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True)
class ElasticaSeries:
    """Series of the elastica in the deflection and the radial force, as sympy polynomials with rational coefficients.

    Parameters
    ----------
    delta, radial : Symbol
        The deflection ``delta`` [rad] and the normalised radial force ``F_r`` [-].
    tangential : Expr
        Normalised tangential force ``F_t`` [-].
    radius : Expr
        ``rho_t / l`` [-].
    energy : Expr
        Bending energy over ``EI / l`` [-].
    """

    delta: sp.Symbol
    radial: sp.Symbol
    tangential: sp.Expr
    radius: sp.Expr
    energy: sp.Expr


def _refuse(order: int, radial_order: int) -> None:
    if order < 1 or order % 2 == 0 or radial_order < 0:
        raise InputError(
            "The series of the elastica need an odd, positive order in the deflection and none below 0 in the radial "
            f"force; got {order} and {radial_order}."
        )


@cache
def elastica_series(order: int = 5, radial_order: int = 1) -> ElasticaSeries:
    """Derive the series of the elastica from eq. (5) of the paper.

    Parameters
    ----------
    order : int
        Highest power of ``delta`` in the tangential force, odd; radius and energy go one further.
    radial_order : int
        Highest power of ``F_r``.

    Returns
    -------
    ElasticaSeries

    Raises
    ------
    InputError
        If `order` is not odd and positive, or `radial_order` is negative.
    """
    _refuse(order, radial_order)
    from sympy import QQ, Symbol
    from sympy.polys.rings import ring

    names = Symbol("delta", real=True), Symbol("F_r", real=True)
    polynomials, delta, radial, s = ring((*names, Symbol("s")), QQ)

    def cut(p: Any) -> Any:
        kept = {m: a for m, a in p.terms() if m[0] <= order + 1 and m[1] <= radial_order}
        return polynomials.from_dict(kept)

    def integral(p: Any, start: int) -> Any:
        """From `start`, 0 or 1, to s."""
        primitive = polynomials.from_dict({(i, j, n + 1): a / (n + 1) for (i, j, n), a in p.terms()})
        return primitive - primitive.subs(s, start)

    def sine_and_cosine(p: Any) -> tuple[Any, Any]:
        sine, cosine, power = polynomials.zero, polynomials.one, polynomials.one
        for n in range(1, order + 2):
            power = cut(power * p) / n
            sign = -1 if n % 4 in (2, 3) else 1
            sine, cosine = (sine + sign * power, cosine) if n % 2 else (sine, cosine + sign * power)
        return sine, cosine

    def coefficient(p: Any, i: int, j: int) -> Any:
        return polynomials.from_dict({(0, 0, n): a for (k, m, n), a in p.terms() if (k, m) == (i, j)})

    def bent(curvature: Any) -> Any:
        return integral(integral(curvature, 1), 0)

    def mean(p: Any) -> Any:
        return integral(p, 0).subs(s, 1)

    unit = bent(-polynomials.one)  # the shape of the linear beam under a unit force, eq. (2)
    psi, tangential = -delta, polynomials.zero
    for i in range(1, order + 1, 2):
        for j in range(radial_order + 1):
            sine, cosine = sine_and_cosine(psi)
            amplitude = delta**i * radial**j
            known = psi + amplitude * bent(coefficient(cut(radial * sine) - cut(tangential * cosine), i, j))
            miss = mean(coefficient(sine_and_cosine(known)[0], i, j))
            force = -miss.coeff(1) / mean(unit).coeff(1)
            psi, tangential = known + amplitude * unit * force, tangential + amplitude * force
    curvature = psi.diff(s)
    energy = mean(cut(curvature * curvature)) / 2
    radius = mean(sine_and_cosine(psi)[1])
    return ElasticaSeries(*names, tangential.as_expr(), radius.as_expr(), energy.as_expr())
