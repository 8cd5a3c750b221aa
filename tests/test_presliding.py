"""Dry friction whose contact gives way before it slips: Dahl's law, told from Coulomb's and from hysteresis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from discovery.declarations import symbols as s
from discovery.declarations.registry import get_effect
from discovery.recordings.dataset import load_dataset
from discovery.runs.loop import close_loop

SLIDING, REACH, NOISE = 0.3, 0.02, 1e-3
TIME = np.arange(0.0, 8.0, 0.01)
RIG = """
name = "pendulum"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "angle", unit = "rad", noise = 1e-3 }
[model]
effects = ["viscous_damping", "gravity_torque"]
[records]
train = [{ file = "0.csv" }, { file = "1.csv" }]
holdout = [{ file = "2.csv" }]
"""


def test_behind_a_turn_the_friction_follows_an_exponential() -> None:
    law = get_effect("presliding_friction")
    ((state, slope),) = law.states().items()
    numbers = {"f_p": SLIDING, "s_p": REACH}
    values = {x: numbers[x.name] for x in (slope + law.expression()).free_symbols if x.name in numbers}
    force = sp.diff(law.expression(), s.bend_dot).subs(values)
    rate = sp.lambdify([state, s.bend_dot], slope.subs(values))
    way = np.linspace(0.0, 0.1, 101)
    # It slid the other way before: along the way, the law knows no time.
    given = solve_ivp(lambda _, z: rate(z, 1.0), (0.0, 0.1), [-REACH], t_eval=way, rtol=1e-10, atol=1e-14).y[0]
    found = sp.lambdify(state, force)(given)
    np.testing.assert_allclose(found, -SLIDING * (1 - 2 * np.exp(-way / REACH)), atol=1e-8)
    # A turn begins with twice the stiffness of a contact that nothing loads.
    assert (found[1] - found[0]) / way[1] == pytest.approx(-2 * SLIDING / REACH, rel=0.03)


def swing(first: float, reach: float) -> NDArray:
    """Return the swing of a rigid pendulum from an angle; without a reach its friction is Coulomb's."""

    def slopes(_: float, y: NDArray) -> list[float]:
        q, v, z = y
        held = z / reach if reach else np.tanh(v / 1e-4)
        return [v, -30.0 * np.sin(q) - 0.1 * v - SLIDING * held, v - abs(v) * z / reach if reach else 0.0]

    span, start = (0.0, TIME[-1]), [first, 0.0, 0.0]
    return solve_ivp(slopes, span, start, "LSODA", TIME, rtol=1e-8, atol=1e-10, max_step=5e-3).y[0]


@pytest.mark.parametrize(("reach", "named"), [(REACH, "presliding_friction"), (0.0, "coulomb_friction")])
def test_a_contact_that_gives_way_is_told_from_one_that_does_not(tmp_path: Path, reach: float, named: str) -> None:
    rng = np.random.default_rng(3)
    for i, first in enumerate((0.3, 0.15, 0.22)):
        read = swing(first, reach) + NOISE * rng.standard_normal(TIME.size)
        np.savetxt(tmp_path / f"{i}.csv", np.column_stack([TIME, read]), delimiter=",", header="t,angle", comments="")
    (tmp_path / "rig.toml").write_text(RIG)
    result = close_loop(load_dataset(tmp_path / "rig.toml"))
    assert (result.verdict, result.added) == ("explained", (named,))
    assert result.errors["after"]["holdout"]["rms"] < 1.1 * NOISE
    for name, value in {"f_p": SLIDING, "s_p": REACH}.items() if reach else {"f_c": SLIDING}.items():
        found = result.summary()["effects"][0]["parameters"][name]
        assert abs(found["value"] - value) < 4 * found["sd"]
        assert found["sd"] < 0.05 * value
