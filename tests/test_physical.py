"""Parameters in kilograms and newtons."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from test_export import with_stiffness

from discovery.declarations.effect import Load, Memory
from discovery.declarations.parameters import Parameter
from discovery.declarations.place import amplitudes
from discovery.declarations.priors import HalfStudent
from discovery.declarations.symbols import bend_dot, delta, delta_dot, t
from discovery.estimation.physical import physical_parameters
from discovery.export import FittedModel, from_json, to_c, to_json, to_latex, to_numpy, to_sympy_file
from discovery.rigs.rig import Quantity, Rig

_SLIP = sp.Symbol("z_slip", real=True)


def stand_in(rig: Any, coordinate: str, output: str = "m") -> Any:
    """Return what is asked of an experiment."""
    return SimpleNamespace(rig=rig, coordinate_unit=coordinate, recording=SimpleNamespace(units=(output,)))


def pushed(unit: str) -> Any:
    return SimpleNamespace(columns=SimpleNamespace(input=SimpleNamespace(unit=unit)), mass=None, inertia=None)


def test_an_arm_weighs_what_its_rig_says() -> None:
    """The dry friction that the twin of `arm_coulomb` hides is 0.6 mN at the tip, at a metre: 0.6 mN m."""
    model = with_stiffness("constant_radius", "viscous_damping", "coulomb_friction", "radius_law")
    values = {"length": 1.0, "alpha": 8.1, "xi": 0.0458, "f_c": 0.01285, "v_c": 1e-3, "gamma": 0.44}
    rig = Rig("arm", length=Quantity(1.0, 1e-3), tip_mass=Quantity(0.04376, 2e-4), beam_mass=Quantity(0.01245, 1e-4))
    found = physical_parameters(model, values, ("alpha",), np.array([[0.1**2]]), stand_in(rig, "rad"))
    inertia = 0.04376 + 33 / 140 * 0.01245
    assert found.keys() == {"inertia", "alpha", "xi", "f_c"}
    relative = np.sqrt((2e-4**2 + (33 / 140 * 1e-4) ** 2) / inertia**2 + 4e-6)
    np.testing.assert_allclose(found["inertia"][:2], [inertia, inertia * relative])
    np.testing.assert_allclose(found["alpha"][:2], inertia * 8.1 * np.array([1.0, np.hypot(0.1 / 8.1, relative)]))
    assert found["f_c"][0] == pytest.approx(0.6e-3, rel=1e-2)
    assert [found[n][2] for n in ("inertia", "alpha", "xi", "f_c")] == ["kg m^2", "N m", "N m s", "N m"]
    nothing = Rig("arm", length=Quantity(1.0, 1e-3))
    assert physical_parameters(model, values, (), np.empty((0, 0)), stand_in(nothing, "rad")) == {}


def test_a_force_tells_the_mass_of_an_oscillator() -> None:
    """Newtons in, metres out: m = 1/g, k = alpha/g, c = xi/g, k_3 = beta/g; correlated errors are followed."""
    model = with_stiffness("oscillator", "viscous_damping", "cubic_stiffness")
    values = {"g": 0.5, "alpha": 100.0, "xi": 0.2, "beta": 300.0}
    # The stiffness is known better than either of its parts.
    covariance = np.array([[0.01**2, 1.99 * 0.01], [1.99 * 0.01, 2.0**2]])
    found = physical_parameters(model, values, ("g", "alpha"), covariance, stand_in(pushed("N"), "m"))
    assert {n: (v, u) for n, (v, _, u) in found.items()} == {
        "inertia": (2.0, "kg"), "alpha": (200.0, "N m^-1"), "xi": (0.4, "N s m^-1"), "beta": (600.0, "N m^-3"),
    }  # fmt: skip
    assert found["inertia"][1] == pytest.approx(2.0 * 0.02)
    assert found["alpha"][1] == pytest.approx(200 * np.sqrt(0.02**2 + 0.02**2 - 2 * 1.99 * 0.01 / 50))
    assert physical_parameters(model, values, (), np.empty((0, 0)), stand_in(pushed("V"), "m")) == {}
    turning = physical_parameters(model, values, (), np.empty((0, 0)), stand_in(pushed("N m"), "rad"))
    assert turning["inertia"] == (2.0, 0.0, "kg m^2")
    assert turning["alpha"][2] == "N m"


def test_a_stated_mass_tells_forces_where_no_input_does() -> None:
    model = with_stiffness("base_excited", "coulomb_friction")
    values = {"alpha": 100.0, "f_c": 0.2, "v_c": 1e-3}
    rig = Rig("table", mass=Quantity(0.5, 0.005))
    found = physical_parameters(model, values, ("alpha",), np.array([[1.0]]), stand_in(rig, "m"))
    assert {n: (v, u) for n, (v, _, u) in found.items()} == {
        "inertia": (0.5, "kg"), "alpha": (50.0, "N m^-1"), "f_c": (0.1, "N"),
    }  # fmt: skip
    assert found["alpha"][1] == pytest.approx(50 * np.hypot(0.01, 0.01))


def test_what_is_read_in_a_unit_of_its_own_has_nothing_in_newtons() -> None:
    """Pixels of a camera are no length: neither a force in newtons nor a mass in kilograms scales them."""
    model = with_stiffness("oscillator")
    values = {"g": 0.5, "alpha": 100.0}
    weighed = Rig("glider", mass=Quantity(0.2, 1e-3))
    for rig in (pushed("N"), weighed):
        assert physical_parameters(model, values, (), np.empty((0, 0)), stand_in(rig, "pixel", "pixel")) == {}
    # A mass is known in kilograms whatever unit the input has.
    counted = SimpleNamespace(columns=pushed("count").columns, mass=Quantity(0.2, 1e-3), inertia=None)
    found = physical_parameters(model, values, (), np.empty((0, 0)), stand_in(counted, "m"))
    assert found["alpha"] == (pytest.approx(20.0), pytest.approx(0.1), "N m^-1")


def test_an_inverse_rig_reads_the_force() -> None:
    model = with_stiffness("inverse_dynamics", "coulomb_friction").without(["linear_stiffness"])
    values = {"m": 95.0, "m_0": 100.0, "f_c": 0.2, "v_c": 1e-3}
    found = physical_parameters(model, values, (), np.empty((0, 0)), stand_in(pushed("m"), "m", "N"))
    assert found == {"inertia": (95.0, 0.0, "kg"), "f_c": (pytest.approx(20.0), 0.0, "N")}


def test_a_view_tells_every_amplitude_of_a_law_as_a_force() -> None:
    """Sliding friction and its bump are forces, the Stribeck speed is none: 15 N, 10 N with m_0 = 100 kg."""
    model = with_stiffness("inverse_dynamics", "stribeck_friction").without(["linear_stiffness"])
    values = {"m": 20.0, "m_0": 100.0, "f_k": 0.15, "f_b": 0.1, "v_s": 0.02, "v_e": 7e-4}
    covariance = np.diag([0.5, 1e-3, 2e-3, 1e-3]) ** 2
    names = ("m", "f_k", "f_b", "v_s")
    found = physical_parameters(model, values, names, covariance, stand_in(pushed("m"), "m", "N"))
    assert found == {
        "inertia": (20.0, pytest.approx(0.5), "kg"),
        "f_k": (pytest.approx(15.0), pytest.approx(0.1), "N"),
        "f_b": (pytest.approx(10.0), pytest.approx(0.2), "N"),
    }


def test_a_torque_tells_gravity_also_where_a_part_of_it_is_zero() -> None:
    """A link of J = 1/g = 0.05 kg m^2 with g_c = 30 s^-2 hangs with m g_0 r = 1.5 N m; a zero is uncertain, too."""
    model = with_stiffness("oscillator", "gravity_torque").without(["linear_stiffness"])
    values = {"g": 20.0, "g_c": 30.0, "g_s": 0.0}
    covariance = np.diag([0.2, 0.3, 0.4]) ** 2
    rig = stand_in(pushed("mN m"), "rad", "rad")
    found = physical_parameters(model, values, ("g", "g_c", "g_s"), covariance, rig)
    assert found == {
        "inertia": (pytest.approx(0.05), pytest.approx(0.05 * 0.01), "kg m^2"),
        "g_c": (pytest.approx(1.5), pytest.approx(1.5 * np.hypot(0.01, 0.01)), "N m"),
        "g_s": (0.0, pytest.approx(0.4 * 0.05), "N m"),
    }


def test_only_forces_are_told_as_forces() -> None:
    """Of cogging the torques, not the count; of a periodic force those along the only line; of shares nothing."""
    model = with_stiffness("inverse_dynamics", "cogging", "periodic_disturbance", "equilibrium_offset")
    values = dict.fromkeys(model.parameters, 1.0) | {"m_0": 0.002}
    found = physical_parameters(model, values, (), np.empty((0, 0)), stand_in(pushed("deg"), "rad", "N m"))
    assert {n: u for n, (_, _, u) in found.items()} == {
        "inertia": "kg m^2", **dict.fromkeys(("alpha", "n_a", "n_b", "a_s", "a_c"), "N m")
    }  # fmt: skip
    assert found["n_a"][0] == 0.002


class Product(Load):
    """A force that two parameters scale, so that neither alone does."""

    on = delta_dot
    first = Parameter("s^-2", "one factor", (0.0, 1.0), HalfStudent(1.0))
    second = Parameter("q", "the other", (0.0, 1.0), HalfStudent(1.0))

    def expression(self) -> Any:
        return self.first * self.second


class Fading(Load):
    """A force that fades: its rate is free, but scales nothing."""

    on = delta_dot
    size = Parameter("s^-2 q", "force at first", (0.0, 1.0), HalfStudent(1.0))
    fades = Parameter("s^-1", "rate", (0.0, 1.0), HalfStudent(1.0))

    def expression(self) -> Any:
        return self.size * sp.exp(-self.fades * t)


class Offset(Fading):
    """A force of which a part is there whatever the amplitude is."""

    def expression(self) -> Any:
        return super().expression() + delta


class Sliding(Memory):
    """A force that grows with a length that its own memory depends on."""

    reach = Parameter("s^-2", "reach", (0.0, 1.0), HalfStudent(1.0))

    def states(self) -> Any:
        return {_SLIP: bend_dot - _SLIP / self.reach}

    def expression(self) -> Any:
        return -self.reach * _SLIP * bend_dot


@pytest.mark.parametrize(("law", "found"), [(Product, ()), (Fading, ("size",)), (Offset, ()), (Sliding, ())])
def test_what_scales_with_the_inertia(law: Any, found: tuple[str, ...]) -> None:
    assert amplitudes(law()) == found


def test_every_export_says_them() -> None:
    model = with_stiffness("oscillator")
    physical = {"alpha": (200.0, 1.5, "N m^-1"), "inertia": (2.0, float("nan"), "kg")}
    found = FittedModel(model, {"alpha": 100.0, "g": 0.5}, physical=physical)
    for text in (*to_c(found), to_numpy(found), to_sympy_file(found), to_latex(found)):
        assert "In physical units: alpha = 200.0 +- 1.5 N m^-1." in text
        assert "inertia = 2 kg." in text
    again = from_json(to_json(found)).physical
    assert again["alpha"] == physical["alpha"]
    assert np.isnan(again["inertia"][1])
    # Of other numbers nothing is known in kilograms.
    assert "physical units" not in to_numpy(found, {"alpha": 90.0})
