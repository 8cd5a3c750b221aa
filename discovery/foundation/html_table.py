"""Small tables in HTML, as notebooks show a result."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def html_table(title: str, header: Sequence[str], rows: Iterable[Sequence[object]], *, below: str = "") -> str:
    """Return a sentence in bold, a table, and a sentence below it; numbers to four digits.

    Examples
    --------
    >>> html_table("a < b", ["name"], [[0.123456]])
    '<p><b>a &lt; b</b></p><table><tr><th>name</th></tr><tr><td>0.1235</td></tr></table>'
    """
    body = "".join("<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in rows)
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    said = f"<p>{escape(below)}</p>" if below else ""
    return f"<p><b>{escape(title)}</b></p><table><tr>{head}</tr>{body}</table>{said}"


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return escape(f"{value:.4g}" if isinstance(value, float) else str(value))
