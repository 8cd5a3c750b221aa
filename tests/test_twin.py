"""The twin against theory, against itself with more modes, and against a discretisation that shares nothing with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from discovery_datasets.arm import NODES, PAPER_RIG, Arm
from discovery_datasets.beam import discretise, integration_matrix
from discovery_datasets.disturbances import (
    DISTURBANCES,
    STANDARD_GRAVITY,
    CameraOriginOffset,
    CoulombFriction,
    Disturbance,
    EncoderRipple,
    InitialCurvature,
    PeriodicDisturbance,
    PositionScale,
    QuadraticDrag,
    SensorDelay,
    StiffnessDrift,
    StructuralDamping,
    TableTilt,
    ViscoelasticRelaxation,
)
from discovery_datasets.manoeuvres import minimum_jerk, rest, sequence, trapezoid
from discovery_datasets.recordings import MANOEUVRES, sample_times
from discovery_datasets.twin import record, simulate, static_tip, write_csv
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import odeint
from scipy.optimize import brentq

FRICTIONLESS = replace(PAPER_RIG, disc_friction=0.0)
SHORT = {"modes": 3, "nodes": 8}
FINE = 1e-10


def tip(motion):
    return motion.tip_x + 1j * motion.tip_y


# --- space discretisation


def test_integration_is_exact_for_polynomials():
    position, integral = integration_matrix(9)
    for power in range(9):
        np.testing.assert_allclose(integral @ position**power, position ** (power + 1) / (power + 1), atol=1e-14)


def test_curvature_shapes_are_orthonormal_and_free_of_moment_at_the_tip():
    beam = discretise(1.0, 0.01, 0.04, modes=5, nodes=20)
    _, integral = integration_matrix(20)
    curvature = np.linalg.lstsq(integral, beam.angle_shapes[:, 1:], rcond=None)[0]
    np.testing.assert_allclose(curvature.T @ (beam.weights[:, None] * curvature), np.eye(5), atol=1e-10)
    np.testing.assert_allclose(curvature[-1], 0.0, atol=1e-10)


def test_too_few_nodes_are_refused():
    with pytest.raises(ValueError, match="5 modes need at least 7 nodes"):
        discretise(1.0, 0.01, 0.04, modes=5, nodes=6)


# --- statics and linear limit


@pytest.mark.parametrize(
    ("load", "deflection", "shortening"),
    [(1, 0.30172, 0.05643), (2, 0.49346, 0.16064), (5, 0.71379, 0.38763), (10, 0.81061, 0.55500)],
)
def test_static_deflection_is_mattiassons(load, deflection, shortening):
    # K. Mattiasson, Int. J. Numer. Methods Eng. 17, 1981: cantilever under a transverse end load P l^2 / EI
    rig = replace(PAPER_RIG, length=0.8)
    force = 1j * load * rig.flexural_rigidity / rig.length**2
    position = static_tip(rig, tip_force=force, modes=8, nodes=20) / rig.length
    assert position.imag == pytest.approx(deflection, abs=6e-6)
    assert 1 - position.real == pytest.approx(shortening, abs=6e-6)


def linear_modes(rig, modes):
    arm = Arm.of(rig, (), modes, modes + 7)
    still = np.zeros(modes + 1)
    mass = arm.balance(0.0, still, still, still[1:])[0][1:, 1:]
    square, shapes = np.linalg.eigh(np.linalg.inv(np.linalg.cholesky(mass)) @ np.linalg.inv(np.linalg.cholesky(mass)).T)
    frequency = np.sqrt(rig.flexural_rigidity / rig.length / square)[::-1] if False else None
    stiffness = rig.flexural_rigidity / rig.length
    values, vectors = np.linalg.eig(np.linalg.inv(mass) * stiffness)
    order = np.argsort(values.real)
    return np.sqrt(values.real[order]), vectors.real[:, order]
