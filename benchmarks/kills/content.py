"""What a folder of results holds: whether each of its files is whole, and all that must not differ between two runs."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import pandas as pd

from discovery.foundation.errors import InputError
from discovery.results.manifest import check_whole

#: Keys and columns that say when something was done, or how long it took.
_CLOCK = frozenset({"created", "seconds", "loop_seconds"})
_STAMP = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+:0-9]*")


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file())


def hidden(folder: Path) -> list[str]:
    """Return the names below a folder that begin with a dot: what is not finished."""
    return [str(path.relative_to(folder)) for path in sorted(folder.rglob(".*"))]


def faults(folder: Path) -> list[str]:
    """Return what is wrong with the files of a folder of results, whatever they are of: each must be whole."""
    found = []
    for path in _files(folder):
        if path.name.startswith(".") or any(part.startswith(".") for part in path.relative_to(folder).parts):
            continue
        try:
            _read(path)
        except Exception as error:  # each library has its own exceptions for a damaged file
            found.append(f"{path.relative_to(folder)} is not whole: {type(error).__name__}: {error}")
    if (folder / "results.json").exists():
        try:
            check_whole(folder, json.loads((folder / "results.json").read_text(encoding="utf-8")))
        except InputError as error:
            found.append(str(error))
    return found


def _read(path: Path) -> Any:
    """Return what a file says, without when it was said; an exception where it is cut short."""
    data = path.read_bytes()
    if path.suffix == ".json":
        return _timeless(json.loads(data))
    if path.suffix in (".csv", ".parquet"):
        table = pd.read_csv(io.BytesIO(data)) if path.suffix == ".csv" else pd.read_parquet(io.BytesIO(data))
        return table.drop(columns=[name for name in table.columns if name in _CLOCK]).to_csv()
    if path.suffix in (".nc", ".h5"):
        with h5py.File(io.BytesIO(data)) as file:
            file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)
    if path.suffix in (".html", ".svg") and not data.rstrip().endswith((b"</html>", b"</svg>")):
        raise ValueError("the page is cut short")
    return _STAMP.sub(b"", data)


def _timeless(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _timeless(part) for key, part in value.items() if key not in _CLOCK}
    return [_timeless(part) for part in value] if isinstance(value, list) else value


def content(folder: Path) -> dict[str, Any]:
    """Return what each file below a folder says, to the last digit, by its path."""
    return {str(path.relative_to(folder)): _read(path) for path in _files(folder)}


def differences(found: dict[str, Any], expected: dict[str, Any]) -> list[str]:
    """Return in which files the content of a folder differs from that of another."""
    return [
        f"{name} is {'missing' if name not in found else 'left over' if name not in expected else 'another'}"
        for name in sorted({**expected, **found})
        if name not in found or name not in expected or found[name] != expected[name]
    ]
