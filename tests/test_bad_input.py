"""Bad input: each fault of a recording gets one paragraph that names file, column, row and remedy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from discovery.foundation.errors import InputError
from discovery.recordings.recording import read_recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

ARM = Rig(
    "arm",
    length=Quantity(0.9, 1e-3),
    tip_mass=Quantity(0.044, 2e-4),
    beam_mass=Quantity(0.012, 2e-4),
    flexural_rigidity=Quantity(0.126, 6e-3),
    position_noise=3e-4,
    angle_noise=7e-5,
)
OSCILLATOR = Rig(
    "o",
    kind="oscillator",
    columns=Columns(TimeColumn("t", "s", None), InputColumn("u", "V", "spline"), OutputColumn("y", "V", None)),
)


def swing(n=600, step=0.01, move=0.8):
    time = step * np.arange(n)
    motor = move * np.clip(time - 0.3, 0.0, 1.0)
    tip = motor + 0.3 * np.sin(3.0 * time)
    x, y = 0.88 * np.cos(tip), 0.88 * np.sin(tip)
    return pd.DataFrame({"time_s": time, "motor_angle_rad": motor, "tip_x_m": x, "tip_y_m": y}).round(7)


def change(row, column, value):
    def edit(frame):
        frame = frame.astype(object) if isinstance(value, str) else frame
        frame.loc[row, column] = value
        return frame

    return edit


def refused(path, rig=ARM, **options):
    """Read a file that must be refused, and give the message, which must be one paragraph that names the file."""
    with pytest.raises(InputError) as error:
        read_recording(path, rig, **options)
    message = str(error.value)
    assert str(path) in message
    assert "\n" not in message
    assert message.endswith(".")
    return message


TABLES = {
    "missing column": (lambda f: f.drop(columns="tip_y_m"), ["no column 'tip_y_m'", "Columns found: time_s"]),
    "missing column and one like it": (
        lambda f: f.drop(columns="tip_y_m"),
        ["no column 'tip_y_m': the tip needs both. Columns found"],
    ),
    "other column for the missing one": (
        lambda f: f.rename(columns={"tip_y_m": "tip_ym"}),
        ["no column 'tip_y_m'", "Did you mean 'tip_ym'?"],
    ),
    "motor runs away in degrees": (
        lambda f: f.assign(motor_angle_deg=5e3 * f["motor_angle_rad"]).drop(columns="motor_angle_rad"),
        ["turn by 4000 deg", "Correct the unit in the column's name."],
    ),
    "beyond reach in millimetres": (
        lambda f: f.assign(tip_x_mm=2e3 * f["tip_x_m"], tip_y_mm=2e3 * f["tip_y_m"]).drop(
            columns=["tip_x_m", "tip_y_m"]
        ),
        ["would be 1760 mm away on an arm that is 900 mm long"],
    ),
    "time goes back in milliseconds": (
        lambda f: change(100, "time_ms", 500.0)(f.assign(time_ms=1e3 * f["time_s"]).drop(columns="time_s")),
        ["row 101", "500 ms is earlier than the row before"],
    ),
    "misspelt column": (
        lambda f: f.rename(columns={"motor_angle_rad": "motor_angel_rad"}),
        ["no column 'motor_angle_rad'", "Did you mean 'motor_angel_rad'?"],
    ),
    "no time": (lambda f: f.drop(columns="time_s"), ["no column 'time_s'"]),
    "no output": (lambda f: f[["time_s", "motor_angle_rad"]], ["no output column", "add tip_x_m and tip_y_m"]),
    "no unit": (lambda f: f.rename(columns={"tip_x_m": "tip_x"}), ["'tip_x' lacks its unit", "'tip_x_m'"]),
    "wrong unit": (lambda f: f.rename(columns={"tip_x_m": "tip_x_rad"}), ["'tip_x_rad'", "cannot be converted to 'm'"]),
    "same quantity twice": (lambda f: f.assign(time_ms=1e3 * f["time_s"]), ["time is given twice", "Keep one"]),
    "text in numbers": (
        change(41, "tip_y_m", "n/a?"),
        ["column 'tip_y_m', row 42 (line 43 of the file): 'n/a?' is not a number", "leave the cell empty"],
    ),
    "decimal comma": (
        change(3, "tip_y_m", "0;5"),
        ["column 'tip_y_m', row 4 (line 5 of the file): '0;5' is not a number", "decimal point"],
    ),
    "infinite": (
        change(9, "tip_x_m", np.inf),
        ["column 'tip_x_m', row 10 (line 11 of the file): the value is infinite"],
    ),
    "time goes back": (
        change(100, "time_s", 0.5),
        ["column 'time_s', row 101 (line 102 of the file): 0.5 s is earlier than the row before", "sort the rows"],
    ),
    "time repeats": (
        change(100, "time_s", 0.99),
        ["column 'time_s', row 101 (line 102 of the file): 0.99 s is the same time as the row before"],
    ),
    "time missing": (change(7, "time_s", np.nan), ["column 'time_s', row 8 (line 9 of the file): the time is missing"]),
    "gap in the input": (
        change(200, "motor_angle_rad", np.nan),
        ["column 'motor_angle_rad', row 201 (line 202 of the file): the input is missing", "fill it, or cut"],
    ),
    "dead sensor": (
        lambda f: f.assign(tip_y_m=0.25),
        ["column 'tip_y_m'", "every reading", "is 0.25", "dead or not connected"],
    ),
    "empty sensor": (lambda f: f.assign(tip_y_m=np.nan), ["column 'tip_y_m' is too short: 0 readings in 600 rows"]),
    "too short": (lambda f: f[:20], ["too short: 20 rows", "at least 30"]),
    "less than a swing": (
        lambda f: f.assign(time_s=f["time_s"] / 10),
        ["column 'time_s'", "too short: it lasts 0.599 s, less than one swing", "Record longer"],
    ),
    "time in milliseconds": (
        lambda f: f.assign(time_s=1e3 * f["time_s"]),
        ["column 'time_s'", "10 s apart", "rename the column to 'time_ms'"],
    ),
    "millimetres as metres": (
        lambda f: f.assign(tip_x_m=1e3 * f["tip_x_m"], tip_y_m=1e3 * f["tip_y_m"]),
        ["columns 'tip_x_m' and 'tip_y_m', row 1 (line 2", "880 m away", "0.9 m long", "'tip_x_mm' and 'tip_y_mm'"],
    ),
    "metres as millimetres": (
        lambda f: f.rename(columns={"tip_x_m": "tip_x_mm", "tip_y_m": "tip_y_mm"}),
        ["never farther from the hub than 0.88 mm, but the arm is 900 mm long", "unit in the columns' names"],
    ),
    "beyond reach in one row": (
        change(77, "tip_x_m", 1.4),
        [
            "row 78 (line 79 of the file)",
            "m away on an arm that is 0.9 m long",
            "empty the cells of a wild one",
            "length_m",
        ],
    ),
    "degrees as radians": (
        lambda f: f.assign(motor_angle_rad=np.degrees(f["motor_angle_rad"])),
        ["column 'motor_angle_rad'", "turn by 45.84 rad", "'motor_angle_deg'"],
    ),
    "time by another name": (
        lambda f: f.rename(columns={"time_s": "t_s"}),
        ["has no column 'time_s'. Give that column this name, in its own unit.", "Columns found: t_s, motor_angle_rad"],
    ),
    "few degrees as radians": (
        lambda f: f.assign(motor_angle_rad=np.degrees(0.15 * f["motor_angle_rad"])),
        ["column 'motor_angle_rad'", "turn by 6.875 rad", "'motor_angle_deg'"],
    ),
    "tip angle in degrees": (
        lambda f: f.assign(tip_angle_rad=np.degrees(f["motor_angle_rad"])).drop(columns=["tip_x_m", "tip_y_m"]),
        ["column 'tip_angle_rad'", "more than half a turn", "_deg"],
    ),
    "deflection in millimetres": (
        lambda f: f.assign(tip_deflection_m=1e3 * f["tip_y_m"]).drop(columns=["tip_x_m", "tip_y_m"]),
        ["column 'tip_deflection_m'", "0.9 m long", "'tip_deflection_mm'"],
    ),
}


@pytest.mark.parametrize("fault", TABLES)
def test_faults_of_an_arm_recording(tmp_path, fault):
    edit, parts = TABLES[fault]
    path = tmp_path / "bad.csv"
    edit(swing()).to_csv(path, index=False)
    message = refused(path)
    for part in parts:
        assert part in message


def test_the_unharmed_recording_is_read(tmp_path):
    path = tmp_path / "good.csv"
    swing().to_csv(path, index=False)
    assert read_recording(path, ARM).time.size == 600


@pytest.mark.parametrize("move", [0.0, 0.02, 1.5, 5.0])
def test_small_and_large_manoeuvres_are_plausible(tmp_path, move):
    path = tmp_path / "good.csv"
    swing(move=move).to_csv(path, index=False)
    assert read_recording(path, ARM).output.shape == (600, 2)


def test_outliers_of_the_camera_within_reach_are_data(tmp_path):
    frame = swing()
    frame.loc[100, "tip_x_m"] = 0.0
    path = tmp_path / "good.csv"
    frame.to_csv(path, index=False)
    assert read_recording(path, ARM).output[100, 0] == 0.0


@pytest.mark.parametrize(
    ("name", "content", "parts"),
    [
        ("none.csv", None, ["cannot be read: No such file", "Check the path"]),
        ("empty.csv", b"", ["is empty"]),
        ("blank.csv", b"\n \n", ["is empty"]),
        ("comments.csv", b"# nothing\n", ["is empty but for comments"]),
        ("header.csv", b"time_s,motor_angle_rad,tip_x_m,tip_y_m\n", ["header and no data rows"]),
        ("binary.csv", bytes(range(256)), ["is a binary file"]),
        ("nul.csv", b"time_s,a\n\x00\x01,2\n", ["is a binary file"]),
        ("numbers.csv", b"0.0,1.0\n0.1,2.0\n", ["line 1: the first line holds numbers", "Add a header"]),
        ("twice.csv", b"time_s,tip_x_m,tip_x_m\n0,1,1\n", ["line 1: two columns are named 'tip_x_m'"]),
        ("wide.csv", b"time_s,tip_x_m\n0,1\n1,2,3\n", ["line 3: 3 cells in a table of 2 columns"]),
        (
            "settings.csv",
            b"angle,rate,count\n90,1000,2\n" + 9 * b"1.0\n",
            ["line 3: 1 cell in a table of 3", "settings"],
        ),
        ("decimal.csv", b"time_s,tip_x_m\n0,0,1,0\n", ["line 2: 4 cells", "decimal point"]),
        ("swing.xlsx", b"PK", ["format '.xlsx' is not known", ".parquet"]),
        ("swing", b"time_s\n", ["without a suffix", ".csv"]),
        ("swing.parquet", b"no parquet", ["is not a readable .parquet file"]),
        ("swing.mat", b"no matlab file at all, but long enough to be read as one", ["is not a readable .mat file"]),
        ("swing.h5", b"no hdf5", ["is not a readable .h5 file"]),
    ],
)
def test_faults_of_a_file(tmp_path, name, content, parts):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    message = refused(path)
    for part in parts:
        assert part in message


def test_a_folder_is_no_recording(tmp_path):
    (tmp_path / "r.csv").mkdir()
    assert "cannot be read" in refused(tmp_path / "r.csv")


def test_rows_count_from_the_file_also_in_a_part(tmp_path):
    frame = swing()
    frame.loc[300, "motor_angle_rad"] = np.nan
    path = tmp_path / "bad.csv"
    frame.to_csv(path, index=False)
    assert "row 301 (line 302 of the file)" in refused(path, samples=(200, 400))
    assert read_recording(path, ARM, samples=(0, 300)).time.size == 300
    assert "has 600 samples, so [500, 700] is not a part" in refused(path, samples=(500, 700))


def test_a_rigidity_in_another_unit_is_not_blamed_on_the_time_alone(tmp_path):
    path = tmp_path / "swing.csv"
    swing().to_csv(path, index=False)
    for factor in (1e6, 1e-6):
        stiff = replace(ARM, flexural_rigidity=Quantity(factor * 0.126, 6e-3))
        message = refused(path, stiff)
        assert "by the rig file's masses, length and rigidity" in message
        assert "correct these" in message


def test_prediction_files_are_checked_too(tmp_path):
    frame = swing()[["time_s", "motor_angle_rad"]]
    path = tmp_path / "drive.csv"
    frame.assign(motor_angle_rad=np.degrees(frame["motor_angle_rad"])).to_csv(path, index=False)
    assert "'motor_angle_deg'" in refused(path, with_output=False)
    frame[:1].to_csv(path, index=False)
    assert "too short: 1 row." in refused(path, with_output=False)


@pytest.mark.parametrize(
    ("edit", "parts"),
    [
        (lambda f: f.drop(columns="u"), ["no column 'u', which the rig file declares", "Columns found: t, y"]),
        (lambda f: f.rename(columns={"t": "t_s"}), ["no column 't'", "Write its name in [columns] as the file has it"]),
        (lambda f: f.rename(columns={"t": "time"}), ["no column 't', which the rig file declares. Write its name"]),
        (lambda f: f.drop(columns="y"), ["no output column: the rig file declares 'y'", "Columns found: t, u."]),
        (lambda f: f.assign(y=1.0), ["column 'y'", "dead"]),
        (lambda f: f[:20], ["too short: 20 rows"]),
        (change(5, "u", np.nan), ["column 'u', row 6", "the input is missing"]),
        (change(5, "t", 0.0), ["column 't', row 6", "earlier than the row before", "sort the rows, remove"]),
        (change(50, "t", 0.0), ["column 't', row 51", "earlier than the row before. Times must strictly increase"]),
        (
            lambda f: f.assign(t=f.t - 0.42 * (f.index >= 60)),
            ["column 't', row 61", "or its clock was set back, name each part in [records]", "samples = [start, stop]"],
        ),
        (lambda f: f[::-1], ["column 't', row 2", "earlier than the row before. Times must strictly increase"]),
        (
            lambda f: pd.concat([f, f, f]),
            [
                "column 't', row 101 (line 102",
                "0 s is earlier than",
                "several trials",
                "where = { column = value } or samples = [start, stop]",
            ],
        ),
    ],
)
def test_faults_of_an_oscillator_recording(tmp_path, edit, parts):
    time = 0.1 * np.arange(100)
    path = tmp_path / "o.csv"
    edit(pd.DataFrame({"t": time, "u": np.cos(time), "y": np.sin(time)})).to_csv(path, index=False)
    message = refused(path, OSCILLATOR)
    for part in parts:
        assert part in message


def test_the_rig_file_is_named_where_it_declares_what_is_not_there(tmp_path):
    path, rig = tmp_path / "o.csv", replace(OSCILLATOR, path=tmp_path / "rig.toml")
    frame = pd.DataFrame({"t": np.arange(100.0), "u": np.ones(100), "y2": np.arange(100.0)})
    frame.to_csv(path, index=False)
    assert f"the rig file {rig.path} declares 'y'" in refused(path, rig)
    assert "Did you mean 'y2'?" in refused(path, rig)
    frame.rename(columns={"u": "y_u"}).to_csv(path, index=False)
    wanted = replace(rig.columns, input=InputColumn("y_u", "V", "spline"), output=OutputColumn("y_y", "V"))
    assert "Did you mean" not in refused(path, replace(rig, columns=wanted))
    frame.drop(columns="u").rename(columns={"y2": "y"}).to_csv(path, index=False)
    assert f"no column 'u', which the rig file {rig.path} declares" in refused(path, rig)


def test_a_dead_sensor_is_quoted_as_the_file_has_it(tmp_path):
    column = OutputColumn("y", "mm", zero=2.0, scale=3.0)
    frame = pd.DataFrame({"t": np.arange(100.0), "y": 7.0})
    frame.to_csv(tmp_path / "o.csv", index=False)
    rig = replace(OSCILLATOR, columns=Columns(TimeColumn("t", "s", None), None, column))
    assert "every reading, from row 1 (line 2 of the file) on, is 7." in refused(tmp_path / "o.csv", rig)


def test_vectors_of_different_length(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "o.mat", {"t": np.arange(100.0), "u": np.arange(99.0), "y": np.arange(100.0)})
    assert "differ in length ('t' 100, 'u' 99, 'y' 100)" in refused(tmp_path / "o.mat", OSCILLATOR)


@pytest.mark.parametrize("cells", [pd.timedelta_range("0s", periods=600), pd.date_range("2020", periods=600)])
def test_times_that_are_dates_or_durations_are_refused(tmp_path, cells):
    swing().assign(time_s=cells[: len(swing())]).to_parquet(tmp_path / "r.parquet")
    assert "'time_s' holds dates or durations" in refused(tmp_path / "r.parquet")


@pytest.mark.parametrize("jump", [3600.0, 86400.0, 3e7])
def test_a_clock_that_jumps_by_more_than_the_recording_is_refused(tmp_path, jump):
    frame = swing()
    frame.loc[300:, "time_s"] += jump
    frame.to_csv(tmp_path / "r.csv", index=False)
    message = refused(tmp_path / "r.csv")
    assert "column 'time_s', row 301 (line 302 of the file)" in message
    assert "clock jumped" in message
    assert "samples = [start, stop]" in message
