"""Draw the picture of docs/ARCHITECTURE.md: ``python docs/draw_architecture.py OUT.svg``.

Boxes are layers, lowest at the bottom; a module imports only from lower boxes. The dashed path on the right is the way
of the data, from a recording to the page.
"""

from __future__ import annotations

import sys
from html import escape
from pathlib import Path

WIDTH, LEFT, BOX, STEP, TALL = 860, 20, 560, 74, 58
#: Layers from top to bottom: colour, title, modules, and what a run has at that level.
LAYERS = [
    ("#f6e8d5", "cli, report, testing", "commands, pages, what every effect must fulfil", "report.html"),
    ("#f6e8d5", "runs, export, results", "stages in order; a run is saved whole three times", "results.json, *.nc"),
    ("#dbe9f4", "diagnosis, selection, screening", "what is missing: screen, refit, compare evidences", "loop.json"),
    ("#dbe9f4", "sindy, posterior, theory", "discover, sample, check", "equation, posterior"),
    ("#dcefe3", "estimation", "residuals of a model on recordings, fits with a covariance", "estimates"),
    ("#dcefe3", "rigs, recordings, signals", "files in, checked; smooth input; derivatives", "rig.toml, *.csv"),
    ("#ece5f3", "simulation", "batches of simulations on a compiled kernel", ""),
    ("#ece5f3", "equations", "base + sum of effects: equations of motion, then a program", ""),
    ("#ece5f3", "mechanics/*", "bases: constant_radius, reduced, elastica, oscillator", ""),
    ("#fbe3e4", "effects/*", "one physical effect a file: a new effect goes here", ""),
    ("#eeeeee", "declarations", "what an effect is, and the words it is written in", ""),
    ("#eeeeee", "foundation", "exceptions, files, caches, threads: no mechanics", ""),
]  # fmt: skip


def text(x: float, y: float, content: str, size: int, extra: str = "") -> str:
    """Return one line of text."""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" {extra}>{escape(content)}</text>'


def arrow(path: str, dashed: bool = False) -> str:
    """Return an arrow along an SVG path."""
    style = ' stroke-dasharray="6 5" stroke="#0072b2"' if dashed else ' stroke="#555"'
    head = "data" if dashed else "import"
    return f'<path d="{path}" fill="none" stroke-width="2"{style} marker-end="url(#{head})"/>'


def draw() -> str:
    """Return the picture."""
    height = 2 * LEFT + 30 + STEP * len(LAYERS) + 66
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        'font-family="Helvetica, Arial, sans-serif" fill="#222" role="img" aria-label="Layers of the package">',
        "<defs>",
        *(
            f'<marker id="{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
            f'orient="auto"><path d="M0 0 L10 5 L0 10 z" fill="{colour}"/></marker>'
            for name, colour in (("import", "#555"), ("data", "#0072b2"))
        ),
        "</defs>",
        f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>',
        text(LEFT, 34, "discovery: a module imports only from the boxes below its own", 16, 'font-weight="bold"'),
        text(LEFT + BOX + 60, 34, "files of a run", 16, 'font-weight="bold" fill="#0072b2"'),
    ]
    tops = [LEFT + 30 + STEP * i for i in range(len(LAYERS))]
    filled = [i for i, layer in enumerate(LAYERS) if layer[3]]
    for i, (colour, title, meaning, file) in enumerate(LAYERS):
        y = tops[i]
        parts.append(f'<rect x="{LEFT}" y="{y}" width="{BOX}" height="{TALL}" rx="6" fill="{colour}" stroke="#999"/>')
        parts.append(text(LEFT + 14, y + 24, title, 16, 'font-weight="bold"'))
        parts.append(text(LEFT + 14, y + 45, meaning, 14))
        if i + 1 < len(LAYERS):
            parts.append(arrow(f"M{LEFT + BOX / 2:g} {y + TALL} V{y + STEP - 1}"))
        if file:
            parts.append(text(LEFT + BOX + 60, y + 34, file, 15, 'fill="#0072b2"'))
    for lower, upper in zip(filled[:0:-1], filled[-2::-1], strict=True):
        x = LEFT + BOX + 30
        parts.append(arrow(f"M{x} {tops[lower] + 26} V{tops[upper] + 34}", dashed=True))
    y = tops[-1] + STEP + 6
    parts.append(f'<rect x="{LEFT}" y="{y}" width="{BOX}" height="{TALL}" rx="6" fill="#fff8c9" stroke="#999"/>')
    parts.append(text(LEFT + 14, y + 24, "discovery_datasets (datasets/)", 16, 'font-weight="bold"'))
    parts.append(
        text(LEFT + 14, y + 45, "the twin and the registry of measured data; imports nothing of discovery", 14)
    )
    x, to = LEFT + BOX + 30, tops[filled[-1]] + 40
    parts.append(arrow(f"M{LEFT + BOX} {y + 30} H{x} V{to}", dashed=True))
    parts.append(text(x + 30, y + 34, "recordings", 15, 'fill="#0072b2"'))
    return "\n".join([*parts, "</svg>"]) + "\n"


def main() -> None:
    """Write the picture."""
    Path(sys.argv[1]).write_text(draw(), encoding="utf-8")


if __name__ == "__main__":
    main()
