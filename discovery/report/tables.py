"""Tables: rounded for the page, with every digit for a CSV file."""

from __future__ import annotations

import base64
import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from markupsafe import Markup, escape

from discovery.equations.latex import parameter_letter, term
from discovery.report.mathml import inline

#: Cells of a page are text or ready markup; those of a CSV file plain values.
Cell = str | Markup
#: Characters beyond which a cell of words may break.
_LONG = 24
_HEAD = 'th scope="col"'


@dataclass(frozen=True)
class Table:
    """One table of the page, and its CSV file with the stem `name`.

    The `caption` says what it holds, units and intervals included. `header` and `rows` are of the page, rounded;
    `raw_header` and `raw_rows` of the CSV file, as the result file has them, or its very records, of which the columns
    of the header are taken. Columns of words, `text`, are set to the left, the others hold numbers. `narrow` are all
    columns in the order in which a narrow screen shows them, each row a paragraph; empty for a table that scrolls
    there.
    """

    name: str
    caption: str
    header: tuple[Cell, ...]
    rows: Sequence[Sequence[Cell]]
    raw_header: tuple[str, ...]
    raw_rows: Sequence[Sequence[Any] | Mapping[str, Any]]
    text: tuple[int, ...] = field(default=(0,))
    narrow: tuple[int, ...] = ()

    def html(self) -> Markup:
        """Return the table in a box that scrolls sideways where the screen is narrow."""

        def cells(tag: str, values: Iterable[Cell]) -> str:
            return "".join(
                f"<{tag}{self._look(i, v)}{self._place(i) if tag == 'td' else ''}>{escape(v)}</{tag.split()[0]}>"
                for i, v in enumerate(values)
            )

        # A unit of one has no brackets.
        header = [v if isinstance(v, Markup) else v.removesuffix(" []") for v in self.header]
        body = "".join(f"<tr>{cells('td', row)}</tr>" for row in self.rows)
        name, stacked = f"table-{self.name}", ' class="stacked"' if self.narrow else ""
        return Markup(
            f'<div class="caption"><p id="{name}">{escape(self.caption)}</p> {self._link()}</div>'
            f'<div class="scroll" tabindex="0" role="region" aria-labelledby="{name}">'
            f'<table{stacked} aria-labelledby="{name}">'
            f"<thead><tr>{cells(_HEAD, header)}</tr></thead><tbody>{body}</tbody></table></div>"
        )

    def _link(self) -> str:
        """Return the link that saves the table with every digit; it holds the file, so that it needs no other."""
        content = base64.b64encode(self.csv().encode("utf-8")).decode("ascii")
        return (
            f'<a class="csv" download="{escape(self.name)}.csv" href="data:text/csv;base64,{content}" '
            f'aria-label="CSV file of the table {escape(self.name.replace("_", " "))}">CSV</a>'
        )

    def _look(self, column: int, value: Cell) -> str:
        """Return the class of a cell: words to the left, and long ones may take several lines."""
        if column not in self.text:
            return ""
        long = value.count("<math") > 2 if isinstance(value, Markup) else len(value) > _LONG
        return ' class="t long"' if long else ' class="t"'

    def _place(self, column: int) -> str:
        """Return where a narrow screen shows a cell, and what it calls a number there."""
        if not self.narrow:
            return ""
        called = "" if column in self.text else f' data-label="{escape(self.header[column])}"'
        return f' style="order:{self.narrow.index(column)}"{called}'

    def csv(self) -> str:
        """Return the content of the CSV file."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.raw_header)
        for row in self.raw_rows:
            values = [row.get(key) for key in self.raw_header] if isinstance(row, Mapping) else row
            writer.writerow(["" if v is None else v for v in values])
        return buffer.getvalue()


def term_cell(text: str) -> Markup:
    """Return a term of an equation, such as ``delta^2 theta_t'``, as mathematics."""
    return inline(term(text))


def name_cell(name: str) -> Markup:
    """Return a parameter's symbol as mathematics; ``beta/alpha`` is a ratio."""
    return inline("/".join(map(parameter_letter, name.split("/"))))
