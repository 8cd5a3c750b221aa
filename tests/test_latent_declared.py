"""The missing force of a declared system: where the only coordinate is read as it is, and nowhere else."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.declarations.system import Constant, SystemDeclaration
from discovery.diagnosis.missing_force import LEAST_GAIN
from discovery.equations.model import Model
from discovery.estimation.fit import Fit, fit
from discovery.mechanics import get_base
from discovery.mechanics.systems import declare
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn
from discovery.runs.stages import unexplained

TIME, NOISE, MASS, FRICTION = np.linspace(0.0, 20.0, 801), 1e-3, 2.0, 0.05
RIG = {"columns": Columns(TimeColumn(), None, OutputColumn("y", "m"))}


def spring(coordinates: str = "x", output: str = "x", place: str = "x") -> SystemDeclaration:
    """Return a body on a spring, read and touched as stated."""
    return SystemDeclaration(
        name="body on a spring",
        coordinates=dict.fromkeys(coordinates.split(), "m"),
        constants={
            "mass": Constant("kg", MASS),
            "stiffness": Constant("N / m", 20.0, free=True),
            "loss": Constant("N s / m", 0.2, free=True),
            "reach": Constant("m", 1.0),
        },
        kinetic=" + ".join(f"mass*dot({q})^2/2" for q in coordinates.split()),
        potential=" + ".join(f"stiffness*{q}^2/2" for q in coordinates.split()),
        dissipation=" + ".join(f"loss*dot({q})^2/2" for q in coordinates.split()),
        output=output,
        places={"body": place},
    )


def force(t):
    """A force per unit inertia that no effect of the model makes."""
    return 0.06 * np.exp(-(((t - 9.0) / 1.2) ** 2))


@cache
def swing(factor: int) -> Fit:
    """Return a fit of the true law to a motion that a force, unknown to it, disturbs, read so many times as large."""

    def slopes(t, y):
        return [y[1], force(t) - 0.08 * y[1] - 9.0 * y[0] - FRICTION / MASS * y[1] / np.hypot(y[1], 1e-3)]

    solved = solve_ivp(slopes, (0.0, 20.0), (0.25, 0.0), method="LSODA", t_eval=TIME, rtol=1e-8, atol=1e-10)
    read = factor * solved.y[0] + NOISE * np.random.default_rng(7).standard_normal(TIME.size)
    recording = Recording("r", TIME, None, read[:, None], ("output",), ("m",), np.array([NOISE]), sha256="", source="")
    known = {"mass": MASS, "stiffness": 9.0 * MASS, "loss": 0.08 * MASS, "f_c_body": FRICTION / factor}
    known["v_c_body"] = 1e-3 * factor
    system = spring("x", f"{factor}*x", f"{factor}*x")
    model = Model(declare(system), ("coulomb_friction_at_body",), known)
    return fit(model, [Experiment(recording, None, Rig("o", "oscillator", system=system, **RIG))])


def ended(fitted: Any) -> Any:
    return SimpleNamespace(complete=False, impossible=False, after=fitted)


@pytest.mark.parametrize("factor", [1, 2])
def test_a_force_on_the_only_coordinate_is_recovered(factor: int) -> None:
    told: list[str] = []
    dataset: Any = SimpleNamespace(holdout=())
    found = unexplained(ended(swing(factor)), dataset, progress=told.append)
    assert told == ["reconstructing the missing force"]
    assert found is not None
    assert found.summary()["unit"] == "m s^-2"
    (latent,) = found.forces
    wanted = factor * force(latent.time)
    assert latent.gain > LEAST_GAIN
    assert np.corrcoef(latent.mean, wanted)[0, 1] > 0.9
    assert latent.mean[np.argmax(wanted)] == pytest.approx(wanted.max(), rel=0.15)
    assert np.mean(np.abs(latent.mean - wanted) < 1.645 * latent.sd) > 0.75


@pytest.mark.parametrize(
    ("stated", "read"),
    [
        (("x", "x", "x"), True),
        (("x", "2*x", "2*x"), True),
        (("x", "dot(x)", "x"), False),
        (("x", "x", "2*x"), False),
        (("x", "reach*sin(x/reach)", "reach*sin(x/reach)"), False),
        (("x z", "x", "x"), False),
    ],
)
def test_where_the_only_coordinate_is_not_read_as_it_is_that_is_why(
    stated: tuple[str, str, str], *, read: bool
) -> None:
    mechanics = get_base(declare(spring(*stated)))
    assert mechanics.reads_pushed is read
    if not read:
        told: list[str] = []
        fitted, dataset = SimpleNamespace(model=SimpleNamespace(mechanics=mechanics)), SimpleNamespace(holdout=())
        assert unexplained(ended(fitted), dataset, progress=told.append) is None  # type: ignore[arg-type]
        assert "where the output is itself the coordinate that a force moves" in told[0]
