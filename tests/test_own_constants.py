"""Constants of a declared system that are others in one recording: another mass on the same spring."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.equations.model import Model
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.estimation.predict import predict
from discovery.foundation.errors import InputError
from discovery.recordings.dataset import Dataset, load_dataset, read_to_predict
from discovery.recordings.experiment import Experiment
from discovery.rigs.rig_file import read_rig

STIFFNESS, LOSS, NOISE = 20.0, 0.1, 2e-4
MASSES = (0.2, 0.35, 0.8)
RIG = """name = "masses on a spring"
[system]
coordinates = {{ x = "m" }}
kinetic = "mass*dot(x)^2/2"
potential = "stiffness*x^2/2"
dissipation = "loss*dot(x)^2/2"
output = "x"
places = {{ body = "x" }}
[system.constants]
mass = {{ value = 200.0, unit = "g" }}
stiffness = {{ guess = 15.0, unit = "N / m" }}
loss = {{ guess = 0.2, unit = "N s / m" }}
weight = {{ value = 1.0, sd = 0.1, unit = "N" }}
[columns]
time = {{ name = "t_s", unit = "s" }}
output = {{ name = "x_m", unit = "m", noise = 2e-4 }}
[records]
train = [{{ file = "r0.csv" }}, {{ file = "r1.csv"{one} }}]
holdout = [{{ file = "r2.csv"{two} }}]
"""
OWN = {"one": ", constants = { mass = 350 }", "two": ", constants = { mass = 800 }"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Releases of three masses, by another integrator."""
    path, rng = tmp_path_factory.mktemp("masses"), np.random.default_rng(4)
    time = np.arange(0.0, 6.0, 0.02)
    for i, mass in enumerate(MASSES):

        def motion(_: float, state: np.ndarray, mass: float = mass) -> list[float]:
            return [state[1], -(STIFFNESS * state[0] + LOSS * state[1]) / mass]

        read = solve_ivp(motion, (0.0, 6.0), [0.05, 0.0], t_eval=time, rtol=1e-9, atol=1e-11, method="LSODA").y[0]
        table = np.column_stack([time, read + NOISE * rng.standard_normal(time.size)])
        np.savetxt(path / f"r{i}.csv", table, delimiter=",", header="t_s,x_m", comments="")
    return path


def dataset(folder: Path, **own: str) -> Dataset:
    plain = "".join(line for line in RIG.splitlines(keepends=True) if not line.startswith("weight"))
    (folder / "rig.toml").write_text(plain.format(**own))
    return load_dataset(folder / "rig.toml")


def test_one_spring_explains_three_masses_only_where_each_has_its_own(folder: Path) -> None:
    data = dataset(folder, **OWN)
    found = fit(declared_model(data), data)
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.15)
    for name, true in (("stiffness", STIFFNESS), ("loss", LOSS)):
        assert abs(found.values[name] - true) < 4 * found.sd[name]
    alike = dataset(folder, one="", two="")
    assert fit(declared_model(alike), alike).reduced_chi2 > 100


def test_a_recording_moves_as_a_model_with_its_constant_does(folder: Path) -> None:
    data = dataset(folder, **OWN)
    found = fit(declared_model(data), data)
    (_, second) = found.problem.predict(found.minimum.x)
    model = found.problem.model
    heavy = Model(model.base, model.effects, {**model.known, "mass": 0.35})
    plain = dataset(folder, one="", two="")
    alone = fit(heavy, [plain.train[1]], start={n: found.values[n] for n in ("stiffness", "loss")})
    x = alone.problem.start({n: v for n, v in found.values.items() if "[r0]" not in n})
    np.testing.assert_allclose(second, alone.problem.predict(x)[0], atol=1e-7)


def test_it_is_told_and_kept_in_parts_and_other_files(folder: Path) -> None:
    data = dataset(folder, **OWN)
    (flag,) = (f for f in data.train[1].recording.flags if f.code == "own_constant")
    assert "mass is 0.35 kg" in flag.sentence
    assert data.train[0].recording.constants == ()
    assert data.train[1].recording.part(slice(10, 50)).constants == (("mass", pytest.approx(0.35)),)
    named = load_dataset(folder / "rig.toml", [folder / "r1.csv"], [folder / "r2.csv"])
    assert [dict(e.recording.constants)["mass"] for _, e in named.everything] == pytest.approx([0.35, 0.8])


def test_a_listed_file_is_predicted_with_its_constant(folder: Path) -> None:
    data = dataset(folder, **OWN)
    found = fit(declared_model(data), data)
    listed, plain = (
        predict(found, Experiment(replace(data.holdout[0].recording, constants=constants), None, data.rig), (0.05, 0.0))
        for constants in (read_to_predict(folder / "r2.csv", data.rig).constants, ())
    )
    measured = data.holdout[0].recording.output
    assert np.sqrt(np.mean((listed[0] - measured) ** 2)) < 2 * NOISE
    assert np.sqrt(np.mean((plain[0] - measured) ** 2)) > 50 * NOISE


@pytest.mark.parametrize("name", ["stiffness", "weight", "length"])
def test_a_constant_that_no_value_states_is_refused(folder: Path, name: str) -> None:
    (folder / "wrong.toml").write_text(RIG.format(one=f", constants = {{ {name} = 1.0 }}", two=""))
    with pytest.raises(InputError, match=rf"wrong.toml, line \d+.*'{name}'.*those are mass"):
        read_rig(folder / "wrong.toml")


def test_another_kind_of_system_has_none(folder: Path) -> None:
    text = RIG.format(one=OWN["one"], two="")
    head, tail = text.split("[system]")[0], text[text.index("[columns]") :]
    (folder / "plain.toml").write_text(f'{head}kind = "oscillator"\n[model]\neffects = ["linear_stiffness"]\n{tail}')
    with pytest.raises(InputError, match="there is none"):
        read_rig(folder / "plain.toml")
