"""Which files belong to one run: results.json names each with its hash, and is written last."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from discovery.foundation.errors import InputError
from discovery.foundation.io import DRAFT
from discovery.foundation.locks import folder_lock

#: Files of a finished run, the one that says that it is finished last.
RESULTS = (
    "posterior.nc",
    "predictive.nc",
    "trajectories.nc",
    "amplitude.nc",
    "laws.nc",
    "force.nc",
    "loop.json",
    "results.json",
)
#: Begin of the names of folders in which results are gathered.
SAVING = ".saving-"
_LAST = RESULTS[-1]
#: What is made from the results of a run, and says that they are there.
_PAGE = "report.html"


def hashes(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of the files of those names that a folder holds."""
    found = (folder / name for name in names)
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in found if path.is_file()}


def check_whole(folder: Path, results: Mapping[str, Any]) -> None:
    """Refuse the files of a run where one is not that which its results.json names.

    One of an earlier version names no files, and is believed. InputError if a file of the run is missing, is another
    one, or is of no run.
    """
    origin = results.get("provenance")
    named = origin.get("files") if isinstance(origin, Mapping) else None
    if not isinstance(named, Mapping):
        return
    try:
        found = hashes(folder, dict.fromkeys((*named, *RESULTS[:-1])))
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error}. Run the pipeline again.") from None
    for name in dict.fromkeys((*named, *found)):
        if found.get(name) != named.get(name):
            fault = "is missing" if name not in found else "was not written by the run that wrote results.json"
            raise InputError(
                f"{folder / name} {fault}: the folder would mix results. Run the pipeline again, with a folder of its "
                "own for any other command."
            )


def move_in_place(beside: Path, out: Path, *, same_answer: bool = False) -> None:
    """Replace the results in a folder by those of a new run, gathered in another folder of the same disk.

    The file that says that they are whole goes first and comes last: a process that ends in between leaves a folder
    without it, never one that mixes two runs. The page of the former results goes with them, but where the new ones
    say the same and more.
    """
    for name in (_LAST,) if same_answer else (_LAST, _PAGE):
        (out / name).unlink(missing_ok=True)
    new = {path.name for path in beside.iterdir()} - {_LAST}
    old = {name for name in RESULTS if (out / name).is_file()} | {p.name for p in out.glob("manoeuvre_*.csv")}
    for name in sorted(old - new):
        (out / name).unlink()
    for name in (*sorted(new), _LAST):
        (beside / name).replace(out / name)


def remove_unfinished(out: Path) -> None:
    """Remove what commands that were ended from outside left in a folder and in those right below it.

    No other command may be writing to it; a folder below to which one does is left alone.
    """
    _remove_drafts(out)
    for folder in (path for path in out.iterdir() if path.is_dir() and not path.is_symlink()):
        with folder_lock(folder) as free:
            if free:
                _remove_drafts(folder)


def _remove_drafts(folder: Path) -> None:
    import shutil

    for gathered in folder.glob(f"{SAVING}*"):
        shutil.rmtree(gathered, ignore_errors=True)
    for draft in folder.glob(f"{DRAFT}{'[0-9a-f]' * 8}-*"):
        draft.unlink(missing_ok=True)
