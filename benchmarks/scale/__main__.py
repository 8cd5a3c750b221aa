"""Do a campaign whose workers are killed, and write its table: ``python -m benchmarks.scale FOLDER [--rigs N]``."""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.faults.page import put
from benchmarks.scale.study import study

_HEAD = (
    "", "rigs", "kills", "begun", "lost", "kept twice", "differing", "time [s]", "efficiency", "parent’s processor [%]",
    "parent’s memory, second → last tenth [MiB]", "largest worker [MiB]",
)  # fmt: skip


def table(content: Mapping[str, Any]) -> str:
    """Return the numbers as Markdown."""
    lines = ["| " + " | ".join(_HEAD) + " |", "|---" * len(_HEAD) + "|"]
    for name, title in (("processes", "processes of this machine"), ("dask", "local Dask cluster")):
        one = content[name]
        counts = " | ".join(str(one[key]) for key in ("rigs", "kills", "begun", "lost", "kept_twice", "differing"))
        memory = f"{one['memory_mib']['second_tenth']:.0f} → {one['memory_mib']['last_tenth']:.0f}"
        shares = f"{100 * one['efficiency']:.0f} % | {100 * one['own_cpu_s'] / one['work_cpu_s']:.1f}"
        lines.append(
            f"| {title} | {counts} | {one['seconds']:.0f} | {shares} | {memory} | {one['worker_peak_mib']:.0f} |"
        )
    lines += [
        "",
        f"{content['workers']} workers on {content['cores']} cores; the page over all takes {content['page_s']:.0f} s.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scale")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rigs", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kill-every", type=float, default=25.0, help="rigs between two kills, on average")
    parser.add_argument("--page", type=Path, help="a page that is given the table")
    given = parser.parse_args()
    with TemporaryDirectory() as made:
        content = study(given.rigs, given.workers, given.kill_every, Path(made))
    content |= {"workers": given.workers, "platform": platform.platform()}
    content |= {"cores": os.cpu_count()}
    given.folder.mkdir(parents=True, exist_ok=True)
    (given.folder / "scale.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    text = table(content)
    if given.page is not None:
        put(given.page, "scale", text)
    print(f"{text}written: {given.folder / 'scale.json'}")


if __name__ == "__main__":
    main()
