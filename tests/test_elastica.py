from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_bvp, solve_ivp

from benchmarks.paper.theory.elastica.beam import shape_under_load, tip_under_load
from benchmarks.paper.theory.elastica.loads import FORCE_MAX
from benchmarks.paper.theory.elastica.series import elastica_series
from benchmarks.paper.theory.elastica.small_deflection import small_deflection_shape, small_deflection_tip
from discovery.foundation.errors import InputError
from discovery.theory.elastica.static_law import DEFLECTION_MAX, perpendicular_law

# Mattiasson, Int. J. Numer. Methods Eng. 17 (1981) 145, cantilever under a vertical tip load: P l^2 / EI, w / l, u / l.
MATTIASSON = [
    (1.0, 0.30172, 0.05643),
    (2.0, 0.49346, 0.16064),
    (5.0, 0.71379, 0.38763),
    (10.0, 0.81061, 0.55500),
]

# Timoshenko and Gere, Theory of Elastic Stability, 2nd ed., table 2-4: tip slope [deg], P / P_cr, x / l, y / l.
BUCKLED = [
    (20.0, 1.015, 0.970, 0.220),
    (40.0, 1.063, 0.881, 0.422),
    (60.0, 1.152, 0.741, 0.593),
    (80.0, 1.293, 0.560, 0.719),
    (100.0, 1.518, 0.349, 0.792),
    (120.0, 1.884, 0.123, 0.803),
    (140.0, 2.541, -0.107, 0.750),
    (160.0, 4.029, -0.340, 0.625),
]


@pytest.mark.parametrize(("load", "across", "shortening"), MATTIASSON)
def test_published_cantilever_table(load: float, across: float, shortening: float) -> None:
    tip = tip_under_load(load, np.pi / 2)
    assert tip.y == pytest.approx(across, abs=5.1e-6)
    assert 1.0 - tip.x == pytest.approx(shortening, abs=5.1e-6)


@pytest.mark.parametrize(
    ("load", "direction"),
    [(0.5, 1.0), (3.0, np.pi / 2), (4.0, 2.6), (2.0, -2.0), (8.0, 0.4), (20.0, 1.2), (6.0, np.pi - 0.01), (40.0, -2.5)],
)
def test_boundary_value_solver(load: float, direction: float) -> None:
    def equation(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.vstack([y[1], load * np.sin(y[0] - direction), np.cos(y[0]), np.sin(y[0])])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0.0, 1.0, 41)
    # From the shape under another load: the solver has eq. (5) and both ends.
    start = shape_under_load(0.8 * load, 0.95 * direction, s)
    guess = np.vstack([start.slope, np.gradient(start.slope, s), start.x, start.y])
    reference = solve_bvp(equation, ends, s, guess, tol=1e-10, max_nodes=20_000)
    assert reference.success
    shape = shape_under_load(load, direction, s)
    slope, _, x, y = reference.sol(s)
    assert np.max(np.abs(shape.slope - slope)) < 1e-8
    assert np.max(np.abs(shape.x - x)) < 1e-8
    assert np.max(np.abs(shape.y - y)) < 1e-8
    tip = tip_under_load(load, direction)
    np.testing.assert_allclose([tip.slope, tip.x, tip.y], [slope[-1], x[-1], y[-1]], atol=1e-8)


@settings(deadline=None, max_examples=60)
@given(st.floats(-3.0, 2.0), st.floats(-np.pi, np.pi))
def test_shape_obeys_the_equation_and_both_ends(exponent: float, direction: float) -> None:
    load = 10.0**exponent
    shape, tip = shape_under_load(load, direction), tip_under_load(load, direction)

    def equation(_: float, y: np.ndarray) -> list[float]:
        return [y[1], load * np.sin(y[0] - direction), np.cos(y[0]), np.sin(y[0])]

    start = [float(tip.slope), 0.0, float(tip.x), float(tip.y)]
    path = solve_ivp(equation, (1.0, 0.0), start, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=shape.arc[::-1])
    slope, curvature, x, y = path.y[:, ::-1]
    # The integration away from the tip multiplies rounding by exp(sqrt(load)) < 3e4.
    assert np.max(np.abs(shape.slope - slope)) < 1e-8
    assert np.max(np.abs(shape.x - x)) < 1e-8
    assert np.max(np.abs(shape.y - y)) < 1e-8
    assert max(abs(slope[0]), abs(x[0]), abs(y[0])) < 1e-8
    side = 1.0 if direction >= 0.0 else -1.0
    assert np.min(side * curvature) >= -1e-8, "the branch without inflection bends to one side only"


@given(st.floats(-FORCE_MAX, FORCE_MAX), st.floats(-20.0, 20.0))
def test_symmetries_and_reach(force: float, direction: float) -> None:
    tip, mirror = tip_under_load(force, direction), tip_under_load(force, -direction)
    reverse = tip_under_load(-force, direction + np.pi)
    folded = (abs(force), (direction + (np.pi if force < 0 else 0.0)) % (2.0 * np.pi))
    if abs(folded[1] - np.pi) > 1e-6:  # at exactly pi the side of buckling is a convention
        assert tip.x == pytest.approx(mirror.x, abs=1e-6)
        assert tip.y == pytest.approx(-mirror.y, abs=1e-6)
        assert tip.x == pytest.approx(reverse.x, abs=1e-6)
        assert tip.y == pytest.approx(reverse.y, abs=1e-6)
    assert tip.radius <= 1.0 + 1e-12
    assert tip.radius == pytest.approx(np.hypot(tip.x, tip.y))
    assert tip.angle == pytest.approx(np.arctan2(tip.y, tip.x))


def test_small_deflection_limit() -> None:
    load = 10.0 ** np.arange(-8.0, -2.0)
    tip = tip_under_load(load, np.pi / 2)
    # Relative errors fall with the square of the load until rounding of the position, 1e-15 / load.
    assert np.all(np.abs(tip.y / (load / 3.0) - 1.0) < load**2 + 3e-15 / load)
    assert np.all(np.abs(tip.slope / (load / 2.0) - 1.0) < load**2 + 1e-14)
    assert tip_under_load(0.0, 1.0).x == 1.0
    assert abs(tip_under_load(0.0, 1.0).y) < 1e-15


def test_elastica_tends_to_the_linear_beam() -> None:
    load = np.array([0.4, 0.2, 0.1, 0.05])
    beam, line = shape_under_load(load, np.pi / 2), small_deflection_shape(load)
    np.testing.assert_array_equal(line.arc, beam.arc)
    np.testing.assert_allclose(line.y[:, -1], small_deflection_tip(load), rtol=1e-15)
    # EI y'' = M of eq. (2): the second difference of a cubic is exact.
    step = line.arc[1]
    np.testing.assert_allclose(
        np.diff(line.y, 2, axis=-1) / step**2, load[:, None] * (1.0 - line.arc[1:-1]), atol=1e-11
    )
    np.testing.assert_allclose(np.gradient(line.y, step, axis=-1)[:, 1:-1], line.slope[:, 1:-1], atol=load[0] * step**2)
    assert np.all((line.y[:, 0] == 0.0) & (line.slope[:, 0] == 0.0))
    for error in (np.max(np.abs(beam.y - line.y), axis=-1), np.max(np.abs(beam.slope - line.slope), axis=-1)):
        np.testing.assert_allclose(np.log2(error[:-1] / error[1:]), 3.0, atol=0.05)
    along = np.max(np.abs(beam.x - line.x), axis=-1)
    np.testing.assert_allclose(np.log2(along[:-1] / along[1:]), 2.0, atol=0.05)


@pytest.mark.parametrize("direction", [1e-5, 0.3, np.pi / 2, 2.5, np.pi - 1e-5])
def test_digits_survive_a_vanishing_force(direction: float) -> None:
    load = 10.0 ** np.arange(-10.0, -3.0)
    tip = tip_under_load(load, direction)
    across = load * np.sin(direction)
    np.testing.assert_allclose(tip.y, across / 3.0, rtol=2e-3 * load[-1] / 1e-4)
    np.testing.assert_allclose(tip.y[:3], across[:3] / 3.0, rtol=2e-8)
    # (1 - rho) / delta^2 = 1 / 10, to the rounding that is left over the force.
    ratio = tip.shortening / tip.angle**2
    assert np.all(np.abs(ratio / 0.1 - 1.0) < load + 3e-14 / load)


def test_pull_leaves_the_beam_straight() -> None:
    tip = tip_under_load([0.1, 10.0, 1000.0], 0.0)
    np.testing.assert_allclose(tip.x, 1.0, atol=1e-15)
    np.testing.assert_array_equal(tip.y, 0.0)


def test_compression_buckles_at_the_euler_load() -> None:
    euler = np.pi**2 / 4.0
    below, above = tip_under_load(0.99 * euler, np.pi), tip_under_load(1.01 * euler, np.pi)
    assert abs(below.y) < 1e-12
    assert above.y > 0.1
    assert tip_under_load(1.01 * euler, -np.pi).y == pytest.approx(-above.y)


@pytest.mark.parametrize(("slope", "ratio", "x", "y"), BUCKLED)
def test_published_buckling_table(slope: float, ratio: float, x: float, y: float) -> None:
    tip = tip_under_load(ratio * np.pi**2 / 4.0, np.pi)
    # The table rounds the load to 3 digits, which near the Euler load is 0.4 degrees of slope.
    assert np.degrees(tip.slope) == pytest.approx(slope, abs=0.5)
    assert tip.x == pytest.approx(x, abs=2e-3 if ratio > 1.1 else 6e-3)
    assert tip.y == pytest.approx(y, abs=2e-3 if ratio > 1.1 else 6e-3)


def test_strong_force_aligns_the_beam() -> None:
    tip = tip_under_load(FORCE_MAX, np.array([0.3, 1.5, 3.0]))
    np.testing.assert_allclose(tip.slope, [0.3, 1.5, 3.0], atol=1e-12)


def test_broadcasting() -> None:
    tip = tip_under_load(np.array([[1.0], [2.0]]), np.array([0.5, 1.0, 1.5]))
    shape = shape_under_load(np.array([[1.0], [2.0]]), np.array([0.5, 1.0, 1.5]), [0.0, 0.5, 1.0])
    assert tip.radius.shape == (2, 3)
    assert shape.x.shape == (2, 3, 3)
    np.testing.assert_allclose(shape.x[..., -1], tip.x, atol=1e-14)
    np.testing.assert_allclose(shape.slope[..., 0], 0.0, atol=1e-14)
    assert tip.x[1, 2] == tip_under_load(2.0, 1.5).x


def _series() -> tuple[sp.Expr, sp.Expr]:
    """Force to third order and radius to second order in delta, of a force perpendicular to the radius, by sympy."""
    e, s, delta = sp.symbols("e s delta")
    f1, f3, a1, a3 = sp.symbols("f1 f3 a1 a3")
    # theta = e t1 + e^3 t3, F = e f1 + e^3 f3; phi - pi / 2 = e a1 + e^3 a3 is the tip's polar angle.
    t1 = sp.integrate(f1 * (1 - s), s)
    t1 = sp.expand(t1 - t1.subs(s, 0))
    angle = e * a1 + e**3 * a3

    def third_order(expression: sp.Expr) -> sp.Expr:
        return sp.series(expression, e, 0, 4).removeO()

    # theta'' = F sin(theta - phi) = -F cos(theta - angle)
    right = third_order(-(e * f1 + e**3 * f3) * sp.cos(e * t1 - angle)).coeff(e, 3)
    curvature = sp.integrate(sp.expand(right), s)
    curvature = curvature - curvature.subs(s, 1)
    t3 = sp.integrate(sp.expand(curvature), s)
    t3 = t3 - t3.subs(s, 0)
    theta = e * t1 + e**3 * t3
    x = sp.integrate(sp.expand(third_order(sp.cos(theta))), (s, 0, 1))
    y = sp.integrate(sp.expand(third_order(sp.sin(theta))), (s, 0, 1))
    closure = sp.expand(third_order(y - x * sp.tan(angle)))
    first = sp.solve(closure.coeff(e, 1), f1)[0]
    third = sp.solve(closure.coeff(e, 3).subs(f1, first), f3)[0]
    # The expansion parameter is the angle itself: a1 = 1, a3 = 0.
    unit = {a1: 1, a3: 0}
    force = first.subs(unit) * delta + third.subs(unit) * delta**3
    radius = sp.series(sp.sqrt(x**2 + y**2).subs(f1, first).subs(unit), e, 0, 3).removeO().subs(e, delta)
    return sp.expand(force), sp.expand(radius)


@pytest.mark.slow
def test_perpendicular_law_series() -> None:
    force, radius = _series()
    delta = next(iter(force.free_symbols))
    assert force == 3 * delta + sp.Rational(13, 70) * delta**3
    assert radius == 1 - delta**2 / 10
    # Derived another way, order by order in the frame of the radius.
    derived = elastica_series(3, 0)
    assert derived.tangential.subs(derived.delta, delta) == force
    assert derived.radius.coeff(derived.delta, 2) == radius.coeff(delta, 2)
    angle = np.array([0.01, 0.02, 0.04])
    numeric_force, numeric_radius = perpendicular_law(angle)
    # What the series leaves falls with the next even or odd power: 32 and 16 for each doubling.
    left_force = numeric_force - sp.lambdify(delta, force)(angle)
    left_radius = numeric_radius - sp.lambdify(delta, radius)(angle)
    np.testing.assert_allclose(left_force[1:] / left_force[:-1], 32.0, rtol=0.02)
    np.testing.assert_allclose(left_radius[1:] / left_radius[:-1], 16.0, rtol=0.02)


@given(st.floats(-0.999 * DEFLECTION_MAX, 0.999 * DEFLECTION_MAX))
def test_perpendicular_law_against_the_loaded_beam(delta: float) -> None:
    force, rho = perpendicular_law(delta)
    tip = tip_under_load(force, delta + np.pi / 2)
    assert tip.radius == pytest.approx(float(rho), abs=1e-10)
    assert tip.angle == pytest.approx(delta, abs=1e-10)
    opposite_force, opposite_rho = perpendicular_law(-delta)
    assert opposite_force == -force
    assert opposite_rho == rho


def test_work_of_the_force_is_the_bending_energy() -> None:
    delta = np.linspace(0.0, 1.4, 2001)
    force, rho = perpendicular_law(delta)
    work = np.trapezoid(rho * force, delta)
    shape = shape_under_load(force[-1], delta[-1] + np.pi / 2, np.linspace(0.0, 1.0, 4001))
    curvature = np.gradient(shape.slope, shape.arc, edge_order=2)
    assert work == pytest.approx(0.5 * np.trapezoid(curvature**2, shape.arc), rel=1e-6)


def test_refusals() -> None:
    for delta in (1.6, np.nan, [0.1, -2.0]):
        with pytest.raises(InputError, match=r"up to a deflection of 1\.5708 rad"):
            perpendicular_law(delta)
    for force, direction in ((np.nan, 0.0), (np.inf, 0.0), (2 * FORCE_MAX, 0.0), (1.0, np.nan)):
        with pytest.raises(InputError, match="must be finite"):
            tip_under_load(force, direction)
    with pytest.raises(InputError, match="from 0"):
        shape_under_load(1.0, 1.0, [0.0, 1.1])
    with pytest.raises(InputError, match="from 0"):
        small_deflection_shape(1.0, [-0.1, 1.0])
