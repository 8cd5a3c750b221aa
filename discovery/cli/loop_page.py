"""The page of a loop alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from discovery.diagnosis.missing_force import MissingForce
    from discovery.recordings.dataset import Dataset
    from discovery.runs.failed_loop import FailedLoop
    from discovery.runs.loop_result import LoopResult

__all__ = ["write_failed_page", "write_page"]


def write_page(folder: Path, dataset: Dataset, result: LoopResult, missing: MissingForce | None, seed: int) -> Path:
    """Write the page of a loop, one file beside its loop.json."""
    from discovery.runs.loop_files import gather_loop

    return _written(folder, lambda beside: gather_loop(beside, dataset, result, missing, seed))


def write_failed_page(folder: Path, loop: FailedLoop, seed: int) -> Path:
    """Write the page of a loop whose declared model has no fit."""
    from discovery.runs.failed_loop import gather_failed_loop

    return _written(folder, lambda beside: gather_failed_loop(beside, loop, seed))


def _written(folder: Path, gather: Callable[[Path], None]) -> Path:
    """Write a page of what is gathered for it, and kept nowhere."""
    from tempfile import TemporaryDirectory

    from discovery.report import build_report
    from discovery.results.manifest import SAVING

    with TemporaryDirectory(dir=folder, prefix=SAVING) as name:
        beside = Path(name)
        gather(beside)
        return build_report(beside).replace(folder / "report.html")
