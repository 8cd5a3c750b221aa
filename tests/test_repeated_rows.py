"""Rows that a logger wrote twice are used once, and said; a stamp with two readings is refused."""

from pathlib import Path

import numpy as np
import pytest

from discovery.foundation.errors import InputError
from discovery.recordings.recording import read_recording
from discovery.rigs.rig_file import read_rig

RIG = """name = "spring"
kind = "oscillator"

[columns]
time = { name = "t", unit = "s" }
output = { name = "x", unit = "mm" }

[model]
effects = ["viscous_damping"]
"""
TIME = np.arange(300) * 0.013
SWING = 20.0 * np.exp(-0.3 * TIME) * np.cos(9.0 * TIME) + 0.05 * np.random.default_rng(4).standard_normal(TIME.size)


def written(folder: Path, *columns: np.ndarray, rows=None) -> Path:
    table = np.column_stack(columns)
    table = table if rows is None else table[rows]
    np.savetxt(folder / "a.csv", table, "%.6f", ",", header="t,x", comments="")
    (folder / "rig.toml").write_text(RIG)
    return folder / "rig.toml"


def test_rows_that_stand_twice_are_used_once(tmp_path):
    rig = read_rig(written(tmp_path, TIME, SWING))
    clean = read_recording(tmp_path / "a.csv", rig)
    rows = np.sort(np.r_[np.arange(TIME.size), [7, 90, 90, 299]])
    written(tmp_path, TIME, SWING, rows=rows)
    found = read_recording(tmp_path / "a.csv", rig)
    assert np.array_equal(found.time, clean.time)
    assert np.array_equal(found.output, clean.output)
    assert found.noise == pytest.approx(clean.noise)
    told = [flag for flag in found.flags if flag.code == "rows_repeated"]
    assert [flag.numbers for flag in told] == [{"count": 4, "start": pytest.approx(7 * 0.013)}]
    assert "4 rows hold the time and all readings of the row before, the first at 0.091 s" in str(told[0])
    # What is taken apart later is named by the rows of the file.
    assert found.rows is not None
    assert np.array_equal(rows[found.rows[:-1]], np.arange(TIME.size))
    assert found.rows[-1] == rows.size
    assert "rows_repeated" not in [flag.code for flag in clean.flags]


def test_empty_cells_that_stand_twice_are_the_same(tmp_path):
    gaps = np.where(np.isin(np.arange(TIME.size), [50, 51]), np.nan, SWING)
    written(tmp_path, TIME, gaps, rows=np.sort(np.r_[np.arange(TIME.size), 50]))
    found = read_recording(tmp_path / "a.csv", read_rig(tmp_path / "rig.toml"))
    assert np.isnan(found.output).sum() == 2


def test_a_stamp_of_two_readings_is_refused_at_its_row(tmp_path):
    rows = np.sort(np.r_[np.arange(TIME.size), [7, 90]])
    other = SWING[rows]
    other[92] += 0.5
    written(tmp_path, TIME[rows], other)
    with pytest.raises(InputError, match=r"row 93 \(line 94 of the file\).*the same time as the row before"):
        read_recording(tmp_path / "a.csv", read_rig(tmp_path / "rig.toml"))


def test_rounded_stamps_of_a_body_at_rest_are_no_rows_twice(tmp_path):
    time = np.round(np.arange(300) * 0.0071, 2)
    position = np.where(time < 0.3, 20.0, 20.0 * np.cos(9.0 * (time - 0.3)))
    rest = np.flatnonzero(time >= 0.3)
    position[rest] += 0.05 * np.random.default_rng(5).standard_normal(rest.size)
    found = read_recording(tmp_path / "a.csv", read_rig(written(tmp_path, time, position)))
    assert found.time.size == 300
    assert "times_rounded" in [flag.code for flag in found.flags]


def test_rounded_stamps_and_rows_twice_are_both_told(tmp_path):
    time = np.round(np.arange(300) / 29.97, 2)
    swing = 20.0 * np.cos(3.0 * np.arange(300) / 29.97) + 0.05 * np.random.default_rng(6).standard_normal(300)
    rig = written(tmp_path, time, swing, rows=np.sort(np.r_[np.arange(300), [4, 200]]))
    found = read_recording(tmp_path / "a.csv", read_rig(rig))
    assert found.time.size == 300
    assert {"rows_repeated", "times_rounded"} <= {flag.code for flag in found.flags}
    assert np.diff(found.time) == pytest.approx(1 / 29.97, rel=1e-3)
