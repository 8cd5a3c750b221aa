"""``python -m benchmarks.paper FOLDER``: run the studies and write the page."""

from __future__ import annotations

import sys
from pathlib import Path

from discovery.foundation.errors import DiscoveryError


def main() -> None:
    """Run every study that is not there yet, then write the page."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.paper FOLDER")
    from benchmarks.paper.page import build_page
    from benchmarks.paper.study import run_studies

    folder = Path(sys.argv[1])
    try:
        run_studies(folder, lambda sentence: print(f"  {sentence}", file=sys.stderr, flush=True))
        print(build_page(folder))
    except DiscoveryError as error:
        sys.exit(f"discovery: {error}")


if __name__ == "__main__":
    main()
