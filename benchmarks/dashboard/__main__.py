"""Command line of the dashboard."""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.dashboard.page import build_index
from discovery.foundation.errors import InputError

if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.dashboard FOLDER")
    try:
        print(build_index(Path(sys.argv[1])))
    except InputError as error:
        sys.exit(f"discovery: {error}")
