from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.manoeuvres import Manoeuvre, minimum_jerk, trapezoid
from discovery_datasets.twin import simulate as simulate_twin
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import root

from benchmarks.paper.theory.elastica.beam import tip_under_load
from benchmarks.paper.theory.massless_arm.massless_limit import distance_to_rod, tip_distance
from benchmarks.paper.theory.massless_arm.model import GeneralModel, GeneralMotion, cartesian_acceleration
from benchmarks.paper.theory.massless_arm.potential import DEFLECTION_LIMIT, RADIAL_LIMITS, tip_potential
from benchmarks.paper.theory.massless_arm.simulation import simulate_general
from discovery.foundation.errors import InputError, SimulationFailure
from discovery.recordings.drive import Drive
from discovery.theory.elastica.static_law import perpendicular_law

RIG = PAPER_RIG
ARM = GeneralModel(RIG.flexural_rigidity, RIG.tip_mass, RIG.length, RIG.disc_friction / RIG.tip_mass)
FREE = replace(ARM, xi=0.0)
END = 6.0
TIME = np.linspace(0.0, END, 301)
MOVES = {"trapezoid": trapezoid(1.0, 1.4), "minimum_jerk": minimum_jerk(1.0, 1.0)}


def exact_drive(manoeuvre: Manoeuvre, end: float = END, stretch: float = 1.0) -> Drive:
    """The manoeuvre's own polynomials, on a time axis `stretch` times as long."""
    edges = np.array([0.0, *manoeuvre.kinks, end / stretch])
    rows = []
    for i in range(edges.size - 1):
        origin, powers = manoeuvre.stretch(i)
        shifted = np.polynomial.Polynomial(powers)(np.polynomial.Polynomial([edges[i] - origin, 1.0])).coef
        rows.append(np.pad(shifted / stretch ** np.arange(float(shifted.size)), (0, 6 - shifted.size))[::-1])
    return Drive(edges * stretch, np.array(rows).T, np.asarray(manoeuvre.kinks) * stretch)


def distance(a: GeneralMotion, b: GeneralMotion) -> float:
    return float(np.hypot(*(a.position - b.position)).max())


# The potential of the tip.

deflections = st.floats(-DEFLECTION_LIMIT, DEFLECTION_LIMIT)


@settings(deadline=None, max_examples=200)
@given(deflections, st.floats(-1.0, RADIAL_LIMITS[1]))
def test_the_potential_is_that_of_the_elliptic_integrals(delta: float, radial: float) -> None:
    d, f = np.array([delta]), np.array([radial])
    rho, _, _, moment, *_ = tip_potential().tip(d, f)[:, 0]
    across = moment / rho
    force, direction = np.hypot(radial, across), delta + np.arctan2(across, radial)
    tip = tip_under_load(force, direction)
    assert tip.angle == pytest.approx(delta, abs=1e-9)
    assert tip.radius == pytest.approx(rho, abs=1e-10)
    # The first integral of (5) gives the bending energy from the tip's slope.
    energy = force * np.cos(tip.slope - direction) - radial * tip.radius
    assert tip_potential().energy(d, f)[0] == pytest.approx(float(energy), abs=1e-9)


def test_the_derivatives_of_the_potential() -> None:
    rng, h, potential = np.random.default_rng(0), 1e-5, tip_potential()
    delta, radial = rng.uniform(-1.39, 1.39, 300), rng.uniform(*RADIAL_LIMITS, 300)
    tip = potential.tip(delta, radial)
    by_delta = (potential.tip(delta + h, radial) - potential.tip(delta - h, radial)) / (2 * h)
    by_force = (potential.tip(delta, radial + h) - potential.tip(delta, radial - h)) / (2 * h)
    for got, expected in (
        (by_delta[0], tip[1]),
        (by_force[0], tip[2]),
        (by_delta[3], tip[4]),
        (by_force[3], -tip[1]),
        (by_delta[1], tip[5]),
        (by_force[1], tip[6]),
    ):
        np.testing.assert_allclose(got, expected, atol=1e-9)


def test_the_straight_arm_is_a_spring_of_stiffness_175() -> None:
    small = np.array([1e-3])
    shortening = [(1.0 - tip_potential().tip(small, np.array([f]))[0, 0]) / small[0] ** 2 for f in (-0.01, 0.0, 0.01)]
    assert shortening[1] == pytest.approx(1 / 10, rel=1e-5)
    assert 0.02 / (shortening[0] - shortening[2]) == pytest.approx(175.0, rel=1e-4)
    # A straight column under tension F = k^2: the moment of the tip force is k^2 tanh k / (k - tanh k) delta.
    for k in (0.5, 2.0, 4.0):
        moment = tip_potential().tip(np.zeros(1), np.array([k**2]))[4, 0]
        assert moment == pytest.approx(k**2 * np.tanh(k) / (k - np.tanh(k)), rel=1e-9)
    # Under compression clamped and pinned: tan instead of tanh, across the load of buckling pi^2 / 4.
    k = 2.0
    assert tip_potential().tip(np.zeros(1), np.array([-(k**2)]))[4, 0] == pytest.approx(
        k**2 * np.tan(k) / (np.tan(k) - k), rel=1e-9
    )


# The forms of the equation.


def test_equation_8_has_the_rate_squared() -> None:
    time = sp.Symbol("time")
    theta, rho = sp.sin(2 * time) + time**2, 1 - sp.cos(time) / 5
    at = {time: 0.7}
    polar = [float(sp.diff(f, time, n).subs(at)) for n in (0, 1, 2) for f in (theta, rho)]
    expected = [float(sp.diff(rho * f, time, 2).subs(at)) for f in (sp.cos(theta), sp.sin(theta))]
    np.testing.assert_allclose(cartesian_acceleration(*(np.array(v) for v in polar)), expected, rtol=1e-12)
    t, r, t1, r1, t2, r2 = polar
    misprinted = r2 * np.cos(t) - 2 * r1 * np.sin(t) * t1 - r * np.cos(t) * t2**2 - r * np.sin(t) * t2
    assert misprinted != pytest.approx(expected[0], rel=0.01)


def test_cartesian_and_polar_form_agree() -> None:
    motion = simulate_general(ARM, exact_drive(MOVES["trapezoid"]), TIME)
    # (7) in the fixed frame, from accelerations by (8).
    np.testing.assert_allclose(
        ARM.tip_mass * motion.acceleration, -motion.force - ARM.xi * ARM.tip_mass * motion.velocity, atol=1e-14
    )
    np.testing.assert_allclose(np.hypot(*motion.position), motion.rho, rtol=1e-14)
    x, y = motion.position
    fx, fy = motion.force
    np.testing.assert_allclose(motion.coupling_torque, -(x * fy - y * fx), atol=1e-15)


def test_the_accelerations_are_those_of_the_positions() -> None:
    time = np.linspace(0.0, 1.4, 1401)
    motion = simulate_general(ARM, exact_drive(MOVES["minimum_jerk"]), time, step=0.005)
    speed = np.gradient(motion.position, time, axis=1)
    np.testing.assert_allclose(speed[:, 2:-2], motion.velocity[:, 2:-2], atol=2e-5)
    numeric = np.gradient(motion.velocity, time, axis=1)
    np.testing.assert_allclose(numeric[:, 2:-2], motion.acceleration[:, 2:-2], atol=3e-4)


def cartesian_force(x: float, y: float, guess: np.ndarray) -> np.ndarray:
    """Normalised force on the tip of a beam along x, by the elliptic integrals and a root finder."""

    def miss(f: np.ndarray) -> list[float]:
        tip = tip_under_load(np.hypot(*f), np.arctan2(f[1], f[0]))
        return [float(tip.x) - x, float(tip.y) - y]

    found = root(miss, guess, tol=1e-12)
    assert np.abs(miss(found.x)).max() < 1e-10
    return found.x


@pytest.mark.slow
def test_an_independent_solver_in_cartesian_coordinates() -> None:
    # Away from the straight arm the inverse of the map is good enough for an explicit method.
    model, time = GeneralModel(1.0, 1.0, 1.0, 0.05), np.linspace(0.0, 0.6, 13)
    motion = simulate_general(model, None, time, deflection=0.8, rate=0.1, retardation=0.0)
    last = motion.force[:, 0]

    def slope(_: float, state: np.ndarray) -> np.ndarray:
        nonlocal last
        last = cartesian_force(state[0], state[1], last)
        return np.concatenate([state[2:], -last - model.xi * state[2:]])

    start = np.concatenate([motion.position[:, 0], motion.velocity[:, 0]])
    path = solve_ivp(slope, (0.0, 0.6), start, "DOP853", t_eval=time, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(path.y[:2], motion.position, atol=1e-7)
    np.testing.assert_allclose(path.y[2:], motion.velocity, atol=2e-6)


@pytest.mark.slow
def test_one_normalised_motion_for_arms_of_any_size() -> None:
    other = GeneralModel(2.0, 0.7, 1.8, 0.0)
    other = replace(other, xi=ARM.xi * ARM.time_scale / other.time_scale)
    stretch = other.time_scale / ARM.time_scale
    one = simulate_general(ARM, exact_drive(MOVES["trapezoid"]), TIME).normalised()
    two = simulate_general(other, exact_drive(MOVES["trapezoid"], END * stretch, stretch), TIME * stretch).normalised()
    plain = simulate_general(
        ARM.normalised(), exact_drive(MOVES["trapezoid"], END / ARM.time_scale, 1 / ARM.time_scale), one.time
    )
    for motion in (two, plain):
        assert motion.model.xi == pytest.approx(one.model.xi)
        for name in ("time", "theta_t", "rho", "theta_rate", "rho_rate", "radial", "tangential"):
            np.testing.assert_allclose(getattr(motion, name), getattr(one, name), atol=1e-7, err_msg=name)
        np.testing.assert_allclose(motion.kinetic_energy, one.kinetic_energy, atol=1e-7)
        np.testing.assert_allclose(motion.bending_energy, one.bending_energy, atol=1e-7)
    # With the paper's unit of time, sqrt(m), the two would differ.
    assert other.time_scale / ARM.time_scale != pytest.approx(np.sqrt(other.tip_mass / ARM.tip_mass), rel=0.1)


# Convergence and energy.


@pytest.mark.parametrize(
    ("move", "limits"),
    [("trapezoid", (4e-6, 2e-7)), pytest.param("minimum_jerk", (1e-6, 5e-8), marks=pytest.mark.slow)],
)
def test_the_path_converges_with_the_step(move: str, limits: tuple[float, float]) -> None:
    drive, time = exact_drive(MOVES[move]), TIME[:101]
    fine, *coarse = (simulate_general(ARM, drive, time, step=step) for step in (0.0025, 0.01, 0.005))
    crossings = np.flatnonzero(np.diff(np.sign(fine.theta_t - fine.theta_m)[time > 0.6]))
    assert crossings.size >= 1, "the straight arm is passed"
    for motion, limit in zip(coarse, limits, strict=True):
        assert distance(motion, fine) < limit


@pytest.mark.slow
@pytest.mark.parametrize("move", [minimum_jerk(1.0, 1.0), trapezoid(1.0, 1.0)])
def test_the_path_converges_with_the_retardation(move: Manoeuvre) -> None:
    drive = exact_drive(move)
    two, one, half = (simulate_general(ARM, drive, TIME, step=0.005, retardation=r) for r in (0.02, 0.01, 0.005))
    steps = distance(two, one), distance(one, half)
    assert steps[1] < 2e-5
    assert steps[0] / steps[1] == pytest.approx(2.0, rel=0.25)


@pytest.mark.slow
def test_hard_ramps_leave_ringing_that_is_bounded() -> None:
    """The ringing depends on the retardation, the tip by little; without any the radial force leaves its domain."""
    drive = exact_drive(MOVES["trapezoid"])
    with pytest.raises(SimulationFailure, match="a longer retardation calms"):
        simulate_general(ARM, drive, TIME, retardation=0.0)
    path = [simulate_general(ARM, drive, TIME, retardation=r) for r in (0.02, 0.01, 0.005, 0.0025)]
    assert max(distance(a, b) for a, b in pairwise(path)) < 1e-4
    assert max(motion.radial.max() for motion in path) < 0.45


@pytest.mark.parametrize(("speed", "largest"), [(1.6, 0.85), (2.2, 0.90)])
def test_the_default_passes_harder_ramps(speed: float, largest: float) -> None:
    motion = simulate_general(ARM, exact_drive(trapezoid(1.0, speed)), TIME)
    assert np.abs(motion.theta_t - motion.theta_m).max() == pytest.approx(largest, abs=0.01)


def test_energy_is_conserved_without_friction_and_retardation() -> None:
    drift = []
    for step in (0.02, 0.01, 0.005):
        motion = simulate_general(FREE, None, np.linspace(0.0, 0.4, 81), deflection=0.8, step=step, retardation=0.0)
        energy = motion.kinetic_energy + motion.bending_energy
        drift.append(float(np.abs(energy / energy[0] - 1.0).max()))
    assert drift[1] < 2e-8
    # Outputs lie between the steps, on polynomials of degree three.
    assert np.log2(np.array(drift[:-1]) / drift[1:]).min() > 3.5


def test_energy_with_retardation_only_falls_and_hardly() -> None:
    motion = simulate_general(FREE, None, np.linspace(0.0, 8.0, 801), deflection=0.3)
    energy = motion.kinetic_energy + motion.bending_energy
    assert np.diff(energy / energy[0]).max() < 2e-9
    assert -2e-5 < energy[-1] / energy[0] - 1.0 < 0.0


def test_friction_takes_its_power() -> None:
    time = np.linspace(0.0, 4.0, 4001)
    motion = simulate_general(ARM, None, time, deflection=0.4)
    energy = motion.kinetic_energy + motion.bending_energy
    lost = np.trapezoid(2.0 * ARM.xi * motion.kinetic_energy, time)
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-3)


# Limits.


@pytest.mark.slow
@pytest.mark.parametrize("amplitude", [0.02, 0.1])
def test_small_swings_have_the_frequency_of_the_linear_model(amplitude: float) -> None:
    omega = np.sqrt(3 * FREE.flexural_rigidity / (FREE.tip_mass * FREE.length**3))
    time = np.linspace(0.0, 20.0, 4001)
    angle = simulate_general(FREE, None, time, deflection=amplitude).theta_t
    cross = np.flatnonzero(angle[:-1] * angle[1:] < 0)
    when = time[cross] - angle[cross] * (time[1] - time[0]) / (angle[cross + 1] - angle[cross])
    ratio = np.pi / np.diff(when).mean() / omega
    # To third order beta = (64/525) alpha adds 3/8 of beta / alpha, and c1, c2, c3 an eighth of their sum.
    expected = amplitude**2 * (3 / 8 * 64 / 525 + (1 / 5 - 2 / 5 + 1 / 25) / 8)
    assert ratio - 1.0 == pytest.approx(expected, rel=0.03)


def test_a_small_motion_is_that_of_the_cubic_model() -> None:
    move = minimum_jerk(0.1, 1.0)
    drive = exact_drive(move)
    motion = simulate_general(ARM, drive, TIME)
    alpha = 3 / ARM.time_scale**2

    def slope(t: float, y: np.ndarray) -> list[float]:
        delta = y[0] - float(move(t)[0])
        return [y[1], -ARM.xi * y[1] - alpha * (delta + 0.0619 * delta**3)]

    path = solve_ivp(slope, (0.0, END), [0.0, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-11, max_step=0.05)
    assert np.abs(path.y[0] - motion.theta_t).max() < 2e-4
    np.testing.assert_allclose(motion.rho, np.cos((motion.theta_t - motion.theta_m) / np.sqrt(5)), atol=1e-5)


def test_the_arm_at_rest_stays_straight_and_a_damped_one_returns() -> None:
    still = simulate_general(ARM, None, TIME)
    np.testing.assert_allclose(still.position, np.array([[1.0], [0.0]]) * np.ones(TIME.size), atol=1e-12)
    np.testing.assert_allclose(still.force, 0.0, atol=1e-9)
    damped = simulate_general(replace(ARM, xi=6.0), exact_drive(MOVES["trapezoid"], 12.0), np.linspace(0.0, 12.0, 121))
    assert damped.theta_t[-1] == pytest.approx(1.0, abs=1e-6)
    assert damped.rho[-1] == pytest.approx(1.0, abs=1e-9)


def test_a_slow_arm_follows_the_perpendicular_law() -> None:
    # Creeping back under heavy friction, the tip's force is the friction, along a path almost across the radius.
    motion = simulate_general(replace(ARM, xi=60.0), None, np.linspace(0.0, 5.0, 51), deflection=0.4)
    force, rho = perpendicular_law(motion.theta_t)
    np.testing.assert_allclose(motion.rho, rho, atol=1e-4)
    np.testing.assert_allclose(motion.tangential / ARM.force_scale, force, rtol=0.01)


# The rod's mass goes to zero.


@pytest.mark.slow
def test_the_twin_nears_the_massless_arm() -> None:
    drive = exact_drive(MOVES["minimum_jerk"])
    motion, mean, corrected = simulate_general(ARM, drive, TIME), [], []
    for beam_mass in (0.01245, 0.003, 0.0003):
        rig = replace(RIG, beam_mass=beam_mass)
        twin = simulate_twin(rig, MOVES["minimum_jerk"], TIME)
        mean.append(tip_distance(motion, twin.tip_x, twin.tip_y).mean)
        felt = GeneralModel(
            rig.flexural_rigidity, rig.effective_mass, rig.length, rig.disc_friction / rig.effective_mass
        )
        corrected.append(tip_distance(simulate_general(felt, drive, TIME), twin.tip_x, twin.tip_y).mean)
    # In proportion to the rod's mass; 33/140 of it at the tip take away all but a twentieth.
    assert mean[1] / mean[0] == pytest.approx(0.003 / 0.01245, rel=0.1)
    assert mean[2] / mean[0] == pytest.approx(0.0003 / 0.01245, rel=0.1)
    assert corrected[0] < 0.05 * mean[0]
    assert corrected[2] < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("move", ["minimum_jerk", "trapezoid"])
def test_the_elastica_base_nears_the_massless_arm(move: str) -> None:
    drive = exact_drive(MOVES[move])
    ratios = (0.2845, 0.05, 0.005)
    plain = [distance_to_rod(ARM, drive, TIME, mu, effective=False) for mu in ratios]
    felt = [distance_to_rod(ARM, drive, TIME, mu, effective=True) for mu in ratios]
    assert plain[2].mean / plain[1].mean == pytest.approx(0.1, rel=0.1)
    assert felt[0].mean > felt[1].mean > felt[2].mean
    assert felt[2].mean < 2e-4
    assert felt[2].peak < 5e-4


# Refusals.


@pytest.mark.parametrize("wrong", [{"flexural_rigidity": 0.0}, {"tip_mass": -1.0}, {"length": np.nan}, {"xi": -0.1}])
def test_an_impossible_arm_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="positive rigidity"):
        replace(ARM, **wrong)


def test_impossible_simulations_are_refused() -> None:
    with pytest.raises(InputError, match="increasing order"):
        simulate_general(ARM, None, TIME[::-1])
    for wrong in ({"deflection": 1.5}, {"step": 0.0}, {"retardation": -1.0}, {"rate": np.nan}):
        with pytest.raises(InputError, match="needs a positive step"):
            simulate_general(ARM, None, TIME, **wrong)
    with pytest.raises(InputError, match=r"got ndarray.*smooth_motion.*spline_drive"):
        simulate_general(ARM, 0.1 * TIME, TIME)  # type: ignore[arg-type]


def test_a_motion_beyond_the_domain_says_when() -> None:
    with pytest.raises(SimulationFailure, match="leaves the deflections") as caught:
        simulate_general(ARM, None, TIME, rate=20.0)
    assert 0.0 <= caught.value.time < END
    assert caught.value.parameters["m"] == ARM.tip_mass
