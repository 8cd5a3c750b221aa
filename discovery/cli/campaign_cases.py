"""The cases of a campaign: rig files below a folder, their recordings, and what their outcomes are made from."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: Files that are named before the rest is counted.
_NAMED = 5


@dataclass(frozen=True)
class Case:
    """One loop of a campaign: a rig file, the files of its recordings, and the folder where loop.json goes.

    The recordings are its `own`, those of its [records], or were found beside it; of its own, `only` one may be fitted.
    With `page`, the case gets a page of its own.
    """

    rig: Path
    train: tuple[Path, ...]
    holdout: tuple[Path, ...]
    own: bool
    only: int | None
    out: Path
    seed: int
    page: bool = False


def rig_files(where: Path) -> tuple[list[Path], list[Path]]:
    """Return the rig files below a folder, or the one that is named, and the other TOML files there.

    A ``rig*.toml`` counts even where it cannot be read. InputError if there is none, or the named one cannot be read.
    """
    from discovery.foundation.errors import InputError
    from discovery.foundation.io import shown
    from discovery.rigs.rig_file import read_rig

    if not os.path.exists(where):
        raise InputError(f"{shown(where)} does not exist. Give a folder with rig files in it, or a rig file.")
    if not where.is_dir():
        read_rig(where)
        return [where], []
    found = sorted(p for p in where.rglob("*.toml") if not any(n.startswith(".") for n in p.relative_to(where).parts))
    rigs = [path for path in found if path.name.startswith("rig") or _is_rig(path)]
    if not rigs:
        raise InputError(
            f"There is no rig file below {where}{listed(found)}. Give a rig file, or a folder that holds some."
        )
    return rigs, [path for path in found if path not in set(rigs)]


def _is_rig(path: Path) -> bool:
    """Whether a TOML file describes a system, rightly or not."""
    from discovery.declarations.unit_suffixes import split_suffix
    from discovery.rigs.kinds import KINDS
    from discovery.rigs.quantities import QUANTITIES

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    described = str(content.get("kind")) in KINDS or isinstance(content.get("columns"), dict)
    return isinstance(content.get("name"), str) and (
        described or any(split_suffix(key, QUANTITIES) is not None for key in content)
    )


def found_cases(
    rigs: Sequence[Path], root: Path, out: Path, *, seed: int = 1, each: bool = False, page: bool = False
) -> list[tuple[str, Case]]:
    """Return the cases of rig files below a folder by name, each with a folder in `out`, as `campaign` says."""
    cases: dict[str, Case] = {}
    for rig in rigs:
        place = (rig.parent if rig.name == "rig.toml" else rig.with_suffix("")).relative_to(root)
        base = "_".join(place.parts) or rig.stem
        train, holdout, own = _recordings(rig.resolve())
        parts: list[tuple[str, tuple[Path, ...], int | None]] = [(base, tuple(path for _, path in train), None)]
        if each and len(train) > 1:
            parts = [(f"{base}_{word}", (path,), i if own else None) for i, (word, path) in enumerate(train)]
        for wanted, files, only in parts:
            name, count = wanted, 1
            # The outcomes of all lie in the folder cases.
            while name in cases or name == "cases":
                count += 1
                name = f"{wanted}_{count}"
            cases[name] = Case(rig.resolve(), files, holdout, own, only, out.resolve() / name, seed=seed, page=page)
    return list(cases.items())


def _recordings(rig: Path) -> tuple[list[tuple[str, Path]], tuple[Path, ...], bool]:
    """Return the training recordings of a rig with their names, the hold-outs, and whether its [records] name them."""
    from discovery.foundation.errors import InputError
    from discovery.rigs.rig_file import read_rig

    try:
        records = read_rig(rig).records
    except InputError:  # told as the outcome of the case
        return [], (), False
    if train := records.get("train"):
        holdout = tuple(part.file for part in records.get("holdout", ()))
        return [(part.name or part.file.stem, part.file) for part in train], holdout, True
    return [(path.stem, path) for path in beside(rig, "train")], tuple(beside(rig, "holdout")), False


def beside(rig: Path, role: str) -> list[Path]:
    """Return the recordings beside a rig file that are named after a role, without those free of noise."""
    return [path for path in sorted(rig.parent.glob(f"{role}*.csv")) if not path.stem.endswith("_clean")]


def origins(cases: Sequence[tuple[str, Case]]) -> dict[str, dict[str, Any]]:
    """Return what every case is made from: version of the package, SHA-256 of the rig file and of its recordings."""
    from functools import cache
    from hashlib import file_digest
    from importlib.metadata import version

    @cache
    def sha256(path: Path) -> str | None:
        if os.path.exists(path):
            with path.open("rb") as file:
                return file_digest(file, "sha256").hexdigest()
        # Public measured data lie in the user's data folder, and are used only as they were registered.
        from discovery_datasets.registry import FILES, registered

        name = registered(path)
        return None if name is None else FILES[name].sha256

    package = version("discovery")
    return {
        name: {
            "version": package,
            "rig_file": sha256(case.rig),
            "training_recordings": [[path.name, sha256(path)] for path in case.train],
            "hold_outs": [[path.name, sha256(path)] for path in case.holdout],
        }
        for name, case in cases
    }


def listed(paths: Sequence[Path]) -> str:
    """Name files that were skipped because they are no rig files."""
    if not paths:
        return ""
    more = f" and {len(paths) - _NAMED} more" if len(paths) > _NAMED else ""
    return f"; skipped, no rig files: {', '.join(map(str, paths[:_NAMED]))}{more}"
