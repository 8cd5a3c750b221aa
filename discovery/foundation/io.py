"""Tables in files: named columns out of CSV, Parquet, MAT and HDF5, and results written whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.clock import seconds_of
from discovery.foundation.encoding import decoded
from discovery.foundation.errors import ComputationError, InputError, suggestion
from discovery.foundation.text_table import parse_text

_CSV = (".csv", ".tsv", ".txt", ".dat")
#: Larger numbers leave the range of floating-point numbers in another unit.
_LARGEST = 1e200
#: Begin of the names of files that are not finished.
DRAFT = ".discovery-"
#: Letters of its own name that a draft keeps: with more, a long name would have no draft.
_STEM = 40
#: Letters of a path in a message.
_SHOWN = 300
_KNOWN = (*_CSV, ".parquet", ".pq", ".mat", ".h5", ".hdf5")


@dataclass(frozen=True)
class Table:
    """The columns of a file as they stand in it."""

    path: Path
    #: each (n,): numbers where every cell is one (an empty cell is NaN), else the cells as text.
    columns: Mapping[str, npt.NDArray[Any]]
    sha256: str  # of the file's bytes
    #: (n,): line of each row in a text file, from 1; empty for other formats.
    lines: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    rows: IntArray | None = None  # (n,), row of the file that each row was, from 0; None where all were taken
    whole: int = 0  # rows of the file, of which these were taken; 0 where all were
    guessed: str = ""  # encoding of a text file where nothing says it; empty for UTF-8

    def where(self, row: int) -> str:
        """Name a row for people: data rows count from 1."""
        line = f" (line {self.lines[row]} of the file)" if row < self.lines.size else ""
        return f"row {(row if self.rows is None else self.rows[row]) + 1}{line}"

    def take(self, names: Sequence[str], rows: IntArray) -> Table:
        """Return some columns and rows, which keep their places in the file for messages."""
        known = rows if self.rows is None else self.rows[rows]
        lines = self.lines[rows] if self.lines.size else self.lines
        whole = self.whole or next(iter(self.columns.values())).size
        return replace(self, columns={n: self.columns[n][rows] for n in names}, lines=lines, rows=known, whole=whole)

    def matching(self, where: Sequence[tuple[str, str | float]]) -> IntArray:
        """Find the rows in which columns have given values, numbers up to rounding, text up to blanks around it.

        A column that is not there, and values that no row has, are refused.
        """
        found: IntArray | None = None
        for name, value in where:
            if name not in self.columns:
                raise InputError(
                    f"{self.path} has no column {name!r}, by which the rig file picks rows."
                    f"{suggestion(name, self.columns)} Columns found: {', '.join(map(str, self.columns))[:300]}."
                )
            column = self.columns[name]
            if isinstance(value, str):
                fits = np.array([str(cell).strip() == value.strip() for cell in column], bool)
            else:
                fits = np.isclose(self.numbers(name), value, rtol=1e-9, atol=0.0)
            rows = np.flatnonzero(fits) if found is None else found[fits[found]]
            if rows.size == 0:
                others = dict.fromkeys(str(cell).strip() for cell in (column if found is None else column[found]))
                raise InputError(
                    f"{self.path} has no row in which {name!r} is {value!r}.{suggestion(str(value), others)} "
                    f"Values found: {', '.join(others)[:300]}."
                )
            found = rows
        return np.arange(next(iter(self.columns.values())).size) if found is None else found

    def numbers(self, name: str) -> FloatArray:
        """Give a column as numbers, shape (n,), empty cells as NaN; a cell that is text or infinite is refused."""
        column = self.columns[name]
        if np.iscomplexobj(column):
            raise InputError(f"{self.path}: the column {name!r} holds complex numbers. Give real ones.")
        if column.dtype.kind in "mM":
            raise InputError(
                f"{self.path}: the column {name!r} holds dates or durations. Write it as numbers in the unit that is "
                "declared, such as seconds since the first row."
            )
        if column.dtype.kind in "OUS":
            values, bad = _parse(column)
            if bad is not None:
                raise InputError(
                    f"{self.path}, column {name!r}, {self.where(bad)}: {str(column[bad])[:40]!r} is not a number. "
                    "Write numbers with a decimal point, and leave the cell empty where there is no reading."
                )
        else:
            values = np.asarray(column, np.float64)
        infinite = np.abs(values) > _LARGEST
        if infinite.any():
            row = int(np.argmax(infinite))
            size = "infinite" if np.isinf(values[row]) else f"{values[row]:.3g}, which nothing reads"
            raise InputError(
                f"{self.path}, column {name!r}, {self.where(row)}: the value is {size}. "
                "Leave the cell empty where there is no reading. Correct the unit or the scale if all are that large."
            )
        return values

    def times(self, name: str, unit: str = "s", scale: float = 1.0) -> FloatArray:
        """Give a column of times as numbers, shape (n,); those of a clock are seconds since the first.

        `unit`, `scale`: the unit that is declared, and what a number counts in it. InputError for a clock's times in
        another one than seconds.
        """
        column = self.columns[name]
        passed = seconds_of(column) if column.dtype.kind in "OUS" else None
        if passed is not None and (unit, scale) != ("s", 1.0):
            wrong = repr(unit) if scale == 1.0 else f"{scale:g} {unit}"
            raise InputError(
                f"{self.path}, column {name!r}: times of a clock are in s, not in {wrong}. Correct the unit."
            )
        return scale * self.numbers(name) if passed is None else passed


def _parse(column: npt.NDArray[Any]) -> tuple[FloatArray, int | None]:
    """Numbers of a column of text, and the first row that is none."""
    import pandas as pd

    text = pd.Series(column, dtype=object)
    empty = text.isna() | text.map(str).str.strip().str.lower().isin(["", "nan", "na", "null", "none"])
    values = pd.to_numeric(text.where(~empty), errors="coerce").to_numpy(np.float64)
    wrong = np.isnan(values) & ~empty.to_numpy()
    return values, int(np.argmax(wrong)) if wrong.any() else None


def read_table(path: str | os.PathLike[str], header: Sequence[str] | None = None) -> Table:
    """Read the columns of a file.

    `path`: text (see `discovery.foundation.text_table.parse_text`), Parquet, MAT (any version) or HDF5 (one-dimensional
    datasets). `header`: names of the columns of a text file without a line of names. Raises InputError if the file is
    missing, empty, of an unknown format or not what its name says, or if two columns share a name.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _KNOWN:
        raise InputError(f"{path}: the format {suffix or 'without a suffix'!r} is not known. Use {', '.join(_KNOWN)}.")
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:  # a name may hold what no file's name can
        raise InputError(f"{shown(path)} cannot be read: {reason(error)}. Check the path of the recording.") from error
    if not content.strip():
        raise InputError(f"{path} is empty. Export the recording again.")
    sha256 = hashlib.sha256(content).hexdigest()
    if suffix in _CSV:
        found = decoded(content)
        if found is None:
            raise InputError(
                f"{path} is a binary file, not text. Export the recording as CSV, or give it its true suffix."
            )
        columns, lines = parse_text(path, found[0], header)
        return Table(path, columns, sha256, lines, guessed=found[1])
    readers = {".parquet": _read_parquet, ".pq": _read_parquet, ".mat": _read_mat}
    try:
        columns = readers.get(suffix, _read_hdf5)(path)
    except InputError:
        raise
    except Exception as error:  # each library has exceptions of its own for a damaged file
        raise InputError(
            f"{path} is not a readable {suffix} file ({error or type(error).__name__}). Export the recording again, "
            "or give it the suffix of its true format."
        ) from error
    if not columns:
        raise InputError(f"{path} holds no column of numbers. Export the recording again, one named vector a column.")
    return Table(path, columns, sha256)


def _read_parquet(path: Path) -> dict[str, npt.NDArray[Any]]:
    import pandas as pd
    import pyarrow.parquet

    names = pyarrow.parquet.read_schema(path).names
    duplicate = [name for name, count in Counter(names).items() if count > 1]
    if duplicate:
        raise InputError(f"{path}: two columns are named {duplicate[0]!r}. Rename or remove one of them.")
    frame = pd.read_parquet(path)
    return {str(name): frame[name].to_numpy() for name in frame.columns}


def _read_mat(path: Path) -> dict[str, npt.NDArray[Any]]:
    with path.open("rb") as file:
        version_7_3 = b"MATLAB 7.3" in file.read(128)
    if version_7_3:
        return _read_hdf5(path)
    from scipy.io import loadmat

    return _vectors({name: value for name, value in loadmat(path).items() if not name.startswith("__")})


def _read_hdf5(path: Path) -> dict[str, npt.NDArray[Any]]:
    import h5py

    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    short = Counter(name.rsplit("/", 1)[-1] for name in found)
    return _vectors({last if short[last := name.rsplit("/", 1)[-1]] == 1 else name: found[name] for name in found})


def _vectors(variables: Mapping[str, Any]) -> dict[str, npt.NDArray[Any]]:
    arrays = {name: np.asarray(value) for name, value in variables.items()}
    return {
        name: array.ravel()
        for name, array in arrays.items()
        if array.dtype.kind in "fiub" and array.size > 1 and array.size == max(array.shape)
    }


@contextlib.contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file beside its place and move it there when it is complete; its folder is made if need be.

    What is written is removed if the block raises, and whatever stood at the place before is then still there.

    Raises ComputationError if the system refuses: the disk is full, a folder lies in the file's place.

    Examples
    --------
    >>> with atomic_write("out/fit.json") as temporary:  # doctest: +SKIP
    ...     temporary.write_text("{}")
    """
    path = Path(path)
    temporary = path.with_name(f"{DRAFT}{secrets.token_hex(4)}-{path.stem[-_STEM:]}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise ComputationError(
            f"{shown(path)} cannot be written: {reason(error)}. Nothing of it is half-written, and what stood there "
            "before is still there. Make room, or name another folder, and give the same command again."
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def reason(error: OSError | ValueError) -> str:
    """Return what the system says about a file, without the file's name."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__


def shown(path: str | os.PathLike[str]) -> str:
    """Return a path for a message: a name that is no file's may be of any length."""
    text = os.fspath(path)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN // 2]}...{text[-_SHOWN // 2 :]}"
