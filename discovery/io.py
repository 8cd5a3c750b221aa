"""Tables in files: named columns out of CSV, Parquet, MAT and HDF5, and results written whole or not at all."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import os
import secrets
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from discovery.errors import InputError

__all__ = ["Table", "atomic_write", "read_table"]

_CSV = (".csv", ".tsv", ".txt", ".dat")
_KNOWN = (*_CSV, ".parquet", ".pq", ".mat", ".h5", ".hdf5")


@dataclass(frozen=True)
class Table:
    """The columns of a file as they stand in it.

    Attributes
    ----------
    path : Path
    columns : mapping of str to array, shape (n,)
        Numbers where every cell is one (an empty cell is NaN), else the cells as text.
    sha256 : str
        Of the file's bytes.
    lines : array of int, shape (n,)
        Line of each row in a text file, from 1; empty for other formats.
    """

    path: Path
    columns: Mapping[str, npt.NDArray[Any]]
    sha256: str
    lines: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    def where(self, row: int) -> str:
        """Name a row for people: data rows count from 1."""
        line = f" (line {self.lines[row]} of the file)" if row < self.lines.size else ""
        return f"row {row + 1}{line}"

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """Give a column as numbers, shape (n,); empty cells are NaN.

        Raises
        ------
        InputError
            If a cell is text or infinite.
        """
        column = self.columns[name]
        if np.iscomplexobj(column):
            raise InputError(f"{self.path}: the column {name!r} holds complex numbers. Give real ones.")
        if column.dtype.kind in "OUSM":
            values, bad = _parse(column)
            if bad is not None:
                raise InputError(
                    f"{self.path}, column {name!r}, {self.where(bad)}: {str(column[bad])[:40]!r} is not a number. "
                    "Write numbers with a decimal point, and leave the cell empty where there is no reading."
                )
        else:
            values = np.asarray(column, np.float64)
        infinite = np.isinf(values)
        if infinite.any():
            row = int(np.argmax(infinite))
            raise InputError(
                f"{self.path}, column {name!r}, {self.where(row)}: the value is infinite. "
                "Leave the cell empty where there is no reading."
            )
        return values


def _parse(column: npt.NDArray[Any]) -> tuple[npt.NDArray[np.float64], int | None]:
    """Numbers of a column of text, and the first row that is none."""
    import pandas as pd

    text = pd.Series(column, dtype=object)
    empty = text.isna() | text.astype(str).str.strip().str.lower().isin(["", "nan", "na", "null", "none"])
    values = pd.to_numeric(text.where(~empty), errors="coerce").to_numpy(np.float64)
    wrong = np.isnan(values) & ~empty.to_numpy()
    return values, int(np.argmax(wrong)) if wrong.any() else None


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read the columns of a file.

    Parameters
    ----------
    path : path
        CSV (separated by commas, semicolons or tabs, one header line, ``#`` starts a comment line), Parquet, MAT (any
        version) or HDF5 (one-dimensional datasets).

    Raises
    ------
    InputError
        If the file is missing, empty, of an unknown format or not what its name says, or if two columns share a name.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _KNOWN:
        raise InputError(f"{path}: the format {suffix or 'without a suffix'!r} is not known. Use {', '.join(_KNOWN)}.")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}. Check the path of the recording.") from error
    if not content.strip():
        raise InputError(f"{path} is empty. Export the recording again.")
    sha256 = hashlib.sha256(content).hexdigest()
    if suffix in _CSV:
        columns, lines = _read_csv(path, content)
        return Table(path, columns, sha256, lines)
    readers = {".parquet": _read_parquet, ".pq": _read_parquet, ".mat": _read_mat}
    try:
        columns = readers.get(suffix, _read_hdf5)(path)
    except InputError:
        raise
    except Exception as error:  # each library has exceptions of its own for a damaged file
        raise InputError(
            f"{path} is not a readable {suffix} file ({error or type(error).__name__}). Export the recording again, "
            f"or give "
            "it the suffix of its true format."
        ) from error
    if not columns:
        raise InputError(f"{path} holds no column of numbers. Export the recording again, one named vector a column.")
    return Table(path, columns, sha256)


def _read_csv(path: Path, content: bytes) -> tuple[dict[str, npt.NDArray[Any]], npt.NDArray[np.int64]]:
    import pandas as pd

    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path} is a binary file, not text. Export the recording as CSV, or give it its true suffix.")
    stripped = (line.strip() for line in text.splitlines())
    lines = np.array([number for number, line in enumerate(stripped, 1) if line and line[0] != "#"], np.int64)
    if lines.size == 0:
        raise InputError(f"{path} is empty but for comments. Export the recording again.")
    kept = np.array(text.splitlines(), dtype=object)[lines - 1]
    first = str(kept[0])
    separator = max(",;\t", key=first.count)
    names = [name.strip() for name in next(csv.reader([first], delimiter=separator))]
    if all(_is_number(name) for name in names):
        raise InputError(
            f"{path}, line {lines[0]}: the first line holds numbers, not column names. Add a header such as "
            "'time_s,motor_angle_rad,tip_x_m,tip_y_m'."
        )
    duplicate = [name for name, count in Counter(names).items() if count > 1]
    if duplicate:
        raise InputError(
            f"{path}, line {lines[0]}: two columns are named {duplicate[0]!r}. Rename or remove one of them."
        )
    if lines.size == 1:
        raise InputError(f"{path} has a header and no data rows: it is empty. Export the recording again.")
    for line, row in zip(lines[1:], kept[1:], strict=True):
        cells = row.count(separator) + 1
        if cells > len(names) and '"' not in row:
            raise InputError(
                f"{path}, line {line}: {cells} cells in a table of {len(names)} columns. Use a decimal point in "
                f"numbers, "
                f"and {separator!r} only between columns."
            )
    with warnings.catch_warnings():
        # A column of mixed types is reported by Table.numbers, with its row.
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)
        try:
            frame = pd.read_csv(
                StringIO("\n".join(kept[1:])),
                sep=separator,
                header=None,
                names=names,
                index_col=False,
                skipinitialspace=True,
                skip_blank_lines=False,
            )
        except pd.errors.ParserError as error:
            raise InputError(f"{path} is not a table: {error}. Give every row as many cells as the header.") from error
    return {name: frame[name].to_numpy() for name in names}, lines[1:]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


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
    """Write a file beside its place and move it there when it is complete.

    Parameters
    ----------
    path : path
        The final place; its folder is made if need be.

    Yields
    ------
    Path
        Where to write; the same suffix, the same folder. It is removed if the block raises, and whatever stood at
        `path` before is then still there.

    Examples
    --------
    >>> with atomic_write("out/fit.json") as temporary:  # doctest: +SKIP
    ...     temporary.write_text("{}")
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
