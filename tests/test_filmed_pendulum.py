"""A pendulum that is read in metres, to the side: by the sine of its angle, and not by a spring that bends."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery import close_loop, declared_model, fit_model, load_dataset
from discovery.diagnosis.stand_in import seen_aside
from discovery.drafting.rig_text import draft
from discovery.equations.program import build_program
from discovery.estimation.fit import Fit
from discovery.mechanics.systems import system_base
from discovery.report.doubt_sentences import caution_sentence
from discovery.rigs.rig_system import ready_made
from discovery.simulation.kernel.compile import numpy_derivative

LENGTH, GRAVITY, LOSS, DRAG, NOISE = 0.8, 9.81, 0.02, 0.05, 4e-4  # SI units, loss and drag over the inertia
RIG = """
name = "bob on film"
[system]
like = "filmed_pendulum"

[columns]
time = { name = "t_s", unit = "s" }
output = { name = "x_mm", unit = "mm" }
"""


def film(path: Path, angle: float, seed: int) -> Path:
    """Write what a camera reads of a bob that is let go, with a drag that the declaration does not know."""

    def slope(_: float, state: list[float]) -> tuple[float, float]:
        a, w = state
        return w, -GRAVITY / LENGTH * np.sin(a) - LOSS * w - DRAG * abs(w) * w

    time = np.arange(900) / 60
    swing = solve_ivp(slope, (0.0, 15.0), (angle, 0.3), "DOP853", time, rtol=1e-10, atol=1e-12).y[0]
    read = LENGTH * np.sin(swing) + np.random.default_rng(seed).normal(0.0, NOISE, time.size)
    np.savetxt(path, np.column_stack([time, 1e3 * read]), "%.5f", ",", header="t_s,x_mm", comments="")
    return path


def test_it_moves_as_in_textbooks() -> None:
    base = system_base(ready_made()["filmed_pendulum"])
    program = build_program(base.name, ())
    values = {x.name: value for x, value in base.guess.items()}
    slopes = numpy_derivative(program)(0.0, (0.0, 0.0, 0.0), [0.7, -0.4], [values[p] for p in program.parameters])
    length, loss = values["length_to_bob"], values["loss"]
    assert slopes[1] == pytest.approx(-GRAVITY / length * np.sin(0.7) + loss * 0.4 / length**2)


def test_a_free_motion_in_metres_is_drafted_with_the_way_to_declare_it(tmp_path: Path) -> None:
    path = film(tmp_path / "one.csv", 0.7, 1)
    text = draft([path], tmp_path)
    assert tomllib.loads(text)["kind"] == "oscillator"
    assert '[system] with like = "filmed_pendulum"' in text
    (turned := tmp_path / "b.csv").write_text(path.read_text().replace("x_mm", "angle_mrad"))
    assert "filmed_pendulum" not in draft([turned], tmp_path)
    (rate := tmp_path / "c.csv").write_text(path.read_text().replace("x_mm", "gyro_mrad_s"))
    assert '# potential = "-stiffness*cos(angle)"   # of a pendulum, instead' in draft([rate], tmp_path)


@pytest.mark.parametrize(("unit", "sign", "doubted"), [("m", -1.0, True), ("m", 1.0, False), ("rad", -1.0, False)])
def test_a_spring_that_gives_way_in_metres_is_doubted(unit: str, sign: float, doubted: bool, tmp_path: Path) -> None:
    path = film(tmp_path / "a.csv", 0.7, 1)
    rig = (
        RIG.replace("[system]\nlike", "kind").replace('"filmed_pendulum"', '"oscillator"').replace("x_mm", f"x_m{unit}")
    )
    (tmp_path / "rig.toml").write_text(rig.replace('unit = "mm"', f'unit = "m{unit}"'), encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("x_mm", f"x_m{unit}"), encoding="utf-8")
    declared = declared_model(data := load_dataset(tmp_path / "rig.toml", [path]))
    fitted = fit_model(declared.with_effect("cubic_stiffness"), data)
    values = {**fitted.values, "beta": sign * abs(fitted.values["beta"])}
    found = seen_aside(cast(Fit, SimpleNamespace(problem=fitted.problem, values=values)), ["cubic_stiffness"])
    assert (found is not None) == doubted
    if found is not None:
        assert (found.code, found.about, found.effect) == ("seen_aside", "beta", "cubic_stiffness")
        assert caution_sentence(found.summary()).startswith("cubic stiffness gives way the farther it is bent")


@pytest.mark.slow
def test_its_drag_is_found(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    one, two, held = (film(tmp_path / f"{i}.csv", angle, i) for i, angle in enumerate((0.7, 0.45, -0.6)))
    result = close_loop(load_dataset(tmp_path / "rig.toml", [one, two], [held]))
    assert (result.verdict, result.added) == ("explained", ("quadratic_drag_at_pivot",))
    values, sds = result.after.values, result.after.sd
    for name, true in {"c_2_pivot": DRAG * LENGTH**2, "length_to_bob": LENGTH, "loss": LOSS * LENGTH**2}.items():
        assert values[name] == pytest.approx(true, abs=4 * sds[name] + 1e-3 * true)
    assert result.summary()["errors"]["after"]["holdout"]["rms"] < 1.1 * NOISE
