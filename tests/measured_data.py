"""Whether measured recordings of others are here: a test that needs them is skipped with the reason, set by set."""

from __future__ import annotations

from pathlib import Path

import pytest
from discovery_datasets import registry

DATASETS = Path(__file__).parents[1] / "datasets"


def needs(*names: str) -> None:
    """Skip the test unless the sets or files of those names are here."""
    states = [s for s in registry.check() if s.name in names or s.name.partition("/")[0] in names]
    assert states, f"nothing is registered as {names}"
    missing = [f"{s.name} is {s.state}" for s in states if s.state != "ok"]
    if missing:
        pytest.skip(f"{', '.join(missing)}; set {registry.VARIABLE} to the folder that holds it")
