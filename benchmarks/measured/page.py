"""The page that compares all measured sets: one self-contained HTML file made of the runs' result files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.measured.derived import Check, drive_checks, gravity_over_length
from benchmarks.measured.entry import Entry
from benchmarks.measured.figure import draw
from discovery.foundation.io import atomic_write
from discovery.report.answer import added_effects
from discovery.report.numbers import MISSING, significant, uncertain
from discovery.report.page import embed, environment
from discovery.report.sentences import verdict_sentence
from discovery.report.style import styled
from discovery.report.tables import Table
from discovery.report.words import effect_name, listed, page_prose, sentence, values_text

#: Rigs of this kind are many and alike: they share one section.
_MANY = "falling_body"


def build_comparison(entries: Sequence[Entry], folder: Path, left_out: Sequence[str] = ()) -> Path:
    """Write ``index.html``, ``figures/`` and ``tables/`` of a folder of runs.

    Parameters
    ----------
    entries : sequence of Entry
        At least one, in the order of the page.
    folder : Path
        The folder of the runs.
    left_out : sequence of str
        Why rigs have no run, for the page.

    Returns
    -------
    Path
        The page.
    """
    alone = [e for e in entries if e.run.results["rig"]["kind"] != _MANY]
    many = [e for e in entries if e not in alone]
    tables = {"overview": _overview(alone), **({"laws": _laws(many)} if many else {})}
    details = [t for e in entries for t in (_errors(e), _checks(e)) if t is not None]
    with styled():
        figure = embed(folder, draw(entries))
    for table in (*tables.values(), *details):
        with atomic_write(folder / "tables" / f"{table.name}.csv") as temporary:
            temporary.write_text(table.csv(), encoding="utf-8")
    context = {
        "answer": _answer(entries),
        "tables": {name: table.html() for name, table in tables.items()},
        "figures": {"overview": [figure]},
        "entries": [_section(e) for e in alone],
        "many": [_section(e) for e in many],
        "regressions": [f"{e.name}: {r}" for e in entries for r in e.regressions],
        "left_out": left_out,
    }
    path = folder / "index.html"
    with atomic_write(path) as temporary:
        page = environment("benchmarks.measured").get_template("comparison.html.j2").render(context)
        temporary.write_text(page, encoding="utf-8")
    return path


def _answer(entries: Sequence[Entry]) -> str:
    """Return what the page says in one sentence."""
    outcomes = [o for e in entries for o in e.outcomes]
    reached = sum(o.reached for o in outcomes)
    worse = sum(len(e.regressions) for e in entries)
    after = {e.name: e.error("after", e.judged) or 0.0 for e in entries}
    better = sum(after[e.name] < (e.error("before", e.judged) or 0.0) for e in entries)
    known = [(e, best[0]) for e in entries if (best := e.best_known(e.judged)) is not None]
    beaten = sum(after[e.name] <= best for e, best in known)
    return (
        f"Of {len(entries)} rigs, the loop lowers the held-out error of {better}, and reaches the best comparable "
        f"figure or less on {beaten} of the {len(known)} that have one; of {len(outcomes)} goals stated beforehand "
        f"{reached} are reached. {f'Regressions: {worse}' if worse else 'No result is a regression'}."
    )


def _name(entry: Entry) -> str:
    return sentence(str(entry.run.results["rig"]["name"]))


def _verdict(entry: Entry) -> str:
    return effect_name(entry.run.loop["verdict"])


def _declared(entry: Entry) -> str:
    return listed(effect_name(e) for e in entry.run.loop["declared"]) or "the bare body"


def _rows(entry: Entry) -> list[tuple[list[str], list[Any]]]:
    """Return the rows of a rig in the table over all: held-out recordings, then each that is only scored."""
    rows = []
    for group in ("holdout", *(g for g in entry.groups if g == "continued"), *entry.tests):
        before, after = (entry.error(when, group) for when in ("before", "after"))
        best, floor = entry.best_known(group), entry.floor(group)[0]
        first = group == "holdout"
        train = [entry.error(when, "train") if first else None for when in ("before", "after")]
        cells = [
            f"{_name(entry)}{f' [{entry.unit}]' if entry.unit else ''}" if first else f"… {entry.group_name(group)}",
            " + ".join([_declared(entry), *entry.added]) if first else "",
            _verdict(entry) if first else "",
            *(f"{significant(a)} → {significant(b)}" if b is not None else "" for a, b in (train, (before, after))),
            significant(best[0]) if best else MISSING,
            significant(floor),
            f"{sum(o.reached for o in entry.outcomes)} of {len(entry.outcomes)}" if first and entry.outcomes else "",
        ]
        raw = [entry.name, group, entry.run.loop["verdict"], " + ".join(entry.added), entry.unit, *train, before, after]
        rows.append((cells, [*raw, best and best[0], best and best[1], floor]))
    return rows


def _overview(entries: Sequence[Entry]) -> Table:
    rows = [row for e in entries for row in _rows(e)]
    head = (
        "recordings",
        "declared + added",
        "verdict",
        "training, before → after",
        "held out, before → after",
        "best known",
        "floor",
        "goals reached",
    )
    keys = (
        "rig",
        "group",
        "verdict",
        "added",
        "unit",
        "train_before",
        "train_after",
        "before",
        "after",
        "best_known",
        "best_known_model",
        "floor",
    )
    caption = (
        "Free-run rms errors. Held out: the initial state is fitted there, nothing else; run on from training: not "
        "even that. The held-out recordings also confirm what joins, so that their error is not that of unseen data; "
        "those that are only scored decide nothing. "
        "%: rms of the error over rms of the signal. No unit: over the signal’s standard deviation."
    )
    return Table("overview", caption, head, [r for r, _ in rows], keys, [r for _, r in rows], (0, 1, 2, 3, 4))


def _key(entry: Entry) -> str:
    return entry.name.replace("/rig_", "_").replace("/rig", "")


def _errors(entry: Entry) -> Table:
    """Return the errors of a rig beside all that is known."""
    groups = entry.groups
    rows = [
        (label, [entry.error(when, g) for g in groups])
        for label, when in (("declared model, refitted", "before"), (f"with {listed(entry.added)}", "after"))
        if when == "before" or entry.run.loop["effects"]
    ]
    if entry.reference:
        scores = [entry.scaled(entry.reference[g]["rms"], g) if g in entry.reference else None for g in groups]
        rows.append(("reference model, as published, through the same filter", scores))
    rows += [
        (f"{f.model} ({f.source}{'' if f.comparable else '; not comparable'})", [f.errors.get(g) for g in groups])
        for f in entry.known.figures
    ]
    unit = f" [{entry.unit}]" if entry.unit else ""
    head = ("model", *(f"{entry.group_name(g)}{unit}" for g in groups))
    cells = [[label, *map(significant, values)] for label, values in rows]
    floor, kind = entry.floor()
    over = "" if entry.unit else " over the standard deviation of the signal"
    caption = f"Free-run rms errors{over}. A perfect model would leave {entry.shown(floor)} ({kind})."
    return Table(f"errors_{_key(entry)}", caption, head, cells, ("model", *groups), [[n, *v] for n, v in rows])


def _checks(entry: Entry) -> Table | None:
    """Return fitted quantities beside independent values, where there are such."""
    checks: list[Check] = []
    if entry.known.reference is not None:
        checks += drive_checks(entry.run, entry.known.reference)
    hanging = gravity_over_length(entry.run)
    checks += [hanging] if hanging else []
    if not checks:
        return None
    cells = [
        [c.symbol, c.meaning, c.unit, uncertain(c.fitted, c.sd), uncertain(c.expected, c.expected_sd)] for c in checks
    ]
    raw = [[c.symbol, c.meaning, c.unit, c.fitted, c.sd, c.expected, c.expected_sd] for c in checks]
    source = "the geometry" if hanging else entry.known.reference.source if entry.known.reference else ""
    keys = ("symbol", "meaning", "unit", "fitted", "sd", "expected", "expected_sd")
    head = ("", "what", "unit", "fitted ± sd", "independent")
    return Table(f"checks_{_key(entry)}", f"The final model beside {source}.", head, cells, keys, raw, (0, 1, 2))


def _laws(entries: Sequence[Entry]) -> Table:
    """Return what the data prefer, body by body."""
    cells, raw = [], []
    for e in entries:
        added = {name: p for effect in e.run.loop["effects"] for name, p in effect["parameters"].items()}
        values = page_prose(values_text(added, e.run.coordinate_unit))
        errors = [e.error(when, group) for group in ("train", "holdout") for when in ("before", "after")]
        train, held = (f"{significant(a)} → {significant(b)}" for a, b in (errors[:2], errors[2:]))
        law = listed(e.added) or "nothing"
        cells.append([_name(e), law, values or MISSING, _verdict(e), train, held, significant(e.floor()[0])])
        raw.append([e.name, " + ".join(e.added), e.run.loop["verdict"], *errors, e.floor()[0]])
    unit = entries[0].unit
    head = (
        "body",
        "added",
        "parameters",
        "verdict",
        f"training, before → after [{unit}]",
        f"held out, before → after [{unit}]",
        f"floor [{unit}]",
    )
    keys = ("rig", "added", "verdict", "train_before", "train_after", "before", "after", "floor")
    caption = "What the data want added to the fall without air, body by body; “or”: they cannot tell which."
    return Table("laws", caption, head, cells, keys, raw, (0, 1, 2, 3))


def _section(entry: Entry) -> dict[str, Any]:
    """Return what the page says of one rig."""
    checks = _checks(entry)
    notes = dict.fromkeys(n for r in entry.run.results["recordings"] for n in r.get("notes", ()))
    return {
        "key": _key(entry),
        "name": _name(entry),
        "report": f"{entry.name}/report.html",
        "verdict": entry.run.loop["verdict"],
        "verdict_words": _verdict(entry),
        "because": verdict_sentence(entry.run.loop),
        "declared": _declared(entry),
        "added": added_effects(entry.run),
        "errors": _errors(entry).html(),
        "checks": checks.html() if checks else "",
        "outcomes": entry.outcomes,
        "bounds": entry.bounds,
        "remarks": entry.known.remarks,
        "notes": list(notes),
    }
