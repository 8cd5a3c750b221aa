"""Formulas of docstrings as one line that a console can show."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator

_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)
_WORDS = {
    **{
        r"\,": " ",
        r"\ ": " ",
        r"\to": " -> ",
        r"\le": " <= ",
        r"\approx": " ~ ",
        r"\dots": "...",
        r"\int": " integral",
    },
    **dict.fromkeys((r"\left", r"\right", r"\Bigl", r"\Bigr"), ""),
    **{r"\varrho": " rho", r"\varphi": " phi"},
}
_FRACTIONS = (r"\frac", r"\tfrac")
_FUNCTIONS = (r"\sin", r"\cos", r"\arctan", r"\max")
_DOTS = {r"\dot": "'", r"\ddot": "''"}


def plain_text(docstring: str) -> str:
    """Return a docstring without its markup: formulas as plain text, displayed ones indented, each on its line."""

    def shown(found: re.Match[str]) -> str:
        return "\n".join(f"    {plain_formula(part)}" for part in re.split(r",?\\qquad", found[1]))

    text = re.sub(r"^\.\. math:: ?(.*(?:\n {4,}.*)*)", shown, docstring, flags=re.MULTILINE)
    return re.sub(r":math:`([^`]*)`|``([^`]*)``", lambda m: plain_formula(m[1]) if m[1] else m[2], text)


def plain_formula(latex: str) -> str:
    r"""Return a formula in LaTeX as plain text; a dot over a symbol becomes a prime.

    Examples
    --------
    >>> plain_formula(r"D = \tfrac13\, c_2\, v_t^3"), plain_formula(r"F = -\frac{g}{l}\, \dot\theta_t^2")
    ('D = 1/3 c_2 v_t^3', "F = -g/l theta_t'^2")
    """
    text = "".join(_pieces(deque(_TOKEN.findall(latex))))
    text = re.sub(r"('+)\s*(_(?:\w|\(\w+\))+)", r"\2\1", text)  # the prime of theta_t stands last
    text = re.sub(r"\s*([_^'),;\]])", r"\1", text)
    text = re.sub(r"([_^(\[])\s+", r"\1", text)
    text = re.sub(r"\| *([\w']+) *\|", r"|\1|", text)
    return re.sub(r"(^|[=(,] *)- ", r"\1-", " ".join(text.split()))


def _pieces(tokens: deque[str], end: str = "") -> Iterator[str]:
    while tokens:
        token = tokens.popleft()
        if token == end:
            return
        yield _piece(token, tokens)


def _piece(token: str, tokens: deque[str]) -> str:
    """Return what a token and its arguments stand for."""
    if token == "{":
        return "".join(_pieces(tokens, "}"))
    if token in _FRACTIONS:
        return f" {_whole(_argument(tokens))}/{_whole(_argument(tokens))} "
    if token == r"\sqrt":
        first = _argument(tokens)
        if first != "[":
            return f" sqrt({first.strip()})"
        degree = "".join(_pieces(tokens, "]"))
        return f" {_whole(_argument(tokens))}^(1/{degree})"
    if token in _DOTS:
        return f" {_argument(tokens).strip()}{_DOTS[token]} "
    if token == r"\operatorname" or token in _FUNCTIONS:
        name = token[1:] if token in _FUNCTIONS else _argument(tokens)
        of = tokens and tokens[0] in _FRACTIONS
        return f" {name}({_argument(tokens).strip()})" if of else f" {name}{_space(tokens)}"
    if token in (r"\mathrm", r"\text"):
        return _argument(tokens)
    if token in ("_", "^"):
        found = _argument(tokens).strip()
        return token + (found if found.isalnum() else f"({found})")
    if token in _WORDS or not token.startswith("\\"):
        return _WORDS.get(token, token)
    return f" {token[1:]}{_space(tokens)}"


def _argument(tokens: deque[str]) -> str:
    while tokens and not tokens[0].strip():
        tokens.popleft()
    return _piece(tokens.popleft(), tokens) if tokens else ""


def _space(tokens: deque[str]) -> str:
    """Return the blank after a word that something else than a bracket or an index follows."""
    return " " if tokens and re.match(r"\\?[A-Za-z0-9]", tokens[0]) else ""


def _whole(text: str) -> str:
    """Put what is more than one factor in brackets."""
    text = " ".join(text.split())
    return text if re.fullmatch(r"[\w^']*|\w+\([^()]*\)", text) else f"({text})"
