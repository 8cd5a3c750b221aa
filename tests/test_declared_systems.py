"""Systems in their own equations: the law, the laws of known machines, and what a rig file may not say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.systems import laws, machines
from benchmarks.systems.record import record
from discovery.declarations.formula import Quantity, read_formula
from discovery.declarations.system import Constant
from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.estimation.declared import declared_model
from discovery.estimation.equilibrium import equilibrium
from discovery.estimation.fit import fit
from discovery.estimation.natural_units import NaturalUnits
from discovery.export.symbolic import equation_text
from discovery.foundation.errors import InputError
from discovery.mechanics.systems import system_base
from discovery.posterior.likelihood import log_posterior
from discovery.recordings.dataset import load_dataset
from discovery.rigs.rig_file import read_rig
from discovery.rigs.rig_system import ready_made
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.testing.systems import SystemContract


class TestReadyMade(SystemContract):
    systems = ready_made()


def accelerations(system: str, recorded: tuple[float, float, float], state: list[float]) -> list[float]:
    base = system_base(ready_made()[system])
    program = build_program(base.name, ())
    values = {x.name: value for x, value in base.guess.items()}
    numbers = [values.get(p, 0.0) for p in program.parameters]
    slopes = numpy_derivative(program)(0.0, recorded, state, numbers)
    return [float(a) for a in slopes[len(state) // 2 :]]


def test_cart_pendulum_as_in_textbooks() -> None:
    x, phi, v, w = 0.1, 0.7, 0.3, -1.1
    m, big, length, j, g, c, d, force = 0.1, 0.5, 0.3, 0.01, 9.81, 0.5, 1e-3, 2.0
    mass = [[big + m, m * length * np.cos(phi)], [m * length * np.cos(phi), j]]
    rest = [force + m * length * np.sin(phi) * w**2 - c * v, -m * g * length * np.sin(phi) - d * w]
    assert np.allclose(accelerations("cart_pendulum", (force, 0, 0), [x, phi, v, w]), np.linalg.solve(mass, rest))


def test_pendulum_on_a_cart_feels_its_acceleration() -> None:
    phi, w, shove = 0.4, 0.2, 3.0
    m, length, j, g, d = 0.1, 0.3, 0.01, 9.81, 1e-3
    expected = (-m * length * np.cos(phi) * shove - m * g * length * np.sin(phi) - d * w) / j
    assert np.allclose(accelerations("pendulum_on_cart", (0.0, 5.0, shove), [phi, w]), [expected])


def test_motor_with_its_back_voltage() -> None:
    w, voltage = 3.0, 2.0
    assert np.allclose(
        accelerations("dc_motor", (voltage, 0, 0), [0.0, w]), [(0.05 * (voltage - 0.05 * w) - 1e-4 * w) / 1e-4]
    )


def test_of_a_rate_that_is_read_one_number_is_the_start(tmp_path: Path) -> None:
    """A motor whose speed is read starts at some speed; of the second number its readings know nothing."""
    (tmp_path / "rig.toml").write_text(machines.motor().rig, encoding="utf-8")
    record(machines.motor(), "shaft", laws.NOTHING, tmp_path / "a.csv", 1)
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"], keep_third=False)
    found = fit(declared_model(data), data)
    assert [n for n in found.summary()["parameters"] if "[" in n] == ["delta_0_init[a]"]
    assert found.told("delta_0_init[a]")["unit"] == "rad/s"
    assert np.isfinite(found.told("delta_0_init[a]")["sd"])
    assert log_posterior(found).names.count("delta_0_init[a]") == 1
    assert len(log_posterior(found).names) == len(log_posterior(found).units)


GYRO = """
name = "pendulum"

[system]
coordinates = { swing = "rad" }
kinetic = "inertia*dot(swing)^2/2"
potential = "-weight*cos(swing)"
dissipation = "loss*dot(swing)^2/2"
output = "dot(swing)"
places = { pivot = "swing" }

[system.constants]
inertia = { value = 0.02, unit = "kg m^2" }
weight = { guess = 0.25, unit = "N m" }
loss = { guess = 1e-3, unit = "N m s" }

[columns]
time = { name = "t", unit = "s" }
output = { name = "gyro", unit = "rad / s", noise = 0.01 }
"""


def test_a_pendulum_whose_rate_is_read_may_be_let_go_anywhere(tmp_path: Path) -> None:
    """What a gyro reads of a release at rest tells the angle by the slope of the rate."""
    time = np.arange(400) / 50

    def slope(_: float, state: list[float]) -> list[float]:
        return [state[1], -15.0 * np.sin(state[0]) - 0.1 * state[1]]

    rate = solve_ivp(slope, (0.0, 8.0), [1.0, 0.0], "DOP853", time, rtol=1e-9, atol=1e-10).y[1]
    read = rate + np.random.default_rng(1).normal(0.0, 0.01, time.size)
    (tmp_path / "rig.toml").write_text(GYRO, encoding="utf-8")
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, read]), "%.9g", ",", header="t,gyro", comments="")
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"], keep_third=False)
    found = fit(declared_model(data), data)
    assert found.reduced_chi2 < 1.2
    assert found.values["weight"] == pytest.approx(0.3, abs=4 * found.sd["weight"])
    # At the guess 0.25 N m / 0.02 kg m^2 = 12.5 s^-2 turn the angle into a slope.
    assert found.values["rate_0_init[a]"] == pytest.approx(-12.5, rel=0.01)
    assert found.told("rate_0_init[a]")["unit"] == "rad/s s^-1"


def test_play_asks_for_a_spring_and_cogging_for_a_rotor() -> None:
    offered = {
        name: {e for e in candidates(Model(system_base(system).name, ())) if e.startswith(("play", "cogging"))}
        for name, system in ready_made().items()
    }
    expected = {
        "cart_pendulum": set(),
        "dc_motor": {"cogging_at_shaft"},
        "furuta_pendulum": {"cogging_at_axis"},
        "pendulum_on_cart": set(),
        "quarter_car": {"play_at_suspension", "play_at_tyre_contact"},
        "two_mass_drive": {"play_at_joint", "cogging_at_motor", "cogging_at_load"},
    }
    assert {name: offered[name] for name in expected} == expected
    assert not {"play", "cogging"} & set(candidates(Model("oscillator", ("linear_stiffness",))))


def test_a_linear_spring_is_sought_where_none_is_declared() -> None:
    """Beside one that is declared it is its twin; gravity is none, and what turns freely may be tied by a cable."""
    offered = {
        name: {e for e in candidates(Model(system_base(system).name, ())) if e.startswith("linear_stiffness")}
        for name, system in ready_made().items()
    }
    assert offered["furuta_pendulum"] == {"linear_stiffness_at_axis", "linear_stiffness_at_pivot"}
    assert offered["two_mass_drive"] == {"linear_stiffness_at_motor", "linear_stiffness_at_load"}
    assert offered["quarter_car"] == set()


def test_a_linear_spring_at_a_place_pulls_back() -> None:
    base = system_base(ready_made()["dc_motor"]).name
    program = build_program(base, ("linear_stiffness_at_shaft",))
    values = {"inertia": 2e-4, "loss": 0.0, "torque_constant": 0.0, "resistance": 1.0, "alpha_shaft": 3e-3}
    state = [0.5, 0.0]
    slopes = numpy_derivative(program)(0.0, (0.0, 0.0, 0.0), state, [values[p] for p in program.parameters])
    assert slopes[1] == pytest.approx(-3e-3 * 0.5 / 2e-4)


def test_a_drive_is_doubted_where_the_input_is_a_force() -> None:
    """What moves as recorded passes no amplifier, and neither does what is not driven at all."""
    of_drives = {"input_dead_zone", "input_saturation"}
    systems = ("cart_pendulum", "dc_motor", "furuta_pendulum", "pendulum_on_cart", "quarter_car", "two_mass_drive")
    models = {name: Model(system_base(ready_made()[name]).name, ()) for name in systems}
    models["pushed"] = Model("oscillator", ("linear_stiffness",))
    models["left alone"] = Model("oscillator", ("linear_stiffness",), {"g": 0.0})
    models |= {base: Model(base, ()) for base in ("base_excited", "servo", "inverse_dynamics", "falling_body")}
    offered = {name for name, model in models.items() if of_drives <= set(candidates(model))}
    assert offered == {"cart_pendulum", "dc_motor", "furuta_pendulum", "two_mass_drive", "pushed"}
    assert not [name for name in models.keys() - offered if of_drives & set(candidates(models[name]))]


def test_a_gain_is_what_the_input_does_nothing_without() -> None:
    """A motor divides by its resistance, and a force acts by itself; a motion is no input that a gain passes on."""
    found = {name: system_base(system).gains() for name, system in ready_made().items()}
    assert found.pop("dc_motor") == {"torque_constant"}
    levels = {"most": Constant("N", 1.0, None, True), "half": Constant("N", 1.0, None, True)}
    cart = ready_made()["cart_pendulum"]
    pushed = replace(cart, constants={**cart.constants, **levels}, forces={"position": "most*force/(force + half)"})
    assert system_base(pushed).gains() == {"most"}
    assert set(map(frozenset, found.values())) == {frozenset()}


def test_a_drive_passes_what_lies_between_its_dead_zone_and_its_limit() -> None:
    program = build_program("oscillator", ("input_dead_zone", "input_saturation"))
    slopes = numpy_derivative(program)
    values = {"g": 2.0, "w_u": 0.5, "s_u": 1 / 3.0}

    def pushed(force: float) -> float:
        return float(slopes(0.0, (force, 0.0, 0.0), [0.0, 0.0], [values[p] for p in program.parameters])[1]) / 2.0

    assert [pushed(u) for u in (-9.0, -2.0, -0.4, 0.0, 0.5, 1.5, 3.5, 9.0)] == pytest.approx(
        [-3.0, -1.5, 0.0, 0.0, 0.0, 1.0, 3.0, 3.0]
    )


def test_forces_at_a_place_are_told_in_newtons() -> None:
    """At an angle as torques; a drag, which has no time in its unit, in kilograms."""
    for system, place, units in (
        ("quarter_car", "suspension", {"beta": "N m^-3", "f_c": "N", "c_2": "kg m^-1"}),
        ("two_mass_drive", "joint", {"beta": "N m", "f_c": "N m"}),
    ):
        effects = tuple(f"{e}_at_{place}" for e in ("cubic_stiffness", "coulomb_friction", "quadratic_drag"))
        parameters = Model(system_base(ready_made()[system]).name, effects).parameters
        assert {n: parameters[f"{n}_{place}"].value_unit for n in units} == units


def test_buoyancy_is_asked_of_what_falls() -> None:
    asked = {b for b in ("oscillator", "falling_body", "servo") if "buoyancy" in candidates(Model(b, ()))}
    assert asked == {"falling_body"}
    program = build_program("falling_body", ("buoyancy",))
    values = {"g_0": 9.8, "b_g": 2.0}
    slopes = numpy_derivative(program)(0.0, (0.0, 0.0, 0.0), [1.0, 0.0], [values[p] for p in program.parameters])
    assert float(slopes[1]) == pytest.approx(-7.8)


def test_a_joint_with_play_is_as_declared_beyond_it() -> None:
    """In the gap nothing acts; beyond it spring and damper do, from where the parts touch."""
    base = system_base(ready_made()["two_mass_drive"])
    program = build_program(base.name, ("play_at_joint",))
    values = {x.name: value for x, value in base.guess.items()} | {"w_b_joint": 0.1}
    slopes, numbers = numpy_derivative(program), [values.get(p, 0.0) for p in program.parameters]

    def torque(twist: float, rate: float) -> float:
        moved = slopes(0.0, (0.0, 0.0, 0.0), [twist, 0.0, rate, 0.0], numbers)
        return float(-1e-3 * moved[2])

    assert torque(0.05, 2.0) == pytest.approx(0.0, abs=1e-5)
    assert torque(0.3, 2.0) == pytest.approx(1.0 * (0.3 - 0.1) + 1e-3 * 2.0, rel=1e-3)
    assert torque(-0.3, 0.0) == pytest.approx(-0.2, rel=1e-6)


@pytest.mark.parametrize("system", list(ready_made()))
def test_a_prediction_begins_at_rest(system: str) -> None:
    model = Model(system_base(ready_made()[system]).name, ())
    assert equilibrium(model, {}, NaturalUnits(time=1.0, coordinate=1.0, length=1.0), [0.0]) == 0.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("__import__('os').system('true')", "may not stand in a formula"),
        ("x.__class__", "may not stand in a formula"),
        ("(lambda: 1)()", "may not stand in a formula"),
        ("[1, 2]", "may not stand in a formula"),
        ("'text'", "may not stand in a formula"),
        ("True", "may not stand in a formula"),
        ("1j", "may not stand in a formula"),
        ("x if x else 1", "may not stand in a formula"),
        ("open(x)", "is no function of a formula"),
        ("eval(x)", "is no function of a formula"),
        ("sin(x, x)", "takes 1 argument"),
        ("sin(x)", "takes a number without a unit"),
        ("x^x", "must be a number"),
        ("9^9^9", "must be a number"),
        ("9.0^8^8", "must be a number"),
        ("exp(exp(exp(9)))", "cannot be computed"),
        ("1e999", "too large"),
        ("x/0", "divides by zero"),
        ("x + k", "cannot be added"),
        ("xx", "Did you mean 'x'"),
        ("dot(x)", "may not stand here"),
        ("dot(2*x)", "takes the name"),
        ("x +", "is no formula"),
        ("(" * 500 + "x" + ")" * 500, ""),
        ("x" * 3000, "too long"),
    ],
)
def test_refused(text: str, says: str) -> None:
    import sympy as sp

    names = {"x": Quantity((sp.Symbol("x"),), "m"), "k": Quantity((sp.Symbol("k"),), "N / m")}
    if not says:
        with pytest.raises(InputError):
            read_formula(text, names, "kg")
        return
    with pytest.raises(InputError, match=says):
        read_formula(text, names)


RIG = """
name = "drive"

[system]
coordinates = { phi = "rad" }
input = { torque = "N m" }
kinetic = "inertia*dot(phi)^2/2"
dissipation = "loss*dot(phi)^2/2"
forces = { phi = "torque" }
output = "dot(phi)"
places = { shaft = "phi" }

[system.constants]
inertia = { guess = 2.0, unit = "g m^2" }
loss = { value = 1e-3, sd = 1e-4, unit = "N m s" }

[columns]
time = { name = "t" }
input = { name = "u", unit = "mN m" }
output = { name = "y", unit = "deg/s", noise = 0.1 }
"""


def rig_with(tmp_path: Path, old: str, new: str) -> Path:
    assert old in RIG
    path = tmp_path / "rig.toml"
    path.write_text(RIG.replace(old, new, 1))
    return path


def test_a_rig_file_declares_a_system(tmp_path: Path) -> None:
    rig = read_rig(rig_with(tmp_path, "drive", "drive"))
    assert rig.kind == "system"
    assert rig.system is not None
    assert rig.system.constants["inertia"].value == pytest.approx(2e-3)
    assert rig.system.constants["inertia"].free
    assert rig.system.constants["loss"].sd == 1e-4


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"inertia*dot(phi)^2/2"', '"inertia*dot(psi)^2/2"', r"line 7, key 'kinetic': 'psi' is not declared"),
        ('"inertia*dot(phi)^2/2"', '"inertia*phi^2/2"', r"line 7, key 'kinetic': .* should be in J"),
        ('"loss*dot(phi)^2/2"', '"loss*phi^2/2"', r"line 8, key 'dissipation': .* should be in W"),
        ('"inertia*dot(phi)^2/2"', "\"__import__('os')\"", r"line 7, key 'kinetic': '__import__' is no function"),
        ('{ phi = "torque" }', '{ psi = "torque" }', r"line 9, key 'forces': there is no coordinate 'psi'"),
        ('{ phi = "torque" }', '{ phi = "loss" }', r"line 9, key 'forces.phi': .* should be in J"),
        ("loss = {", "m = {", r"key 'constants.m': the name 'm' is that of something else in a model\. Write a longer"),
        (
            "loss = {",
            'length = { value = 1.0, unit = "m" }\ng = { value = 9.8, unit = "m s^-2" }\nloss = {',
            r"key 'constants.length': .* in a model, and so is 'g'\. .*'own_length'\. docs/YOUR_SYSTEM\.md lists",
        ),
        ("loss = {", "drive_loss = {", r"key 'constants.drive_loss': the name 'drive_loss' is that"),
        ("loss = {", "lambda = {", r"key 'constants.lambda': 'lambda' cannot be a name"),
        ('sd = 1e-4, unit = "N m s"', 'sd = 1e-4, unit = "lightspeed"', r"key 'constants.loss'"),
        ("value = 1e-3, sd", "value = 1e-3, guess = 1.0, sd", "either a value"),
        ('places = { shaft = "phi" }', "", "lacks the key 'places'"),
        ('output = "dot(phi)"', 'output = "phi"', r"key 'output': it is in 1, and its column in 'deg/s'"),
        ('input = { torque = "N m" }', 'input = { torque = "N" }', r"key 'forces.phi'"),
        ('[system]\n', '[system]\nlike = "dc_moter"\n', "Did you mean 'dc_motor'"),
        ('name = "drive"', 'name = "drive"\nkind = "drive"', "belong together"),
        ("[columns]", '[model]\neffects = ["coulomb_friction"]\n[columns]', "Write coulomb_friction_at_shaft"),
        ("[columns]", '[model]\neffects = ["coulomb_friction_at_hub"]\n[columns]', "Its places are shaft"),
        ("[columns]", '[model]\neffects = ["radius_law"]\n[columns]', "radius_law"),
    ],
)  # fmt: skip
def test_refused_with_line_and_remedy(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_rig(rig_with(tmp_path, old, new))


def test_its_equations_in_text_are_its_own() -> None:
    """Not those of a rod: energies and forces in the names of the declaration, and what effects add."""
    base = system_base(ready_made()["dc_motor"]).name
    text = equation_text(Model(base, ("coulomb_friction_at_shaft", "input_lag", "sensor_delay")))
    assert any(line.startswith("Kinetic energy: T = ") for line in text)
    assert "memory: u_l' = (u - u_l)/tau_u" in text
    assert any(line.endswith("t_read = t - tau") for line in text)
    assert not any("theta(s, t)" in line or "r_0" in line for line in text)
