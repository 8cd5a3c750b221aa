from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.manoeuvres import Manoeuvre, trapezoid
from discovery_datasets.twin import simulate as simulate_twin
from scipy.optimize import brentq, root

from discovery.declarations import symbols as s
from discovery.declarations.forces import SmoothForce
from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, Program, build_program
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.mechanics.reduced import rod_coupling
from discovery.mechanics.rod import STRAIGHT, rod_of
from discovery.mechanics.rod_shapes import (
    RICH,
    bending_matrix,
    mass_matrix,
    polynomials,
    quadrature,
    reduced_shapes,
    rod_masses,
)
from discovery.recordings.drive import Drive
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator
from discovery.testing.states import every_effect
from discovery.theory.elastica.static_law import perpendicular_law

EFFECTS = ("viscous_damping", "linear_stiffness")
ELASTICA = ("elastica_4", "elastica", "elastica_2", "elastica_1")
#: At rest the same as three modes.
CALM = "elastica_calm"
#: Mattiasson, Int. J. Numer. Methods Eng. 17 (1981) 145, vertical tip load P l^2 / EI: w / l, u / l.
MATTIASSON = [
    (1.0, 0.30172, 0.05643),
    (2.0, 0.49346, 0.16064),
    (5.0, 0.71379, 0.38763),
    (10.0, 0.81061, 0.55500),
]
#: Largest error of the tip [lengths] that four, three, two and one curvature modes reach at these loads.
STATIC_ERROR = {
    "elastica_4": {1.0: 1e-5, 2.0: 1e-5, 5.0: 5e-5, 10.0: 2e-4},
    "elastica": {1.0: 1e-5, 2.0: 1e-5, 5.0: 5e-5, 10.0: 2e-4},
    "elastica_calm": {1.0: 1e-5, 2.0: 1e-5, 5.0: 5e-5, 10.0: 2e-4},
    "elastica_2": {1.0: 1.5e-5, 2.0: 1e-4, 5.0: 1e-3, 10.0: 4e-3},
    "elastica_1": {1.0: 3e-4, 2.0: 3e-3, 5.0: 2e-2, 10.0: 5e-2},
}


#: Bases that the search simulates, with a smooth force beside the catalogue: the same simulators serve here.
SEARCHED = ("constant_radius", "reduced", "elastica_calm", "elastica_4")


def whole_kernel(base: str, time: np.ndarray, drive: Drive | None, step: float, **values: float) -> np.ndarray:
    effects = every_effect(base)
    if base in SEARCHED:
        effects = tuple(sorted({*effects, SmoothForce.id()}))
    sim = Simulator(base, effects, time, drive, step=step)
    declared = Model(base, effects).parameters
    parameters = np.array([[values.get(n, declared[n].default)] for n in sim.names])
    return sim(parameters, np.array([values.get("start", 0.0)]), np.array([values.get("rate", 0.0)]))[:, :, 0]


def mechanics_program(base: str, *rows: sp.Expr) -> Program:
    """Program whose slopes are expressions in the channels of a base."""
    program = build_program(base, EFFECTS)
    mechanics = get_base(base).mechanics()
    channels = tuple((symbol, channel.value) for symbol, channel in mechanics.channels.items())
    return replace(program, derivative=(*mechanics.assignments, *channels), slopes=rows)


# The reduced base against Lagrange's equations.


def reduced_equation() -> tuple[sp.Expr, dict[str, sp.Symbol]]:
    """theta_t'' to third order, from sympy's Lagrange equation of a point mass on rho = l (1 - delta^2 / 10)."""
    time = sp.Symbol("time")
    theta, motor = sp.Function("theta")(time), sp.Function("motor")(time)
    names = {n: sp.Symbol(n, real=True) for n in ("xi", "alpha", "mu")}
    delta = theta - motor
    rho = sp.cos(delta / sp.sqrt(5))
    position = rho * sp.cos(theta), rho * sp.sin(theta)
    kinetic = sum(sp.diff(p, time) ** 2 for p in position) / 2
    kinetic += rod_coupling(names["mu"]) * sp.diff(theta, time) * sp.diff(motor, time)
    # The force across the radius is 3 delta + 13/70 delta^3; it acts at the lever rho, times alpha / 3.
    force = names["alpha"] / 3 * sp.series(rho.subs(theta, motor + s.delta), s.delta, 0, 4).removeO()
    force = sp.series(force * (3 * s.delta + sp.Rational(13, 70) * s.delta**3), s.delta, 0, 4).removeO()
    rate = sp.diff(theta, time)
    row = sp.diff(sp.diff(kinetic, rate), time) - sp.diff(kinetic, theta) + force.subs(s.delta, delta)
    replaced = {
        sp.diff(theta, time, 2): sp.Symbol("acc"),
        sp.diff(motor, time, 2): s.alpha_m,
        rate: s.omega,
        sp.diff(motor, time): s.omega_m,
        theta: s.theta_m + s.delta,
        motor: s.theta_m,
    }
    for old, new in replaced.items():
        row = row.subs(old, new)
    row, acceleration = row.doit(), sp.Symbol("acc")
    return -row.subs(acceleration, 0) / sp.diff(row, acceleration), names


def test_reduced_is_lagranges_equation() -> None:
    expected, names = reduced_equation()
    program = build_program("reduced", EFFECTS)
    derivative = numpy_derivative(program)
    numbers = sp.lambdify((s.delta, s.omega, s.theta_m, s.omega_m, s.alpha_m, names["alpha"], names["mu"]), expected)
    rng = np.random.default_rng(0)
    for _ in range(5):
        delta, omega, motor, omega_m, alpha_m = rng.uniform(-1, 1, 5)
        values = {"xi": 0.0, "alpha": 9.0, "mu": 0.3, "length": 1.0}
        got = derivative(
            0.0, (motor, omega_m, alpha_m), (motor + delta, omega), [values[n] for n in program.parameters]
        )
        assert got[1] == pytest.approx(numbers(delta, omega, motor, omega_m, alpha_m, 9.0, 0.3), rel=1e-12, abs=1e-12)


def test_reduced_has_the_third_order_coefficients() -> None:
    program = build_program("reduced", EFFECTS)
    delta_dot, eps = s.delta_dot, sp.Symbol("eps")
    known = {sp.Symbol("xi", real=True): 0, RECORDED[0]: s.theta_m, RECORDED[1]: s.omega_m, RECORDED[2]: s.alpha_m}
    q, qd = program.states
    for symbol, expression in (*program.drive, *program.derivative):
        if symbol not in (s.theta_m, s.omega_m, s.alpha_m):
            known[symbol] = expression.xreplace(known)
    slope = program.slopes[1].xreplace(known)
    # The paper's form has theta_t' and delta' in place of theta_m'.
    slope = slope.subs({q: s.theta_m + s.delta, s.omega_m: qd - delta_dot})
    scaled = slope.subs({x: eps * x for x in (s.delta, qd, delta_dot, s.alpha_m)}, simultaneous=True)
    third = sp.expand(sp.series(scaled, eps, 0, 4).removeO())
    terms = sp.Poly(-third, eps, s.delta, qd, delta_dot, s.alpha_m)
    mu = sp.Symbol("mu", real=True)

    def coefficient(order: int, *powers: int) -> sp.Expr:
        return sp.simplify(
            terms.coeff_monomial(eps**order * sp.prod(x**p for x, p in zip(terms.gens[1:], powers, strict=True)))
        )

    assert coefficient(1, 1, 0, 0, 0) == s.alpha
    assert coefficient(3, 3, 0, 0, 0) == sp.Rational(64, 525) * s.alpha
    assert coefficient(3, 1, 2, 0, 0) == sp.Rational(1, 5)
    assert coefficient(3, 1, 1, 1, 0) == sp.Rational(-2, 5)
    assert coefficient(3, 1, 0, 2, 0) == sp.Rational(1, 25)
    coupling = coefficient(1, 0, 0, 0, 1)
    assert sp.simplify(coupling - 11 * mu / (2 * (140 + 33 * mu))) == 0
    # The motor's acceleration also meets the changed inertia 1 - (4/25) delta^2 of the rod's coupling.
    assert sp.simplify(coefficient(3, 2, 0, 0, 1) - (-sp.Rational(1, 25) + sp.Rational(4, 25) * coupling)) == 0
    assert sp.Rational(64, 525) == pytest.approx(0.122, abs=1e-4)
    assert float(rod_coupling(sp.Rational(1245, 4376))) == pytest.approx(0.0105, abs=5e-5)


# The elastica in its static limit.


def static_tip(base: str, load: float, direction: float) -> tuple[float, float]:
    """Tip under a dead load P l^2 / EI at an angle from the rod, where the public program has no acceleration."""
    program = build_program(base, EFFECTS)
    n, mechanics = program.n_coordinates, get_base(base).mechanics()
    # The power of a dead load pushes through the channels v_x and v_y; three times EI / (m_eff l^3) is alpha.
    alpha = 9.0
    fx, fy = alpha / 3 * load * np.cos(direction), alpha / 3 * load * np.sin(direction)
    j = [fx * mechanics.channels[s.v_x].jacobian[i] + fy * mechanics.channels[s.v_y].jacobian[i] for i in range(n)]
    mass = [mechanics.mass[i][k] for i in range(n) for k in range(n)]
    push = numpy_derivative(mechanics_program(base, s.x, s.y, *j, *mass))
    slopes = numpy_derivative(program)
    values = {"xi": 0.0, "alpha": alpha, "length": 1.0, "mu": 0.3, "tau_r": 0.0}
    parameters = [values[name] for name in program.parameters]

    def imbalance(q: np.ndarray, share: float = 1.0) -> np.ndarray:
        state = np.concatenate([q, np.zeros(n)])
        rows = push(0.0, (0.0, 0.0, 0.0), state, parameters)
        inertia = np.reshape(np.array(rows[2 + n :], float), (n, n))
        acceleration = np.array(slopes(0.0, (0.0, 0.0, 0.0), state, parameters)[n : 2 * n], float)
        return inertia @ acceleration + share * np.array(rows[2 : 2 + n], float)

    q = np.zeros(n)
    for share in np.linspace(0.1, 1.0, 10):
        q = root(imbalance, q, args=(share,), tol=1e-13).x
    assert np.abs(imbalance(q)).max() < 1e-9
    x, y = push(0.0, (0.0, 0.0, 0.0), np.concatenate([q, np.zeros(n)]), parameters)[:2]
    return float(x), float(y)


@pytest.mark.parametrize("base", [*ELASTICA, CALM])
@pytest.mark.parametrize(
    ("load", "across", "shortening"),
    [row if row[0] in (1.0, 10.0) else pytest.param(*row, marks=pytest.mark.slow) for row in MATTIASSON],
)
def test_the_static_elastica_is_mattiassons(base: str, load: float, across: float, shortening: float) -> None:
    x, y = static_tip(base, load, np.pi / 2)
    error = float(np.hypot(y - across, 1 - x - shortening))
    assert error < STATIC_ERROR[base][load]


@pytest.mark.parametrize(("deflection", "tolerance"), [(0.1, 1e-10), (0.3, 1e-8), (0.6, 1e-7), (0.9, 1e-6)])
def test_the_static_elastica_follows_the_perpendicular_law(deflection: float, tolerance: float) -> None:
    force, radius = (float(v) for v in perpendicular_law(deflection))
    x, y = static_tip("elastica", force, deflection + np.pi / 2)
    assert np.arctan2(y, x) == pytest.approx(deflection, abs=tolerance)
    assert np.hypot(x, y) == pytest.approx(radius, abs=tolerance)


@pytest.mark.parametrize("base", [*ELASTICA, CALM])
@pytest.mark.parametrize(
    "deflection", [-0.8, 0.0, 0.4, *(pytest.param(d, marks=pytest.mark.slow) for d in (-0.2, 0.9))]
)
def test_a_motion_starts_on_the_static_shape(base: str, deflection: float) -> None:
    q, rate = get_base(base).initial_coordinates(np.array([deflection]), np.array([0.7]), np.zeros(2))
    show = numpy_derivative(mechanics_program(base, s.theta, s.rho, s.omega))
    theta, rho, omega = show(0.0, (0.0, 0.0, 0.0), np.concatenate([q, rate])[:, 0], [0.0] * 5)
    # Fewer nodes for searches.
    assert theta == pytest.approx(deflection, abs=2e-6 if base == CALM else 1e-7)
    assert omega == pytest.approx(0.7, abs=3e-6 if base == CALM else 1e-6)
    tolerance = {"elastica_4": 1e-6, "elastica": 1e-6, CALM: 1e-5, "elastica_2": 5e-4, "elastica_1": 1e-4}[base]
    assert rho == pytest.approx(float(perpendicular_law(deflection)[1]), abs=tolerance)


# The rod.


@pytest.mark.parametrize(("rooted", "highest"), [(False, 11), (True, 10)])
def test_the_quadrature_integrates_polynomials_from_the_base(rooted: bool, highest: int) -> None:
    at, weights, cumulative = quadrature(6, rooted=rooted)
    ends = np.append(at, 1.0)
    for power in range(6):
        np.testing.assert_allclose(cumulative @ at**power, ends ** (power + 1) / (power + 1), atol=1e-14)
    assert weights @ at**highest == pytest.approx(1 / (highest + 1), abs=1e-14)
    assert (float(at[0]) == 0.0) is rooted


@pytest.mark.parametrize(("count", "nodes", "rooted"), [(1, 6, False), (3, 6, False), (3, 5, True), (4, 7, False)])
def test_masses_at_the_nodes_give_the_straight_rod_its_inertia(count: int, nodes: int, rooted: bool) -> None:
    weights = reduced_shapes(max(2, count))[:count]
    at, tip, _ = quadrature(nodes, rooted=rooted)
    masses, shapes = rod_masses(weights, nodes, rooted=rooted), weights @ polynomials(at)
    inertia = shapes @ (0.3 * masses + np.outer(tip, tip)) @ shapes.T / (1 + 33 / 140 * 0.3)
    np.testing.assert_allclose(inertia, mass_matrix(weights, 0.3), atol=1e-12)
    # As the whole rod turns, and as the rest of it bends meanwhile.
    assert masses.sum() == pytest.approx(1 / 3, rel=1e-12)
    s, w, path = quadrature(RICH + 4)
    turning = (w * s) @ (path[:-1] @ (weights @ polynomials(s)).T)
    np.testing.assert_allclose(shapes @ masses.sum(axis=1), turning, atol=1e-12)


def test_the_shapes_are_clamped_and_free() -> None:
    h = 1e-5
    np.testing.assert_allclose(polynomials(np.array([0.0])), 0.0)
    slope = (polynomials(np.array([1.0])) - polynomials(np.array([1.0 - h]))) / h
    np.testing.assert_allclose(slope, 0.0, atol=1e-3)


def analytic_frequencies(mu: float, count: int) -> np.ndarray:
    """omega^2 / alpha of a clamped beam with a tip mass, from the roots of its frequency equation."""

    def equation(b: float) -> float:
        # Divided by cosh b.
        return np.cos(b) + 1 / np.cosh(b) + b / mu * (np.cos(b) * np.tanh(b) - np.sin(b))

    grid = np.linspace(1e-3, (count + 1) * np.pi, 4000)
    values = np.array([equation(b) for b in grid])
    brackets = np.flatnonzero(values[:-1] * values[1:] < 0)[:count]
    roots = np.array([brentq(equation, grid[i], grid[i + 1], xtol=1e-14) for i in brackets])
    return roots**4 * (1 + 33 / 140 * mu) / mu / 3


def program_frequencies(base: str, mu: float) -> np.ndarray:
    """Squares of the angular frequencies of small motions, over alpha, from the slopes of the public program."""
    program = build_program(base, EFFECTS)
    n = program.n_coordinates
    derivative = numpy_derivative(program)
    values = {"xi": 0.0, "alpha": 1.0, "length": 1.0, "mu": mu, "tau_r": 0.0}
    parameters = [values[name] for name in program.parameters]
    stiffness = np.empty((n, n))
    for i in range(n):
        state = np.zeros(2 * n)
        state[i] = 1e-5
        stiffness[:, i] = np.array(derivative(0.0, (0.0, 0.0, 0.0), state, parameters)[n:], float) / -1e-5
    return np.sort(np.linalg.eigvals(stiffness).real)


@pytest.mark.parametrize("mu", [0.05, 0.2845, 1.0])
def test_one_shape_has_the_frequency_of_the_effective_mass(mu: float) -> None:
    # The share 33/140 of the rod is that of the static shape.
    np.testing.assert_allclose(program_frequencies("elastica_1", mu), 1.0, rtol=1e-10)
    assert get_base("elastica_1").highest_frequency({"mu": mu}) == pytest.approx(1.0, rel=1e-10)


@pytest.mark.parametrize("mu", [0.05, 0.2845, 1.0])
@pytest.mark.parametrize("base", ELASTICA[:3])
def test_small_motions_have_the_frequencies_of_a_clamped_beam_with_tip_mass(base: str, mu: float) -> None:
    got, exact = program_frequencies(base, mu), analytic_frequencies(mu, 2)
    assert got[0] == pytest.approx(exact[0], rel=5e-5)
    assert got[1] == pytest.approx(exact[1], rel=5e-4)
    # Fewer shapes than a rod has can only stiffen it.
    assert (got[:2] > exact * (1 - 1e-6)).all()
    assert get_base(base).highest_frequency({"mu": mu}) ** 2 == pytest.approx(got[-1], rel=1e-7)


@pytest.mark.parametrize("mu", [0.02, 0.2845, 1.0])
def test_a_heavier_third_mode_rings_more_slowly_and_leaves_the_others_alone(mu: float) -> None:
    calm, own = program_frequencies(CALM, mu), program_frequencies("elastica", mu)
    np.testing.assert_allclose(calm[:2], own[:2], rtol=1e-4)
    assert calm[2] == pytest.approx(own[2] / 3, rel=2e-2)
    assert get_base(CALM).highest_frequency({"mu": mu}) ** 2 == pytest.approx(calm[2], rel=1e-7)


@pytest.mark.parametrize("mu", [0.02, 0.2845, 1.0])
def test_four_shapes_have_three_frequencies_of_a_beam_and_a_slower_fourth(mu: float) -> None:
    got, weights = program_frequencies("elastica_4", mu), get_base("elastica_4").weights
    np.testing.assert_allclose(got[:3], analytic_frequencies(mu, 3), rtol=5e-4)
    whole = np.linalg.eigvals(np.linalg.solve(mass_matrix(weights, mu), bending_matrix(weights) / 3)).real
    assert got[3] == pytest.approx(whole.max() / 4, rel=2e-2)


def test_seven_polynomials_have_the_frequencies_of_a_clamped_beam_with_tip_mass() -> None:
    everything = np.eye(RICH)
    modes = np.linalg.eigvals(np.linalg.solve(mass_matrix(everything, 0.2845), bending_matrix(everything) / 3))
    np.testing.assert_allclose(np.sort(modes.real)[:3], analytic_frequencies(0.2845, 3), rtol=1e-5)


@pytest.mark.parametrize("base", ELASTICA[:2])
def test_without_a_rod_the_slow_mode_is_that_of_the_massless_spring(base: str) -> None:
    slow = [program_frequencies(base, mu)[0] - 1 for mu in (0.1, 0.01, 0.001)]
    assert abs(slow[2]) < 1e-8
    # The share 33/140 of the rod's mass leaves an error of second order in mu.
    assert abs(slow[1]) < 0.02 * abs(slow[0])


# Motion.


def exact_drive(manoeuvre: Manoeuvre, end: float) -> Drive:
    edges = np.array([0.0, *manoeuvre.kinks, end])
    rows = []
    for i in range(edges.size - 1):
        origin, powers = manoeuvre.stretch(i)
        polynomial = np.polynomial.Polynomial(powers)(np.polynomial.Polynomial([edges[i] - origin, 1.0])).coef
        rows.append(np.pad(polynomial, (0, 3 - polynomial.size))[::-1])
    return Drive(edges, np.array(rows).T, np.asarray(manoeuvre.kinks))


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 1.0])
def test_the_exact_arm_moves_like_a_converged_beam(friction: float) -> None:
    rig = replace(PAPER_RIG, disc_friction=friction * PAPER_RIG.disc_friction)
    manoeuvre, time = trapezoid(1.0, 1.4, start=0.3), np.linspace(0.0, 6.0, 301)
    twin = simulate_twin(rig, manoeuvre, time)
    alpha = 3 * rig.flexural_rigidity / (rig.effective_mass * rig.length**3)
    xi, mu = rig.disc_friction / rig.effective_mass, rig.beam_mass / rig.tip_mass
    drive = exact_drive(manoeuvre, 6.0)
    mean, peak = {}, {}
    for base in ("constant_radius", "reduced", CALM, *ELASTICA):
        values = {
            "alpha": alpha,
            "xi": xi,
            "mu": mu,
            "A": float(rod_coupling(mu)),
            "beta": 64 / 525 * alpha,
            "gamma": 5**-0.5,
        }
        tip = whole_kernel(base, time, drive, 0.004, **values)
        distance = np.hypot(tip[:, 0] - twin.tip_x, tip[:, 1] - twin.tip_y)
        mean[base], peak[base] = float(distance.mean()), float(distance.max())
    assert mean["elastica"] < 5e-5
    assert peak["elastica"] < 1.5e-4
    assert mean[CALM] < 5e-5
    # It is about as close as the three modes with their own inertia.
    del mean[CALM]
    order = ("elastica_4", "elastica", "elastica_2", "elastica_1", "reduced", "constant_radius")
    assert sorted(mean, key=lambda base: mean[base]) == list(order)


@pytest.mark.parametrize("base", ["constant_radius", "oscillator", *ELASTICA])
def test_the_components_of_the_bending_make_its_energy(base: str) -> None:
    bending = get_base(base).mechanics().bending
    n = get_base(base).n_coordinates
    jacobian = [entry for _, _, row in bending for entry in row]
    show = numpy_derivative(
        mechanics_program(base, s.U, s.w2, *(b[0] for b in bending), *(b[1] for b in bending), *jacobian)
    )
    rng = np.random.default_rng(0)
    q, rate = rng.uniform(-0.3, 0.3, (2, n))
    count = len(build_program(base, EFFECTS).parameters)
    energy, speed, *rest = show(0.0, (0.0, 0.0, 0.0), np.concatenate([q, rate]), [0.0] * count)
    value, change, rows = rest[:n], rest[n : 2 * n], np.reshape(rest[2 * n :], (n, n))
    assert energy == pytest.approx(np.sum(np.square(value)) / 2)
    assert speed == pytest.approx(np.sum(np.square(change)))
    np.testing.assert_allclose(value, rows @ q, atol=1e-15)
    np.testing.assert_allclose(change, rows @ rate, atol=1e-15)


@pytest.mark.parametrize(
    "base",
    [
        "constant_radius",
        "reduced",
        *(pytest.param(b, marks=pytest.mark.slow) if b in ("elastica", "elastica_4") else b for b in ELASTICA),
    ],
)
@pytest.mark.parametrize("lossy", [False, True])
def test_energy_over_a_swing(base: str, lossy: bool) -> None:
    from scipy.integrate import solve_ivp

    program = build_program(base, EFFECTS)
    n, mechanics = program.n_coordinates, get_base(base).mechanics()
    values = {"xi": 0.1 * lossy, "alpha": 9.0, "length": 1.0, "mu": 0.3, "tau_r": 0.002 * lossy}
    parameters = [values[name] for name in program.parameters]
    mass = [mechanics.mass[i][k] for i in range(n) for k in range(n)]
    show = numpy_derivative(mechanics_program(base, s.U, *mass))
    slopes = numpy_derivative(program)
    motor = (0.3, 0.0, 0.0)
    q, rate = get_base(base).initial_coordinates(np.array([0.8]), np.array([0.5]), np.array([0.3, 0.0]))
    path = solve_ivp(
        lambda t, y: np.array(slopes(t, motor, y, parameters), float),
        (0.0, 2.0),
        np.concatenate([q, rate])[:, 0],
        "DOP853",
        rtol=1e-11,
        atol=1e-11,
    )
    rows = show(0.0, motor, path.y, parameters)
    inertia = np.array([np.broadcast_to(row, path.t.shape) for row in rows[1:]]).reshape(n, n, -1)
    velocity = path.y[n:]
    energy = np.einsum("it,ijt,jt->t", velocity, inertia, velocity) / 2 + 9.0 * rows[0]
    if lossy:
        assert np.diff(energy).max() < 1e-9
        assert energy[-1] < 0.95 * energy[0]
    else:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


def test_what_is_kept_of_a_derivation_is_that_of_the_base_and_of_the_rod() -> None:
    calm, soft = get_base(CALM), rod_of([get_effect("base_compliance")])
    for rod in (STRAIGHT, soft):
        assert calm.mechanics(rod) is calm.mechanics(rod)
        assert calm.mechanics(rod) == calm.derive(rod)
    assert calm.mechanics(soft) != calm.mechanics() != get_base("elastica").mechanics()


def test_an_unknown_base_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match="known are constant_radius, reduced, elastica"):
        get_base("beam")
