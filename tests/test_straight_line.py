"""Statements that are translated one by one compute what Python computes of the same text."""

import math

import numba
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from discovery.simulation.kernel import vectormath
from discovery.simulation.kernel.straight_line import received, straight_line

TEXT = {
    "arithmetic": "a = w[0 + i] * x - 2.0 / w[1 + i]\nw[2 + i] = -a + w[1 + i]**3.0",
    "a name assigned again": "x = x + 1.0\nx = x * w[0 + i]\nw[2 + i] = x",
    "added in place": "w[2 + i] = 1.0\nw[2 + i] += x * w[0 + i]",
    "functions": "w[2 + i] = abs(x - 3.0) + math.tanh(w[0 + i]) + math.log(w[1 + i])",
    "a choice": "w[2 + i] = (x if (w[0 + i] > 0.0) else (1.0 if (x <= 2.0) else 3.0))",
    "a choice between parts": "w[2 + i] = (x if ((w[0 + i] > 0.0 and x < 2.0) or not x < 5.0) else 7.0)",
}


@pytest.mark.parametrize("text", TEXT.values(), ids=TEXT)
@pytest.mark.parametrize(("value", "x"), [(0.5, 1.5), (-0.5, 2.5), (0.25, 6.0)])
def test_it_computes_what_python_computes(text: str, value: float, x: float) -> None:
    body = straight_line(text, {"math": math})
    w = np.array([value, 1.75, 0.0])
    numba.njit(lambda w, x: body(w, 0, (x,)))(w, x)
    expected = {"w": [value, 1.75, 0.0], "x": x, "i": 0, "math": math}
    exec(text, expected)
    np.testing.assert_allclose(w, expected["w"], rtol=1e-15)


def test_it_calls_compiled_functions() -> None:
    body = straight_line("w[0 + i] = _sin(w[0 + i])", {"_sin": vectormath.sin})

    @numba.njit
    def run(w):
        for i in range(4):
            body(w, i, ())

    w = np.linspace(-2.0, 2.0, 4)
    expected = [vectormath.sin(x) for x in w]
    run(w)
    assert_array_equal(w, expected)


def test_what_it_is_given_is_what_it_does_not_assign_before() -> None:
    assert received(["a = b + _sin(c)", "d = a * math.tanh(e)", "w[3 + i] = d + w[4 + i]", "b = 1.0"]) == [
        "b",
        "c",
        "e",
    ]


@pytest.mark.parametrize("text", ["a, x = x", "w[i] = x", "w[x] = x", "a = [x]", "a = x @ x", "x", "a = x[0]"])
def test_anything_else_is_refused(text: str) -> None:
    body = straight_line(text, {})
    with pytest.raises(NotImplementedError, match="not straight-line"):
        numba.njit(lambda w, x: body(w, 0, (x,)))(np.zeros(3), 1.0)
