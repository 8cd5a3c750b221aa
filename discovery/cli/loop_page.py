"""The page of a loop alone, and what it is made of, kept beside it so that it can be made again."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from discovery.diagnosis.missing_force import MissingForce
    from discovery.recordings.dataset import Dataset
    from discovery.runs.failed_loop import FailedLoop
    from discovery.runs.loop_result import LoopResult

#: Folder beside loop.json that holds what the page is made of, its tables as CSV and its figures.
PARTS = "page"


def write_page(folder: Path, dataset: Dataset, result: LoopResult, missing: MissingForce | None, seed: int) -> Path:
    """Write the page of a loop, one file beside its loop.json, and keep what it is made of."""
    from discovery.runs.loop_files import gather_loop

    return _written(folder, lambda parts: gather_loop(parts, dataset, result, missing, seed))


def write_failed_page(folder: Path, loop: FailedLoop, seed: int) -> Path:
    """Write the page of a loop whose declared model has no fit."""
    from discovery.runs.failed_loop import gather_failed_loop

    return _written(folder, lambda parts: gather_failed_loop(parts, loop, seed))


def _written(folder: Path, gather: Callable[[Path], None]) -> Path:
    """Write a page of what is gathered for it, and keep that."""
    from discovery.results.manifest import SAVING

    with TemporaryDirectory(dir=folder, prefix=SAVING) as beside:
        parts = Path(beside) / PARTS
        parts.mkdir()
        gather(parts)
        remove_page(folder)
        parts.replace(folder / PARTS)
    return rebuild_page(folder)


def rebuild_page(folder: Path) -> Path:
    """Write the page of a loop again from what it is made of."""
    from discovery.report import build_report

    return build_report(folder / PARTS).replace(folder / "report.html")


def has_parts(folder: Path) -> bool:
    """Say whether a folder holds what the page of a loop is made of."""
    return (folder / PARTS / "results.json").is_file()


def check_parts(folder: Path) -> None:
    """Refuse a folder in which something else stands where the parts of the page belong."""
    from discovery.foundation.errors import InputError
    from discovery.foundation.io import shown

    parts = folder / PARTS
    if parts.exists() and not has_parts(folder):
        raise InputError(
            f"{shown(parts)} is where the parts of the page belong, and holds something else. Move it away, or give "
            "another folder with --out."
        )


def remove_page(folder: Path) -> None:
    """Remove the page of an earlier loop, and what it was made of: moved away whole, whatever ends the process then."""
    from discovery.results.manifest import SAVING

    (folder / "report.html").unlink(missing_ok=True)
    if has_parts(folder):
        with TemporaryDirectory(dir=folder, prefix=SAVING) as beside:
            (folder / PARTS).replace(Path(beside) / PARTS)
