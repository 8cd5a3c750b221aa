"""The page of the two controllers, and their table for the documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.closed_loop.study import LAST, SEEDS, TURN
from discovery.foundation.io import atomic_write
from discovery.report.numbers import significant
from discovery.report.page import embed, environment
from discovery.report.style import BLUE, RED, Picture, new_figure, styled
from discovery.report.tables import Table

Row = Mapping[str, Any]
#: What is compared: key, which is also the head in the CSV file, and head of the column.
_MEASURES = (
    ("tip_error_mm", f"tip error in the last {LAST:g} s [mm]"),
    ("energy_left_uJ", "energy left in the arm [µJ]"),
    ("effort", "effort [rad²/s³]"),
    ("cost", "cost"),
)
_PRICE = "price of the acceleration [s⁴]"


def pairs(rows: Sequence[Row]) -> list[tuple[Row, Row]]:
    """Return the rows side by side: on the declared model, on the discovered one."""
    return list(zip(rows[::2], rows[1::2], strict=True))


def best(rows: Sequence[Row]) -> tuple[Row, Row]:
    """Return the pair in which the controller of the discovered model leaves the tip nearest to its goal."""
    whole = [pair for pair in pairs(rows) if not any("failure" in row for row in pair)]
    return min(whole, key=lambda pair: pair[1]["tip_error_mm"])


def _cells(before: Row, after: Row) -> list[str]:
    if "failure" in before or "failure" in after:
        return ["unstable"] * len(_MEASURES)
    return [f"{significant(before[key])} → {significant(after[key])}" for key, _ in _MEASURES]


def markdown(rows: Sequence[Row]) -> str:
    """Return the table as Markdown."""
    head = [_PRICE, *(words for _, words in _MEASURES)]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    lines += [f"| {before['price_s4']:g} | {' | '.join(_cells(before, after))} |" for before, after in pairs(rows)]
    return "\n".join(lines) + "\n"


def _table(rows: Sequence[Row]) -> Table:
    keys = [key for key, _ in _MEASURES]
    return Table(
        "controllers",
        f"Controller of the declared → of the discovered model, means over {len(SEEDS)} noises; from a gentle "
        "controller to a fast one.",
        (_PRICE, *(words for _, words in _MEASURES)),
        [[f"{before['price_s4']:g}", *_cells(before, after)] for before, after in pairs(rows)],
        ("price_s4", "model", *keys),
        [[row["price_s4"], row["model"], *(row.get(key) for key in keys)] for row in rows],
        text=(),
    )


def _draw(before: Row, after: Row) -> Picture:
    """Return tip and motor in both loops."""
    figure = new_figure(4.2)
    tip, motor = figure.subplots(2, 1, sharex=True)
    for row, colour, name in ((before, RED, "of the declared model"), (after, BLUE, "of the discovered model")):
        run = row["run"]
        tip.plot(run["time_s"], run["tip_mrad"], color=colour, label=f"controller {name}")
        motor.plot(run["time_s"], run["motor_rad_s2"], color=colour, drawstyle="steps-post")
    tip.set_ylabel("tip from its goal [mrad]")
    tip.set_ylim(-40.0, 40.0)
    motor.set_ylabel("motor [rad/s²]")
    motor.set_xlabel("time [s]")
    figure.legend(loc="outside upper left")
    return Picture(
        "closed_loop",
        figure,
        f"Tip and motor of the twin, which turns by {TURN:g} rad, at a price of {before['price_s4']:g} s⁴.",
        "The tip under the controller of the discovered model comes to rest closer to its goal.",
    )


def build_page(rows: Sequence[Row], folder: Path) -> Path:
    """Write ``report.html``, ``figures/`` and ``tables/`` of the study.

    Parameters
    ----------
    rows : sequence of mapping
        From `benchmarks.closed_loop.study.compare`.
    folder : Path
        Made if need be.
    """
    before, after = best(rows)
    table = _table(rows)
    with styled():
        figure = embed(folder, _draw(before, after))
    with atomic_write(folder / "tables" / f"{table.name}.csv") as draft:
        draft.write_text(table.csv(), encoding="utf-8")
    context = {
        "turn": f"{TURN:g}",
        "last": f"{LAST:g}",
        "price": f"{before['price_s4']:g}",
        "tip": [significant(row["tip_error_mm"]) for row in (before, after)],
        "energy": [significant(row["energy_left_uJ"]) for row in (before, after)],
        "tables": {"controllers": table.html()},
        "figures": {"closed_loop": [figure]},
    }
    path = folder / "report.html"
    with atomic_write(path) as draft:
        template = environment("benchmarks.closed_loop").get_template("closed_loop.html.j2")
        draft.write_text(template.render(context), encoding="utf-8")
    return path
