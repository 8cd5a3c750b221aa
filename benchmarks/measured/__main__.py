"""``python -m benchmarks.measured list DATASETS`` and ``python -m benchmarks.measured page DATASETS FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

from discovery.foundation.errors import DiscoveryError


def main() -> None:
    """List the rigs whose recordings are at hand, or write the page over their runs; a regression is a failure."""
    from benchmarks.measured.rigs import at_hand

    match sys.argv[1:]:
        case ["list", datasets]:
            names, missing = at_hand(Path(datasets))
            print(*names)
            for sentence in missing:
                print(sentence, file=sys.stderr)
            if missing:
                print("set DISCOVERY_DATA to the folders that hold the measured files", file=sys.stderr)
        case ["page", datasets, folder]:
            try:
                page, regressions = _page(Path(datasets), Path(folder))
            except DiscoveryError as error:
                sys.exit(f"discovery: {error}")
            print(page)
            if regressions:
                sys.exit("\n".join(f"regression in {r}" for r in regressions))
        case _:
            sys.exit("usage: python -m benchmarks.measured list DATASETS | page DATASETS FOLDER")


def _page(datasets: Path, folder: Path) -> tuple[Path, list[str]]:
    from benchmarks.measured.entry import read_entries
    from benchmarks.measured.known import read_known
    from benchmarks.measured.page import build_comparison
    from benchmarks.measured.reference import score_reference
    from benchmarks.measured.rigs import at_hand, measured_rigs
    from discovery.results.provenance import write_json

    rigs = measured_rigs(datasets)
    names, missing = at_hand(datasets)
    for name in names:
        reference, run = read_known(rigs[name]).reference, folder / name
        if reference is not None and (run / "results.json").exists():
            write_json(run / "reference.json", score_reference(rigs[name], reference))
    failed = [name for name in names if not (folder / name / "results.json").exists()]
    unfinished = [f"no finished run: {', '.join(failed)}"] if failed else []
    entries = read_entries(rigs, folder)
    page = build_comparison(entries, folder, (*missing, *unfinished))
    return page, [f"{e.name}: {r}" for e in entries if e.name in names for r in e.regressions]


if __name__ == "__main__":
    main()
