"""The source paper's errata: each check computed, and each able to come out the other way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from discovery_datasets.twin import PAPER_RIG

from benchmarks.paper import errata as checks
from benchmarks.paper.errata_force import coupling_torque_frame, force_frame, motor_constant
from benchmarks.paper.errata_motion import largest_deflection, time_scale
from benchmarks.paper.stand import Stand, manoeuvre, stand


@pytest.fixture(scope="module")
def recording() -> Stand:
    return stand(PAPER_RIG, manoeuvre(), name="paper", seed=[3, 1], duration=8.0)


def test_a_polar_acceleration_is_that_of_an_analytic_motion() -> None:
    """A spiral: rho = 1 + t^2 / 10 and theta = t^2, so that both rates count."""
    t = np.linspace(0.0, 1.5, 301)
    rho, theta = 1 + t**2 / 10, t**2
    z = rho * np.exp(1j * theta)
    exact = (0.2 + 2j * (0.2 * t) * (2 * t) + rho * (2j - (2 * t) ** 2)) * np.exp(1j * theta)
    tip = np.column_stack([z.real, z.imag])
    right = checks.polar_acceleration(t, tip) @ [1, 1j]
    printed = checks.polar_acceleration(t, tip, centripetal_order=2) @ [1, 1j]
    np.testing.assert_allclose(right, exact, atol=1e-6)
    np.testing.assert_allclose(np.abs(printed - exact), rho * np.abs(4 - 4 * t**2), atol=1e-6)


def test_a_the_centripetal_term(recording: Stand) -> None:
    n = checks.centripetal_term(recording).numbers
    assert n["rms_error_right"] < 1e-4 * n["rms_acceleration"]
    assert n["rms_error_printed"] > n["rms_acceleration"]


@pytest.mark.slow
def test_b_the_time_scale() -> None:
    n = time_scale(duration=3.0).numbers
    assert n["largest_distance_right_lengths"] < 1e-6
    assert n["smallest_distance_printed_lengths"] > 0.3
    # Where length and rigidity are the same, the printed scale is right as well: mass alone enters as printed.
    n = time_scale([(1.0, 1.0, 1.7)], duration=1.5).numbers
    assert n["smallest_distance_printed_lengths"] < 1e-6


def test_c_a_force_and_not_a_torque() -> None:
    n = checks.stiffness_unit().numbers
    assert (n["printed_is_torque"], n["printed_is_force"]) == (1.0, 0.0)
    assert (n["alpha_15_from_force_is_per_s2"], n["alpha_15_from_printed_12_is_per_s2"]) == (1.0, 0.0)
    assert n["stiffness_over_right"] == pytest.approx(1.0, rel=1e-5)
    assert n["stiffness_over_printed"] == pytest.approx(0.5, rel=1e-5)
    assert checks.stiffness_unit(length=1.0).numbers["stiffness_over_printed"] == pytest.approx(1.0, rel=1e-5)


def test_d_the_rods_mass() -> None:
    n = checks.rod_mass().numbers
    assert n["rod_mass_g"] == pytest.approx(12.45, abs=5e-3)
    assert n["rod_over_disc"] == pytest.approx(0.28, abs=5e-3)
    assert n["alpha_massless"] == pytest.approx(8.636, abs=5e-4)
    assert n["alpha_with_rod"] == pytest.approx(8.09, abs=5e-3)
    assert n["moment_from_diameter"] == pytest.approx(3.98e-12, rel=2e-3)
    # What is needed gives the fitted value back.
    assert n["rod_mass_needed_g"] < 0
    moved = 43.76 + 33 / 140 * n["rod_mass_needed_g"]
    assert 3 * 31.65e9 * 3.98e-12 / (1e-3 * moved) == pytest.approx(8.7907, rel=1e-12)
    for mass, modulus in ((43.76, "massless"), (43.76 + 33 / 140 * n["rod_mass_g"], "with_rod")):
        stiffness = 3 * 1e9 * n[f"modulus_needed_{modulus}_GPa"] * 3.98e-12
        assert stiffness / (1e-3 * mass) == pytest.approx(8.7907, rel=1e-12)


def test_e_the_radius(recording: Stand) -> None:
    n = checks.radius_error(recording).numbers
    assert 60 < n["largest_mm"] < 75
    assert n["largest_by_law_16_mm"] == pytest.approx(71.1, abs=0.1)
    assert n["mean_mm"] < 0.5 * n["largest_mm"]
    assert n["printed_ratio"] == pytest.approx(9.8, abs=0.03)
    bent = recording.motion.tip_x + 1j * recording.motion.tip_y
    straight = replace(recording.motion, tip_x=(bent / abs(bent)).real, tip_y=(bent / abs(bent)).imag)
    assert checks.radius_error(replace(recording, motion=straight)).numbers["largest_mm"] < 1e-9


@pytest.mark.slow
def test_f_the_deflection_that_is_reached() -> None:
    n = largest_deflection().numbers
    assert n["ideal_rad"] == pytest.approx(0.69, abs=5e-3)
    assert n["trapezoid_1.25_rad"] == pytest.approx(0.79, abs=5e-3)
    assert n["trapezoid_1.4_rad"] == pytest.approx(0.83, abs=5e-3)


def test_f_is_that_of_an_undamped_linear_arm_at_small_deflection() -> None:
    """A hub that jumps to a rate v swings a linear arm by v / omega, here to third order in the move."""
    speed = 0.1
    n = largest_deflection((speed,), ramp=1e-3).numbers
    omega = np.sqrt(3 * PAPER_RIG.flexural_rigidity / PAPER_RIG.effective_mass)
    xi = PAPER_RIG.disc_friction / PAPER_RIG.effective_mass
    expected = speed / omega * np.exp(-xi * np.pi / omega / 4) * (1 + 0.0105)
    assert n["ideal_rad"] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("hub", [-1.2, 0.7, 2.5])
def test_g_the_force_turns_with_the_hub(hub: float) -> None:
    n = force_frame(hub, direction=hub + 1.3).numbers
    assert n["force_error_N"] < 1e-5
    assert n["direction_error_printed_rad"] == pytest.approx(abs(hub), abs=1e-5)
    assert n["direction_error_rotated_rad"] < 1e-5


def test_h_the_coupling_torque(recording: Stand) -> None:
    n = coupling_torque_frame(recording).numbers
    assert n["torque_over_11"] == pytest.approx(1.0, abs=0.15)
    assert n["correlation"] > 0.97
    assert n["correlation_with_phi_of_3"] < 0.9


@pytest.mark.parametrize("gear_ratio", [1.0, 50.0])
def test_i_the_motors_constant(gear_ratio: float) -> None:
    assert motor_constant(gear_ratio).numbers["constant_over_rotor_constant"] == pytest.approx(gear_ratio)


def test_all_of_them_in_order(recording: Stand, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "time_scale", lambda: time_scale([(1.1, 1.0, 1.0)], duration=1.0))
    found = checks.errata(recording)
    assert [e.key for e in found] == [*"abcdef", "misprint 1", "misprint 2", "misprint 3"]
    for erratum in found:
        assert all(np.isfinite(v) for v in erratum.numbers.values())
        assert erratum.printed != erratum.right
        assert erratum.sentence.endswith(".")
