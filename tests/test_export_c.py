"""Exported C, compiled: it computes what the compiled kernel computes, without a warning."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from c_model import CModel
from test_export import (
    BASES,
    DRIVE,
    ROOT,
    STEP,
    TIME,
    everything,
    kernel,
    module,
    some_values,
    with_stiffness,
)

from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.export import FittedModel, export_model, to_c, to_numpy
from discovery.foundation.errors import InputError
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import read_recording
from discovery.rigs.rig_file import read_rig
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator

#: To compile all effects of an arm with a rod takes long; the arm of `held_out` below has one, too.
COMPILED = [pytest.param(b, marks=pytest.mark.slow) if b in ("reduced", "elastica") else b for b in BASES]

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("c")


@pytest.fixture(scope="module")
def whole(folder: Path):
    """Return a base with all of its effects, compiled once."""

    @cache
    def of(base: str) -> tuple[Model, dict[str, float], CModel]:
        model, values, _ = everything(base)
        return model, values, CModel(*to_c(model, values), folder / base)

    return of


def inputs(model: Model, time: np.ndarray) -> np.ndarray:
    recorded = DRIVE.evaluate(time)
    return recorded if model.mechanics.input_moves else recorded[:1]


@pytest.mark.parametrize("base", COMPILED)
def test_slopes_are_those_of_the_program(base: str, whole) -> None:
    model, values, found = whole(base)
    program = build_program(model.base, model.effects)
    rng, slopes = np.random.default_rng(1), numpy_derivative(program)
    for _ in range(5):
        state, motor = rng.uniform(-0.4, 0.4, len(program.states)), rng.uniform(-1, 1, 3)
        expected = slopes(0.7, motor, state, [values[n] for n in program.parameters])
        np.testing.assert_allclose(found.derivative(0.7, state, motor), expected, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("base", [pytest.param("reduced", marks=pytest.mark.slow), "oscillator"])
def test_the_c_is_called_from_python_as_the_numpy_file_is(base: str, tmp_path: Path) -> None:
    model, values, namespace = everything(base)
    export_model(FittedModel(model, values), tmp_path, ["c"])
    specification = importlib.util.spec_from_file_location("model_c", tmp_path / "model_c.py")
    assert specification is not None
    assert specification.loader is not None
    found = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(found)
    time = TIME[::3]
    driven = inputs(model, time)
    for parameter, value in found.PARAMETERS.items():
        assert value == pytest.approx(values[parameter], rel=1e-15)
    got = found.simulate(time, *driven, deflection=0.2, rate=-0.3, step=STEP)
    _, expected = CModel(*to_c(model, values), tmp_path / "other").simulate(time, driven, 0.2, -0.3, STEP)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-10)
    assert got.shape == namespace["simulate"](time, *driven, deflection=0.2, rate=-0.3, step=STEP).shape
    name = next(iter(found.PARAMETERS))
    other = found.simulate(time, *driven, deflection=0.2, parameters={**found.PARAMETERS, name: 0.5}, step=STEP)
    assert not np.allclose(other, got)
    with pytest.raises(ValueError, match="never decrease"):
        found.simulate(time[::-1], *driven)
    with pytest.raises(ValueError, match="inputs"):
        found.simulate(time, *driven, driven[0])
    # Neither is taken for the Python file that may lie beside it.
    assert importlib.machinery.PathFinder.find_spec("model", [str(tmp_path)]) is None


@pytest.mark.parametrize("base", COMPILED)
def test_the_simulator_is_the_numpy_files(base: str, whole) -> None:
    """With all effects, those with memory, a late and drifting instrument and friction included."""
    model, _, found = whole(base)
    time = TIME[::3]
    status, got = found.simulate(time, inputs(model, time), 0.2, -0.3, STEP)
    assert status == 0
    simulate = everything(base)[2]["simulate"]
    expected = simulate(time, *inputs(model, time), deflection=0.2, rate=-0.3, step=STEP)
    late = everything(base)[2]["lateness"](time)
    inside = (time - late > time[0]) & (time - late < time[-1])
    # A reading of the acceleration asks for rates and memory between steps, and for the input.
    near = 1e-10 if model.mechanics.reads_state else 5e-6
    np.testing.assert_allclose(got[:, inside], expected[:, inside], rtol=1e-9, atol=near)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=2e-3)


def held_out(tau: float) -> tuple[Experiment, Model, dict[str, float]]:
    """Return a recording that no fit saw, and a model of the arm with memory, friction and a late camera."""
    rig = read_rig(ROOT / "datasets" / "arm" / "rig.toml")
    experiment = make_experiment(read_recording(ROOT / "datasets" / "arm" / "holdout_inside.csv", rig), rig)
    effects = (
        "viscous_damping", "cubic_stiffness", "coulomb_friction", "viscoelastic_relaxation", "hysteresis",
        "sensor_delay", "table_tilt",
    )  # fmt: skip
    model = with_stiffness("reduced", *effects)
    return experiment, model, {**some_values(model), "tau": tau}


@pytest.mark.parametrize("tau", [0.0, 0.0127, -0.02])
def test_a_held_out_recording_is_followed_step_by_step(tau: float, folder: Path) -> None:
    """On the steps of the kernel: 25 s of motion, within 1e-9 of the largest reading."""
    experiment, model, values = held_out(tau)
    simulator = Simulator(model.base, model.effects, experiment.recording.time, experiment.drive, step=0.002)
    parameters = np.array([[values[n]] for n in simulator.names])
    expected = simulator(parameters, np.array([0.05]), np.array([-0.1]))[:, :, 0]
    found = CModel(*to_c(FittedModel(model, values, step=0.002)), folder / f"tau{tau}")
    grid = simulator.grid
    found.start(grid.times[0], 0.05, -0.1, grid.drive[0, 0])
    got, due, ready = np.empty_like(expected), 0, grid.times + grid.steps
    for k, length in enumerate(grid.steps):
        found.step(length, *grid.drive[k])
        while due < grid.out_time.size and grid.out_time[due] - tau < ready[k]:
            status, got[due] = found.read(grid.out_time[due])
            assert status == 0
            due += 1
    for j in range(due, grid.out_time.size):
        got[j] = found.read(grid.out_time[j])[1]
    assert grid.times.size > 10_000
    assert np.abs(got - expected).max() < 1e-9 * np.abs(expected).max()


def test_the_integrator_is_of_order_four(folder: Path) -> None:
    model = with_stiffness("constant_radius", "cubic_stiffness")
    found = CModel(*to_c(model, some_values(model)), folder / "order")
    fine = found.simulate(TIME, inputs(model, TIME), 0.4, 0.0, 2.5e-4)[1]
    error = [np.abs(found.simulate(TIME, inputs(model, TIME), 0.4, 0.0, h)[1] - fine).max() for h in (0.004, 0.002)]
    assert error[0] / error[1] == pytest.approx(16, rel=0.1)


def test_a_jump_of_the_input_begins_anew(folder: Path) -> None:
    """Where a time is given twice the input jumps: as in the numpy file, and not as where it is smooth."""
    model = with_stiffness("oscillator", "viscous_damping")
    values = some_values(model)
    found = CModel(*to_c(model, values), folder / "jump")
    time = np.insert(TIME, 50, [0.1985, 0.1985])
    u = np.where(np.arange(time.size) <= 50, 0.0, 4.0)
    expected = module(to_numpy(model, values))["simulate"](time, u, deflection=0.1, step=STEP)
    np.testing.assert_allclose(found.simulate(time, u[None], 0.1, 0.0, STEP)[1], expected, rtol=0, atol=1e-12)


def test_a_free_decay_needs_no_input(folder: Path) -> None:
    model = with_stiffness("oscillator")
    found = CModel(*to_c(model, {"alpha": 9.0, "g": 0.0}), folder / "free")
    _, got = found.simulate(TIME, np.zeros((1, TIME.size)), 0.2, 0.0, 0.002)
    np.testing.assert_allclose(got[0], 0.2 * np.cos(3.0 * TIME), atol=1e-9)


def test_a_history_that_is_too_short_is_told(folder: Path) -> None:
    model = with_stiffness("oscillator", "sensor_delay")
    found = CModel(*to_c(model, {**some_values(model), "tau": 0.1}), folder / "late")
    u = np.zeros(1)
    found.start(0.0, 0.1, 0.0, u)
    for _ in range(3 * found.history):
        found.step(found.step_length / 3, u, u, u)
    now = found.history * found.step_length
    assert found.read(now)[0] == 1
    assert found.read(now + 0.1)[0] == 0
    # As many steps as the file's own are enough.
    found.start(0.0, 0.1, 0.0, u)
    for _ in range(3 * found.history):
        found.step(found.step_length, u, u, u)
    assert found.read(3 * found.history * found.step_length)[0] == 0


@pytest.mark.parametrize(
    ("time", "step"), [([0.0, 0.0], 0.1), ([0.0, 1.0, 0.5], 0.1), ([0.0, np.inf], 0.1), ([0.0, np.nan], 0.1),
                       ([0.0, 1.0], 0.0), ([0.0, 1.0], np.nan)],
)  # fmt: skip
def test_times_that_make_no_record_are_refused(time: list[float], step: float, whole) -> None:
    *_, found = whole("oscillator")
    assert found.simulate(np.array(time), np.zeros((1, len(time))), 0.1, 0.0, step)[0] == 2


def test_the_source_allocates_nothing_and_takes_a_name(folder: Path) -> None:
    model = with_stiffness("oscillator", "cubic_stiffness")
    header, source = to_c(model, some_values(model), "circuit")
    assert "MODEL" not in header + source
    assert not {"malloc", "calloc", "realloc", "alloca", "stdlib"} & set(source.replace("(", " ").split())
    (folder / "circuit.h").write_text(header)
    (folder / "circuit.c").write_text(source)
    (folder / "main.cpp").write_text('#include "circuit.h"\nint main() { return CIRCUIT_STATES - 2; }\n')
    subprocess.run(["gcc", "-std=c99", "-c", "circuit.c"], cwd=folder, check=True)
    subprocess.run(["g++", "-Wall", "-Werror", "main.cpp", "-o", "main"], cwd=folder, check=True)
    subprocess.run([folder / "main"], check=True)
    for wrong in ("", "Circuit", "a b", "1a", "../a"):
        with pytest.raises(InputError, match="no name in C"):
            to_c(model, some_values(model), wrong)


@pytest.mark.parametrize(
    "name", ["*/ int pwned = 1; /*", "a\n#include <pwned.h>\n", "\\", "??/\n", "*\\\n/ x", "@HEAD@\0"]
)
def test_no_name_leaves_the_comment(name: str, folder: Path) -> None:
    model = with_stiffness("oscillator")
    provenance = {
        "discovery": "1", "rig": {"name": name, "sha256": "0" * 64}, "data": [{"source": name, "sha256": "1" * 64}],
    }  # fmt: skip
    found = FittedModel(model, some_values(model), initial={name: (0.1, 0.0)}, provenance=provenance)
    header, source = to_c(found)
    plain = to_c(FittedModel(model, some_values(model)))
    place = folder / "name"
    # Whatever the name, the compiler sees the same program.
    assert [seen(t, place) for t in (header, source)] == [seen(t, place) for t in plain]


def seen(text: str, folder: Path) -> str:
    folder.mkdir(exist_ok=True)
    command = ["gcc", "-std=c99", "-trigraphs", "-Wcomment", "-Werror", "-fpreprocessed", "-dD", "-E", "-P", "-xc", "-"]
    return subprocess.run(command, input=text, text=True, capture_output=True, check=True, cwd=folder).stdout


def test_the_kernel_and_the_file_agree_on_a_smooth_drive(whole) -> None:
    model, values, found = whole("constant_radius")
    assert (
        np.abs(found.simulate(TIME, inputs(model, TIME), 0.2, -0.3, STEP)[1] - kernel(model, values, (0.2, -0.3))).max()
        < 1e-8
    )
