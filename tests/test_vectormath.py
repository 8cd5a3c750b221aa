from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.simulation.kernel.vectormath import atan2, cos, exp, sin, sqrt

angles = st.floats(-1e5, 1e5)
numbers = st.floats(-1e3, 1e3, allow_subnormal=False)


# The first call compiles.
@settings(deadline=None)
@given(angles)
def test_sine_and_cosine(x: float) -> None:
    # The reduction by pi/2 in two parts loses about n * 1e-17 over n quadrants.
    tolerance = 5e-16 + 2e-16 * abs(x)
    assert abs(sin(x) - math.sin(x)) <= tolerance
    assert abs(cos(x) - math.cos(x)) <= tolerance


@settings(deadline=None)
@given(st.floats(-2 * math.pi, 2 * math.pi))
def test_sine_and_cosine_to_a_few_ulp_within_two_turns(x: float) -> None:
    assert abs(sin(x) - math.sin(x)) <= 4e-16
    assert abs(cos(x) - math.cos(x)) <= 4e-16
    assert abs(sin(x) ** 2 + cos(x) ** 2 - 1) <= 1e-15


@settings(deadline=None)
@given(st.floats(-1e-3, 1e-3))
def test_the_sine_of_a_small_angle_keeps_its_digits(x: float) -> None:
    assert abs(sin(x) - math.sin(x)) <= 4e-16 * abs(x)


@settings(deadline=None)
@given(numbers, numbers)
def test_arc_tangent_of_two(y: float, x: float) -> None:
    # Zeros have no sign here.
    x, y = x + 0.0, y + 0.0
    assert abs(atan2(y, x) - math.atan2(y, x)) <= 1e-15


def test_arc_tangent_on_the_axes() -> None:
    assert atan2(0.0, 0.0) == 0.0
    assert atan2(0.0, 1.0) == 0.0
    assert atan2(1.0, 0.0) == math.pi / 2
    assert atan2(-1.0, 0.0) == -math.pi / 2
    assert atan2(0.0, -1.0) == math.pi


@settings(deadline=None)
@given(st.floats(0, 1e12))
def test_square_root(x: float) -> None:
    assert sqrt(x) == math.sqrt(x)


def test_square_root_of_negative_round_off_is_zero() -> None:
    assert sqrt(-1e-17) == 0.0


@settings(deadline=None)
@given(st.floats(-650, 709))
def test_exponential(x: float) -> None:
    # The reduction by ln 2 in two parts loses about n * 1e-16 over n halvings, as that of the sine.
    assert abs(exp(x) - math.exp(x)) <= (1e-15 + 2e-16 * abs(x)) * math.exp(x)


def test_the_exponential_stays_within_the_numbers_there_are() -> None:
    assert exp(-1e9) == exp(-650.0) < 1e-282
    assert exp(1e9) == exp(709.0) > 1e307
    assert exp(0.0) == 1.0


def test_what_is_not_finite_stays_so() -> None:
    assert np.isnan(exp(math.nan))
    assert np.isnan(sin(math.inf))
    assert np.isnan(cos(math.nan))
