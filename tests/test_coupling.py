from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from discovery_datasets.arm import PAPER_RIG
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.twin import simulate as simulate_twin
from scipy.integrate import simpson
from test_mechanics import exact_drive, mechanics_program

from benchmarks.paper.theory.arm_motion import fitted_coupling, integrate, move_arm
from benchmarks.paper.theory.coupling import Arm, effective_inertia
from benchmarks.paper.theory.drivetrain.driven_arm import drive_arm
from benchmarks.paper.theory.drivetrain.motor import ASSUMED_MOTOR, PositionController
from benchmarks.paper.theory.elastica.force_map import load_at_tip
from discovery.declarations import symbols as s
from discovery.declarations.effect import Dissipation, Kinetic, Load, Memory, Potential
from discovery.declarations.registry import get_effect
from discovery.equations.contributions import strands
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.export import FittedModel, from_json, to_json
from discovery.foundation.errors import InputError, SimulationFailure
from discovery.mechanics import base_names, get_base
from discovery.mechanics.base import SHORTENING_RADIUS
from discovery.mechanics.reduced import rod_coupling, rod_inertia
from discovery.mechanics.rod_shapes import polynomials, quadrature, reduced_shapes
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording, read_recording
from discovery.rigs.kinds import PAPER_MODEL
from discovery.rigs.rig import Quantity, Rig
from discovery.rigs.rig_file import read_rig
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator
from discovery.testing.states import every_effect

INERTIA = PAPER_RIG.effective_mass * PAPER_RIG.length**2
ALPHA = 3 * PAPER_RIG.flexural_rigidity / (PAPER_RIG.effective_mass * PAPER_RIG.length**3)
MU = PAPER_RIG.beam_mass / PAPER_RIG.tip_mass
PLAIN = ("viscous_damping", "linear_stiffness")
#: Largest error of the torque against the twin, over its largest value.
TWIN_ERROR = {"elastica_4": 0.01, "elastica": 0.01, "elastica_2": 0.08, "elastica_1": 0.1, "reduced": 0.1}


def arm_on(base: str, effects: tuple[str, ...] = PLAIN, inertia: float = INERTIA, **values: float) -> Arm:
    numbers = {"xi": 0.0, "alpha": ALPHA, "mu": MU, "tau_r": 0.0, "length": 1.0, **values}
    return Arm(Model(base, effects), numbers, inertia)


@pytest.mark.parametrize(
    "base", [pytest.param(b, marks=pytest.mark.slow) if b in ("elastica", "elastica_4") else b for b in TWIN_ERROR]
)
def test_the_torque_is_that_of_a_converged_beam(base: str) -> None:
    rig, manoeuvre, time = PAPER_RIG, trapezoid(1.0, 1.4, start=0.2), np.linspace(0.0, 2.0, 101)
    twin = simulate_twin(rig, manoeuvre, time)
    motion = move_arm(arm_on(base, xi=rig.disc_friction / rig.effective_mass), exact_drive(manoeuvre, 2.0), time)
    scale = np.abs(twin.base_torque).max()
    # At a kink of the acceleration the torque has two values.
    away = np.abs(time[:, None] - np.array(manoeuvre.kinks)).min(axis=1) > 1e-6
    error = np.abs(motion.coupling_torque - twin.base_torque)[away] / scale
    assert error.max() < TWIN_ERROR[base]
    np.testing.assert_allclose(motion.theta_t, twin.tip_angle, atol=0.03)


def test_the_cubic_model_pulls_with_its_spring() -> None:
    rng = np.random.default_rng(0)
    theta, omega, *motor = rng.uniform(-1, 1, (5, 20))
    model = Model("constant_radius", PAPER_MODEL, {"length": 1.0})
    values = {"xi": 0.3, "alpha": 8.79, "beta": 0.51, "gamma": 0.45}
    arm = Arm(model, values, 0.05)
    torque = 0.05 * np.asarray(arm.rows(0.0, motor, np.array([theta, omega]))[len(arm.program.states)])
    delta = theta - motor[0]
    np.testing.assert_allclose(torque, -0.05 * (8.79 * delta + 0.51 * delta**3), rtol=1e-12)


@pytest.mark.parametrize("mu", [0.04, pytest.param(0.005, marks=pytest.mark.slow)])
def test_without_a_rod_it_is_the_papers_force_on_its_lever(mu: float) -> None:
    # A swing from 0.7 to 0.45 rad against eq. (11), with the force of the static elastica at the tip.
    time = np.linspace(0.0, 0.3, 31)
    still = Drive(np.array([0.0, 1.0]), np.zeros((1, 1)), np.empty(0))
    motion = move_arm(arm_on("elastica", mu=mu), still, time, deflection=0.7)
    rho = np.hypot(motion.x, motion.y)
    force, direction = load_at_tip(rho, motion.theta_t)
    rigidity = ALPHA * INERTIA / 3
    paper = -force * rigidity * rho * np.sin(direction - motion.theta_t)
    assert np.abs(motion.coupling_torque - paper).max() / np.abs(paper).max() < 0.05 * mu


def lagrange_torque(base: str, effects: tuple[str, ...]) -> tuple[sp.Expr, list[sp.Symbol]]:
    """Gamma_c as the generalised force on theta_m, by Euler and Lagrange, with theta_t'' as a symbol."""
    mechanics = get_base(base).mechanics()
    (q,), (qd,), qdd = mechanics.coordinates, mechanics.rates, sp.Symbol("qdd")
    place = {c: channel.value for c, channel in mechanics.channels.items()}
    mu = sp.Symbol("mu", real=True)
    kinetic = place[s.v2] / 2
    if base == "reduced":
        kinetic += rod_coupling(mu) * qd * s.omega_m + rod_inertia(mu) * s.omega_m**2 / 2
    push = sp.Integer(0)
    for effect in map(get_effect, effects):
        if isinstance(effect, Kinetic):
            kinetic += effect.expression().xreplace(place)
        elif isinstance(effect, Potential):
            push -= sp.diff(effect.expression().xreplace(place), s.theta_m)
        elif isinstance(effect, Dissipation):
            push -= sp.diff(effect.expression().xreplace(place), s.omega_m)
        elif isinstance(effect, Load):
            push += sp.diff(effect.expression().xreplace(place), s.omega_m)
        elif isinstance(effect, Memory):
            for k, (weight, (bend, rate, _)) in enumerate(strands(effect, mechanics)):
                own = {z: sp.Symbol(f"{z.name}_{k}", real=True) for z in effect.states()}
                power = effect.expression().xreplace({s.bend: bend, s.bend_dot: rate, **own})
                push += weight * sp.diff(power, s.omega_m)
    momentum = sp.diff(kinetic, s.omega_m)
    pairs = ((q, qd), (qd, qdd), (s.theta_m, s.omega_m), (s.omega_m, s.alpha_m))
    change = sp.Add(*[sp.diff(momentum, a) * b for a, b in pairs])
    return change - sp.diff(kinetic, s.theta_m) - push, [q, qd, qdd, s.theta_m, s.omega_m, s.alpha_m]


@pytest.mark.parametrize("base", ["constant_radius", pytest.param("reduced", marks=pytest.mark.slow)])
def test_every_effect_reacts_on_the_motor_as_lagrange_says(base: str) -> None:
    rng = np.random.default_rng(1)
    kinds = Potential | Dissipation | Load | Memory | Kinetic
    ids = [e for e in every_effect(base) if isinstance(get_effect(e), kinds) and e not in SHORTENING_RADIUS]
    assert len(ids) > 8
    if base == "reduced":
        # One of each kind: the derivation there takes long.
        ids = list({get_effect(e).kind: e for e in ids}.values())
    for effect in ids:
        effects = tuple(dict.fromkeys(("linear_stiffness", effect)))
        model = Model(base, effects)
        values = {n: float(rng.uniform(0.1, 0.9)) for n in model.parameters}
        arm = Arm(model, values, 1.0)
        n_states = len(arm.program.states)
        state, motor, time = rng.uniform(0.1, 0.9, n_states), rng.uniform(-0.8, 0.8, 3), 0.7
        rows = arm.rows(time, motor, state)
        expression, names = lagrange_torque(base, effects)
        memory = dict(zip(arm.program.states[2:], state[2:], strict=True))
        numbers = dict(zip(names, [state[0], state[1], rows[1], *motor], strict=True))
        numbers |= memory
        numbers |= {sp.Symbol(n, real=True): v for n, v in values.items()} | {s.t: time}
        expected = float(expression.subs(numbers).doit())
        assert rows[n_states] == pytest.approx(expected, rel=1e-10, abs=1e-12), effect


def elastica_kinetic_energy(arm: Arm, state: np.ndarray, omega_m: np.ndarray) -> np.ndarray:
    """Kinetic energy [J] of the rod and the tip in a few curvature modes, by quadrature of the velocity."""
    n = arm.program.n_coordinates
    nodes, weights, cumulative = quadrature(6)
    phi = reduced_shapes(n) @ polynomials(nodes)
    bend, rate = phi.T @ state[:n], omega_m + phi.T @ state[n : 2 * n]
    speed = np.hypot(cumulative @ (-rate * np.sin(bend)), cumulative @ (rate * np.cos(bend)))
    mu = arm.values["mu"]
    share = np.append(mu * weights, 1.0) / (1 + 33 / 140 * mu)
    return arm.inertia * (share @ speed**2) / 2


def test_the_motors_work_is_stored_or_lost() -> None:
    effects = (*PLAIN, "table_tilt", "quadratic_drag", "structural_damping")
    values = {"xi": 0.2, "c_2": 0.4, "c_s": 0.01, "phi_x": 0.02, "phi_y": -0.03, "tau_r": 0.001}
    arm = arm_on("elastica_2", effects, **values)
    time = np.linspace(0.0, 1.6, 1601)
    # Five derivatives vanish at both ends: a smooth integrand.
    shape = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])(np.polynomial.Polynomial([0, 1 / 1.6]))
    drive = Drive(np.array([0.0, 1.6]), shape.coef[::-1, None], np.empty(0))
    motion = move_arm(arm, drive, time)
    motor = drive.evaluate(time)
    program = mechanics_program("elastica_2", s.U, s.x_g, s.y_g, s.v2, s.w2)
    parameters = [arm.values[n] for n in program.parameters]
    U, x_g, y_g, v2, w2 = numpy_derivative(program)(time, motor, motion.states, parameters)
    stored = elastica_kinetic_energy(arm, motion.states, motor[1])
    stored += INERTIA * (ALPHA * U - 9.80665 * (values["phi_x"] * x_g + values["phi_y"] * y_g))
    lost = values["xi"] * v2 + values["c_2"] * v2**1.5 + (values["c_s"] + ALPHA * values["tau_r"]) * w2
    work = simpson(motion.coupling_torque * motor[1], x=time)
    assert work == pytest.approx(stored[-1] - stored[0] + INERTIA * simpson(lost, x=time), rel=1e-6)
    assert INERTIA * simpson(lost, x=time) > 0.1 * work


def test_a_stiff_turn_needs_the_whole_inertia() -> None:
    # A straight arm, turned with 1 rad/s^2 from rest: the rod and the tip as a rigid body.
    whole = PAPER_RIG.tip_mass + PAPER_RIG.beam_mass / 3
    for base in ("reduced", "elastica"):
        n = get_base(base).n_coordinates
        arm = arm_on(base)
        bent = arm.rows(0.0, np.array([0.0, 0.0, 1.0]), np.zeros(2 * n))
        # What the bending takes off: the tip's own acceleration belongs to the deflection.
        mechanics = get_base(base).mechanics()
        lever = numpy_derivative(mechanics_program(base, *mechanics.channels[s.h].jacobian))
        parameters = [arm.values[k] for k in build_program(base, PLAIN).parameters]
        rows = lever(0.0, (0.0, 0.0, 1.0), np.zeros(2 * n), parameters)
        relative = np.array(bent[n : 2 * n], float) - (1.0 if base == "reduced" else 0.0)
        rigid = bent[2 * n] - np.array(rows, float) @ relative
        assert rigid * INERTIA == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("base", base_names())
def test_a_model_that_nobody_asks_for_its_torque_does_not_compute_it(base: str) -> None:
    assigned = {symbol for symbol, _ in build_program(base, every_effect(base)).derivative}
    assert s.h not in assigned


@pytest.mark.parametrize("base", ["constant_radius", "elastica_1", "elastica_2"])
def test_the_motion_is_the_kernels(base: str) -> None:
    manoeuvre, time = trapezoid(0.8, 1.2, start=0.2), np.linspace(0.0, 2.0, 51)
    drive = exact_drive(manoeuvre, 2.0)
    motion = move_arm(arm_on(base, xi=0.05), drive, time, deflection=0.1, rate=-0.2)
    simulator = Simulator(base, PLAIN, time, drive, step=0.001)
    numbers = {"xi": 0.05, "alpha": ALPHA, "mu": MU, "tau_r": 0.0, "length": 1.0}
    parameters = np.array([[numbers[n]] for n in simulator.names])
    tip = simulator(parameters, np.array([0.1]), np.array([-0.2]))[:, :, 0]
    np.testing.assert_allclose(np.column_stack([motion.x, motion.y]), tip, atol=2e-7)


def test_a_fit_shows_its_torque() -> None:
    manoeuvre, time = trapezoid(0.8, 1.2, start=0.2), np.linspace(0.0, 4.0, 201)
    drive = exact_drive(manoeuvre, 4.0)
    arm = arm_on("constant_radius", xi=0.05)
    true = move_arm(arm, drive, time)
    tip = np.column_stack([true.x, true.y])
    recording = Recording("one", time, true.theta_m, tip, ("tip_x", "tip_y"), ("m", "m"), np.full(2, 1e-4), "", "")
    rig = Rig("made", length=Quantity(1.0, 1e-3), tip_mass=Quantity(0.04, 0.0), beam_mass=Quantity(0.014, 0.0))
    fitted = fit(Model("constant_radius", PLAIN, {"length": 1.0}), [Experiment(recording, drive, rig)])
    (motion,) = fitted_coupling(fitted)
    assert effective_inertia(rig) == pytest.approx(0.0433)
    np.testing.assert_allclose(motion.coupling_torque, true.coupling_torque * 0.0433 / INERTIA, atol=1e-6)
    (other,) = fitted_coupling(fitted, inertia=2 * 0.0433)
    np.testing.assert_allclose(other.coupling_torque, 2 * motion.coupling_torque)


def test_an_exported_model_shows_the_torque_of_its_fit() -> None:
    # The creep speed of dry friction is held, and its default is in natural units: both must use the fit's number.
    folder = Path(__file__).parents[1] / "datasets" / "arm_coulomb"
    rig = read_rig(folder / "rig.toml")
    recording = read_recording(folder / "train_large.csv", rig, (0, 500))
    experiment = make_experiment(recording, rig)
    fitted = fit(declared_model(experiment).with_effect("coulomb_friction"), [experiment])
    (motion,) = fitted_coupling(fitted)
    np.testing.assert_allclose(np.column_stack([motion.x, motion.y]), fitted.predict()[0], atol=1e-5)
    taken = from_json(to_json(fitted))
    (again,) = fitted_coupling(taken, [experiment])
    np.testing.assert_allclose(again.coupling_torque, motion.coupling_torque, rtol=1e-12)
    with pytest.raises(InputError, match="pass experiments"):
        fitted_coupling(taken)
    # A recording that was not fitted starts with what its own first samples show.
    unknown = replace(experiment, recording=replace(recording, name="another"))
    for source in (fitted, taken):
        (near,) = fitted_coupling(source, [unknown])
        assert (near.theta_t - near.theta_m)[0] == pytest.approx(unknown.initial_guess[0])
        assert 1e-8 < np.abs(near.coupling_torque - motion.coupling_torque).max() < 0.02


def test_what_is_no_fitted_model_or_drive_is_named_with_the_remedy() -> None:
    with pytest.raises(InputError, match=r"not of a \w*Path.*read_fitted"):
        fitted_coupling(Path("reports"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"not of a str; `read_rig\(path\)`"):
        effective_inertia("rig.toml")  # type: ignore[arg-type]
    model, numbers = Model("constant_radius", PLAIN), {"xi": 0.1, "alpha": 8.8, "length": 1.0}
    with pytest.raises(InputError, match=r"`\.model` and `\.values`\. Got a Model and a FittedModel"):
        Arm(model, FittedModel(model, numbers), 1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"Got a FittedModel and a dict"):
        Arm(FittedModel(model, numbers), numbers, 1.0)  # type: ignore[arg-type]
    time = np.linspace(0.0, 1.0, 11)
    for refused in (move_arm, lambda *a: drive_arm(a[0], ASSUMED_MOTOR, PositionController(60.0), *a[1:])):
        with pytest.raises(InputError, match=r"got ndarray.*smooth_motion.*spline_drive"):
            refused(arm_on("constant_radius"), 0.1 * time, time)  # type: ignore[arg-type]


def test_what_has_no_torque_is_refused() -> None:
    with pytest.raises(InputError, match="no hub"):
        _ = Arm(Model("oscillator", PLAIN[:1]), {"xi": 0.1, "g": 1.0}, 1.0).program
    with pytest.raises(InputError, match="radial_inertia imitates"):
        _ = arm_on("constant_radius", (*PLAIN, "radial_inertia"), c_rad=0.04).program
    with pytest.raises(InputError, match="needs values of alpha"):
        Arm(Model("constant_radius", PLAIN), {"xi": 0.1}, 1.0)
    with pytest.raises(InputError, match="must be positive"):
        arm_on("reduced", inertia=0.0)
    with pytest.raises(InputError, match="tip mass"):
        effective_inertia(Rig("bare", length=Quantity(1.0, 0.0)))


def test_the_instrument_does_not_change_the_torque() -> None:
    motor, state = np.array([0.1, 0.2, 0.3])[:, None], np.array([0.4, -0.2])[:, None]
    plain, seen = arm_on("reduced"), arm_on("reduced", (*PLAIN, "angle_offset", "sensor_delay"), theta_0=0.1, tau=0.2)
    assert plain.rows(0.0, motor, state) == seen.rows(0.0, motor, state)


def test_a_motion_that_blows_up_says_when() -> None:
    with pytest.raises(SimulationFailure), np.errstate(all="ignore"):
        integrate(lambda t, y, left: y**2, np.array([1.0]), np.array([0.0, 2.0]), np.empty(0))


def test_one_time_at_a_kink_has_the_state_of_both_sides() -> None:
    path = integrate(
        lambda t, y, left: np.array([1.0 if t < 1 or left else -1.0]), np.zeros(1), np.linspace(0, 2, 5), np.ones(1)
    )
    np.testing.assert_allclose(path[0], [0.0, 0.5, 1.0, 0.5, 0.0], atol=1e-9)


def test_the_papers_rig_is_the_twins() -> None:
    rig = Rig(
        "paper",
        length=Quantity(PAPER_RIG.length, 0.0),
        tip_mass=Quantity(PAPER_RIG.tip_mass, 0.0),
        beam_mass=Quantity(PAPER_RIG.beam_mass, 0.0),
    )
    assert effective_inertia(rig) == pytest.approx(INERTIA)
    assert effective_inertia(replace(rig, beam_mass=None)) == pytest.approx(PAPER_RIG.tip_mass)
