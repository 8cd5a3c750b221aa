"""Run the corpus and write its table: ``python -m benchmarks.faults FOLDER [--workers N] [--only WORD]``."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from benchmarks.faults.case import OUTCOMES, Outcome
from benchmarks.faults.corpus import LIMIT, corpus, outcome_of
from benchmarks.faults.page import put
from discovery.runs.spread import spread

#: Times the processor's time of a case that it may take on a machine that does other things, too.
_BUSY = 10.0


def table(outcomes: dict[str, Outcome]) -> str:
    """Return the outcomes by family, and each that may not be, as Markdown."""
    families: dict[str, Counter[str]] = {}
    for name, outcome in outcomes.items():
        families.setdefault(name.split(": ")[0], Counter())[outcome.outcome] += 1
    total = sum(families.values(), Counter())
    slowest = max(outcomes.values(), key=lambda outcome: outcome.seconds, default=None)
    lines = [
        f"| family | attempted | {' | '.join(OUTCOMES)} |",
        "|---|" + "---|" * (len(OUTCOMES) + 1),
        *(
            f"| {name} | {count.total()} | {' | '.join(str(count[outcome]) for outcome in OUTCOMES)} |"
            for name, count in [*families.items(), ("all", total)]
        ),
        "",
        *([] if slowest is None else [f"The slowest takes {slowest.seconds:.0f} s of a processor's time.", ""]),
    ]
    for name, outcome in outcomes.items():
        if not OUTCOMES[outcome.outcome]:
            lines.append(f"- **{outcome.outcome}**, {name}: {' '.join(outcome.said.split())}")
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Run the corpus, and return the number of cases that ended as none may."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--page", type=Path, help="a page that is given the table")
    parser.add_argument("--only", nargs="*", default=[""], help="parts of the names of the cases to run")
    given = parser.parse_args(arguments)
    names = [name for name in corpus() if any(part in name for part in given.only)]
    found: dict[str, Outcome] = {}
    for done in spread(outcome_of, [(name, name) for name in names], workers=given.workers, limit=_BUSY * LIMIT):
        found[done.name] = (
            Outcome(**done.result)
            if done.result
            else Outcome("hang" if (done.error or "").startswith("TooLong") else "traceback", -1, done.error or "")
        )
        if not OUTCOMES[found[done.name].outcome]:
            print(f"{found[done.name].outcome}: {done.name}: {found[done.name].said[-300:]}", flush=True)
    outcomes = {name: found[name] for name in names}
    given.folder.mkdir(parents=True, exist_ok=True)
    records = {name: asdict(outcome) for name, outcome in outcomes.items()}
    (given.folder / "faults.json").write_text(json.dumps(records, indent=1, ensure_ascii=True) + "\n", encoding="utf-8")
    (given.folder / "faults.md").write_text(table(outcomes), encoding="utf-8")
    if given.page is not None:
        put(given.page, "corpus", table(outcomes))
    print(f"written: {given.folder / 'faults.md'}")
    return sum(not OUTCOMES[outcome.outcome] for outcome in outcomes.values())


if __name__ == "__main__":
    sys.exit(min(main(), 1))
