"""Units: exponents, factors and suffixes, against tables and pint, the independent reader of the same strings."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.declarations.unit_suffixes import split_suffix, suffix_unit
from discovery.declarations.units import dimension, homogeneous, si_factor, si_symbol
from discovery.foundation.errors import InputError

UREG = pint.UnitRegistry()
BASES = ("kg", "m", "s", "A", "K")
PINT = {"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K"}


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("", {}),
        ("1", {}),
        ("rad", {}),
        ("rad s^-1", {"s": -1}),
        ("s^-2", {"s": -2}),
        ("1/s", {"s": -1}),
        ("N m^2", {"kg": 1, "m": 3, "s": -2}),
        ("m/s^2", {"m": 1, "s": -2}),
        ("kg m^2 s**-2", {"kg": 1, "m": 2, "s": -2}),
        ("s^(-1/2)", {"s": Fraction(-1, 2)}),
        ("N/m", {"kg": 1, "s": -2}),
        ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}),
        ("m / m", {}),
        ("q s^-2", {"q": 1, "s": -2}),
    ],
)
def test_dimension(unit, exponents):
    assert dimension(unit) == exponents


@given(
    st.lists(
        st.tuples(st.sampled_from([*BASES, "N", "J", "W", "Pa", "V", "Hz"]), st.integers(-4, 4).filter(bool)),
        max_size=5,
    )
)
def test_dimension_agrees_with_pint(factors):
    unit = " ".join(f"{symbol}^{power}" for symbol, power in factors)
    reference = UREG.Quantity(1.0, unit or "dimensionless").to_base_units()
    assert reference.magnitude == pytest.approx(1.0)
    exponents = {PINT[name]: power for name, power in reference.unit_items() if power}
    assert dimension(unit) == pytest.approx(exponents)


@pytest.mark.parametrize("unit", ["mm", "deg", "m^", "m^1/2", "3", "furlong", "m ^ 2"])
def test_dimension_refuses_what_is_not_coherent(unit):
    with pytest.raises(InputError, match="cannot be read at"):
        dimension(unit)


def test_homogeneous_ignores_the_radian():
    assert homogeneous("rad s^-2", "s^-2")
    assert not homogeneous("s^-1", "s^-2")


@pytest.mark.parametrize(
    ("unit", "expected", "factor"),
    [
        ("mm", "m", 1e-3),
        ("deg", "rad", np.pi / 180.0),
        ("g", "kg", 1e-3),
        ("ms", "s", 1e-3),
        ("mV", "V", 1e-3),
        ("um", "m", 1e-6),
        ("mrad", "rad", 1e-3),
        ("kN m^2", "N m^2", 1000.0),
        ("m", "m", 1.0),
    ],
)
def test_conversion_table(unit, expected, factor):
    assert si_factor(unit, expected) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    ("written", "unit", "factor", "symbol"),
    [
        ("Nm", "N m", 1.0, "N m"),
        ("mNm", "N m", 1e-3, "N m"),
        ("Nm/A", "N m/A", 1.0, "kg m^2/A/s^2"),
        ("rev", "rad", 2.0 * np.pi, "rad"),
        ("rev/s", "rad/s", 2.0 * np.pi, "rad/s"),
        ("rev/min", "rad/s", np.pi / 30.0, "rad/s"),
        ("RPM", "rad/s", np.pi / 30.0, "rad/s"),
        ("dps", "rad/s", np.pi / 180.0, "rad/s"),
        ("kmh", "m/s", 1.0 / 3.6, "m/s"),
        ("Grad", "rad", np.pi / 180.0, "rad"),
        ("px", "pixel", 1.0, "pixel"),
    ],
)
def test_units_are_read_as_people_write_them(written, unit, factor, symbol):
    assert si_factor(written, unit) == pytest.approx(factor, rel=1e-14)
    assert si_symbol(written) == symbol


@pytest.mark.parametrize(
    ("unit", "expected", "message"),
    [
        ("mm", "rad", "'mm' cannot be converted to 'rad'"),
        ("deg", "1", "cannot be converted"),
        ("kg", "s", "cannot be converted"),
        ("wibble", "m", "'wibble' is not known"),
        ("m**", "m", "is not known"),
        ("degC", "K", "offset"),
    ],
)
def test_wrong_units_are_refused(unit, expected, message):
    with pytest.raises(InputError, match=message):
        si_factor(unit, expected)


@pytest.mark.parametrize(
    ("unit", "symbol"),
    [
        *[("mV", "V"), ("deg", "rad"), ("mm", "m"), ("g", "kg"), ("", "1"), ("mm/s", "m/s"), ("count", "count")],
        *[("N", "N"), ("N m", "N m"), ("mN*m", "N m"), ("cm kgf", "N m"), ("mJ", "J"), ("W s", "J")],
    ],
)
def test_si_symbol(unit, symbol):
    assert si_symbol(unit) == symbol


@pytest.mark.parametrize(
    ("suffix", "unit"), [("N_m2", "N m^2"), ("mm", "mm"), ("rad_per_s", "rad / s"), ("s-2", "s^-2"), ("deg", "deg")]
)
def test_suffix_unit(suffix, unit):
    assert suffix_unit(suffix) == unit


@pytest.mark.parametrize(
    ("name", "split"),
    [
        ("tip_x_mm", ("tip_x", "mm")),
        ("tip_x", ("tip_x", "")),
        ("tip_mass_kg", ("tip_mass", "kg")),
        ("tip_kg", ("tip", "kg")),
        ("tip_x_raw2b", None),
        ("other_m", None),
    ],
)
def test_split_suffix(name, split):
    assert split_suffix(name, ["tip", "tip_x", "tip_mass"]) == split
