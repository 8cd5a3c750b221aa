"""Compare both controllers and write their page: ``python -m benchmarks.closed_loop REPORTS FOLDER``."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from benchmarks.closed_loop.page import build_page, markdown
from benchmarks.closed_loop.study import compare
from benchmarks.faults.page import put
from discovery.results.provenance import read_json, write_json


def main(arguments: list[str] | None = None) -> None:
    """Run the study where its results are not there yet, and write its pages."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.closed_loop")
    parser.add_argument("reports", type=Path, help="with the folder of the loop on arm_delay")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--again", action="store_true", help="also where the results are there")
    parser.add_argument(
        "--page", type=Path, help="a page that is given the table, and beside it images/closed_loop.svg"
    )
    given = parser.parse_args(arguments)
    results = given.folder / "controllers.json"
    if given.again or not results.exists():
        given.folder.mkdir(parents=True, exist_ok=True)
        write_json(results, {"rows": compare(given.reports, given.workers)})
    rows = read_json(results)["rows"]
    page = build_page(rows, given.folder)
    if given.page is not None:
        put(given.page, "table", markdown(rows))
        shutil.copy(given.folder / "figures" / "closed_loop.svg", given.page.parent / "images" / "closed_loop.svg")
    print(f"written: {page}")


if __name__ == "__main__":
    main()
