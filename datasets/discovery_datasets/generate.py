"""Write the twin's recordings: ``python -m discovery_datasets.generate OUT [SET ...]``.

``OUT/<set>/<recording>.csv`` is made for each set named, all of them if none is. The files equal the committed ones bit
for bit on the same machine with the same pinned dependencies, and to the last printed digit or one beside it elsewhere.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from discovery_datasets.recordings import ARMS, make_set
from discovery_datasets.twin import write_csv


def generate(out: str | Path, sets: Sequence[str] = tuple(ARMS)) -> list[Path]:
    """Write the recordings of the named sets below `out` and return their paths."""
    written = []
    for arm in sets:
        for stem, frame in make_set(arm).items():
            path = Path(out) / arm / f"{stem}.csv"
            write_csv(frame, path)
            written.append(path)
    return written


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="discovery_datasets.generate", description="Write the twin's recordings.")
    parser.add_argument("out", type=Path, help="folder that receives one folder a set")
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"sets to write, of {', '.join(ARMS)}; default all")
    given = parser.parse_args(arguments)
    if unknown := [name for name in given.sets if name not in ARMS]:
        parser.error(f"unknown set {unknown[0]!r}; known are {', '.join(ARMS)}")
    generate(given.out, given.sets or tuple(ARMS))


if __name__ == "__main__":
    main()
