"""A campaign: many cases, each done once, kept on disk as they come, and collected in one table."""

from __future__ import annotations

import collections
import csv
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.foundation.progress import Counter, Tell
from discovery.posterior.pooled import pool
from discovery.results.provenance import plain, read_json, write_json
from discovery.runs.spread import Outcome, Work, spread

if TYPE_CHECKING:
    import pyarrow as pa

#: Rows of a table held at once.
_ROWS = 1000
#: Cases that must have a parameter for it to be pooled: the spread of two is hardly known.
_FEWEST = 3


def campaign(
    work: Work,
    cases: Iterable[tuple[str, Any]],
    folder: str | os.PathLike[str],
    *,
    settings: Mapping[str, Any] | None = None,
    origins: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    **how: Any,
) -> Iterator[Outcome]:
    """Do the cases that are not done yet, and keep every outcome on disk as it comes; yield the outcomes of these.

    The next call goes on where this one was interrupted; cases that failed or whose origin has changed are done again.
    Outcomes go to ``cases/NAME.json`` in the folder, whole or not at all. What else all of them depend on is in
    `settings`, what one is made from, such as hashes of files, in `origins` by its name: both JSON-ready. How they are
    done goes to `discovery.runs.spread.spread`.

    InputError if the folder holds outcomes under another seed or other settings.
    """
    folder = Path(folder)
    _claim(folder / "campaign.json", {"seed": seed, "settings": plain(settings or {})})
    known = origins or {}
    waiting = ((name, case) for name, case, _ in unfinished(cases, folder, known))

    def outcomes() -> Iterator[Outcome]:
        if (first := next(waiting, None)) is None:
            return
        for outcome in spread(work, chain([first], waiting), seed=seed, **how):
            origin = {"origin": known[outcome.name]} if outcome.name in known else {}
            write_json(_file(folder, outcome.name), asdict(outcome) | origin)
            yield outcome

    return outcomes()


def unfinished(
    cases: Iterable[tuple[str, Any]],
    folder: str | os.PathLike[str],
    origins: Mapping[str, Mapping[str, Any]] | None = None,
) -> Iterator[tuple[str, Any, str]]:
    """Yield the cases that a `campaign` still has to do, with the reason why one is done again, empty for a new one."""
    for name, case in cases:
        path = _file(Path(folder), name)
        if not path.exists():
            yield name, case, ""
        elif (reason := _outdated(path, (origins or {}).get(name))) is not None:
            yield name, case, reason


def _outdated(path: Path, origin: Mapping[str, Any] | None) -> str | None:
    """Return why a case is done again, None where its outcome stands."""
    try:
        kept = read_json(path)
    except InputError:
        return "its outcome cannot be read"
    if not isinstance(kept, dict) or not kept.keys() >= {"name", "seconds", "result", "error"}:
        return "its outcome is not whole"
    if kept["error"]:
        return "it failed before"
    if origin is None:
        return None
    if "origin" not in kept:
        return "what it was made from is not known"
    now = json.loads(json.dumps(plain(origin)))
    before = plain(kept["origin"])
    changed = [key for key in {**now, **before} if now.get(key) != before.get(key)]
    return f"changed since: {', '.join(changed).replace('_', ' ')}" if changed else None


def _claim(path: Path, content: dict[str, Any]) -> None:
    """Say what a folder is of, or refuse one that is of something else."""
    if not path.exists():
        write_json(path, content)
    elif plain(read_json(path)) != json.loads(json.dumps(content)):
        raise InputError(
            f"{path.parent} holds a campaign with another seed or other settings (see {path.name}). Delete it, or name "
            "another folder."
        )


def _file(folder: Path, name: str) -> Path:
    return folder / "cases" / f"{name.replace('/', '_')}.json"


def collect(folder: str | os.PathLike[str], names: Iterable[str] | None = None, *, apart: Sequence[str] = ()) -> Path:
    """Write the outcomes of a campaign, or of some of its cases, as one table, sorted by name, and return its path.

    ``results.parquet`` has the columns ``name``, ``seconds``, ``error`` and one for every key of the results. Keys that
    stand `apart` hold a list of mappings and become tables of their own, ``KEY.parquet``, with the name of the case.
    Beside each lies the same as CSV, JSON where no single value is. InputError if there are no outcomes.
    """
    folder = Path(folder)
    found = partial(rows, folder, None if names is None else tuple(names))
    if next(found(), None) is None:
        raise InputError(f"{folder} holds no outcomes of a campaign.")
    for key in apart:
        _write(folder / f"{key}.parquet", partial(_entries, found, key))
    out = folder / "results.parquet"
    _write(out, lambda: ({k: v for k, v in row.items() if k not in apart} for row in found()))
    return out


def _entries(found: Callable[[], Iterator[dict[str, Any]]], key: str) -> Iterator[dict[str, Any]]:
    for row in found():
        for entry in row.get(key) or ():
            yield {"name": row["name"], **entry}


def _write(out: Path, found: Callable[[], Iterator[dict[str, Any]]]) -> None:
    """Write rows as Parquet and, beside it, as CSV."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    # Once over all rows for the columns, once more to write them: memory holds a part of them at a time.
    schemas = [_table(part).schema for part in _parts(found())]
    schema = pa.unify_schemas([pa.schema([("name", pa.string())]), *schemas], promote_options="permissive")
    with atomic_write(out) as draft, pq.ParquetWriter(draft, schema) as writer:
        for part in _parts(found()):
            writer.write_table(pa.Table.from_pylist(part, schema=schema))
    with atomic_write(out.with_suffix(".csv")) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        lines = csv.DictWriter(file, schema.names)
        lines.writeheader()
        for row in found():
            lines.writerow({k: json.dumps(plain(v)) if isinstance(v, (dict, list)) else v for k, v in row.items()})


def rows(folder: str | os.PathLike[str], names: Iterable[str] | None = None) -> Iterator[dict[str, Any]]:
    """Yield the outcomes of a campaign, or of some of its cases, sorted by name, as `collect` writes them."""
    chosen = None if names is None else {_file(Path(folder), name) for name in names}
    for path in sorted((Path(folder) / "cases").glob("*.json")):
        if chosen is None or path in chosen:
            outcome = read_json(path)
            yield {**{k: outcome[k] for k in ("name", "seconds", "error")}, **(outcome["result"] or {})}


def _table(part: list[dict[str, Any]]) -> pa.Table:
    """Return rows as columns: every key that any of them has."""
    import pyarrow as pa

    names = dict.fromkeys(name for row in part for name in row)
    return pa.table({name: [row.get(name) for row in part] for name in names})


def _parts(found: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    while part := list(islice(found, _ROWS)):
        yield part


def watched(outcomes: Iterable[Outcome], total: int, title: str, tell: Tell) -> Iterator[Outcome]:
    """Yield outcomes and tell after each how many of all there are, how many failed and how long the rest will take."""
    counter, failed = Counter(tell, title, total, "done"), 0
    for done, outcome in enumerate(outcomes, 1):
        failed += bool(outcome.error)
        counter.told(done, f"{failed} failed" if failed else "")
        yield outcome


def pooled_parameters(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what the rows of a campaign say of each parameter together, see `discovery.posterior.pooled.pool`.

    An entry for each parameter, initial states left out, that at least three systems of one kind have in one unit with
    a standard deviation; the most frequent first, JSON-ready.
    """
    found: dict[tuple[str, str, str], list[tuple[str, str, float, float]]] = {}
    for row in rows:
        for entry in row.get("parameters") or ():
            # A parameter with brackets is of one recording.
            if entry.get("sd") and entry.get("value") is not None and "[" not in entry["parameter"]:
                unit = re.sub(r"\bq\b", row.get("coordinate_unit") or "q", entry.get("unit") or "")
                group = found.setdefault((row.get("kind") or "", entry["parameter"], unit), [])
                group.append((row["name"], entry.get("effect") or "", entry["value"], entry["sd"]))
    groups = sorted(found.items(), key=lambda item: -len(item[1]))
    return [_pooled(*key, estimates) for key, estimates in groups if len(estimates) >= _FEWEST]


def _pooled(kind: str, parameter: str, unit: str, estimates: list[tuple[str, str, float, float]]) -> dict[str, Any]:
    names, effects, values, sds = zip(*estimates, strict=True)
    said = pool(values, sds)
    return {
        "parameter": parameter,
        "effect": collections.Counter(effects).most_common(1)[0][0],
        "kind": kind,
        "unit": unit,
        "mean": asdict(said.mean),
        "spread": asdict(said.spread),
        "following": asdict(said.following),
        "cases": [
            {"name": name, "value": value, "sd": sd, "shrunk": asdict(shrunk), "shrinkage": share}
            for name, value, sd, shrunk, share in zip(names, values, sds, said.specimens, said.shrinkage, strict=True)
        ],
    }
