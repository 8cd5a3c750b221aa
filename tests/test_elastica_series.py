from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import sympy as sp

from benchmarks.paper.theory.elastica.beam import shape_under_load, tip_under_load
from benchmarks.paper.theory.elastica.force_map import force_components
from benchmarks.paper.theory.elastica.series import elastica_series
from discovery.foundation.errors import InputError
from discovery.theory.elastica.static_law import SMALL_DEFLECTION, perpendicular_law


@lru_cache
def _across() -> tuple[sp.Symbol, sp.Expr, sp.Expr, sp.Expr]:
    """Series under a force across the radius alone."""
    found = elastica_series(5, 0)
    return found.delta, found.tangential, found.radius, found.energy


def test_leading_terms() -> None:
    delta, force, radius, energy = _across()
    # The series that the cubic law and the radius law of the project start from.
    assert force.coeff(delta, 1) == 3
    assert force.coeff(delta, 3) == sp.Rational(13, 70)
    assert SMALL_DEFLECTION.cubic == pytest.approx(float(force.coeff(delta, 3) / 3), rel=1e-15)
    assert radius.coeff(delta, 2) == -sp.Rational(1, 10)
    assert SMALL_DEFLECTION.gamma**2 == pytest.approx(float(-2 * radius.coeff(delta, 2)), rel=1e-15)
    assert energy.coeff(delta, 2) == sp.Rational(3, 2)


@pytest.mark.parametrize(("which", "remainder"), [("force", 7), ("radius", 8)])
def test_what_the_series_leaves_of_the_integrals_falls_with_the_next_power(which: str, remainder: int) -> None:
    delta, force, radius, _ = _across()
    angle = np.array([0.2, 0.4, 0.8])
    exact = perpendicular_law(angle)[0 if which == "force" else 1]
    left = exact - sp.lambdify(delta, force if which == "force" else radius)(angle)
    np.testing.assert_allclose(np.log2(left[1:] / left[:-1]), remainder, atol=0.25)
    assert np.abs(left[0]) < 1e-7


def test_bending_energy() -> None:
    delta, _, _, energy = _across()
    angle = np.array([0.1, 0.2, 0.4])
    law, _ = perpendicular_law(angle)
    # Gauss quadrature of half the square of the curvature, which the first integral of eq. (5) gives.
    nodes, weights = np.polynomial.legendre.leggauss(30)
    direction = angle + np.pi / 2
    slope = shape_under_load(law, direction, 0.5 * (nodes + 1.0)).slope
    tip = tip_under_load(law, direction).slope[:, None]
    half_square = law[:, None] * (np.cos(tip - direction[:, None]) - np.cos(slope - direction[:, None]))
    exact = 0.5 * half_square @ weights
    left = exact - sp.lambdify(delta, energy)(angle)
    np.testing.assert_allclose(np.log2(left[1:] / left[:-1]), 8.0, atol=0.3)


@pytest.mark.parametrize("order", [(3, 0), (5, 2), (7, 1)])
def test_the_work_of_the_force_is_the_bending_energy(order: tuple[int, int]) -> None:
    found = elastica_series(*order)
    delta, radial = found.delta, found.radial
    # dU = rho F_t ddelta + F_r drho, at a constant radial force, within the orders of the series.
    work = found.radius * found.tangential + radial * sp.diff(found.radius, delta)
    left = sp.Poly(sp.expand(work - sp.diff(found.energy, delta)), delta, radial)
    assert all(i > order[0] or j > order[1] for (i, j), _ in left.terms())


def test_tension_to_first_order_of_the_deflection_is_that_of_the_linear_beam() -> None:
    found = elastica_series(1, 4)
    a = sp.symbols("a")
    chord = sp.series(a**2 * sp.tanh(a) / (a - sp.tanh(a)), a, 0, 9).removeO()
    stiffness = sp.expand(found.tangential.coeff(found.delta, 1))
    assert sp.expand(chord.subs(a, sp.sqrt(sp.Symbol("f"))) - stiffness.subs(found.radial, sp.Symbol("f"))) == 0
    assert stiffness.coeff(found.radial, 1) == sp.Rational(1, 5)
    assert found.radius.coeff(found.delta, 2).coeff(found.radial, 1) == sp.Rational(1, 175)


@pytest.mark.slow
def test_tension_moves_the_tip_off_any_radius_law() -> None:
    found = elastica_series(5, 3)
    evaluate = sp.lambdify([found.delta, found.radial], [found.tangential, found.radius])
    delta = 0.3
    across, rho = (float(part[0]) for part in perpendicular_law([delta]))
    left = []
    for radial in (0.2, -0.2, 0.4, -0.4):
        tangential, radius = evaluate(delta, radial)
        held = force_components(radius, delta)
        left.append((held.radial - radial, held.tangential - tangential))
        # Tension stretches the tip outward at the same deflection, and stiffens it.
        assert np.sign(radius - rho) == np.sign(tangential - across) == np.sign(radial)
    # What is left is of fourth order in the radial force and of high order in the deflection.
    assert np.max(np.abs(left)) < 1e-3
    without = elastica_series(5, 0)
    constant = float(without.radius.subs(without.delta, delta))
    assert force_components(constant, delta).radial == pytest.approx(0.0, abs=1e-4)


def test_refusals() -> None:
    for order in ((0, 1), (2, 1), (3, -1)):
        with pytest.raises(InputError, match="odd, positive order"):
            elastica_series(*order)
