"""Run the machines and write their table: ``python -m benchmarks.systems FOLDER [--only WORD ...] [--seed N]``."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from benchmarks.systems.cases import CASES
from benchmarks.systems.run import Outcome, run


def table(outcomes: dict[str, Outcome]) -> str:
    """Return the outcomes as Markdown."""
    lines = [
        "| machine and what it lacks | right | verdict, added | error of its parameters "
        "| held out over noise, before → after | loop: s, CPU s (load) |",
        "|---|---|---|---|---|---|",
    ]
    for name, o in outcomes.items():
        errors = ", ".join(f"{n} {100 * e:+.1f} %" for n, e in (o.errors or {}).items())
        held = "" if o.before is None or o.after is None else f"{o.before:.2f} → {o.after:.3f}"
        added = ", ".join(f"`{e}`" for e in o.added)
        lines.append(
            f"| {name} | {'yes' if o.right else '**no**'} | {o.verdict} {added} | {errors} | {held} "
            f"| {o.seconds:.1f}, {o.cpu:.1f} ({o.load:.1f}) |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Run the cases, and return how many were not answered rightly."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.systems")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[""], help="parts of the names of the cases to run")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    outcomes: dict[str, Outcome] = {}
    for name, case in CASES.items():
        if not any(part in name for part in given.only):
            continue
        word = "".join(c if c.isalnum() else "_" for c in name.lower())
        outcomes[name] = run(case, given.folder / "cases" / word, given.seed)
        print(f"{'right' if outcomes[name].right else 'WRONG'}: {name}: {outcomes[name]}", flush=True)
    given.folder.mkdir(parents=True, exist_ok=True)
    records = {name: asdict(outcome) for name, outcome in outcomes.items()}
    (given.folder / "systems.json").write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")
    (given.folder / "systems.md").write_text(table(outcomes), encoding="utf-8")
    print(f"written: {given.folder / 'systems.md'}")
    return sum(not outcome.right for outcome in outcomes.values())


if __name__ == "__main__":
    sys.exit(min(main(), 1))
