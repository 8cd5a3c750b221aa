"""Formulas in LaTeX as presentation MathML, which browsers draw without any script or font of their own."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from html import unescape
from xml.etree.ElementTree import Element, SubElement, tostring

from latex2mathml.converter import Converter
from markupsafe import Markup

#: As the text of the page writes them.
_LETTERS = str.maketrans("ϕϵ", "φε")
_DOTS = {"˙": ".", "¨": "..", "\N{COMBINING THREE DOTS ABOVE}": "..."}
_SIGNS = ("+", "−", "=")
#: What a sign follows that belongs to the term behind it.
_OPEN = (*_SIGNS, "(", ",", "→")
_NO_FACTOR = ("mo", "mspace")


@cache
def inline(latex: str) -> Markup:
    """Return a formula within a line of text."""
    return _math(_row(latex, "inline"))


@cache
def block(latex: str) -> Markup:
    """Return a formula on a line of its own."""
    return _math(_row(latex), display="block")


def broken(latex: str) -> Markup:
    """Return a formula that a browser may break before each sign of its outermost sums: each term is one."""
    terms: list[list[Element]] = [[]]
    open_brackets, before = 0, ""
    for node in _row(latex):
        mark = (node.text or "") if node.tag == "mo" else ""
        if mark in _SIGNS and not open_brackets and terms[-1] and before not in _SIGNS:
            terms.append([])
            # At the begin of a formula it would be read as a sign that belongs to one number.
            node.set("form", "infix")
        open_brackets += (mark == "(") - (mark == ")")
        terms[-1].append(node)
        if mark == "," and not open_brackets:
            terms.append([])
        before = mark
    return Markup("<wbr/>").join(_math(term, displaystyle="true") for term in terms if term)


def _math(parts: Iterable[Element], **attributes: str) -> Markup:
    whole = Element("math", attributes)
    SubElement(whole, "mrow").extend(parts)
    return Markup(tostring(whole, encoding="unicode"))


def _row(latex: str, display: str = "block") -> Element:
    """Return the parts of a formula side by side."""
    # A word is one element, not one for each letter.
    (row,) = Converter(display=display).convert_to_element(latex.replace(r"\mathrm", r"\text"))
    for node in row.iter():
        # References to characters become these; whatever else a name holds is escaped when it is written.
        node.text = unescape(node.text or "").translate(_LETTERS)
    _tidy(row)
    return row


def _tidy(node: Element) -> None:
    for i, child in enumerate(node):
        _tidy(child)
        if child.tag == "mrow" and len(child) == 1:
            node[i] = child[0]
        elif child.tag == "mo" and child.text and child.text.isalpha():
            child.tag = "mi"
    if node.tag == "mover":
        _raise_dots(node)
    elif node.tag == "mrow":
        _space(node)
    elif node.tag == "msup" and node[0].tag == "msub":
        # An index below and an exponent above share their place.
        node.tag, node[:] = "msubsup", [*node[0], node[1]]


def _raise_dots(node: Element) -> None:
    """Write the dots of a time derivative as full stops, raised: accents sink into a letter without a fitting font."""
    base, over = node
    dots = _DOTS.get(over.text or "")
    if dots is None:
        return
    if base.tag == "msub":
        # The dots stand above the letter, not above its index.
        node.tag, over = "msub", Element("mover")
        over.extend([base[0], node[1]])
        node[:] = [over, base[1]]
        return _raise_dots(over)
    node.set("accent", "false")
    over.attrib, over.text = {"accent": "false"}, dots
    if len(base.text or "") > 1:
        # Larger, and clear of the tall letters of a word, so that they belong to none of them.
        over.set("mathsize", "140%")
        node[0] = Element("mpadded", height="1em")
        node[0].append(base)


def _space(row: Element) -> None:
    """Put a thin space between factors, and tell signs of terms from those between them."""
    before: Element | None = None
    for node in list(row):
        if before is not None and before.tag == "mo" and before.text in _OPEN and node.text in _SIGNS:
            node.set("form", "prefix")
        if before is not None and not {before.tag, node.tag} & {*_NO_FACTOR} and not _leads(before):
            row.insert(list(row).index(node), Element("mspace", width="0.12em"))
        before = node


def _leads(node: Element) -> bool:
    """Return whether a function, or the d of an integral, is written: what follows belongs to it."""
    name = node[0] if node.tag == "msup" else node
    text = name.text or ""
    return (name.tag == "mi" and len(text) > 1) or (name.tag == "mtext" and len(text) == 1)
