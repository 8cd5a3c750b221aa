"""Where a result comes from, and how it is written: beside first, then renamed."""

from __future__ import annotations

import json
import math
import os
import platform
import re
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write, shown
from discovery.foundation.revision import git_revision

if TYPE_CHECKING:
    # Processes that import this may never read a recording.
    from discovery.recordings.dataset import Dataset

#: What JSON has no numbers for, in the words of ECMAScript: a motion that blew up errs infinitely.
_INFINITE = {math.inf: "Infinity", -math.inf: "-Infinity"}
#: Text that could be taken for one of these words, as the name of a recording, gets one more backslash.
_WORD = re.compile(r"\\*-?Infinity")
_PACKAGES = ("discovery", "numpy", "scipy", "sympy", "numba", "pysindy", "emcee", "pandas", "xarray", "matplotlib")


def provenance(dataset: Dataset, *, seed: int, command: Sequence[str] | None = None) -> dict[str, Any]:
    """Return a record of data hashes, seed, versions, revision and command."""
    return {
        **surroundings(command),
        "seed": seed,
        "rig_sha256": dataset.rig.sha256,
        "data": [
            {
                "name": e.recording.name,
                "role": role,
                "sha256": e.recording.sha256,
                "source": Path(e.recording.source).name,
            }
            for role, e in dataset.everything
        ],
    }


def surroundings(command: Sequence[str] | None = None) -> dict[str, Any]:
    """Return a record of versions, revision, platform, time and command."""
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    parts = list(command) if command is not None else sys.argv
    shown = [Path(parts[0]).name, *(os.path.relpath(p) if os.path.isabs(p) else p for p in parts[1:])] if parts else []
    return {
        "command": " ".join(shown),
        "git_revision": git_revision(),
        "versions": versions,
        "platform": f"{platform.system()} {platform.machine()}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def plain(value: Any) -> Any:
    """Return nested data as JSON knows it: what is no number becomes null, what is infinite one of two words."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else _INFINITE[value]
    return f"\\{value}" if isinstance(value, str) and _WORD.fullmatch(value) else value


def read_json(path: Path) -> Any:
    """Return the content of a file from `write_json`, infinite numbers included.

    FileNotFoundError if there is no such file; InputError if it cannot be read, or is not JSON.
    """
    try:
        return restored(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{shown(path)} cannot be read as JSON: {error}. Make it again.") from error


def restored(content: Any) -> Any:
    """Return what `plain` was given, but for missing numbers: those that are infinite in the place of their words."""
    if isinstance(content, dict):
        return {k: restored(v) for k, v in content.items()}
    if isinstance(content, list):
        return [restored(v) for v in content]
    if isinstance(content, str) and _WORD.fullmatch(content):
        return content[1:] if content.startswith("\\") else next(n for n, w in _INFINITE.items() if w == content)
    return content


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file beside `path`, then rename it."""
    with atomic_write(path) as temporary:
        Path(temporary).write_text(json_text(content) + "\n", encoding="utf-8")


def json_text(content: Mapping[str, Any] | Sequence[Any]) -> str:
    """Return nested data as the text of a JSON document."""
    return json.dumps(plain(content), indent=1, allow_nan=False)
