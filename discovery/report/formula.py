"""Terms as the result files name them, read into mathematics: ``delta^2 theta_t'``, ``1 - a delta^2``."""

from __future__ import annotations

import re

from discovery.foundation.errors import InputError
from discovery.report.mathml import power, row, symbol

_FUNCTIONS = ("sin", "cos", "sign", "tanh", "sqrt")


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
    """Return MathML of a term as results name it, such as ``delta^2 theta_t'`` or ``1 - a delta^2``.

    InputError if the text is not such a formula.
    """
    reader = _Reader(text)
    body = reader.sum()
    if reader.peek():
        raise InputError(f"The formula {text!r} cannot be read at {reader.peek()!r}.")
    return body
