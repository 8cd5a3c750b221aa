"""The third-order equation: the derivation against the constants in use, the elastica, a base and the energy."""

from __future__ import annotations

import doctest
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.paper.theory.derivation import effective_mass, free_vibration_beta, inertia, third_order
from benchmarks.paper.theory.elastica.beam import TipState, shape_under_load, tip_under_load
from benchmarks.paper.theory.elastica.shape_series import static_series, taylor
from discovery.declarations import symbols as s
from discovery.mechanics import get_base
from discovery.mechanics.reduced import rod_coupling, rod_inertia
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION
from discovery.theory.elastica.static_law import SMALL_DEFLECTION, perpendicular_law

RODS = ("massless", "linear", "bent")
MU = sp.Symbol("mu", positive=True)
PAPER_MU = 12.45 / 43.76


# The static series.


def test_the_series_are_those_of_the_elastica() -> None:
    series = static_series()
    delta = series.delta
    assert series.force.coeff(delta, 3) == sp.Rational(13, 70)
    assert series.radius == 1 - delta**2 / 10
    # The law in use is the same; law (16) agrees with the radius where gamma^2 / 2 = 1 / 10.
    assert float(series.force.coeff(delta, 3)) / 3 == pytest.approx(SMALL_DEFLECTION.cubic, rel=1e-14)
    assert -float(series.radius.coeff(delta, 2)) == pytest.approx(SMALL_DEFLECTION.gamma**2 / 2, rel=1e-14)
    errors = []
    for size in (0.2, 0.1):
        force, radius = perpendicular_law(size)
        errors.append([float(series.force.subs(delta, size)) - force, float(series.radius.subs(delta, size)) - radius])
    np.testing.assert_allclose(np.log2(np.divide(*errors)), [5, 4], atol=0.1)


def test_the_shape_is_that_of_the_elastica() -> None:
    series = static_series()
    arc = np.linspace(0, 1, 9)
    points = sp.lambdify((series.arc, series.delta), (series.slope, series.x, series.y))
    errors = []
    for size in (0.2, 0.1):
        exact = shape_under_load(perpendicular_law(size)[0], size + np.pi / 2, arc)
        got = points(arc, size)
        errors.append([np.abs(g - e).max() for g, e in zip(got, (exact.slope, exact.x, exact.y), strict=True)])
    np.testing.assert_allclose(np.log2(np.divide(*errors)), [5, 4, 5], atol=0.2)


def test_the_shape_has_the_tip_and_the_energy_of_the_series() -> None:
    """The shape is integrated in the frame of the hub, the series in that of the tip's radius."""
    series = static_series()
    delta, end = series.delta, {series.arc: 1}
    x, y = series.x.subs(end), series.y.subs(end)
    across = taylor(y * sp.cos(delta) - x * sp.sin(delta), delta, 3)
    along = taylor(x * sp.cos(delta) + y * sp.sin(delta), delta, 2)
    bending = sp.integrate(taylor(sp.diff(series.slope, series.arc) ** 2, delta, 4), (series.arc, 0, 1)) / 6
    assert (across, along - series.radius, sp.expand(bending - series.energy)) == (0, 0, 0)


def test_the_bending_energy_is_the_work_of_the_force() -> None:
    """A force across the radius works along the tip's angle alone: dU/d delta is rho F, over its slope 3."""
    series = static_series()
    work = sp.expand(series.radius * series.force / 3)
    slope = sp.diff(series.energy, series.delta)
    assert [work.coeff(series.delta, n) for n in (1, 3)] == [slope.coeff(series.delta, n) for n in (1, 3)]


# The equation.


def test_the_constants_in_use_are_derived() -> None:
    for rod in ("massless", "linear"):
        derived = third_order(rod)
        for name in ("beta", "c1", "c2", "c3"):
            assert getattr(derived, name) == sp.Rational(getattr(DYNAMIC_REDUCTION, name))
        assert free_vibration_beta(derived) == sp.Rational(DYNAMIC_REDUCTION.effective_beta)
    assert third_order("massless").c_m == sp.Rational(DYNAMIC_REDUCTION.c_m)
    assert third_order("massless").A == 0


def test_the_rod_is_33_140_and_couples_to_the_motor() -> None:
    linear = third_order("linear")
    assert sp.simplify(effective_mass() - 1 - sp.Rational(33, 140) * MU) == 0
    assert sp.simplify(linear.A - rod_coupling(MU)) == 0
    assert float(linear.A.subs(MU, PAPER_MU)) == pytest.approx(0.0105, abs=5e-5)
    # The motor's acceleration meets the changed inertia as well.
    assert sp.simplify(linear.c_m - (linear.c1 - (linear.c1 - linear.c3) * (1 + linear.A))) == 0
    still = {static_series().delta: 0}
    both = [sp.simplify(a.subs(still)) for a in (inertia("linear").a0, inertia("bent").a0)]
    assert sp.simplify(both[0] - both[1]) == 0
    assert sp.simplify(both[0] - 1 - 2 * rod_coupling(MU) - rod_inertia(MU)) == 0


def test_33_140_gives_the_frequency_of_a_clamped_beam_with_tip_mass() -> None:
    def equation(b: float) -> float:
        return 1 + np.cos(b) * np.cosh(b) + b / PAPER_MU * (np.cos(b) * np.sinh(b) - np.sin(b) * np.cosh(b))

    # omega^2 = b^4 EI / (m_r l^3) against 3 EI / (m_eff l^3).
    exact = brentq(equation, 0.3, 1.8, xtol=1e-14) ** 4 / PAPER_MU
    assert 3 / float(effective_mass().subs(MU, PAPER_MU)) == pytest.approx(exact, rel=1e-3)
    assert exact < 0.95 * 3, "a massless rod is told apart"


def test_a_base_expanded_is_the_derivation() -> None:
    """Mass, force and energy of the base `reduced`, to third order in delta and the rates."""
    mechanics = get_base("reduced").mechanics()
    (q,), (qd,) = mechanics.coordinates, mechanics.rates
    push = s.alpha * mechanics.channels[s.U].jacobian[0]
    slope = (mechanics.force[0] - push) / mechanics.mass[0][0]
    slope = slope.subs({q: s.theta_m + s.delta, s.omega_m: qd - s.delta_dot}, simultaneous=True)
    eps = sp.Symbol("eps")
    small = (s.delta, qd, s.delta_dot, s.alpha_m)
    got = sp.series(slope.subs({v: eps * v for v in small}, simultaneous=True), eps, 0, 4).removeO().subs(eps, 1)
    e = third_order("linear")
    expected = -(
        s.alpha * (s.delta + e.beta * s.delta**3)
        + e.c1 * s.delta * qd**2
        + e.c2 * s.delta * s.delta_dot * qd
        + e.c3 * s.delta * s.delta_dot**2
        + (e.A - e.c_m * s.delta**2) * s.alpha_m
    )
    assert sp.simplify(sp.expand(got - expected.subs(MU, get_base("reduced").mu))) == 0


@pytest.mark.slow
def test_a_bent_rod_against_quadrature_over_the_exact_shapes() -> None:
    at, weights = np.polynomial.legendre.leggauss(12)
    arc, weights = (at + 1) / 2, weights / 2
    mu, step = 0.8, 1e-4

    def path(size: float) -> np.ndarray:
        shape = shape_under_load(perpendicular_law(size)[0], size + np.pi / 2, np.append(arc, 1.0))
        return shape.x + 1j * shape.y

    share = np.append(mu * weights, 1.0) / float(effective_mass().subs(MU, mu))
    errors = []
    for size in (0.4, 0.2):
        z, slope = path(size), (path(size + step) - path(size - step)) / (2 * step)
        exact = share @ np.abs(z) ** 2, share @ (z.conj() * slope).imag, share @ np.abs(slope) ** 2
        e = inertia("bent")
        got = [float(a.subs({MU: mu, static_series().delta: size})) for a in (e.a0, e.a1, e.a2)]
        errors.append(np.subtract(got, exact))
    # What is left is of fourth order: a wrong coefficient of second order would leave a factor of four.
    np.testing.assert_allclose(np.log2(np.divide(*errors)), 4, atol=0.2)


@pytest.mark.slow
def test_the_rod_hardly_changes_the_coefficients() -> None:
    assert sp.simplify(third_order("bent").A - rod_coupling(MU)) == 0
    linear, bent = third_order("linear"), third_order("bent")
    for name, relative in (("beta", 0.01), ("c1", 0.01), ("c2", 0.01), ("c3", 0.07), ("c_m", 0.035)):
        values = [float(sp.sympify(getattr(e, name)).subs(MU, PAPER_MU)) for e in (linear, bent)]
        assert values[1] == pytest.approx(values[0], rel=relative)
        assert values[1] != pytest.approx(values[0], rel=1e-3)


# Terms that are one term.


@pytest.mark.parametrize("rod", [*RODS[:2], pytest.param("bent", marks=pytest.mark.slow)])
def test_coriolis_is_twice_centrifugal(rod: str) -> None:
    e = third_order(rod)
    assert sp.simplify(e.c2 + 2 * e.c1) == 0


def slopes(coefficients: tuple[float, float, float], hub_rate: float):
    c1, c2, c3 = coefficients
    beta = float(DYNAMIC_REDUCTION.beta)

    def right_hand_side(_: float, y: np.ndarray) -> list[float]:
        delta, rate = y
        turning = rate + hub_rate
        inertial = c1 * turning**2 + c2 * rate * turning + c3 * rate**2
        return [rate, -delta * (1 + beta * delta**2 + inertial)]

    return right_hand_side


def drift(coefficients: tuple[float, float, float], hub_rate: float, amplitude: float) -> float:
    """Relative change of the energy in the turning frame (Jacobi's integral) over a few periods."""
    path = solve_ivp(slopes(coefficients, hub_rate), (0, 20), [amplitude, 0], rtol=1e-11, atol=1e-13, max_step=0.1).y
    delta, rate = path
    rho2 = 1 - delta**2 / 5
    energy = (1 - 4 / 25 * delta**2) * rate**2 / 2 - rho2 * hub_rate**2 / 2 + delta**2 / 2 - delta**4 / 105
    energy += hub_rate**2 / 2
    return float(np.ptp(energy) / energy[0])


def test_the_terms_together_conserve_energy_and_alone_do_not() -> None:
    c = tuple(float(v) for v in (DYNAMIC_REDUCTION.c1, DYNAMIC_REDUCTION.c2, DYNAMIC_REDUCTION.c3))
    hub_rate = 0.1
    whole = [drift(c, hub_rate, amplitude) for amplitude in (0.4, 0.2)]
    assert np.log2(whole[0] / whole[1]) == pytest.approx(4, abs=1.0), "only fifth-order terms of the equation are left"
    for kept in range(3):
        alone = tuple(v if i == kept else 0.0 for i, v in enumerate(c))
        assert drift(alone, hub_rate, 0.2) > 10 * whole[1]


def test_free_vibration_shows_only_the_sum_of_the_three() -> None:
    t = np.linspace(0, 10, 101)
    paths = [
        solve_ivp(slopes(c, 0.0), (0, 10), [0.5, 0.0], t_eval=t, rtol=1e-11, atol=1e-12).y[0]
        for c in ((0.2, -0.4, 0.04), (0.0, 0.0, -0.16), (-0.3, 0.0, 0.14))
    ]
    np.testing.assert_allclose(paths[1], paths[0], atol=1e-9)
    np.testing.assert_allclose(paths[2], paths[0], atol=1e-9)


# The page on the mechanics.


def test_the_session_of_the_page_is_true(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parents[1]
    monkeypatch.chdir(root)
    page = root / "docs" / "MECHANICS.md"
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    test = parser.get_doctest(page.read_text(encoding="utf-8").replace("```", ""), {}, page.name, str(page), 0)
    assert len(test.examples) >= 30
    assert runner.run(test).failed == 0


@pytest.mark.parametrize("along", [-0.8, 0.8])
def test_the_pages_law_of_a_force_along_the_radius(along: float) -> None:
    """F_t = (3 + F_r / 5) delta and rho = 1 - (1/10 - F_r / 175) delta^2, to first order in F_r."""
    delta = 1e-3
    found = []
    for pull in (along, along / 2):
        # The direction of the force at this deflection with this force along the radius.
        across = brentq(lambda f, p=pull: tip(p, f, delta).angle - delta, 0.2 * delta, 6 * delta, xtol=1e-16)
        shortening = 1 - float(tip(pull, across, delta).radius)
        found.append([across / delta - 3 - pull / 5, shortening / delta**2 - 1 / 10 + pull / 175])
    np.testing.assert_allclose(np.divide(*found), 4, rtol=0.15)
    np.testing.assert_allclose(found[0], 0, atol=0.02 * abs(along))


def tip(along: float, across: float, delta: float) -> TipState:
    return tip_under_load(np.hypot(along, across), delta + np.arctan2(across, along))


@pytest.mark.slow
def test_the_pages_numbers_of_a_bent_rod() -> None:
    changes = {}
    for name in ("beta", "c1", "c3"):
        straight, bent = (float(sp.sympify(getattr(third_order(rod), name)).subs(MU, 0.28)) for rod in RODS[1:])
        changes[name] = bent / straight - 1
    assert abs(changes["beta"]) < 0.01
    assert abs(changes["c1"]) < 0.01
    assert changes["c3"] == pytest.approx(0.06, abs=0.005)
