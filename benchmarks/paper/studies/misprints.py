"""The paper's misprints and contradictions, each with its check."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from discovery_datasets.twin import PAPER_RIG

from benchmarks.paper.errata import errata
from benchmarks.paper.stand import manoeuvre, stand

_SEED = 107


def misprints() -> dict[str, Any]:
    """Return every erratum by its letter, on a recording of the paper's manoeuvre."""
    return {e.key: asdict(e) for e in errata(stand(PAPER_RIG, manoeuvre(), name="errata", seed=[_SEED]))}
