"""All studies in order; each is saved when it is done, and not repeated while the code is the same."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import discovery_datasets
import numpy as np
import xarray as xr
from numpy.typing import NDArray

import discovery
from benchmarks import paper
from discovery.foundation.progress import Progress, Tell
from discovery.results.curves import save_groups
from discovery.results.provenance import read_json, surroundings, write_json

FloatArray = NDArray[np.float64]

STUDIES = {
    "comparison": "P11 to P15 on both calibrations of the twin",
    "steps": "the three steps of the mechanics",
    "sensitivity": "speed, length of the record, mass of the rod",
    "claims": "the paper's claims",
    "normalisation": "other arms through equation (9)",
    "statics": "the elastica",
    "dynamics": "the general model",
    "motor": "motor, gear and coupling torque",
    "misprints": "the errata",
}
"""Every study by its module, and what it is about."""
#: Files that make the page and the commands, and no number.
_PAGE = (
    *("discovery/report/", "discovery/cli/", "discovery/export/", "paper/__main__", "paper/figures/", "paper/findings"),
    *("paper/items", "paper/page", "paper/study_tables", "paper/tables"),
)


def written_by() -> str:
    """Return a hash of every source file that a study depends on: the page's own files are not among them."""
    digest = hashlib.sha256()
    for package in (discovery, discovery_datasets, paper):
        root = Path(package.__path__[0])
        for path in sorted(root.rglob("*.py")):
            part = path.relative_to(root.parent).as_posix()
            if not part.startswith(_PAGE):
                digest.update(part.encode() + path.read_bytes())
    return digest.hexdigest()


def run_studies(folder: Path, tell: Tell) -> None:
    """Run every study that is not there yet and write ``studies.json``.

    Parameters
    ----------
    folder : Path
        Receives ``studies/NAME.json``, ``studies/NAME.nc`` and, last, ``studies.json``.
    tell : callable
        Receives a sentence before each study; where all that are left were run before, with how long they took then.
    """
    code = written_by()
    results: dict[str, Any] = {}
    kept = {name: _kept(folder, name) for name in STUDIES}
    for number, (name, about) in enumerate(STUDIES.items(), 1):
        path, done = folder / "studies" / f"{name}.json", kept[name]
        if done.get("code") != code:
            left = sum(
                kept[n].get("seconds", math.nan) for n in list(STUDIES)[number - 1 :] if kept[n].get("code") != code
            )
            tell(Progress.counting(about, number, len(STUDIES), "studies", seconds_left=left))
            began = time.monotonic()
            numbers, curves = _run(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            if curves:
                save_groups(path.with_suffix(".nc"), {k: _dataset(v) for k, v in curves.items()})
            write_json(path, {"code": code, "numbers": numbers, "seconds": time.monotonic() - began})
            done = read_json(path)
        results[name] = done["numbers"]
    write_json(
        folder / "studies.json",
        {"provenance": surroundings(["python", "-m", "benchmarks.paper", str(folder)]), **results},
    )


def _kept(folder: Path, name: str) -> dict[str, Any]:
    """Return what an earlier call found in a study."""
    path = folder / "studies" / f"{name}.json"
    return read_json(path) if path.exists() else {}


def _run(name: str) -> tuple[Mapping[str, Any], Mapping[str, Mapping[str, FloatArray]]]:
    """Return the numbers of a study, and its curves by group."""
    found = getattr(import_module(f"benchmarks.paper.studies.{name}"), name)()
    return found if isinstance(found, tuple) else (found, {})


def _dataset(arrays: Mapping[str, FloatArray]) -> xr.Dataset:
    """Return a group of arrays; each has axes of its own, named after it."""
    return xr.Dataset({k: ([f"{k}_{i}" for i in range(np.ndim(v))], np.asarray(v)) for k, v in arrays.items()})
