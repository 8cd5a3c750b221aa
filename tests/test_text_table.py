"""Text tables: separators, comments, headers given from outside, rows picked by value."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.foundation.errors import InputError
from discovery.foundation.io import read_table
from discovery.foundation.text_table import parse_text, unnamed_columns
from discovery.recordings.recording import read_recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn

VALUES = np.array([[0.0, 1.5, -2e-3], [0.1, 2.5, 4e-3], [0.2, 3.5, 6e-3]])
LAYOUTS = {
    "comma": "0,1.5,-2e-3\n0.1,2.5,4e-3\n0.2,3.5,6e-3\n",
    "tab": "0\t1.5\t-2e-3\n0.1\t2.5\t4e-3\n0.2\t3.5\t6e-3\n",
    "blanks": "   0.0   1.5  -2e-3\n   0.1   2.5   4e-3\n   0.2   3.5   6e-3  \n",
    "padded tab": "  0 \t  1.5\t -2e-3\r\n 0.1\t 2.5\t 4e-3\r\n 0.2\t3.5 \t6e-3 \r\n",
    "tab and blanks": "0 \t1.5  -2e-3\n0.1\t2.5 4e-3\n0.2 3.5\t6e-3\n",
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("comment", ["", "# made on Monday\n", "% t x v\n\n"])
@pytest.mark.parametrize("named", [True, False])
def test_layouts(tmp_path, layout, comment, named):
    path = tmp_path / "r.txt"
    separator = {"comma": ",", "tab": "\t", "padded tab": " \t "}.get(layout, "  ")
    header = "" if named else separator.join("txv") + "\n"
    path.write_text(comment + header + LAYOUTS[layout])
    table = read_table(path, list("txv") if named else None)
    assert list(table.columns) == ["t", "x", "v"]
    np.testing.assert_array_equal(np.column_stack([table.numbers(name) for name in "txv"]), VALUES)
    assert "line" in table.where(0)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_titles_above_the_names_are_passed_over(tmp_path, layout):
    path = tmp_path / "r.txt"
    separator = {"comma": ",", "tab": "\t", "padded tab": " \t "}.get(layout, "  ")
    path.write_text("mass_A\n\nRun 2\n" + separator.join("txv") + "\n" + LAYOUTS[layout])
    table = read_table(path)
    np.testing.assert_array_equal(np.column_stack([table.numbers(name) for name in "txv"]), VALUES)
    assert table.where(0).endswith("(line 5 of the file)")
    assert unnamed_columns(path) == ()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("titles", ["beats 29.2cm\n", "made on Monday, noon\n\n1500\n", "# a\nbeats\n# b\n"])
def test_titles_above_unnamed_numbers_are_passed_over(tmp_path, layout, titles):
    path = tmp_path / "r.txt"
    if layout == "comma":
        titles = titles.replace(",", ":")
    path.write_text(titles + LAYOUTS[layout])
    if layout != "tab and blanks":  # that needs a header to say how many cells there are
        assert unnamed_columns(path) == ("c1", "c2", "c3")
        with pytest.raises(InputError, match="first line holds numbers"):
            read_table(path)
    table = read_table(path, list("txv"))
    np.testing.assert_array_equal(np.column_stack([table.numbers(name) for name in "txv"]), VALUES)
    assert table.where(0).endswith(f"(line {titles.count(chr(10)) + 1} of the file)")


@pytest.mark.parametrize(
    "content",
    [
        "1 2\n1 2 3\n4 5 6\n",  # a row that lost a cell
        "t,x\n0,1,2,3\n0,2,3,4\n",  # names above decimal commas
        "mm s\nt x\n0 1\n2 3\n",  # two lines of names
        "Golf 1 2\n3 4 5\n6 7 8\n",  # a row with a word
    ],
)
def test_what_may_be_a_row_or_names_is_no_title(tmp_path, content):
    path = tmp_path / "r.txt"
    path.write_text(content)
    assert unnamed_columns(path) == ()


@pytest.mark.parametrize("separator", [";", "\t", "  "])
@pytest.mark.parametrize("named", [True, False])
def test_numbers_with_a_decimal_comma(tmp_path, separator, named):
    path = tmp_path / "r.csv"
    rows = [separator.join(f"{v:.4f}".replace(".", ",") for v in row) for row in VALUES]
    path.write_text("\n".join([separator.join("txv")] * named + rows) + "\n")
    table = read_table(path, None if named else list("txv"))
    np.testing.assert_array_equal(np.column_stack([table.numbers(name) for name in "txv"]), VALUES)
    assert unnamed_columns(path) == (() if named else ("c1", "c2", "c3"))


@pytest.mark.parametrize("rows", ["1;1,234\n2;2,345\n", "0,5;1.5\n1,5;2.5\n"], ids=["thousands", "both marks"])
def test_a_comma_that_may_mark_thousands_is_refused(tmp_path, rows):
    path = tmp_path / "r.csv"
    path.write_text("t;x\n" + rows)
    table = read_table(path)
    with pytest.raises(InputError, match="is not a number"):
        _ = [table.numbers(name) for name in "tx"]


@pytest.mark.parametrize(
    ("content", "header", "message"),
    [
        ("1 2 3\n4 5\n", list("abc"), "line 2: 2 cells in a table of 3 columns.*write nan"),
        ("1 2 3\n4 5 6 7\n", list("abc"), "line 2: 4 cells.*blanks only between columns"),
        (
            "a b c\n1 2 3\n",
            list("abc"),
            "line 1: the first line holds names.*: 'a b c'. Remove header.*put # before it",
        ),
        ("run 2\na b c\n1 2 3\n", list("abc"), "line 2: the first line holds names.*: 'a b c'. Remove header"),
        ("t,x\n0,1,2,3\n", None, "line 2: 4 cells.*decimal point.* Else line 't,x' lacks the names of 2 columns: add"),
        (
            "t,x\n0,1,2\n1,2.5,3\n",
            None,
            "3 cells in a table of 2 columns. Line 't,x' lacks the name of 1 column",
        ),
        (
            "t;x\n0,5;1;2;3\n",
            None,
            "2 columns. Line 't;x' lacks the names of 2 columns: add what is missing",
        ),
        ("t,x\n0.5,1,2\n1.5,2\n", None, "line 2: 3 cells.*decimal point.*'t,x' was taken.*delete it or put # before"),
        ("x" * 99 + "\n1 2,\n3 4\n", None, r"Line 'x{57}\.\.\.' was taken"),
        ("1 2\n3 4\n", list("aa"), "two columns are named 'a'"),
        ("1 2\n3 4\n", None, r"line 1: the first line holds numbers.*header = \["),
        ("1,2\n3,4\n", list("abc")[:1], "2 cells in a table of 1 columns"),
    ],
)
def test_refusals(tmp_path, content, header, message):
    path = tmp_path / "r.dat"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_table(path, header)


@pytest.fixture
def drops(tmp_path):
    rows = [f"{ball},{drop},{0.1 * i:.1f},{100 * drop + i}" for ball in ("Golf", "Tennis Ball") for drop in (1, 2)
            for i in range(60)]  # fmt: skip
    path = tmp_path / "drops.csv"
    path.write_text("ball,drop,t,h\n" + "\n".join(rows) + "\n")
    return path


RIG = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("h", "m")))


def test_rows_are_picked_by_text_and_number(drops):
    where = (("ball", "Tennis Ball"), ("drop", 2))
    recording = read_recording(drops, RIG, where=where, name="two")
    np.testing.assert_array_equal(recording.output[:, 0], 200.0 + np.arange(60))
    assert recording.name == "two"
    part = read_recording(drops, RIG, (5, 58), where=where)
    np.testing.assert_array_equal(part.output[:, 0], 205.0 + np.arange(53))
    assert part.source.endswith("drops.csv[ball=Tennis Ball, drop=2, 5:58]")


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ((("bal", "Golf"),), r"no column 'bal'.*Did you mean 'ball'\?"),
        ((("ball", "Tenis Ball"),), r"no row in which 'ball' is 'Tenis Ball'. Did you mean 'Tennis Ball'\?"),
        ((("ball", "Golf"), ("drop", 3)), "no row in which 'drop' is 3. Values found: 1, 2"),
        ((("ball", 3.0),), "'Golf' is not a number"),
    ],
)
def test_rows_that_are_not_there(drops, where, message):
    with pytest.raises(InputError, match=message):
        read_recording(drops, RIG, where=where)


def test_messages_count_rows_of_the_file(drops):
    lines = drops.read_text().splitlines()
    lines[200] = "Tennis Ball,2,nan,5"
    drops.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"row 200 \(line 201 of the file\): the time is missing"):
        read_recording(drops, RIG, where=(("ball", "Tennis Ball"), ("drop", 2)))
    with pytest.raises(InputError, match=r"has 60 samples of this kind, so \[0, 61\] is not"):
        read_recording(drops, RIG, (0, 61), where=(("ball", "Golf"), ("drop", 1)))


ENCODED = {
    "UTF-8 with mark": ("utf-8-sig", ""),
    "UTF-16": ("utf-16", ""),
    "UTF-16 without mark": ("utf-16-le", "UTF-16"),
    "UTF-16, the other order": ("utf-16-be", "UTF-16"),
    "Latin-1": ("latin-1", "Windows-1252"),
    "Windows-1252": ("cp1252", "Windows-1252"),
}


@pytest.mark.parametrize("name", ENCODED)
@pytest.mark.parametrize("named", [True, False])
def test_texts_of_other_encodings_are_read(tmp_path, name, named):
    encoding, guessed = ENCODED[name]
    rows = "".join(f"{0.01 * i:.2f};{np.sin(0.3 * i):.6f}\n" for i in range(200))
    path = tmp_path / "swing.csv"
    path.write_bytes((("t;winkel_°\n" if named else "# aufgenommen für µm und °\n") + rows).encode(encoding))
    header = None if named else ("t", "winkel_°")
    table = read_table(path, header)
    assert list(table.columns) == ["t", "winkel_°"]
    assert table.guessed == guessed
    assert unnamed_columns(path) == (() if named else ("c1", "c2"))
    np.testing.assert_allclose(table.numbers("winkel_°"), np.sin(0.3 * np.arange(200)), atol=1e-6)
    rig = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("winkel_°", "m"), header))
    notes = [f for f in read_recording(path, rig).flags if f.code == "encoding_guessed"]
    assert [f.numbers["encoding"] for f in notes] == [guessed] * bool(guessed)
    assert all(f"read as {guessed}" in f.sentence for f in notes)


@pytest.mark.parametrize("mark", ["\t", ";", ","])
def test_lines_that_are_one_quoted_cell_are_refused_with_a_remedy(tmp_path: Path, mark: str) -> None:
    rows = [mark.join(("t", "x"))] + [mark.join((f"{0.01 * k:.2f}", f"{k * k}")) for k in range(60)]
    (tmp_path / "a.csv").write_text("\n".join(f'"{row}"' for row in ["mass A", *rows]))
    with pytest.raises(InputError, match=r"line 62: the whole line stands between quotation marks.*Delete all quota"):
        read_table(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("x\n" + "\n".join(f'"{k},5"' for k in range(60)))
    assert read_table(tmp_path / "a.csv").columns["x"].size == 60


@pytest.mark.parametrize("content", [b"t,x\n0,1\n1,\x002\n", bytes(500), b"\x7fELF" + bytes(range(256)) * 20])
def test_what_is_no_text_is_refused(tmp_path, content):
    path = tmp_path / "r.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match="binary file"):
        read_table(path)


@pytest.mark.parametrize(
    ("comment", "separator", "names"),
    [
        ("# t, x, v", ",", ["t", "x", "v"]),
        ("# of Monday\n%t;x;v", ";", ["t", "x", "v"]),
        ("# t  x  v", " ", ["t", "x", "v"]),
        ("#  Time (S)   x  v", "\t", ["Time (S)", "x", "v"]),
        ("# t x v", "\t", ["t", "x", "v"]),
        ("# Run of Monday", "\t", None),
        ("# time in seconds", ",", None),
        ("# Recorded on Monday.  Motor A.  Rig 2.", ",", None),
        ("# Time (s) (rad)", ",", None),
        ("# t, x, v\n# Time in seconds", ",", ["t", "x", "v"]),
        ("# of Monday\n# t, x, v\n# [s], [m], [m/s]", ",", ["t [s]", "x [m]", "v [m/s]"]),
        ("# t, x, v\n# [s], [m], -", ",", ["t [s]", "x [m]", "v -"]),
        ("# [s], (m), [m/s]", ",", ["[s]", "(m)", "[m/s]"]),
        ("# t, x\n# made by a logger, of the old kind", ",", None),
        ("# t, x", ",", None),
        ("# t, x, v\n# 3, 2, 1", ",", ["t", "x", "v"]),
        ("% t\tx\tv\n%4/3/2019 1:22 PM", "\t", ["t", "x", "v"]),
    ],
)
def test_a_comment_above_numbers_names_the_columns(tmp_path, comment, separator, names):
    path = tmp_path / "r.txt"
    rows = "\n".join(separator.join(map(str, row)) for row in VALUES)
    path.write_text(f"{comment}\n{rows}\n")
    if names is None:
        assert unnamed_columns(path) == ("c1", "c2", "c3")
        with pytest.raises(InputError, match="holds numbers, not column names"):
            read_table(path)
        return
    table = read_table(path)
    assert list(table.columns) == names
    assert unnamed_columns(path) == ()
    np.testing.assert_array_equal(np.column_stack([table.numbers(name) for name in names]), VALUES)
    # Names that the rig file gives stand above those of a comment.
    assert list(read_table(path, list("abc")).columns) == list("abc")


@pytest.mark.parametrize("above", ["--- a swing ---\ntime,force,angle\n", "time;force;angle\n"])
def test_names_may_be_parted_otherwise_than_the_numbers(tmp_path, above):
    path = tmp_path / "r.txt"
    rows = "\n".join("\t".join(f"{v:.3f}".replace(".", ",") for v in row) for row in VALUES)
    path.write_text(f"{above}{rows}\n")
    table = read_table(path)
    assert list(table.columns) == ["time", "force", "angle"]
    assert unnamed_columns(path) == ()
    np.testing.assert_array_equal(np.column_stack([table.numbers(name) for name in table.columns]), VALUES)
    assert list(read_table(path, list("abc")).columns) == list("abc")


@pytest.mark.parametrize("title", ["Messung 12, Pendel 2, rot", "Smith, John, 2nd", "Lab; Bench; Run"])
def test_a_title_with_marks_names_no_column(tmp_path, title):
    path = tmp_path / "r.txt"
    path.write_text(title + "\n" + "\n".join("\t".join(f"{v:.3f}" for v in row) for row in VALUES) + "\n")
    assert unnamed_columns(path) == ("c1", "c2", "c3")


@pytest.mark.parametrize("empty", [",", ",,", ' , ""', ";", "\t\t"])
def test_rows_of_empty_cells_are_passed_over(empty: str) -> None:
    """Spreadsheets write them by the hundred below what was measured."""
    columns, lines = parse_text(Path("a.csv"), "t,y\n0,1\n1,2\n" + f"{empty}\n" * 300 + "2,3\n")
    assert columns["y"].tolist() == [1, 2, 3]
    assert lines.tolist() == [2, 3, 304]


@pytest.mark.parametrize(("row", "named"), [("2.75\t702\t76.6F", False), ("t\t1\t2", True)])
def test_a_first_row_like_the_others_is_no_line_of_names(tmp_path: Path, row: str, named: bool) -> None:
    """Sensors may be called by numbers; cells with their unit are no names."""
    path = tmp_path / "r.tsv"
    below = ["2.80\t724\t76.6F", "2.85\t745\t76.7F"] if not named else ["0.1\t3\t4", "0.2\t3\t5"]
    path.write_text("\n".join([row, *below]))
    if named:
        assert list(read_table(path).columns) == ["t", "1", "2"]
    else:
        with pytest.raises(InputError, match="holds numbers, not column names"):
            read_table(path)


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("x-axis,1\nsecond,Volt\n0,1\n1,2\n", ["x-axis [second]", "1 [Volt]"]),
        ("t,y\n[s],[mm]\n0,1\n1,2\n", ["t [s]", "y [mm]"]),
        ("t [s],y (mm)\ns,mm\n0,1\n1,2\n", ["t [s]", "y (mm)"]),
    ],
)
def test_units_may_stand_below_names(tmp_path, text, columns):
    found, lines = parse_text(tmp_path / "r.csv", text)
    assert list(found) == columns
    assert lines.tolist() == [3, 4]


@pytest.mark.parametrize("row", ["overflow,overflow", "t,y", "n/a,off"])
def test_words_that_are_no_units_are_no_names(tmp_path, row):
    found, _ = parse_text(tmp_path / "r.csv", f"t,y\n{row}\n0,1\n1,2\n")
    assert list(found) == ["t", "y"]


def test_unnamed_columns_may_end_with_a_mark(tmp_path):
    (tmp_path / "r.csv").write_text("\n0.1,2,\n0.2,3,\n")
    assert unnamed_columns(tmp_path / "r.csv") == ("c1", "c2", "c3")
