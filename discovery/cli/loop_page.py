"""The page of a loop alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from discovery.diagnosis.missing_force import MissingForce
    from discovery.recordings.dataset import Dataset
    from discovery.runs.loop_result import LoopResult

__all__ = ["write_page"]


def write_page(folder: Path, dataset: Dataset, result: LoopResult, missing: MissingForce | None, seed: int) -> Path:
    """Write the page of a loop, one file beside its loop.json."""
    from tempfile import TemporaryDirectory

    from discovery.report import build_report
    from discovery.results.manifest import SAVING
    from discovery.runs.loop_files import gather_loop

    with TemporaryDirectory(dir=folder, prefix=SAVING) as beside:
        gather_loop(Path(beside), dataset, result, missing, seed)
        return build_report(beside).replace(folder / "report.html")
