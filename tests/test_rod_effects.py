from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.disturbances import InitialCurvature
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.quick import readings
from discovery_datasets.quick_effects import BaseCompliance, MaterialNonlinearity, TipRotaryInertia
from discovery_datasets.twin import static_tip
from scipy.optimize import brentq
from test_effects import TestCatalogue as Contract
from test_effects import planted
from test_mechanics import exact_drive

from benchmarks.paper.theory.coupling import Arm
from discovery.declarations import symbols as s
from discovery.declarations.effect import ARM, Dissipation
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent
from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.estimation.bench import Bench
from discovery.estimation.equilibrium import equilibrium
from discovery.estimation.fit import fit
from discovery.estimation.natural_units import NaturalUnits
from discovery.mechanics import get_base
from discovery.mechanics.rod import STRAIGHT, rod_of
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Quantity, Rig
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator
from discovery.testing.states import every_effect

PLAIN = ("viscous_damping", "linear_stiffness")
LENGTH, INERTIA = PAPER_RIG.length, PAPER_RIG.effective_mass * PAPER_RIG.length**2
RIGIDITY = PAPER_RIG.flexural_rigidity / LENGTH
ALPHA, MU = 3 * RIGIDITY / INERTIA, PAPER_RIG.beam_mass / PAPER_RIG.tip_mass
XI = PAPER_RIG.disc_friction / PAPER_RIG.effective_mass
NUMBERS = {"alpha": ALPHA, "xi": XI, "mu": MU, "tau_r": 0.0, "length": LENGTH}
#: What the twin's effect is for the parameter of the catalogue's.
TWIN = {
    "initial_curvature": lambda kappa_0: InitialCurvature(kappa_0 / LENGTH),
    "base_compliance": lambda c_b: BaseCompliance(RIGIDITY / c_b),
    "tip_rotary_inertia": lambda J: TipRotaryInertia(J * INERTIA),
    "material_nonlinearity": lambda b_3: MaterialNonlinearity(b_3 * LENGTH**2),
}
TIME, MANOEUVRE = np.linspace(0.0, 10.0, 501), trapezoid(1.0, 1.0, start=0.3)
#: Sizes as in a real rig: a rod bent by 15 mm, a clamp of 1 % of the rod's compliance, a disc that does not spin.
CASES = [
    ("initial_curvature", 0.03),
    ("initial_curvature", -0.2),
    ("base_compliance", 0.01),
    ("base_compliance", 0.1),
    ("tip_rotary_inertia", 0.001),
    ("material_nonlinearity", 0.01),
    ("material_nonlinearity", -0.01),
]


def only(effect: str) -> str:
    """Return the name of an effect's parameter."""
    (parameter,) = get_effect(effect).parameters()
    return parameter.name


@cache
def truth(effect: str, value: float) -> np.ndarray:
    """Tip of the twin's arm with one effect [m], shape (n, 2)."""
    found = readings(PAPER_RIG, MANOEUVRE, TIME, disturbances=[TWIN[effect](value)], modes=7, nodes=18)
    return np.column_stack([found.reading_x, found.reading_y])


def simulated(base: str, start: float = 0.0, **values: float) -> np.ndarray:
    """Tip of an arm on the simulator of every effect, which other tests have compiled: the others are absent."""
    effects = every_effect(base)
    sim = Simulator(base, effects, TIME, exact_drive(MANOEUVRE, TIME[-1]), step=0.004)
    absent = {n: p.default for n, p in Model(base, effects).parameters.items()}
    numbers = {**absent, **NUMBERS, **values}
    return sim(np.array([[numbers[n]] for n in sim.names]), np.array([start]), np.zeros(1))[:, :, 0]


def mean_distance(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.hypot(*(first - second).T).mean())


@pytest.mark.parametrize(("effect", "value"), CASES)
def test_the_exact_arm_with_an_effect_moves_like_the_twin(effect: str, value: float) -> None:
    start = value / 2 if effect == "initial_curvature" else 0.0
    with_effect = simulated("elastica", start, **{only(effect): value})
    assert mean_distance(with_effect, truth(effect, value)) < 5e-5
    assert mean_distance(simulated("elastica"), truth(effect, value)) > 4e-3


@pytest.mark.parametrize(
    ("effect", "value"), [("base_compliance", 0.1), ("initial_curvature", -0.2), ("material_nonlinearity", 0.01)]
)
def test_a_base_of_one_coordinate_follows_its_effect(effect: str, value: float) -> None:
    # The mechanics of the base itself leave several millimetres.
    start = value / 2 if effect == "initial_curvature" else 0.0
    with_effect = mean_distance(simulated("reduced", start, **{only(effect): value}), truth(effect, value))
    assert with_effect < 0.2 * mean_distance(simulated("reduced"), truth(effect, value))


@pytest.mark.parametrize(
    ("effect", "true"), [CASES[0], *(pytest.param(*CASES[k], marks=pytest.mark.slow) for k in (2, 4, 5))]
)
def test_a_noisy_recording_gives_the_parameter_back(effect: str, true: float) -> None:
    rng = np.random.default_rng(list(effect.encode()))
    tip = truth(effect, true) + 3e-4 * rng.standard_normal((TIME.size, 2))
    drive = exact_drive(MANOEUVRE, TIME[-1])
    channels = (("tip_x", "tip_y"), ("m", "m"), np.full(2, 3e-4))
    recording = Recording("twin", TIME, drive.evaluate(TIME)[0], tip, *channels, "", "")
    experiment = Experiment(recording, drive, Rig("twin", length=Quantity(LENGTH, 0.0)))
    name, model = only(effect), Model("elastica", PLAIN, {"length": LENGTH, "mu": MU, "tau_r": 0.0})
    bench = Bench(model.base, every_effect(model.base), [experiment], 0.004)
    without = fit(model, [experiment], start={"alpha": 0.98 * ALPHA, "xi": 0.04}, bench=bench)
    # The ringing of a rod whose end carries an inertia has a minimum for every beat: the best of all declared starts.
    starts = get_effect(effect).parameters()[0].starts
    fits = [
        fit(model.with_effect(effect), [experiment], start={**without.values, name: v}, bench=bench) for v in starts
    ]
    found = min(fits, key=lambda f: f.minimum.cost)
    assert abs(found.values[name] - true) < 3 * found.sd[name], (found.values[name], found.sd[name])
    assert found.sd[name] < 0.06 * true
    assert found.values["alpha"] == pytest.approx(ALPHA, rel=2e-4 + 4 * found.sd["alpha"] / ALPHA)


# The rod at rest.


@pytest.mark.parametrize("base", ["constant_radius", "reduced", "elastica", "elastica_1"])
def test_a_curved_arm_rests_on_its_arc(base: str) -> None:
    model = Model(base, (*PLAIN, "initial_curvature"), {"length": 1.0, "mu": MU})
    values = {**NUMBERS, "kappa_0": 0.3}
    assert equilibrium(model, values, NaturalUnits(0.3, 1.0, 1.0), (0.4,)) == pytest.approx(0.15, abs=1e-9)
    program = build_program(base, model.effects)
    numbers = [values[n] for n in program.parameters]
    motor = np.array([0.4, 0.0])
    q, rate = get_base(base).initial_coordinates(np.array([0.15]), np.zeros(1), motor, program.form(numbers))
    state = np.concatenate([q, rate])[:, 0]
    slopes = numpy_derivative(program)(0.0, (0.4, 0.0, 0.0), state, numbers)
    np.testing.assert_allclose(np.array(slopes, float), 0.0, atol=1e-9)
    if base != "constant_radius":
        known = dict(zip([*program.states, s.theta_m], [*state, 0.4], strict=True))
        known |= {sp.Symbol(n, real=True): v for n, v in values.items()}
        # The chord of an arc.
        assert np.hypot(*(float(r.subs(known)) for r in program.reading)) == pytest.approx(
            np.sin(0.15) / 0.15, abs=2e-5
        )


def test_the_static_law_of_a_curved_rod_holds_to_third_order() -> None:
    errors = []
    for size in (1.0, 0.5):
        kappa_0, force = 0.3 * size, 1.0 * size
        # A force across the radius: its direction follows the tip.
        angle = 0.0
        for _ in range(30):
            push = 1j * np.exp(1j * angle) * force * RIGIDITY / LENGTH
            tip = static_tip(PAPER_RIG, tip_force=push, disturbances=[InitialCurvature(kappa_0 / LENGTH)])
            angle = float(np.angle(tip))
        rod = rod_of([get_effect("initial_curvature")])
        mechanics = get_base("reduced").mechanics(rod)
        (q,) = mechanics.coordinates
        known = {q: angle, s.theta_m: 0.0, sp.Symbol("kappa_0", real=True): kappa_0}
        radius = float(mechanics.channels[s.rho].value.subs(known))
        pull = float(mechanics.channels[s.U].jacobian[0].subs(known))
        errors.append((abs(radius - abs(tip) / LENGTH), abs(pull - force * abs(tip) / LENGTH / 3)))
    (radius, pull), (finer_radius, finer_pull) = errors
    assert finer_radius < 1e-4
    assert radius / finer_radius > 12
    assert finer_pull < 2e-4
    assert pull / finer_pull > 24


def test_a_compliant_root_turns_the_whole_static_shape() -> None:
    base, c_b, bend = get_base("elastica"), 0.15, np.array([0.3, -0.8])
    clamped, _ = base.initial_coordinates(bend, np.zeros(2), np.zeros(2))
    program = build_program("elastica", (*PLAIN, "base_compliance"))
    numbers = [{**NUMBERS, "c_b": c_b}[n] for n in program.parameters]
    curvature = np.array([float(c) for c in base.mechanics().root[2]]) * 3 @ clamped
    q, rate = base.initial_coordinates(bend + c_b * curvature, np.full(2, 0.7), np.zeros(2), program.form(numbers))
    np.testing.assert_allclose(q, clamped, atol=1e-8)
    mechanics = base.mechanics(program.rod)
    rows = [mechanics.channels[c].value for c in (s.theta, s.omega)]
    show = sp.lambdify([*mechanics.coordinates, *mechanics.rates], _unrolled(mechanics, rows, c_b))
    theta, omega = show(*q, *rate)
    np.testing.assert_allclose(theta, bend + c_b * curvature, atol=2e-6)
    np.testing.assert_allclose(omega, 0.7, atol=2e-5)


def _unrolled(mechanics, rows, c_b: float) -> list[sp.Expr]:
    """Return rows in coordinates and rates alone, the motor at rest."""
    known = {sp.Symbol("c_b", real=True): c_b, sp.Symbol("mu", real=True): MU}
    known |= dict.fromkeys((s.theta_m, s.omega_m, s.alpha_m), 0)
    for symbol, expression in mechanics.assignments:
        if symbol.name.startswith(("psi", "sn", "cs", "px", "py", "tip", "hub")):
            known[symbol] = expression.xreplace(known)
    return [row.xreplace(known) for row in rows]


# Small motions.


def frequencies(base: str, effect: str, value: float, mu: float) -> np.ndarray:
    """Squares of the angular frequencies of small motions over alpha."""
    program = build_program(base, (*PLAIN, effect))
    size, values = len(program.states), {**NUMBERS, "alpha": 1.0, "xi": 0.0, "mu": mu, only(effect): value}
    numbers, slopes = [values[k] for k in program.parameters], numpy_derivative(program)
    pushed = [slopes(0.0, (0.0, 0.0, 0.0), 1e-5 * state, numbers) for state in np.eye(size)]
    turning = np.linalg.eigvals(np.array(pushed, float).T / 1e-5).imag
    return np.sort(turning[turning > 1e-3]) ** 2


def beam_frequency(mu: float, inertia: float = 0.0, compliance: float = 0.0, number: int = 0) -> float:
    """omega^2 / alpha of a beam with tip mass and rotary inertia on a torsion spring, from its boundary conditions."""
    mass, turning = 1 / mu, inertia * (1 + 33 / 140 * mu) / mu

    def equation(b: float) -> float:
        # y = A (cosh - cos) + B (sinh - sin) + C (sin + sinh); y'(0) = compliance y''(0).
        ch, sh, c, si = np.cosh(b), np.sinh(b), np.cos(b), np.sin(b)
        y = np.array([ch - c, sh - si, si + sh])
        dy = b * np.array([sh + si, ch - c, c + ch])
        ddy = b**2 * np.array([ch + c, sh + si, sh - si])
        dddy = b**3 * np.array([sh - si, ch + c, ch - c])
        root = np.array([-compliance * 2 * b**2, 0.0, 2 * b])
        return float(np.linalg.det([root, ddy - turning * b**4 * dy, dddy + mass * b**4 * y]) / b**7)

    grid = np.linspace(0.05, 7.0, 1200)
    values = np.array([equation(b) for b in grid])
    k = int(np.flatnonzero(values[:-1] * values[1:] < 0)[number])
    return brentq(equation, grid[k], grid[k + 1], xtol=1e-14) ** 4 * (1 + 33 / 140 * mu) / mu / 3


@pytest.mark.parametrize("mu", [pytest.param(0.1, marks=pytest.mark.slow), 0.2845])
def test_small_motions_have_the_frequency_of_the_beam(mu: float) -> None:
    assert beam_frequency(mu) == pytest.approx(1.0, abs=2e-4)
    for base, accuracy in (("elastica", 2e-5), ("elastica_1", 2e-3), ("reduced", 2e-3)):
        for inertia in (1e-3, 4e-3):
            found = frequencies(base, "tip_rotary_inertia", inertia, mu)[0]
            assert found == pytest.approx(beam_frequency(mu, inertia=inertia), rel=accuracy), base
        found = frequencies(base, "base_compliance", 0.1, mu)[0]
        # A rod that turns as a whole moves its mass otherwise than a bent one.
        assert found == pytest.approx(beam_frequency(mu, compliance=0.1), rel=5 * accuracy), base


@pytest.mark.parametrize("mu", [0.05, pytest.param(0.15, marks=pytest.mark.slow), 0.35])
@pytest.mark.parametrize("inertia", [1e-3, pytest.param(5e-3, marks=pytest.mark.slow), 0.04])
def test_a_disc_that_turns_with_the_rod_rings_as_on_a_beam(mu: float, inertia: float) -> None:
    found, rigid = (frequencies("elastica", "tip_rotary_inertia", J, mu) for J in (inertia, 1e-9))
    assert found[1] == pytest.approx(beam_frequency(mu, inertia=inertia, number=1), rel=2e-3)
    assert found[2] == pytest.approx(beam_frequency(mu, inertia=inertia, number=2), rel=0.16)
    # No stiffer than the steps of the bare arm bear, however small the inertia.
    bare = get_base("elastica").highest_frequency({"mu": mu})
    assert found[-1] < (1.25 * bare) ** 2
    assert rigid[-1] < (1.25 * bare) ** 2


def test_a_disc_that_turns_with_the_rod_moves_it_like_the_twin() -> None:
    # An inertia as of twenty of the paper's discs; without the bending at its end the arm is 1.6 mm off.
    sim = Simulator("elastica", (*PLAIN, "tip_rotary_inertia"), TIME, exact_drive(MANOEUVRE, TIME[-1]), step=0.002)
    numbers = {**NUMBERS, "J": 0.02}
    tip = sim(np.array([[numbers[n]] for n in sim.names]), np.zeros(1), np.zeros(1))[:, :, 0]
    assert mean_distance(tip, truth("tip_rotary_inertia", 0.02)) < 3e-4


def test_the_hub_must_turn_the_disc_as_well() -> None:
    # A straight arm at rest, turned with 1 rad/s^2 as a rigid body.
    for base in ("constant_radius", "reduced", "elastica"):
        torques = []
        for inertia in (0.0, 0.01):
            values = {**NUMBERS, "J": inertia}
            arm = Arm(Model(base, (*PLAIN, "tip_rotary_inertia"), {"length": 1.0}), values, INERTIA)
            n = get_base(base).n_coordinates
            motor, still = (0.0, 0.0, 1.0), np.zeros(len(arm.program.states))
            if base == "elastica" and inertia:
                # The end of the rod has given way to the moment of the disc.
                drop = [float(arm.rows(0.0, motor, r * np.eye(len(still))[2 * n])[2 * n + 1]) for r in (0.0, 1e-3)]
                still[2 * n] = 1e-3 * drop[0] / (drop[0] - drop[1])
            rows = arm.rows(0.0, np.array(motor), still)
            # A coordinate that does not take part in the turn needs a force of its own: taken off by its momentum.
            program = build_program(base, arm.model.effects)
            slopes = numpy_derivative(program)(0.0, motor, still, arm.parameters)
            lever = _momentum(base, inertia)
            relative = np.array(slopes[n : 2 * n], float) - (0.0 if base == "elastica" else 1.0)
            torques.append(float(rows[len(still)]) - lever @ relative)
        assert torques[1] - torques[0] == pytest.approx(0.01, rel=1e-9), base


def _momentum(base: str, inertia: float) -> np.ndarray:
    """Angular momentum of the straight arm per rate of each coordinate, over m_eff l^2."""
    mechanics = get_base(base).mechanics(STRAIGHT)
    program = build_program(base, PLAIN)
    h, end = mechanics.channels[s.h].jacobian, mechanics.channels[s.slope_dot].jacobian
    n = len(h)
    show = numpy_derivative(replace(program, derivative=mechanics.assignments, slopes=(*h, *end)))
    rows = np.array(show(0.0, (0.0, 0.0, 0.0), np.zeros(2 * n), [NUMBERS[k] for k in program.parameters]), float)
    return rows[:n] + inertia * rows[n:]


# The words themselves.


class BearingFriction(Dissipation):
    r"""Friction of a clamped disc in the fixed frame.

    .. math:: D = \tfrac12 c_e \dot\theta(1)^2
    """

    systems = frozenset({ARM})
    cite = "planted"
    c_e = Parameter("s^-1", "friction of the end", (0.0, 1.0), HalfStudent(0.1), starts=(0.01,), latex="c_e")

    def expression(self):
        return self.c_e * s.slope_dot**2 / 2


@pytest.mark.parametrize("base", ["constant_radius", "reduced", "elastica_2"])
def test_a_law_of_the_slope_of_the_end_obeys_the_contract(base: str) -> None:
    with planted(BearingFriction()):
        for law in (Contract.test_dimensions, Contract.test_force_is_the_gradient_of_the_energy, Contract.test_energy):
            law(Contract(), "bearing_friction", base)


def test_the_quartic_energy_is_that_of_the_static_shape() -> None:
    rigid = get_base("elastica")
    mechanics = rigid.mechanics()
    kappa = {symbol: expression for symbol, expression in mechanics.assignments if symbol.name[:3] in ("kp_", "kc_")}
    for deflection in (0.1, 0.2):
        q, _ = rigid.initial_coordinates(np.array([deflection]), np.zeros(1), np.zeros(2))
        known = dict(zip(mechanics.coordinates, q[:, 0], strict=True))
        value = mechanics.channels[s.U_4].value.xreplace(kappa).xreplace(kappa).subs(known)
        # 27/20 delta^4 with a relative error of second order.
        assert float(value) / (27 / 20 * deflection**4) == pytest.approx(1.0, abs=deflection**2)


def test_compliance_is_no_candidate_where_stiffness_absorbs_it() -> None:
    assert "base_compliance" in get_base("constant_radius").provides
    assert "base_compliance" not in get_base("reduced").provides
