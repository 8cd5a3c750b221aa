"""Values beside their standard deviations: no digit that says nothing, none lost that says something."""

from __future__ import annotations

import math

import pytest

from discovery.foundation.estimate_text import estimate_text
from discovery.report.numbers import uncertain
from discovery.report.words import page_prose


@pytest.mark.parametrize(
    ("value", "sd", "written"),
    [
        (0.00599864, 1.2e-6, "0.0059986 +- 0.0000012"),
        (0.000574279, 7.9e-5, "(5.74 +- 0.79)e-4"),
        (-7.97402e-5, 3.5e-5, "(-8.0 +- 3.5)e-5"),
        (736712.4, 7900.0, "736700 +- 7900"),
        (1.23456789e7, 4.2e4, "(1.2346 +- 0.0042)e7"),
        (0.0, 0.02, "0.000 +- 0.020"),
        (-1e-5, 0.02, "0.000 +- 0.020"),
        (8.79068, 0.00996, "8.791 +- 0.010"),
        (1e-3, 1e3, "0 +- 1000"),
        (0.123456789, None, "0.123457"),
        (0.25, 0.0, "0.25"),
        (2.0, math.nan, "2"),
        (math.nan, 0.1, "nan"),
    ],
)
def test_two_digits_of_the_deviation_decide(value: float, sd: float | None, written: str) -> None:
    assert estimate_text(value, sd) == written


def test_a_ratio_has_no_unit() -> None:
    assert estimate_text(0.25, 0.1, "1") == "0.25 +- 0.10"
    assert estimate_text(0.25, 0.0, "q^-1") == "0.25 q^-1"
    assert estimate_text(0.25, None, "s") == "0.25 s"


@pytest.mark.parametrize(
    ("value", "sd"), [(0.0059986, 1.2e-6), (5.74e-4, 7.9e-5), (-8.0e-5, 3.5e-5), (736712.0, 7900.0)]
)
def test_the_page_writes_the_same_digits(value: float, sd: float) -> None:
    console = page_prose(estimate_text(value, sd))
    assert console.replace(" ", "").replace("\N{NARROW NO-BREAK SPACE}", "") == uncertain(value, sd).replace(
        " ", ""
    ).replace("\N{NARROW NO-BREAK SPACE}", "")
