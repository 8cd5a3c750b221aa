"""Recordings: every format gives the same numbers, names convert units, gaps and irregular times are ordinary."""

from __future__ import annotations

import hashlib

import h5py
import numpy as np
import pandas as pd
import pytest
from discovery_datasets import registry
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from measured_data import needs
from scipy.io import savemat

from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write, read_table
from discovery.recordings.reading_noise import estimate_noise, noise_flags
from discovery.recordings.recording import read_recording
from discovery.recordings.rounding import resolution
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

ARM = Rig("arm", length=Quantity(1.0, 1e-3), position_noise=3e-4, angle_noise=7e-5)


def oscillator(**changes):
    columns = {
        "time": TimeColumn(None, "s", 50.0),
        "input": InputColumn("V1", "V", "band_limited"),
        "output": OutputColumn("V2", "mV", 2e-4),
    }
    return Rig("o", kind="oscillator", columns=Columns(**(columns | changes)))


def swing(n=200, step=0.01):
    time = step * np.arange(n)
    motor = 0.3 * np.clip(time - 0.3, 0.0, 0.5)
    tip = motor + 0.2 * np.sin(3.0 * time)
    return pd.DataFrame({"time_s": time, "motor_angle_rad": motor, "tip_x_m": np.cos(tip), "tip_y_m": np.sin(tip)})


def write(frame, path):
    match path.suffix:
        case ".parquet":
            frame.to_parquet(path)
        case ".mat":
            savemat(path, {name: frame[name].to_numpy() for name in frame})
        case ".h5":
            with h5py.File(path, "w") as file:
                for name in frame:
                    file[f"recording/{name}"] = frame[name].to_numpy()
        case ".tsv":
            frame.to_csv(path, sep="\t", index=False)
        case _:
            frame.to_csv(path, index=False)
    return path


def test_an_arm_whose_tip_does_not_follow_the_motor_is_told(tmp_path):
    good = swing()
    exchanged = good.rename(columns={"tip_x_m": "tip_y_m", "tip_y_m": "tip_x_m"})
    degrees = good.assign(motor_angle_rad=np.degrees(good["motor_angle_rad"]) / 4)
    notes = [read_recording(write(f, tmp_path / "a.csv"), ARM).notes for f in (good, exchanged, degrees)]
    assert [any("beside the motor" in note for note in each) for each in notes] == [False, True, True]


@pytest.mark.parametrize("suffix", [".csv", ".tsv", ".parquet", ".mat", ".h5"])
def test_formats(tmp_path, suffix):
    frame = swing()
    path = write(frame, tmp_path / f"swing{suffix}")
    recording = read_recording(path, ARM)
    np.testing.assert_array_equal(recording.time, frame["time_s"])
    np.testing.assert_array_equal(recording.input, frame["motor_angle_rad"])
    np.testing.assert_array_equal(recording.output, frame[["tip_x_m", "tip_y_m"]])
    assert recording.channels == ("tip_x", "tip_y")
    assert recording.units == ("m", "m")
    assert recording.name == "swing"
    assert recording.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    np.testing.assert_array_equal(recording.noise, [3e-4, 3e-4])
    assert not recording.noise_estimated


def test_matlab_7_3_is_hdf5_behind_a_header(tmp_path):
    path = tmp_path / "swing.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, column in swing().items():
            file[name] = column.to_numpy()[None, :]
    content = bytearray(path.read_bytes())
    content[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(content)
    np.testing.assert_array_equal(read_recording(path, ARM).time, swing()["time_s"])


def test_suffixes_convert(tmp_path):
    frame = swing()
    other = pd.DataFrame(
        {
            "time_ms": 1e3 * frame["time_s"],
            "motor_angle_deg": np.degrees(frame["motor_angle_rad"]),
            "tip_x_mm": 1e3 * frame["tip_x_m"],
            "tip_y_cm": 1e2 * frame["tip_y_m"],
            "temperature": 21.0,
        }
    )
    recording = read_recording(write(other, tmp_path / "other.csv"), ARM)
    np.testing.assert_allclose(recording.time, frame["time_s"], rtol=1e-12)
    np.testing.assert_allclose(recording.input, frame["motor_angle_rad"], rtol=1e-12)
    np.testing.assert_allclose(recording.output, frame[["tip_x_m", "tip_y_m"]], rtol=1e-12)


@pytest.mark.parametrize(
    ("column", "values", "channel", "unit", "noise"),
    [("tip_angle_rad", 0.2, "tip_angle", "rad", 1.5e-4), ("tip_deflection_mm", 200.0, "tip_deflection", "m", 3e-4)],
)
def test_other_outputs(tmp_path, column, values, channel, unit, noise):
    frame = swing()[["time_s", "motor_angle_rad"]].assign(**{column: lambda f: values * np.sin(3.0 * f["time_s"])})
    rig = Rig("arm", length=Quantity(2.0, 1e-3), position_noise=3e-4)
    recording = read_recording(write(frame, tmp_path / "r.csv"), rig)
    assert (recording.channels, recording.units) == ((channel,), (unit,))
    assert recording.output.shape == (200, 1)
    assert np.abs(recording.output).max() == pytest.approx(0.2, rel=1e-3)
    np.testing.assert_allclose(recording.noise, [noise])


def test_gaps_irregular_times_comments_and_blank_lines(tmp_path):
    frame = swing()
    frame["time_s"] += np.random.default_rng(1).uniform(-4e-3, 4e-3, len(frame))
    frame.loc[10:20, "tip_x_m"] = np.nan
    frame.loc[15, "tip_y_m"] = np.nan
    text = "# camera 7\n\n" + frame.to_csv(index=False).replace("\n", "\n\n", 1) + "# end\n"
    (tmp_path / "r.csv").write_text(text, encoding="utf-8-sig")
    recording = read_recording(tmp_path / "r.csv", ARM)
    np.testing.assert_array_equal(recording.time, frame["time_s"])
    assert np.isnan(recording.output[:, 0]).sum() == 11
    assert np.isnan(recording.output[15]).all()


def test_prediction_file_needs_no_output(tmp_path):
    path = write(swing()[["time_s", "motor_angle_rad"]], tmp_path / "drive.csv")
    recording = read_recording(path, ARM, with_output=False)
    assert recording.channels == ("tip_x", "tip_y")
    assert recording.output.shape == (200, 2)
    assert np.isnan(recording.output).all()
    assert not recording.noise_estimated
    with pytest.raises(InputError, match="has no output column: add tip_x_m and tip_y_m"):
        read_recording(path, ARM)


def test_prediction_file_may_have_any_output(tmp_path):
    path = write(swing().assign(tip_x_m="lost").drop(columns="tip_y_m"), tmp_path / "whole.csv")
    with pytest.raises(InputError, match="tip_x_m"):
        read_recording(path, ARM)
    recording = read_recording(path, ARM, with_output=False)
    assert recording.channels == ("tip_x", "tip_y")
    assert np.isnan(recording.output).all()


def test_oscillator_with_rate_slice_and_row_vectors(tmp_path):
    v1, v2 = np.random.default_rng(0).normal(size=(2, 1, 300))
    savemat(tmp_path / "s.mat", {"V1": v1, "V2": v2, "note": "text", "scalar": 3.0})
    recording = read_recording(tmp_path / "s.mat", oscillator(), samples=(100, 260))
    np.testing.assert_allclose(recording.time, np.arange(160) / 50.0)
    np.testing.assert_array_equal(recording.input, v1[0, 100:260])
    np.testing.assert_allclose(recording.output[:, 0], 1e-3 * v2[0, 100:260])
    assert (recording.channels, recording.units) == (("output",), ("V",))
    np.testing.assert_array_equal(recording.noise, [2e-4])
    assert recording.source.endswith("s.mat[100:260]")


def test_free_decay_has_no_input(tmp_path):
    frame = pd.DataFrame({"t": np.arange(100) * 20.0, "y": np.sin(np.arange(100) * 0.3)})
    rig = oscillator(time=TimeColumn("t", "ms", None), input=None, output=OutputColumn("y", "deg", None))
    recording = read_recording(write(frame, tmp_path / "f.csv"), rig)
    assert recording.input is None
    assert recording.time[-1] == pytest.approx(1.98)
    assert recording.units == ("rad",)
    assert recording.noise_estimated


def test_an_output_that_is_not_looked_at_tells_how_many_samples_there_are(tmp_path):
    rig = oscillator(input=None)
    savemat(tmp_path / "s.mat", {"V2": np.sin(0.3 * np.arange(300.0))})
    recording = read_recording(tmp_path / "s.mat", rig, with_output=False)
    np.testing.assert_array_equal(recording.time, read_recording(tmp_path / "s.mat", rig).time)
    assert recording.time.size == 300
    assert np.isnan(recording.output).all()


@given(st.integers(0, 2**32 - 1), st.floats(1e-6, 1e-2), st.integers(300, 2000))
@settings(max_examples=25, deadline=None)
def test_noise_is_estimated_beside_a_signal(seed, noise, n):
    time = 0.01 * np.arange(n)
    values = np.sin(4.0 * time) + (time > 1.0) + np.random.default_rng(seed).normal(0.0, noise, n)
    assert estimate_noise(values) == pytest.approx(noise, rel=0.35)


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_estimated_at_uneven_times(seed):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.004, 0.016, 1500))
    values = np.sin(11.0 * time) + rng.normal(0.0, 2e-3, time.size)
    values[rng.integers(0, time.size, 30)] = np.nan
    assert estimate_noise(values, time) == pytest.approx(2e-3, rel=0.1)
    assert estimate_noise(values) > 2.5e-3


@pytest.mark.parametrize("count", [40, 300, 3000])
def test_the_estimate_of_white_noise_does_not_change_for_the_calmer_fits(count):
    rng = np.random.default_rng(7)
    swings = 50.0 * np.sin(2 * np.pi * np.arange(count) / 60.0)
    found = [estimate_noise(swings + rng.standard_normal(count)) for _ in range(100)]
    # The smallest of seven estimates is a little small, the more so for few readings.
    assert np.mean(found) == pytest.approx({40: 0.89, 300: 0.97, 3000: 0.99}[count], abs=0.05)


def test_noise_that_alternates_is_not_estimated_above_its_scatter():
    rng = np.random.default_rng(8)
    step = 700.0 * (1.0 - np.exp(-np.arange(300) / 8.0))
    alternating = np.where(np.arange(300) % 2 == 0, 19.0, -19.0) * np.sign(rng.random(300) - 0.1)
    assert estimate_noise(step + alternating) == pytest.approx(19.0, rel=0.15)
    assert estimate_noise(step + rng.normal(0.0, 19.0, 300)) == pytest.approx(19.0, rel=0.15)


@pytest.mark.parametrize("rest", [0, 40, 200, 600])
@pytest.mark.parametrize("level", [0.0, 120.0])
def test_a_body_that_stands_still_says_nothing_of_the_noise_of_its_motion(rest, level):
    time = 0.01 * np.arange(400)
    moving = 700.0 * (1.0 - np.exp(-time)) + np.random.default_rng(9).normal(0.0, 5.0, 400)
    values = level + np.round(np.concatenate([np.zeros(rest), moving]), 1)
    assert estimate_noise(values) == pytest.approx(5.0, rel=0.2)
    assert noise_flags("rpm", "rpm", 0.01 * np.arange(values.size), values, 5.0) == []
    # Nor do empty cells between its readings.
    between = np.full(2 * values.size, np.nan)
    between[::2] = values
    assert estimate_noise(between) == estimate_noise(values)


def test_short_moves_between_rests_are_no_noise():
    """An encoder without noise, from one place to the next within twenty readings."""
    for seed in range(20):
        moves = np.random.default_rng(seed).uniform(5.0, 50.0, 6)
        shape = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 20))
        places = np.concatenate([[0.0], np.cumsum(moves)])
        way = [np.concatenate([a + b * shape, np.full(80, a + b)]) for a, b in zip(places, moves, strict=False)]
        assert estimate_noise(np.round(np.concatenate(way))) < 1.0


def test_readings_alike_within_a_step_belong_to_the_noise():
    swing = 20.3 * np.sin(0.002 * np.arange(4000.0))
    coarse = np.round(swing + np.random.default_rng(9).normal(0.0, 0.1, swing.size))
    assert estimate_noise(coarse) < 0.3


def test_noise_of_an_unstated_rig_is_marked(tmp_path):
    frame = swing(1000)
    frame[["tip_x_m", "tip_y_m"]] += np.random.default_rng(2).normal(0.0, 1e-3, (1000, 2))
    recording = read_recording(write(frame, tmp_path / "r.csv"), Rig("arm", length=Quantity(1.0, 1e-3)))
    assert recording.noise_estimated
    np.testing.assert_allclose(recording.noise, 1e-3, rtol=0.15)


def test_resolution_of_rounded_and_of_exact_readings():
    values = np.sin(0.05 * np.arange(500))
    assert resolution(np.round(values, 2)) == pytest.approx(0.01 / np.sqrt(12.0))
    assert resolution(values) < 1e-15


@given(
    st.lists(
        st.tuples(st.floats(1e-3, 0.2), st.floats(-1.0, 1.0), st.one_of(st.just(np.nan), st.floats(-0.9, 0.9))),
        min_size=120,
        max_size=140,
    )
)
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_csv_round_trip(tmp_path, rows):
    steps, motor, deflection = np.array(rows).T
    readable = np.isfinite(deflection)
    if readable.sum() < 50 or np.ptp(deflection[readable]) == 0.0:
        return
    frame = pd.DataFrame({"time_s": np.cumsum(steps), "motor_angle_rad": motor, "tip_deflection_m": deflection})
    recording = read_recording(write(frame, tmp_path / "r.csv"), ARM)
    np.testing.assert_array_equal(recording.time, frame["time_s"])
    np.testing.assert_array_equal(recording.input, motor)
    np.testing.assert_array_equal(recording.output[:, 0], deflection)


def test_atomic_write_replaces_whole_files_only(tmp_path):
    path = tmp_path / "results" / "fit.json"
    with atomic_write(path) as temporary:
        temporary.write_text("one")
        assert temporary.suffix == ".json"
        assert not path.exists()
    assert path.read_text() == "one"

    def fail():
        with atomic_write(path) as temporary:
            temporary.write_text("half")
            raise RuntimeError("disk")

    with pytest.raises(RuntimeError, match="disk"):
        fail()
    assert path.read_text() == "one"
    assert list(path.parent.iterdir()) == [path]


def test_table_names_rows_by_file_line(tmp_path):
    (tmp_path / "t.csv").write_text("# a\na,b\n\n1,2\n3,x\n")
    table = read_table(tmp_path / "t.csv")
    with pytest.raises(InputError, match=r"column 'b', row 2 \(line 5 of the file\): 'x' is not a number"):
        table.numbers("b")


@pytest.mark.measured
def test_silverbox():
    needs("silverbox")
    path = registry.locate("silverbox/SNLS80mV.mat")
    rig = oscillator(time=TimeColumn(None, "s", 1e7 / 2**14), output=OutputColumn("V2", "V", None))
    recording = read_recording(path, rig, samples=(40650, 105712))
    assert recording.time.size == 65062
    assert recording.sha256 == "5c7413a52255af0cb4e2f93fb6903beb92b08965ba1e6ad0a6ffedfed8477ed4"
    assert np.abs(recording.output).max() < 0.5
