"""Tables: rounded for the page, with every digit for a CSV file."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from markupsafe import Markup, escape

from discovery.report.mathml import formula, inline, symbol

__all__ = ["Table", "name_cell", "term_cell"]

#: Cells of a page are text or ready markup; those of a CSV file plain values.
Cell = str | Markup


@dataclass(frozen=True)
class Table:
    """One table of the page and its CSV file.

    Parameters
    ----------
    name : str
        Stem of the CSV file.
    caption : str
        What it holds, units and intervals included.
    header : tuple of str
        Column heads of the page.
    rows : sequence of sequence of str or Markup
        Rounded cells.
    raw_header : tuple of str
        Column names of the CSV file.
    raw_rows : sequence of sequence
        The same numbers unrounded, as the result file has them.
    text : tuple of int
        Columns of words, set to the left; the others hold numbers.
    """

    name: str
    caption: str
    header: tuple[str, ...]
    rows: Sequence[Sequence[Cell]]
    raw_header: tuple[str, ...]
    raw_rows: Sequence[Sequence[Any]]
    text: tuple[int, ...] = field(default=(0,))

    def html(self) -> Markup:
        """Return the table in a box that scrolls sideways where the screen is narrow."""

        def cells(tag: str, values: Iterable[Cell]) -> str:
            kinds = (f' class="t"' if i in self.text else "" for i, _ in enumerate(self.header))
            return "".join(f"<{tag}{kind}>{escape(v)}</{tag}>" for kind, v in zip(kinds, values, strict=True))

        body = "".join(f"<tr>{cells('td', row)}</tr>" for row in self.rows)
        head = cells('th scope="col"', self.header).replace('</th scope="col">', "</th>")
        return Markup(
            f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(self.caption)}"><table>'
            f"<caption>{escape(self.caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
        )

    def csv(self) -> str:
        """Return the content of the CSV file."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.raw_header)
        writer.writerows(["" if v is None else v for v in row] for row in self.raw_rows)
        return buffer.getvalue()


def term_cell(text: str) -> Markup:
    """Return a term of an equation, such as ``delta^2 theta_t'``, as mathematics."""
    return Markup(inline(formula(text)))


def name_cell(name: str, latex: str = "") -> Markup:
    """Return a parameter's symbol as mathematics; ``beta/alpha`` is a ratio."""
    parts = [symbol(latex if latex and "/" not in name else part) for part in name.split("/")]
    return Markup(inline("<mrow>" + "<mo>/</mo>".join(parts) + "</mrow>"))
