"""Run the command line as ``python -m discovery.cli``."""

from __future__ import annotations

from discovery.cli import main

main()
