"""An accelerometer on a pendulum reads by two axes where it begins, at any angle; one axis along the rod does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from discovery import close_loop, load_dataset
from discovery.estimation.declared import first_fit
from discovery.estimation.natural_units import natural_units
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.mechanics.first_angle import ReadByAngle

G, REACH, PULL, LOSS = 9.81, 0.2, 28.0, 0.15
RIG = """
name = "rod with an accelerometer"
[system]
coordinates = { q = "rad" }
kinetic = "inertia*dot(q)^2/2"
potential = "-moment*cos(q)"
dissipation = "loss*dot(q)^2/2"
output = "gravity*sin(q) + reach*ddot(q)"
also = { radial = "gravity*cos(q) + reach*dot(q)^2" }
places = { pivot = "q" }
[system.constants]
inertia = { value = 1.0, unit = "kg m^2" }
moment = { guess = 20.0, unit = "N m" }
loss = { guess = 0.3, unit = "N m s" }
reach = { guess = 0.05, unit = "m" }
gravity = { value = 9.81, unit = "m s^-2" }
[columns]
time = { name = "time", unit = "s" }
output = { name = "x", unit = "m/s^2", noise = 0.05 }
also = { radial = { name = "z", unit = "m/s^2", noise = 0.05 } }
[records]
train = [{ file = "a.csv" }]
holdout = [{ file = "b.csv" }]
"""


def written(folder: Path, dry: float, rig: str = RIG) -> Path:
    """Write two releases from -120 and 149 degrees, with dry friction [N m], by a solver of its own."""
    rng = np.random.default_rng(0)

    def turns(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return -PULL * np.sin(q) - LOSS * v - dry * np.tanh(v / 1e-2)

    time = np.arange(0.0, 10.0, 0.01)
    for name, begin in (("a", -2.1), ("b", 2.6)):
        found = solve_ivp(lambda t, y: [y[1], turns(*y)], (0.0, 10.0), [begin, 0.0], t_eval=time, rtol=1e-9, atol=1e-10)
        q, v = found.y
        along = [G * np.sin(q) + REACH * turns(q, v), G * np.cos(q) + REACH * v**2]
        table = [time, *(axis + rng.normal(0.0, 0.05, time.size) for axis in along)]
        np.savetxt(folder / f"{name}.csv", np.column_stack(table), "%.6g", ",", header="time,x,z", comments="")
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    return folder / "rig.toml"


def first_angle(laws: list[sp.Expr], angle: sp.Symbol, read: np.ndarray) -> tuple[float, float] | None:
    turn = ReadByAngle.of(laws, angle)
    return None if turn is None else turn.begin(read)


def test_a_release_from_a_large_angle_is_found(tmp_path: Path) -> None:
    data = load_dataset(written(tmp_path, 0.0))
    # Its equations say what an accelerometer reads.
    assert not [flag for e in data.train for flag in e.recording.flags if flag.code == "rate_as_position"]
    found = first_fit(data.train, natural_units(data.train))
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.1)
    for name, true in (("moment", PULL), ("loss", LOSS), ("reach", REACH)):
        assert abs(found.values[name] - true) < 4.0 * found.sd[name]


@pytest.mark.slow
def test_what_its_pivot_lacks_is_named(tmp_path: Path) -> None:
    found = close_loop(load_dataset(written(tmp_path, 0.4)))
    assert found.added == ("coulomb_friction_at_pivot",)
    assert found.after.values["f_c_pivot"] == pytest.approx(0.4, rel=0.03)


@given(st.floats(-3.1, 3.1), st.floats(-9.0, 9.0))
def test_two_axes_tell_an_angle_and_its_rate(angle: float, rate: float) -> None:
    q = sp.Symbol("q", real=True)
    read = np.array([[G * np.sin(angle), G * np.cos(angle) * rate], [G * np.cos(angle), -G * np.sin(angle) * rate]])
    found = first_angle([G * sp.sin(q), G * sp.cos(q)], q, read)
    assert found is not None
    # Angles are tried half a degree apart, and those that read almost the same are one.
    assert found[0] == pytest.approx(angle, abs=0.1)
    assert found[1] == pytest.approx(rate, abs=0.1 * max(1.0, abs(rate)))


@given(st.floats(-1.4, 1.4))
def test_one_axis_tells_the_angle_nearer_to_rest(angle: float) -> None:
    q = sp.Symbol("q", real=True)
    found = first_angle([G * sp.sin(q)], q, np.array([[G * np.sin(angle), 0.0]]))
    assert found is not None
    assert np.sin(found[0]) == pytest.approx(np.sin(angle), abs=0.07)
    assert abs(found[0]) < np.pi / 2 + 0.01


def test_a_straight_reading_tells_by_itself() -> None:
    q = sp.Symbol("q", real=True)
    assert first_angle([2.0 * q, G * sp.sin(q)], q, np.array([[1.0, 0.0], [4.0, 0.0]])) is None


def test_a_law_with_poles_or_without_a_value_tells_where_it_has_one() -> None:
    q = sp.Symbol("q", real=True)
    spot = first_angle([2.0 * sp.tan(q)], q, np.array([[2.0 * np.tan(0.6), 0.0]]))
    assert spot is not None
    assert spot[0] == pytest.approx(0.6, abs=0.15)  # within a twelfth of the range
    slider = first_angle([sp.sqrt(0.25 - sp.sin(q) ** 2) - 0.5], q, np.array([[np.sqrt(0.25 - 0.09) - 0.5, 0.0]]))
    assert slider is not None
    assert np.sin(abs(slider[0])) == pytest.approx(0.3, abs=0.05)
    assert first_angle([sp.sqrt(-1 - q**2)], q, np.array([[0.1, 0.0]])) is None


@pytest.mark.parametrize(("reach", "order"), [(0.2, 0), (0.34, 0), (0.6, 2)])
def test_a_lever_arm_changes_no_start(tmp_path: Path, reach: float, order: int) -> None:
    text = RIG.replace("guess = 0.05", f"guess = {reach}").replace("guess = 20.0", f"guess = {PULL}")
    base = get_base(load_dataset(written(tmp_path, 0.0, text)).rig.base)
    assert base.order == order
    for angle in (-2.1, 2.6, 1.0):
        turns = -PULL * np.sin(angle)
        read = [[G * np.sin(angle) + reach * turns, 0.0], [G * np.cos(angle), 0.0]]
        told = base.first_state(np.array(read))
        assert told is not None
        assert told[0] * base.shape[0] == pytest.approx(angle, abs=0.02)


def test_an_axis_that_is_not_quite_along_the_rod_tells_a_little(tmp_path: Path) -> None:
    text = RIG.replace("gravity*sin(q) + reach*ddot(q)", "gravity*cos(q + tilt) + reach*dot(q)^2")
    text = text.replace('also = { radial = "gravity*cos(q) + reach*dot(q)^2" }\n', "")
    text = text.replace('also = { radial = { name = "z", unit = "m/s^2", noise = 0.05 } }\n', "")
    text = text.replace("[system.constants]\n", '[system.constants]\ntilt = { value = 0.1, unit = "rad" }\n')
    assert get_base(load_dataset(written(tmp_path, 0.0, text)).rig.base).order == 0


def test_an_output_without_a_slope_at_rest_is_refused(tmp_path: Path) -> None:
    # The axis along the rod is even in its angle and rate.
    text = RIG.replace("gravity*sin(q) + reach*ddot(q)", "gravity*cos(q) + reach*dot(q)^2")
    text = text.replace('also = { radial = "gravity*cos(q) + reach*dot(q)^2" }\n', "")
    text = text.replace('also = { radial = { name = "z", unit = "m/s^2", noise = 0.05 } }\n', "")
    with pytest.raises(InputError, match=r"key 'output': at rest it does not change with any coordinate.*another axis"):
        load_dataset(written(tmp_path, 0.0, text))
