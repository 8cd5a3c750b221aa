"""Run the corpus and write its table: ``python -m benchmarks.faults FOLDER [--workers N] [--only WORD]``."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from benchmarks.faults.case import OUTCOMES, Outcome
from benchmarks.faults.corpus import corpus, outcome_of
from discovery.runs.spread import spread

#: Seconds after which a case counts as hanging.
LIMIT = 60.0


def table(outcomes: dict[str, Outcome]) -> str:
    """Return the outcomes by family, and each that may not be, as Markdown."""
    families: dict[str, Counter[str]] = {}
    for name, outcome in outcomes.items():
        families.setdefault(name.split(": ")[0], Counter())[outcome.outcome] += 1
    total = sum(families.values(), Counter())
    lines = [
        f"| family | attempted | {' | '.join(OUTCOMES)} |",
        "|---|" + "---|" * (len(OUTCOMES) + 1),
        *(
            f"| {name} | {count.total()} | {' | '.join(str(count[outcome]) for outcome in OUTCOMES)} |"
            for name, count in [*families.items(), ("all", total)]
        ),
        "",
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
    parser.add_argument("--only", nargs="*", default=[""], help="parts of the names of the cases to run")
    given = parser.parse_args(arguments)
    names = [name for name in corpus() if any(part in name for part in given.only)]
    found: dict[str, Outcome] = {}
    for done in spread(outcome_of, [(name, name) for name in names], workers=given.workers, limit=LIMIT):
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
    print(f"written: {given.folder / 'faults.md'}")
    return sum(not OUTCOMES[outcome.outcome] for outcome in outcomes.values())


if __name__ == "__main__":
    sys.exit(min(main(), 1))
