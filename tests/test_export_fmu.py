"""The exported functional mock-up unit in a simulator of FMUs: it gives what the compiled kernel gives."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from test_export import BASES, DRIVE, FOUR, STEP, TIME, everything, module, some_values, with_stiffness
from test_export_c import held_out

from discovery.export import FittedModel, to_fmu, to_numpy
from discovery.foundation.errors import InputError
from discovery.simulation.simulate import Simulator

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


def written(found: FittedModel, folder: Path) -> Path:
    path = folder / "model.fmu"
    path.write_bytes(to_fmu(found))
    return path


def driven(
    path: Path, names: tuple[str, ...], time: np.ndarray, recorded: np.ndarray, change: np.ndarray, **start: float
) -> np.ndarray:
    """Return the outputs at the given times, of an input of shape (inputs, m) and its derivative over each step."""
    read = fmpy.read_model_description(str(path))
    places = {v.name: v.valueReference for v in read.modelVariables}
    outputs = [v.valueReference for v in read.modelVariables if v.causality == "output"]
    given = [places[n] for n in names]
    fmu = fmpy.instantiate_fmu(fmpy.extract(str(path), str(path.with_suffix(""))), read, fmi_type="CoSimulation")
    fmu.setupExperiment(startTime=time[0])
    fmu.enterInitializationMode()
    fmu.setReal([places[n] for n in start], list(start.values()))
    fmu.setReal(given, list(recorded[:, 0]))
    fmu.exitInitializationMode()
    found = [fmu.getReal(outputs)]
    for k in range(time.size - 1):
        fmu.setReal(given, list(recorded[:, k]))
        fmu.setRealInputDerivatives(given, [1] * len(given), list(change[:, k]))
        fmu.doStep(time[k], time[k + 1] - time[k])
        found.append(fmu.getReal(outputs))
    fmu.terminate()
    fmu.freeInstance()
    return np.transpose(found)


@pytest.mark.parametrize("base", [b if b in FOUR else pytest.param(b, marks=pytest.mark.slow) for b in BASES])
def test_the_description_is_valid(base: str, tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    model, values, _ = everything(base)
    assert validate_fmu(str(written(FittedModel(model, values), tmp_path))) == []


@pytest.mark.parametrize(
    ("base", "given", "units"),
    [
        ("reduced", "", ["rad", "rad s^-1", "rad s^-2", "m", "m"]),
        ("oscillator", "N", ["N", "m"]),
        ("base_excited", "m", ["m", "m s^-1", "m s^-2", "m"]),
        ("oscillator", "", [None, "m"]),
    ],
)
def test_inputs_and_outputs_have_units(base: str, given: str, units: list[str | None], tmp_path: Path) -> None:
    model = with_stiffness(base)
    found = FittedModel(model, some_values(model), coordinate="" if base == "reduced" else "m", given=given)
    read = fmpy.read_model_description(str(written(found, tmp_path)))
    assert [v.unit for v in read.modelVariables if v.causality in {"input", "output"}] == units


@pytest.mark.parametrize("tau", [pytest.param(0.0, marks=pytest.mark.slow), 0.0127])
def test_a_held_out_recording_is_followed(tau: float, tmp_path: Path) -> None:
    """25 s in steps of a millisecond, shorter at kinks: within 1e-6 of the kernel, relative to the largest reading.

    At integration steps of a millisecond, which differ, sharp friction makes both solvers wrong by 3e-6.
    """
    experiment, model, values = held_out(tau)
    assert experiment.drive is not None
    record = experiment.recording.time
    even = np.linspace(record[0], record[-1], 1 + round((record[-1] - record[0]) / 1e-3))
    joints = np.union1d(experiment.drive.kinks, experiment.drive.breakpoints)
    time = np.union1d(even, joints[(joints > record[0]) & (joints < record[-1])])
    time = time[np.diff(time, prepend=-1.0) > 1e-7]
    simulator = Simulator(model.base, model.effects, time, experiment.drive, step=2e-4)
    parameters = np.array([[values[n]] for n in simulator.names])
    expected = simulator(parameters, np.array([0.05]), np.array([-0.1]))[:, :, 0].T
    path = written(FittedModel(model, values, step=2e-4), tmp_path)
    motor = experiment.drive.evaluate(time)
    change = (experiment.drive.evaluate(time[1:], side="left") - motor[:, :-1]) / np.diff(time)
    names = ("theta_m", "theta_m_dot", "theta_m_ddot")
    far = 1e-6 * np.abs(expected).max()
    got = driven(path, names, time, motor, change, deflection_0=0.05, rate_0=-0.1)
    assert np.abs(got - expected).max() < far


def test_the_simulators_own_loop_runs_it(tmp_path: Path) -> None:
    """It holds the acceleration within a step, which is what a motor with constant acceleration does."""
    model = with_stiffness("reduced", "viscous_damping", "sensor_delay")
    values = some_values(model)
    time = np.linspace(0.0, 1.0, 501)
    motor = np.array([1.5 * time**2, 3.0 * time, np.full_like(time, 3.0)])
    expected = module(to_numpy(model, values))["simulate"](time, *motor, deflection=0.1, step=STEP)
    table = np.rec.fromarrays([time, *motor], names=["time", "theta_m", "theta_m_dot", "theta_m_ddot"])
    path = written(FittedModel(model, values, step=STEP), tmp_path)
    found = fmpy.simulate_fmu(
        str(path), stop_time=1.0, output_interval=0.002, input=table, step_size=0.002,
        start_values={"deflection_0": 0.1}, output=["tip_x", "tip_y"],
    )  # fmt: skip
    np.testing.assert_allclose([found["tip_x"], found["tip_y"]], expected, rtol=0, atol=1e-9)


def test_a_force_is_straight_between_communication_points(tmp_path: Path) -> None:
    model = with_stiffness("oscillator", "viscous_damping", "coulomb_friction", "sensor_delay")
    values = {**some_values(model), "tau": 0.011}
    u = 4.0 * DRIVE.evaluate(TIME)[0]
    expected = module(to_numpy(model, values))["simulate"](TIME, u, deflection=0.2, step=STEP)
    path = written(FittedModel(model, values, step=STEP), tmp_path)
    change = np.diff(u, append=u[-1:])[None] / np.diff(TIME)[0]
    got = driven(path, ("input",), TIME, u[None], change, deflection_0=0.2)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)


def test_parameters_can_be_set_and_states_kept(tmp_path: Path) -> None:
    model = with_stiffness("oscillator")
    path = written(FittedModel(model, {"alpha": 4.0, "g": 1.0}, step=0.002), tmp_path)
    read = fmpy.read_model_description(str(path))
    places = {v.name: v.valueReference for v in read.modelVariables}
    folder = fmpy.extract(str(path), unzipdir=str(tmp_path / "fmu"))
    fmu = fmpy.instantiate_fmu(folder, read, fmi_type="CoSimulation")
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.setReal([places["alpha"], places["deflection_0"]], [9.0, 0.2])
    fmu.exitInitializationMode()
    output = [places["output"]]
    assert fmu.getReal(output) == [0.2]
    fmu.doStep(0.0, 0.5)
    assert fmu.getReal(output)[0] == pytest.approx(0.2 * np.cos(1.5), abs=1e-9)
    kept = fmu.getFMUstate()
    fmu.doStep(0.5, 0.5)
    later = fmu.getReal(output)
    assert later[0] == pytest.approx(0.2 * np.cos(3.0), abs=1e-9)
    again = fmu.deSerializeFMUstate(fmu.serializeFMUstate(kept))
    fmu.setFMUstate(again)
    fmu.doStep(0.5, 0.5)
    assert fmu.getReal(output) == later
    with pytest.raises(Exception, match="fmi2SetReal failed"):
        fmu.setReal([places["alpha"]], [1.0])
    with pytest.raises(Exception, match="fmi2DoStep failed"):
        fmu.doStep(1.0, 0.0)
    fmu.freeFMUstate(kept)
    fmu.freeFMUstate(again)
    fmu.terminate()
    fmu.freeInstance()


def test_the_sources_compile_alone_without_a_warning(tmp_path: Path) -> None:
    model = with_stiffness("reduced", "sensor_delay")
    with zipfile.ZipFile(written(FittedModel(model, some_values(model)), tmp_path)) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    assert [n for n in names if n.startswith("binaries/")] or sys.platform != "linux"
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror"]
    command = ["cc", *flags, "-shared", "-fPIC", "model.c", "fmi2.c", "-lm", "-o", "model.so"]
    subprocess.run(command, cwd=tmp_path / "sources", check=True)


def test_the_same_model_is_the_same_file_and_any_name_is_text() -> None:
    model = with_stiffness("oscillator")
    name = '"/><x a="\0\n]]>&lt;\u202e*/'
    found = FittedModel(model, some_values(model), provenance={"rig": {"name": name, "sha256": "0" * 64}})
    content = to_fmu(found)
    assert content == to_fmu(found)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    assert '"/><x a=" ]]>&lt; */' in (root.get("description") or "")
    assert {e.tag for e in root.iter()} & {"x"} == set()


def test_without_a_compiler_the_sources_are_left(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    model = with_stiffness("oscillator")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with zipfile.ZipFile(io.BytesIO(to_fmu(model, some_values(model)))) as archive:
        assert {n.split("/")[0] for n in archive.namelist()} == {"modelDescription.xml", "sources"}
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho no >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda name: str(broken))
    with pytest.raises(InputError, match=r"cannot compile the model \(no\)"):
        to_fmu(model, some_values(model))
