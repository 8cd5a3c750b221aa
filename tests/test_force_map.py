from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_bvp

from benchmarks.paper.theory.elastica.beam import shape_under_load, tip_under_load
from benchmarks.paper.theory.elastica.first_guess import first_guess
from benchmarks.paper.theory.elastica.force_map import force_components, load_at_tip
from benchmarks.paper.theory.elastica.loads import FORCE_MAX
from benchmarks.paper.theory.elastica.polar import polar_compliance
from benchmarks.paper.theory.elastica.reach import radius_limits
from discovery.foundation.errors import InputError
from discovery.theory.elastica.static_law import perpendicular_law

# Timoshenko and Gere, Theory of Elastic Stability, 2nd ed., table 2-4, buckled by compression: P / P_cr, x / l, y / l.
BUCKLED = [
    (1.152, 0.741, 0.593),
    (1.293, 0.560, 0.719),
    (1.518, 0.349, 0.792),
    (1.884, 0.123, 0.803),
    (2.541, -0.107, 0.750),
    (4.029, -0.340, 0.625),
]


def _loads(n: int, weakest: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return 10.0 ** rng.uniform(np.log10(weakest), 4.0, n), rng.uniform(-np.pi, np.pi, n)


def test_a_position_is_held_by_its_force_all_over_the_domain() -> None:
    tip = tip_under_load(*_loads(30_000))
    bent = np.abs(tip.angle) > 1e-4
    assert np.max(np.abs(tip.angle)) > 3.0
    rho, delta = tip.radius[bent], tip.angle[bent]
    held = tip_under_load(*load_at_tip(rho, delta))
    np.testing.assert_allclose(held.radius, rho, rtol=0.0, atol=5e-15)
    np.testing.assert_allclose(held.angle, delta, rtol=1e-11, atol=1e-14)


def test_a_force_is_found_again_from_its_position_all_over_the_domain() -> None:
    force, direction = _loads(30_000)
    tip = tip_under_load(force, direction)
    bent = np.abs(tip.angle) > 1e-3
    found = force_components(tip.radius[bent], tip.angle[bent])
    angle = direction[bent] - tip.angle[bent]
    radial, tangential = force[bent] * np.cos(angle), force[bent] * np.sin(angle)
    # 1 - rho over its rounding is what the radius knows of the force.
    known = 1e-12 + 3e-15 / (1.0 - tip.radius[bent])
    assert np.all(np.abs(found.radial - radial) < known * (8.0 + np.abs(radial)))
    assert np.all(np.abs(found.tangential - tangential) < known * (8.0 + np.abs(radial)) * np.abs(tip.angle[bent]))
    np.testing.assert_allclose(found.moment, tip.radius[bent] * found.tangential, rtol=1e-15)


@settings(deadline=None)
@given(st.floats(1e-3, 3.12), st.floats(0.0, 1.0), st.booleans())
def test_every_radius_within_its_limits_is_held(delta: float, share: float, left: bool) -> None:
    low, high = radius_limits(delta)
    rho = low + (0.999 * share + 5e-4) * (high - low)
    sign = -1.0 if left else 1.0
    force, direction = load_at_tip(rho, sign * delta)
    assert 0.0 < force <= FORCE_MAX
    assert 0.0 < sign * direction <= np.pi
    tip = tip_under_load(force, direction)
    assert tip.radius == pytest.approx(rho, abs=1e-14)
    assert tip.angle == pytest.approx(sign * delta, rel=1e-11)


@pytest.mark.parametrize("delta", [0.05, 0.6, 1.2, 2.0, 2.6])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_boundary_value_solver(delta: float, share: float) -> None:
    low, high = radius_limits(delta)
    rho = low + share * (high - low)
    force, direction = load_at_tip(rho, delta)
    x, y = rho * np.cos(delta), rho * np.sin(delta)

    def equation(_: np.ndarray, u: np.ndarray, load: np.ndarray) -> np.ndarray:
        along, across = load
        return np.vstack([u[1], along * np.sin(u[0]) - across * np.cos(u[0]), np.cos(u[0]), np.sin(u[0])])

    def ends(a: np.ndarray, b: np.ndarray, load: np.ndarray) -> np.ndarray:
        return np.array([a[0], b[1], a[2], a[3], b[2] - x, b[3] - y])

    # From a shape of another force: the solver has the tip's position alone.
    s = np.linspace(0.0, 1.0, 81)
    shape = shape_under_load(0.9 * force, 0.98 * direction, s)
    guess = np.vstack([shape.slope, np.gradient(shape.slope, s), shape.x, shape.y])
    start = 0.9 * force * np.array([np.cos(0.98 * direction), np.sin(0.98 * direction)])
    reference = solve_bvp(equation, ends, s, guess, p=start, tol=1e-9, max_nodes=20_000)
    assert reference.success
    angle = np.arctan2(reference.p[1], reference.p[0]) - delta
    found = force_components(rho, delta)
    size = float(np.hypot(*reference.p))
    # What the solver leaves of the position moves the force by the slope of the map.
    assert found.radial == pytest.approx(size * np.cos(angle), rel=1e-6, abs=1e-6 / delta**2)
    assert found.tangential == pytest.approx(size * np.sin(angle), rel=1e-6)
    assert found.moment == pytest.approx(reference.sol(0.0)[1], rel=1e-6)


@pytest.mark.parametrize(("ratio", "x", "y"), BUCKLED)
def test_published_buckling_table_is_the_limit(ratio: float, x: float, y: float) -> None:
    delta = np.arctan2(y, x)
    low, _ = radius_limits(delta)
    assert low == pytest.approx(np.hypot(x, y), abs=1e-3)
    force, direction = load_at_tip(low + 1e-12, delta)
    assert direction == pytest.approx(np.pi, abs=1e-9)
    assert force == pytest.approx(ratio * np.pi**2 / 4.0, rel=2e-2)


def test_limits() -> None:
    low, high = radius_limits([[0.0, 1e-7], [-1.0, 1.0]])
    assert low.shape == (2, 2)
    np.testing.assert_allclose(low[0], 1.0, rtol=0.0, atol=2e-15)
    np.testing.assert_array_equal(high[0], [1.0, 1.0])
    assert low[1, 0] == low[1, 1]
    # At the Euler load the beam is a quarter of a sine wave: (1 - rho) / delta^2 = pi^2 / 16 - 1 / 2.
    assert (1.0 - radius_limits(1e-3)[0]) / 1e-6 == pytest.approx(np.pi**2 / 16 - 0.5, rel=1e-5)
    force, _ = load_at_tip(high[1, 1], 1.0)
    assert force == pytest.approx(FORCE_MAX, rel=1e-9)
    assert force <= FORCE_MAX


def _straight_limit(radial: float) -> tuple[float, float]:
    """F_t / delta and (1 - rho) / delta^2 of the linear beam under tension or compression along its chord."""
    a = np.emath.sqrt(radial)
    amplitude = 1.0 / (np.cosh(a) - np.sinh(a) / a)
    spread = 0.5 + np.sinh(2.0 * a) / (4.0 * a) - (np.sinh(a) / a) ** 2
    return float(np.real(radial * np.tanh(a) / (a - np.tanh(a)))), float(np.real(0.5 * amplitude**2 * spread))


@pytest.mark.parametrize("radial", [-2.3, -1.0, -0.1, 0.1, 1.0, 30.0, 400.0])
@pytest.mark.parametrize("delta", [1e-9, 1e-6, 1e-4])
def test_smooth_through_the_straight_beam(radial: float, delta: float) -> None:
    stiffness, contraction = _straight_limit(radial)
    tangential = stiffness * delta
    direction = delta + np.arctan2(tangential, radial)
    force = np.hypot(radial, tangential)
    tip = tip_under_load(force, direction)
    # Rounding of a direction next to pi is what remains.
    limit = 2.0 * delta**2 + 1e-13 + (2e-15 / delta if radial < 0.0 else 0.0)
    assert tip.angle == pytest.approx(delta, rel=10.0 * limit)
    assert tip.shortening / tip.angle**2 == pytest.approx(contraction, rel=2.0 * delta**2 + 1e-11 + limit)
    assert first_guess(tip.shortening, tip.angle) == (
        pytest.approx(radial, abs=0.01 * (8.0 + radial)),
        pytest.approx(stiffness, rel=0.01),
    )


def test_force_across_the_radius() -> None:
    delta = np.array([0.05, 0.4, 0.8, 1.5])
    force, rho = perpendicular_law(delta)
    found = force_components(rho, delta)
    np.testing.assert_allclose(found.tangential, force, rtol=1e-12)
    np.testing.assert_allclose(found.radial, 0.0, atol=1e-9)
    assert found.moment[2] == rho[2] * found.tangential[2]


def test_shapes_reach_the_positions_they_are_drawn_for() -> None:
    delta = np.array([-2.5, -0.8, 0.3, 1.0, 2.0])
    low, high = radius_limits(delta)
    rho = 0.7 * low + 0.3 * high
    shape = shape_under_load(*load_at_tip(rho, delta))
    np.testing.assert_allclose(shape.x[:, -1], rho * np.cos(delta), atol=1e-13)
    np.testing.assert_allclose(shape.y[:, -1], rho * np.sin(delta), atol=1e-13)
    length = np.sum(np.hypot(np.diff(shape.x), np.diff(shape.y)), axis=1)
    np.testing.assert_allclose(length, 1.0, atol=2e-3)


def test_compliance_is_the_slope_of_the_map() -> None:
    force, direction = np.array([2.0, 0.3, 5.0, 30.0, 2.0, 1e-4]), np.array([1.0, 2.0, 3.0, -2.0, 3.14, 1.5])
    compliance = polar_compliance(force, direction)
    assert compliance.shape == (6, 2, 2)

    def at(df: float, dphi: float) -> tuple[np.ndarray, np.ndarray]:
        f, phi = force * (1.0 + df), direction + dphi
        tip = tip_under_load(f, phi)
        load = np.stack([f * np.cos(phi - tip.angle), f * np.sin(phi - tip.angle)], axis=-1)
        return np.stack([tip.radius, tip.angle], axis=-1), load

    for step in ((1e-5, 0.0), (0.0, 1e-5)):
        (position, load), (before, load_before) = at(*step), at(*(-h for h in step))
        moved = np.einsum("kij,kj->ki", compliance, load - load_before)
        np.testing.assert_allclose(moved, position - before, rtol=1e-6, atol=1e-13)


def test_the_force_has_a_potential() -> None:
    force, direction = _loads(2000)
    tip = tip_under_load(force, direction)
    angle = direction - tip.angle
    keep = np.abs(tip.angle) > 0.05
    stiffness = np.linalg.inv(polar_compliance(force, direction)[keep])
    # dU = F_r drho + rho F_t ddelta, so dF_r / ddelta = F_t + rho dF_t / drho.
    tangential = (force * np.sin(angle))[keep]
    np.testing.assert_allclose(
        stiffness[:, 0, 1], tangential + tip.radius[keep] * stiffness[:, 1, 0], rtol=1e-7, atol=1e-7
    )


def test_broadcasting() -> None:
    force, direction = load_at_tip(np.array([[0.95], [0.96]]), np.array([0.7, 0.8, 0.9]))
    assert force.shape == direction.shape == (2, 3)
    assert force_components(0.95, [0.7, 0.8]).moment.shape == (2,)
    assert load_at_tip(0.96, 0.8) == (force[1, 1], direction[1, 1])
    assert load_at_tip(np.empty(0), np.empty(0))[0].shape == (0,)


@pytest.mark.parametrize(
    ("rho", "delta", "message"),
    [
        (0.5, 0.1, r"a radius from 0\.998833 to 0\.99997501 lengths at a deflection of 0\.1 rad; got 0\.5"),
        (0.01, -1.0, r"a radius from 0\.894992 to 0\.99755186 lengths at a deflection of -1 rad; got 0\.01"),
        (1.0 - 1e-9, 1.2, r"a radius from 0\.856247 to"),
        (0.99, 3.1, r"from 0\.960877 to 0\.98041592"),
        (0.9, 3.13, r"deflects by at most 3\.1212 rad"),
        (1.0, 0.1, "radii between 0 and 1"),
        (1.1, 0.5, "radii between 0 and 1"),
        (0.9, 0.0, "leave out the straight"),
        (0.9, 3.2, "0 and pi rad"),
        (np.nan, 0.3, r"not finite somewhere; leave out the gaps"),
        (0.9, np.inf, r"not finite somewhere; leave out the gaps"),
    ],
)
def test_what_is_out_of_reach_is_named(rho: float, delta: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_at_tip([0.95, rho], [0.8, delta])


def test_limits_are_refused_beyond_the_strongest_force() -> None:
    for delta in (3.13, np.nan):
        with pytest.raises(InputError, match="without inflection"):
            radius_limits(delta)
