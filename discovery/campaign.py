"""A campaign: many cases, each done once, kept on disk as they come, and collected in one table."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discovery.errors import InputError
from discovery.io import atomic_write
from discovery.provenance import plain, write_json
from discovery.spread import Outcome, Work, spread

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["campaign", "collect", "rows", "watched"]

#: Rows of a table held at once.
_ROWS = 1000


def campaign(
    work: Work,
    cases: Iterable[tuple[str, Any]],
    folder: str | os.PathLike[str],
    *,
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
    workers: int = 2,
    scheduler: str | None = None,
    limit: float | None = None,
) -> Iterator[Outcome]:
    """Do the cases that are not done yet, and keep every outcome on disk as it comes.

    Interrupted at whatever moment, the next call goes on where this one was; cases that failed are tried again.

    Parameters
    ----------
    work, cases, seed, workers, scheduler, limit
        See `discovery.spread.spread`.
    folder : path
        Every outcome is written to ``cases/<name>.json`` in it, whole or not at all.
    settings : mapping, optional
        What else the outcomes depend on; JSON-ready.

    Yields
    ------
    Outcome
        Of the cases that were done now.

    Raises
    ------
    InputError
        If the folder holds outcomes under another seed or other settings.
    """
    folder = Path(folder)
    _claim(folder / "campaign.json", {"seed": seed, "settings": plain(settings or {})})
    waiting = ((name, case) for name, case in cases if not _finished(_file(folder, name)))
    for outcome in spread(work, waiting, seed=seed, workers=workers, scheduler=scheduler, limit=limit):
        write_json(_file(folder, outcome.name), asdict(outcome))
        yield outcome


def _claim(path: Path, content: dict[str, Any]) -> None:
    """Say what a folder is of, or refuse one that is of something else."""
    if not path.exists():
        write_json(path, content)
    elif json.loads(path.read_text(encoding="utf-8")) != json.loads(json.dumps(content)):
        raise InputError(
            f"{path.parent} holds a campaign with another seed or other settings (see {path.name}). Delete it, or name "
            "another folder."
        )


def _file(folder: Path, name: str) -> Path:
    return folder / "cases" / f"{name.replace('/', '_')}.json"


def _finished(path: Path) -> bool:
    return path.exists() and not json.loads(path.read_text(encoding="utf-8"))["error"]


def collect(folder: str | os.PathLike[str]) -> Path:
    """Write the outcomes of a campaign as one table, sorted by name, and return its path.

    Parameters
    ----------
    folder : path
        That of `campaign`.

    Returns
    -------
    Path
        ``results.parquet`` in it: columns ``name``, ``seconds``, ``error`` and one for every key of the results.

    Raises
    ------
    InputError
        If there are no outcomes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = Path(folder)
    if next(rows(folder), None) is None:
        raise InputError(f"{folder} holds no outcomes of a campaign.")
    # Once over all outcomes for the columns, once more to write them: memory holds a part of them at a time.
    schema = pa.unify_schemas([_table(part).schema for part in _parts(folder)], promote_options="permissive")
    out = folder / "results.parquet"
    with atomic_write(out) as draft, pq.ParquetWriter(draft, schema) as writer:
        for part in _parts(folder):
            writer.write_table(pa.Table.from_pylist(part, schema=schema))
    return out


def rows(folder: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """Yield the outcomes of a campaign, sorted by name, as `collect` writes them."""
    for path in sorted((Path(folder) / "cases").glob("*.json")):
        outcome = json.loads(path.read_text(encoding="utf-8"))
        yield {**{k: outcome[k] for k in ("name", "seconds", "error")}, **(outcome["result"] or {})}


def _table(part: list[dict[str, Any]]) -> pa.Table:
    """Return rows as columns: every key that any of them has."""
    import pyarrow as pa

    names = dict.fromkeys(name for row in part for name in row)
    return pa.table({name: [row.get(name) for row in part] for name in names})


def _parts(folder: Path) -> Iterator[list[dict[str, Any]]]:
    found = rows(folder)
    while part := list(islice(found, _ROWS)):
        yield part


def watched(outcomes: Iterable[Outcome], total: int | None, title: str) -> Iterator[Outcome]:
    """Yield outcomes and show on standard error how many there are, how many failed and how long the rest will take.

    Parameters
    ----------
    outcomes : iterable of Outcome
        From `campaign` or `spread`.
    total : int or None
        How many there will be, if that is known.
    title : str
        One or two words.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[failed]}"))
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task, failed = bar.add_task(title, total=total, failed=""), 0
        for outcome in outcomes:
            failed += bool(outcome.error)
            bar.update(task, advance=1, failed=f"{failed} failed" * bool(failed))
            yield outcome
