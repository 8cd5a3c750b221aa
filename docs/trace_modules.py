"""Count and draw the modules that the data pass from CSV to verdict: ``python docs/trace_modules.py PAGE.md OUT.svg``.

`discovery loop` runs on the recordings of datasets/arm_delay under a profiler. It notes each module of the package when
one of its functions is first called. Calls while a module is imported do not count. Files of effects are told apart:
all that apply are tried. The numbers are written between the marks of the page.
"""

from __future__ import annotations

import io
import os
import re
import sys
import threading
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "discovery"
BEGIN, END = "<!-- way: written by `make docs` -->", "<!-- end of way -->"
#: The rooms that the data pass, in order, and what happens there.
WAY = {
    "cli": "the command",
    "rigs": "the rig file: what is known before the recordings",
    "recordings": "CSV files, checked; inputs made smooth; experiments",
    "runs": "the loop: what is done when",
    "estimation": "fits, the model's own error, predictions",
    "screening": "every candidate: its response, its refit",
    "selection": "evidence, odds, search: the verdict",
    "diagnosis": "contradictions, rivals, missing force",
    "results": "where the result comes from",
    "report": "the page",
}
#: The rooms that these ask, and what of them.
ASKED = {
    "declarations": "effects, parameters, units",
    "mechanics": "the bare mechanics",
    "equations": "equation of motion, program",
    "simulation": "trajectories",
    "signals": "rates and spectra",
    "theory": "what the elastica predicts",
    "posterior": "noise models",
    "export": "the models in loop.json",
    "plots": "pictures for Python",
    "foundation": "files, caches, threads",
}
LOOP = ("runs", "estimation", "screening", "selection")
WIDTH, LEFT, BOX, SIDE, TALL, STEP = 860, 20, 500, 270, 46, 62


def traced() -> list[str]:
    """Return the files of the package in the order in which a function of each is first called."""
    seen: dict[str, None] = {}

    def note(frame: FrameType, event: str, _: object) -> None:
        name = frame.f_code.co_filename
        if event == "call" and name not in seen and name.startswith(str(PACKAGE)) and not _imports(frame):
            seen[name] = None

    from discovery.cli import main

    folder = ROOT / "datasets" / "arm_delay"
    train = [f"--train={folder / name}" for name in ("train_paper.csv", "train_large.csv")]
    command = ["loop", str(folder / "rig.toml"), *train, f"--holdout={folder / 'holdout_inside.csv'}", "--quiet"]
    said = io.StringIO()
    with TemporaryDirectory() as out, redirect_stdout(said), redirect_stderr(said):
        # What was compiled before would be loaded, and what writes it would not be called.
        os.environ["DISCOVERY_CACHE"] = f"{out}/compiled"
        threading.setprofile(note)
        sys.setprofile(note)
        try:
            main([*command, "--out", f"{out}/loop"])
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]
    return [Path(name).relative_to(PACKAGE).as_posix() for name in seen if name.endswith(".py")]


def _imports(frame: FrameType | None) -> bool:
    """Return whether a call is made by the body of a module, while it is imported."""
    while frame is not None:
        if frame.f_code.co_name == "<module>" and frame.f_code.co_filename.startswith(str(PACKAGE)):
            return True
        frame = frame.f_back
    return False


def counts(modules: Sequence[str]) -> dict[str, int]:
    """Return how many modules of each room execute a function, effects left out."""
    rooms = [name.partition("/")[0] for name in modules]
    return {room: rooms.count(room) for room in dict.fromkeys(rooms) if room != "effects"}


def sentence(modules: Sequence[str]) -> str:
    """Return the numbers in words."""
    rooms = counts(modules)
    every, page = sum(rooms.values()), rooms["report"]
    effects = sum(name.startswith("effects/") for name in modules)
    loop = sum(rooms[room] for room in LOOP)
    return (
        f"From the CSV files of `datasets/arm_delay` to the verdict, {every - page} modules execute a function.\n"
        f"The loop ({', '.join(f'`{room}`' for room in LOOP)}) has {loop} of them.\n"
        f"Another {page} make the page, and {effects} files of effects are offered."
    )


def draw(modules: Sequence[str]) -> str:
    """Return the picture: the way on the left, what is asked on it on the right."""
    rooms = counts(modules)
    assert set(rooms) <= {*WAY, *ASKED}, f"new rooms: {set(rooms) - {*WAY, *ASKED}}"
    way, asked = ([room for room in listed if room in rooms] for listed in (WAY, ASKED))
    height = 2 * LEFT + 30 + STEP * max(len(way), len(asked))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        'font-family="Helvetica, Arial, sans-serif" fill="#222" role="img" aria-label="From CSV to verdict">',
        '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0 L10 5 L0 10 z" fill="#0072b2"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>',
        _text(LEFT, 34, "from CSV to verdict: modules of each room that execute a function", 16, True),
    ]
    for i, room in enumerate(way):
        y = LEFT + 30 + STEP * i
        parts += _box(LEFT, y, BOX, "#dbe9f4", f"{room}: {rooms[room]}", WAY[room])
        if i + 1 < len(way):
            line = f'<path d="M{LEFT + BOX / 2:g} {y + TALL} V{y + STEP - 1}" fill="none" stroke="#0072b2"'
            parts.append(f'{line} stroke-width="2" marker-end="url(#head)"/>')
    for i, room in enumerate(asked):
        right = LEFT + BOX + 50
        parts += _box(right, LEFT + 30 + STEP * i, SIDE, "#eeeeee", f"{room}: {rooms[room]}", ASKED[room])
    return "\n".join([*parts, "</svg>"]) + "\n"


def _box(x: int, y: int, width: int, colour: str, title: str, words: str) -> list[str]:
    frame = f'<rect x="{x}" y="{y}" width="{width}" height="{TALL}" rx="6" fill="{colour}" stroke="#999"/>'
    return [frame, _text(x + 12, y + 20, title, 15, True), _text(x + 12, y + 38, words, 13)]


def _text(x: float, y: float, content: str, size: int, bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}"{weight}>{escape(content)}</text>'


def main() -> None:
    """Write numbers and picture."""
    page, picture = Path(sys.argv[1]), Path(sys.argv[2])
    modules = traced()
    picture.write_text(draw(modules), encoding="utf-8")
    text = page.read_text(encoding="utf-8")
    between = re.compile(re.escape(BEGIN) + r".*?" + re.escape(END), re.DOTALL)
    page.write_text(between.sub(f"{BEGIN}\n{sentence(modules)}\n{END}", text), encoding="utf-8")
    print("\n".join(modules))


if __name__ == "__main__":
    main()
