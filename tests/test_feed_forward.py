"""Tables of a feed-forward: the commanded body moves as wanted."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from test_cli import call
from test_export import module, some_values, with_stiffness

from discovery.equations.model import Model
from discovery.export import FittedModel, feed_forward, to_numpy
from discovery.export.feed_forward import feed_forward_c, feed_forward_csv
from discovery.foundation.errors import InputError

FRICTION = ("viscous_damping", "coulomb_friction")
VALUES = {"alpha": 4.0, "g": 2.0, "xi": 0.3, "f_c": 0.5, "v_c": 1e-3}
MODEL = Model("oscillator", ("linear_stiffness", *FRICTION))
ENDS = {"largest_rate": 2.0, "largest_position": 1.0}


def wanted(time: np.ndarray) -> np.ndarray:
    return np.array([0.4 * np.sin(3 * time), 1.2 * np.cos(3 * time), -3.6 * np.sin(3 * time)])


def test_a_commanded_body_follows() -> None:
    """Without the friction in the command it does not."""
    found = feed_forward(MODEL, VALUES, **ENDS)
    time = np.linspace(0.0, 4.0, 8001)
    q, v, a = wanted(time)
    base = found.offset + found.inertia * a + np.interp(q, found.position, found.spring)
    simulate = module(to_numpy(MODEL, VALUES))["simulate"]
    away = {}
    for told, command in (("all", base + np.interp(v, found.rate, found.friction)), ("no friction", base)):
        away[told] = np.abs(simulate(time, command, deflection=q[0], rate=v[0], step=5e-4)[0] - q).max()
    assert away["all"] < 1e-3 < 0.05 < away["no friction"]
    assert found.inertia == pytest.approx(0.5)
    assert found.warnings == ()


@pytest.mark.parametrize(("base", "told"), [("servo", 1 / 2.0), ("inverse_dynamics", 3.0), ("accelerometer", 1 / 2.0)])
def test_the_laws_are_in_units_of_the_command(base: str, told: float) -> None:
    """A force recorded is that force: m_0 (xi v + f_c sign v); a command is it over its gain."""
    model = Model(base, FRICTION)
    values = {**some_values(model), **{n: VALUES[n] for n in ("xi", "f_c", "v_c")}, "g": 2.0, "m": 7.0, "m_0": 3.0}
    found = feed_forward(model, {n: values[n] for n in model.parameters}, **ENDS)
    law = told * (0.3 * found.rate + 0.5 * found.rate / np.sqrt(found.rate**2 + 1e-6))
    np.testing.assert_allclose(found.friction, law, rtol=1e-9, atol=1e-12)
    assert found.inertia == pytest.approx(7.0 if base == "inverse_dynamics" else 0.5)
    np.testing.assert_allclose(found.spring, 0.0, atol=1e-12)


def test_standard_deviations_are_those_of_the_parameters() -> None:
    fitted = FittedModel(MODEL, VALUES, ("xi", "f_c"), np.diag([0.01**2, 0.02**2]))
    found = feed_forward(fitted, **ENDS)
    fast = found.rate == 2.0
    np.testing.assert_allclose(found.friction_sd[fast], np.hypot(2.0 * 0.01, 0.02) / 2.0, rtol=1e-4)
    np.testing.assert_allclose(found.spring_sd, 0.0, atol=1e-12)


def test_what_the_tables_leave_out_is_told() -> None:
    model = Model("oscillator", ("linear_stiffness", "viscous_damping", "amplitude_dependent_damping", "hysteresis"))
    found = feed_forward(model, some_values(model), **ENDS)
    assert "hysteresis depends on the motion before" in found.warnings[0]
    assert "rate and position together" in found.warnings[1]


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (with_stiffness("reduced", "viscous_damping"), {}, "a command pushes"),
        (with_stiffness("oscillator"), {}, "names no friction"),
        (MODEL, {"largest_rate": 0.0}, "both positive"),
        (MODEL, {"largest_position": np.nan}, "both positive"),
    ],
)
def test_where_there_is_nothing_to_tell_it_is_refused(model: Model, options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        feed_forward(model, some_values(model), **{**ENDS, **options})
    with pytest.raises(InputError, match="gain g is zero"):
        feed_forward(MODEL, {**VALUES, "g": 0.0}, **ENDS)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")
def test_the_c_table_is_the_csv_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    provenance = {"discovery": "1", "rig": {"name": "*/ int x; /*\n\\", "sha256": "0" * 64}, "data": []}
    fitted = FittedModel(MODEL, VALUES, ("xi",), np.array([[1e-4]]), provenance=provenance)
    (tmp_path / "loop.json").write_text(json.dumps({"models": {"after": fitted.to_dict()}}))
    said = call(capsys, "feed-forward", tmp_path, "--out", tmp_path / "out", "--rate", 2, "--position", 1, "--json")
    assert said.status == 0, said.err
    found = feed_forward(fitted, **ENDS)
    printed = json.loads(said.out)
    assert printed["friction"] == found.friction.tolist()
    assert printed["files"] == [str(tmp_path / "out" / f"feed_forward.{end}") for end in ("csv", "h")]
    assert (tmp_path / "out" / "feed_forward.csv").read_text() == feed_forward_csv(found)
    assert (tmp_path / "out" / "feed_forward.h").read_text() == feed_forward_c(found, fitted)
    rows = [r.split(",") for r in feed_forward_csv(found).splitlines()[1:]]
    table = np.array([[float(x) for x in r[1:]] for r in rows if r[0] == "rate"])
    main = tmp_path / "main.c"
    main.write_text(
        '#include <stdio.h>\n#include "out/feed_forward.h"\n'
        'int main(void) { double q, v, a; while (scanf("%lf %lf %lf", &q, &v, &a) == 3) '
        'printf("%.17g\\n", feed_forward(q, v, a)); return 0; }\n'
    )
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["gcc", *flags, "main.c", "-o", "main"], cwd=tmp_path, check=True)
    points = np.random.default_rng(1).uniform(-1.2, 1.2, (50, 3)) * [1, 2, 5]
    asked = "\n".join(" ".join(map(repr, p)) for p in points.tolist())
    told = subprocess.run([tmp_path / "main"], input=asked, text=True, capture_output=True, check=True).stdout
    q, v, a = points.T
    expected = found.inertia * a + np.interp(v, table[:, 0], table[:, 1]) + np.interp(q, found.position, found.spring)
    np.testing.assert_allclose(np.array(told.split(), float), expected, rtol=1e-12, atol=1e-12)
