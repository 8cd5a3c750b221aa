from __future__ import annotations

import inspect
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import sympy as sp
from pushed_oscillator import TIME, experiment, pushes
from test_bench import arm

from discovery.declarations.effect import ARM, OSCILLATOR, Closure, Dissipation, Drive, Effect, Kinetic, Load, Potential
from discovery.declarations.forces import SmoothForce
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, LogNormal, Normal
from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.symbols import delta, delta_dot, omega, rho, t, theta_m, v2, v_x, v_y, x
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.foundation.errors import InputError
from discovery.mechanics import base_names, get_base
from discovery.mechanics.base import RADIUS_LAWS, SHORTENING_RADIUS
from discovery.mechanics.upgrades import UPGRADES, Upgrade
from discovery.testing import EffectContract
from discovery.testing.recovery import check_recovery
from discovery.testing.states import every_effect

#: Ids that users, rig files and stored results know.
VOCABULARY = {
    *("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law"),
    *("centrifugal_stiffening", "coriolis_coupling", "radial_inertia", "distributed_mass", "tip_rotary_inertia"),
    *("radius_quartic", "radius_tension", "quadratic_stiffness", "quintic_stiffness", "material_nonlinearity"),
    *("initial_curvature", "equilibrium_offset", "stiffness_drift", "coulomb_friction", "stribeck_friction"),
    *("quadratic_drag", "structural_damping", "amplitude_dependent_damping", "asymmetric_viscous_damping"),
    "nonlinear_structural_damping",
    *("table_tilt", "gravity_torque", "periodic_disturbance", "base_backlash", "base_compliance", "encoder_ripple"),
    *("input_offset", "input_gain", "base_hysteresis", "hysteresis", "viscoelastic_relaxation"),
    *("sensor_delay", "angle_offset", "position_scale", "camera_origin_offset", "time_base_error", "zero_drift"),
    *("second_mode", "radius_inertia", "elastica_geometry"),
}
#: Effects are searched on it.
EXACT = UPGRADES["elastica_geometry"].base


#: One of each kind of mechanics; the other bases are these with other shapes, or read as other instruments read.
KINDS = (
    *("constant_radius", "reduced", "elastica"),
    *("oscillator", "base_excited", "servo", "inverse_dynamics", "falling_body"),
)


class TestCatalogue(EffectContract):
    """The contract over everything registered, on a base of each kind."""

    bases = KINDS


@pytest.mark.slow
class TestCatalogueOnOtherBases(EffectContract):
    """The same on every other base."""

    bases = tuple(name for name in base_names() if name not in KINDS)


def test_the_promised_effects_are_there() -> None:
    assert {*catalogue(), *UPGRADES} >= VOCABULARY


@pytest.mark.slow
@pytest.mark.parametrize("effect", every_effect(EXACT))
def test_recovery_on_the_exact_arm(effect: str) -> None:
    check_recovery(effect, EXACT)


@pytest.mark.parametrize("step", UPGRADES.values(), ids=lambda step: step.id())
def test_a_step_of_the_mechanics_is_declared_as_effects_are_and_has_no_free_parameter(step: Upgrade) -> None:
    text = inspect.getdoc(type(step)) or ""
    assert step.title()
    assert ".. math::" in text
    assert step.cite
    assert step.id() not in catalogue()
    # What the better base has beyond the simplest is known or held by convention, and it makes effects superfluous.
    assert {p.name for p in (*step.parameters(), *get_base(step.base).parameters()) if not p.fixed} == set()
    assert get_base(step.base).provides >= {"cubic_stiffness", "distributed_mass", *RADIUS_LAWS, *SHORTENING_RADIUS}
    assert f"`{step.base}`" in step.switch()


def test_an_unknown_effect_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"coulomb_frction.*Did you mean coulomb_friction"):
        get_effect("coulomb_frction")


# The contract itself: it must pass what is right and refuse what is not.


class WavyInput(Drive):
    r"""A ripple on the input, and a drift.

    .. math:: \theta = \theta_m + e_r \sin(4\, \theta_m) + e_t t
    """

    systems = frozenset({ARM})
    cite = "planted"
    e_r = Parameter("q", "amplitude", (-0.1, 0.1), Normal(0.0, 0.01), starts=(0.001,), latex="e_r")
    e_t = Parameter("q s^-1", "drift", (-0.1, 0.1), Normal(0.0, 0.01), starts=(0.001,), latex="e_t")

    def expression(self):
        return theta_m + self.e_r * sp.sin(4 * theta_m) + self.e_t * t


class AddedInertia(Kinetic):
    r"""More mass at the tip, and an inertia that depends on the position.

    .. math:: T = m_a \left(\tfrac12 (v_x^2 + v_y^2) + (1 + x \delta)\, \omega \dot\delta\right)
    """

    systems = frozenset({ARM})
    cite = "planted"
    m_a = Parameter("1", "added mass", (0.0, 1.0), HalfStudent(0.1), starts=(0.01,), latex="m_a")

    def expression(self):
        return self.m_a * ((v_x**2 + v_y**2) / 2 + (1 + x * delta) * omega * delta_dot)


class PushingFriction(Dissipation):
    r"""Friction of the wrong sign.

    .. math:: D = -\tfrac12 p_f v^2
    """

    cite = "planted"
    p_f = Parameter("s^-1", "friction", (0.0, 1.0), HalfStudent(0.1), starts=(0.01,), latex="p_f")

    def expression(self):
        return -self.p_f * v2 / 2


class WrongUnit(Potential):
    r"""A spring whose unit is not that of its term.

    .. math:: V = \tfrac14 w_u \delta^4
    """

    cite = "planted"
    w_u = Parameter("s^-2", "stiffness", (0.0, 1.0), HalfStudent(0.1), starts=(2.0,), latex="w_u")

    def expression(self):
        return self.w_u * delta**4 / 4


class CurvedLoad(Load):
    r"""A load whose power is not linear in the rate, so that no force belongs to it.

    .. math:: P = c_l \rho\, \omega^2
    """

    cite = "planted"
    c_l = Parameter("s^-1", "load", (0.0, 1.0), LogNormal(0.1, 1.0), starts=(0.01,), default=0.1, latex="c_l")

    def expression(self):
        return self.c_l * rho * omega**2


class UncitedLaw(Closure):
    """A law without formula and source."""

    systems = frozenset({ARM})
    a_l = Parameter("q^-2", "shortening", (0.0, 1.0), Normal(0.1, 0.1), starts=(0.1,), latex="a_l")

    def expression(self):
        return 1 - self.a_l * delta**2


@contextmanager
def planted(*effects: Effect) -> Iterator[None]:
    """Register effects for the time of a test; the registry hands out one dictionary."""
    known = catalogue()
    known.update({e.id(): e for e in effects})
    try:
        yield
    finally:
        for e in effects:
            del known[e.id()]


@pytest.mark.parametrize("base", ["constant_radius", pytest.param("elastica_2", marks=pytest.mark.slow)])
@pytest.mark.parametrize("effect", [WavyInput(), AddedInertia()])
def test_the_contract_accepts_a_drive_and_a_kinetic_energy(effect: Effect, base: str) -> None:
    contract = TestCatalogue()
    with planted(effect):
        contract.test_declaration(effect.id())
        contract.test_prior(effect.id())
        for law in (
            contract.test_dimensions,
            contract.test_sympy_and_numpy_agree,
            contract.test_force_is_the_gradient_of_the_energy,
            contract.test_absent_by_default,
            contract.test_round_trip,
        ):
            law(effect.id(), base)


@pytest.mark.parametrize(
    ("effect", "law"),
    [
        (PushingFriction(), "test_energy"),
        (WrongUnit(), "test_dimensions"),
        (CurvedLoad(), "test_energy"),
        (CurvedLoad(), "test_absent_by_default"),
    ],
)
def test_the_contract_refuses(effect: Effect, law: str) -> None:
    with planted(effect), pytest.raises(AssertionError):
        getattr(TestCatalogue(), law)(effect.id(), "oscillator")


@pytest.mark.parametrize(
    ("effect", "law"),
    [(UncitedLaw(), "test_declaration"), (WrongUnit(), "test_prior"), (CurvedLoad(), "test_prior")],
)
def test_the_contract_refuses_the_declaration(effect: Effect, law: str) -> None:
    with planted(effect), pytest.raises(AssertionError):
        getattr(TestCatalogue(), law)(effect.id())


@pytest.mark.parametrize(("effect", "simpler"), [(n, s) for n, e in catalogue().items() for s in sorted(e.reduces_to)])
def test_without_one_amplitude_an_effect_is_the_simpler_law_that_it_reduces_to(effect: str, simpler: str) -> None:
    system = ARM if ARM in catalogue()[effect].systems else OSCILLATOR
    base, recording = {
        ARM: ("elastica_calm", arm("a", ("tip_x", "tip_y"), 150)),
        OSCILLATOR: ("oscillator", experiment("a", np.zeros(TIME.size), pushes(0.0, 0.5, 0.0, 0.0))),
    }[system]
    # The simulator that the search has of this base.
    model = Model(base, tuple(sorted({*every_effect(base), SmoothForce.id()})))
    bench = Bench(model.base, model.effects, [recording], 0.01)
    absent = {n: p.default for n, p in model.parameters.items()}
    pushed = {"g": 1.0, "alpha": 9.0}
    absent |= {"alpha": 9.0, "xi": 0.05, "length": 1.0, "mu": 0.1, "tau_r": 1e-4} if system == ARM else pushed

    def moved(amplitude: str) -> np.ndarray:
        values = absent | {amplitude: 0.05}
        return bench.predict(np.array([[values[n]] for n in bench.names]), np.zeros((1, 2, 1)))[0]

    (law,) = (p.name for p in catalogue()[simpler].fitted(system) if not p.shape)
    expected = moved(law)
    assert np.abs(expected - moved("")).max() > 1e-3
    amplitudes = [p.name for p in catalogue()[effect].fitted(system) if not p.shape]
    assert min(np.abs(moved(a) - expected).max() for a in amplitudes) < 1e-12


@pytest.mark.parametrize("base", base_names())
def test_a_gain_may_be_of_any_size(base: str) -> None:
    """A Gaussian prior holds the last fit: a gain, whose unit anyone may choose, it would pull off its data."""
    model = Model(base, ())
    for name in model.free:
        prior = model.parameters[name].prior
        assert float(prior.log_density(prior.width) - prior.log_density(30 * prior.width)) < 16.0, name
