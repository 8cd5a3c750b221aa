"""Equations as presentation MathML, which browsers draw without any script or font of their own, and as LaTeX.

Terms as the result files name them, such as ``delta^2 theta_t'``, are read into it.

"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element, fromstring, tostring

from markupsafe import escape

from discovery.foundation.errors import InputError

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eta": "η", "theta": "θ", "kappa": "κ", "lambda": "λ",
    "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "varphi": "φ", "psi": "ψ",
    "omega": "ω", "Omega": "Ω", "Delta": "Δ", "Phi": "Φ",
    "Gamma": "Γ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ", "chi": "χ", "pi": "π",
}  # fmt: skip


#: A word below the dots of a time derivative, and the size of these.
WORD = '<mpadded height="1em">'
_WORD_DOT = ' mathsize="140%"'
_SIGNS = ("+", "−", "=")
_LOWERED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789\N{MINUS SIGN}")
_FUNCTIONS = ("sin", "cos", "sign", "tanh", "sqrt")


def row(*parts: str) -> str:
    """Return parts side by side."""
    return f"<mrow>{''.join(parts)}</mrow>"


def inline(body: str) -> str:
    """Return a formula within a line of text."""
    return f"<math>{body}</math>"


def block(body: str) -> str:
    """Return a formula on a line of its own."""
    return f'<math display="block">{body}</math>'


def broken(body: str) -> str:
    """Return a formula that a browser may break before each sign of its outermost sums: each term is one."""
    terms: list[list[str]] = [[]]
    open_brackets, before = 0, ""
    for node in _outermost(fromstring(f"<mrow>{body}</mrow>")):
        mark = (node.text or "") if node.tag == "mo" else ""
        if mark in _SIGNS and not open_brackets and terms[-1] and before not in _SIGNS:
            terms.append([])
            # At the begin of a formula it would be read as a sign that belongs to one number.
            node.set("form", "infix")
        open_brackets += (mark in ("(", "[")) - (mark in (")", "]"))
        terms[-1].append(tostring(node, encoding="unicode"))
        if mark == "," and not open_brackets:
            terms.append([])
        before = mark
    return "<wbr/>".join(f'<math displaystyle="true">{row(*term)}</math>' for term in terms if term)


def _outermost(node: Element) -> Iterator[Element]:
    """Return the parts of a formula that stand side by side; what holds no sign that divides stays whole."""
    for child in node:
        if child.tag == "mrow" and _has_sign(child):
            yield from _outermost(child)
        else:
            yield child


def _has_sign(node: Element) -> bool:
    first = node[0].text if len(node) and node[0].tag == "mo" else ""
    if first in ("(", "[", "|"):
        return False
    return any(
        part.text in (*_SIGNS, ",") if part.tag == "mo" else part.tag == "mrow" and _has_sign(part) for part in node
    )


def number(text: str) -> str:
    """Return a number as it is printed elsewhere: its minus sign as an operator, its power of ten raised."""
    minus = "\N{MINUS SIGN}"
    size, _, tens = text.removeprefix(minus).partition("×")
    body = f"<mn>{escape(size.rstrip())}</mn>"
    if tens:
        exponent = tens.strip().removeprefix("10").translate(_LOWERED)
        body = row(body, "<mo>×</mo>", f"<msup><mn>10</mn>{number(exponent)}</msup>")
    return row("<mo>−</mo>", body) if text.startswith(minus) else body


def symbol(name: str, dots: int = 0) -> str:
    """Return a symbol with subscripts after underscores, Greek letters by name, and dots for derivatives."""
    # A name comes from a file: nothing in it is markup.
    head, *tail = str(escape(re.sub(r"\\mathrm|[\\{}]", "", name))).split("_")
    letter = GREEK.get(head, head)
    core = f"<mi>{letter}</mi>"
    if dots:
        # Full stops, raised: without a mathematical font, true accents sink into the letter. Above a word they are
        # larger and clear of its tall letters, so that they belong to none of them.
        word = len(letter) > 1
        over = f'<mo accent="false"{_WORD_DOT if word else ""}>{"." * dots}</mo>'
        core = f'<mover accent="false">{f"{WORD}{core}</mpadded>" if word else core}{over}</mover>'
    subscript = ",".join(GREEK.get(t, t) for t in tail if t)
    return f"<msub>{core}<mi>{subscript}</mi></msub>" if subscript else core


def power(base: str, exponent: str) -> str:
    """Return a power; an index below and an exponent above share their place."""
    if base.startswith("<msub>") and base.endswith("</msub>") and base.count("<msub>") == 1:
        return f"<msubsup>{base[len('<msub>') : -len('</msub>')]}{exponent}</msubsup>"
    return f"<msup>{base}{exponent}</msup>"


def total(terms: Sequence[tuple[str, str]]) -> str:
    """Return a sum of (number as text, MathML of the factor); an empty number stands for one."""
    parts: list[str] = []
    for text, factor in terms:
        minus = text.startswith("\N{MINUS SIGN}")
        size = text[1:] if minus else text
        if minus or parts:
            parts.append(f"<mo>{'−' if minus else '+'}</mo>")
        if size:
            parts.append(f"<mn>{size}</mn>")
        parts.append(row('<mspace width="0.17em"/>' if size and factor else "", factor))
    return row(*parts) if parts else "<mn>0</mn>"


class _Reader:
    """Recursive descent over a small language: sums of products of names, powers, |x| and functions."""

    _TOKEN = re.compile(r"\s*(?:(?P<number>\d+\.?\d*)|(?P<name>[A-Za-z]+(?:_\w+)?)(?P<dots>'*)|(?P<mark>[-+^()|]))")

    def __init__(self, text: str) -> None:
        self.tokens: list[re.Match[str]] = []
        position = 0
        while position < len(text.rstrip()):
            token = self._TOKEN.match(text, position)
            if token is None:
                raise InputError(f"The formula {text!r} cannot be read at {text[position:]!r}.")
            self.tokens.append(token)
            position = token.end()
        self.position = 0
        self.inside = False  # between two bars, where the next one closes

    def peek(self) -> str:
        return self.tokens[self.position].group().strip() if self.position < len(self.tokens) else ""

    def take(self) -> re.Match[str]:
        if self.position >= len(self.tokens):
            raise InputError("A formula ends too early.")
        self.position += 1
        return self.tokens[self.position - 1]

    def sum(self) -> str:
        parts = []
        while self.peek() not in ("", ")", "|"):
            if self.peek() in "+-":
                parts.append(f"<mo>{'−' if self.take().group().strip() == '-' else '+'}</mo>")
            parts.append(self.product())
        return row(*parts)

    def product(self) -> str:
        parts = [self.power()]
        while (self.peek() and self.peek() not in ("+", "-", ")", "|")) or (self.peek() == "|" and not self.inside):
            parts += ['<mspace width="0.12em"/>', self.power()]
        return row(*parts)

    def power(self) -> str:
        base = self.atom()
        if self.peek() != "^":
            return base
        self.take()
        return power(base, self.atom())

    def atom(self) -> str:
        token = self.take()
        mark = token["mark"]
        if token["number"]:
            return f"<mn>{token['number']}</mn>"
        if mark == "|":
            self.inside = True
            body = self.sum()
            self.take()
            self.inside = False
            return row("<mo>|</mo>", body, "<mo>|</mo>")
        if mark == "(":
            body = self.sum()
            self.take()
            return row("<mo>(</mo>", body, "<mo>)</mo>")
        if mark:
            raise InputError(f"A formula has {mark!r} where a factor should be.")
        if token["name"] in _FUNCTIONS and self.peek() == "(":
            return row(f"<mi>{token['name']}</mi>", "<mo>&#x2061;</mo>", self.atom())
        return symbol(token["name"], len(token["dots"]))


def formula(text: str) -> str:
    """Return MathML of a term as results name it, such as ``delta^2 theta_t'``; InputError if the text is none."""
    reader = _Reader(text)
    body = reader.sum()
    if reader.peek():
        raise InputError(f"The formula {text!r} cannot be read at {reader.peek()!r}.")
    return body


_LATEX_LETTERS = {letter: f"\\{name}" for name, letter in GREEK.items() if not name.startswith("var")}
_LATEX_SIGNS = {
    "−": "-", "∂": "\\partial ", "∑": "\\sum", "∫": "\\int", "…": "\\dots", "×": "\\times ", "·": "\\cdot ",
    "≤": "\\le ", "≥": "\\ge ", "∞": "\\infty ", "±": "\\pm ", "{": "\\{", "}": "\\}",
    "\N{NARROW NO-BREAK SPACE}": "\\,", "\N{NO-BREAK SPACE}": "~", "\N{INVISIBLE TIMES}": "",
}  # fmt: skip
_PLAIN = str.maketrans({"\\": "\\backslash ", "_": "\\_", "%": "\\%", "#": "\\#", "&": "\\&", "$": "\\$"})
_ACCENTS = {"˙": "dot", ".": "dot", "..": "ddot", "...": "dddot"}


def latex(body: str) -> str:
    r"""Return a formula in presentation MathML, as the page shows it, as LaTeX.

    Examples
    --------
    >>> latex("<mrow><mi>α</mi><msup><mi>q</mi><mn>3</mn></msup></mrow>")
    '\\alpha q^{3}'
    """
    return " ".join(_as_latex(fromstring(f"<mrow>{body}</mrow>")).split())


def _as_latex(node: Element) -> str:
    parts = [_as_latex(child) for child in node]
    match node.tag:
        case "mi" | "mn" | "mo":
            return _token_latex(node)
        case "mtext":
            return f"\\text{{{(node.text or '').translate(_PLAIN)}}}"
        case "mspace":
            return "\\, "
        case "msup":
            return f"{_base_latex(node[0], parts[0])}^{{{parts[1]}}}"
        case "msub" | "munder":
            return f"{parts[0].rstrip()}_{{{parts[1]}}}"
        case "msubsup" | "munderover":
            return f"{parts[0].rstrip()}_{{{parts[1]}}}^{{{parts[2]}}}"
        case "mfrac":
            return f"\\frac{{{parts[0]}}}{{{parts[1]}}}"
        case "msqrt":
            return f"\\sqrt{{{''.join(parts)}}}"
        case "mover":
            return f"\\{_ACCENTS.get((node[1].text or '').strip(), 'hat')}{{{parts[0].strip()}}}"
        case "mfenced":
            return f"\\left({', '.join(parts)}\\right)"
        case _:
            return "".join(parts)


def _base_latex(node: Element, text: str) -> str:
    return text.rstrip() if node.tag in ("mi", "mn") or text.startswith("(") else f"{{{text.strip()}}}"


def _token_latex(node: Element) -> str:
    text = (node.text or "").strip()
    if text in _LATEX_LETTERS:
        return f"{_LATEX_LETTERS[text]} "
    if text in _LATEX_SIGNS:
        return _LATEX_SIGNS[text]
    safe = text.translate(_PLAIN)
    written = "".join(_LATEX_LETTERS.get(c, _LATEX_SIGNS.get(c, c)) for c in safe) if text == safe else safe
    if node.tag == "mn" or len(text) < 2:
        return written
    if node.tag == "mo" and not text.isalpha():
        return written
    return f"\\mathrm{{{written}}}"
