"""Formulas of a page as LaTeX, to be copied into a paper."""

from __future__ import annotations

from xml.etree.ElementTree import Element, fromstring

from discovery.report.mathml import GREEK

_LETTERS = {letter: f"\\{name}" for name, letter in GREEK.items() if not name.startswith("var")}
_SIGNS = {
    "−": "-", "∂": "\\partial ", "∑": "\\sum", "∫": "\\int", "…": "\\dots", "×": "\\times ", "·": "\\cdot ",
    "≤": "\\le ", "≥": "\\ge ", "∞": "\\infty ", "±": "\\pm ", "{": "\\{", "}": "\\}",
    "\N{NARROW NO-BREAK SPACE}": "\\,", "\N{NO-BREAK SPACE}": "~", "\N{INVISIBLE TIMES}": "",
}  # fmt: skip
_PLAIN = str.maketrans({"\\": "\\backslash ", "_": "\\_", "%": "\\%", "#": "\\#", "&": "\\&", "$": "\\$"})
_DOTS = {"˙": "dot", ".": "dot", "..": "ddot", "...": "dddot"}


def latex(body: str) -> str:
    r"""Return a formula in presentation MathML, as the page shows it, as LaTeX.

    Examples
    --------
    >>> latex("<mrow><mi>α</mi><msup><mi>q</mi><mn>3</mn></msup></mrow>")
    '\\alpha q^{3}'
    """
    return " ".join(_written(fromstring(f"<mrow>{body}</mrow>")).split())


def _written(node: Element) -> str:
    parts = [_written(child) for child in node]
    match node.tag:
        case "mi" | "mn" | "mo":
            return _token(node)
        case "mtext":
            return f"\\text{{{(node.text or '').translate(_PLAIN)}}}"
        case "mspace":
            return "\\, "
        case "msup":
            return f"{_base(node[0], parts[0])}^{{{parts[1]}}}"
        case "msub" | "munder":
            return f"{parts[0].rstrip()}_{{{parts[1]}}}"
        case "msubsup" | "munderover":
            return f"{parts[0].rstrip()}_{{{parts[1]}}}^{{{parts[2]}}}"
        case "mfrac":
            return f"\\frac{{{parts[0]}}}{{{parts[1]}}}"
        case "msqrt":
            return f"\\sqrt{{{''.join(parts)}}}"
        case "mover":
            return f"\\{_DOTS.get((node[1].text or '').strip(), 'hat')}{{{parts[0].strip()}}}"
        case "mfenced":
            return f"\\left({', '.join(parts)}\\right)"
        case _:
            return "".join(parts)


def _base(node: Element, text: str) -> str:
    return text.rstrip() if node.tag in ("mi", "mn") or text.startswith("(") else f"{{{text.strip()}}}"


def _token(node: Element) -> str:
    text = (node.text or "").strip()
    if text in _LETTERS:
        return f"{_LETTERS[text]} "
    if text in _SIGNS:
        return _SIGNS[text]
    safe = text.translate(_PLAIN)
    written = "".join(_LETTERS.get(c, _SIGNS.get(c, c)) for c in safe) if text == safe else safe
    if node.tag == "mn" or len(text) < 2:
        return written
    if node.tag == "mo" and not text.isalpha():
        return written
    return f"\\mathrm{{{written}}}"
