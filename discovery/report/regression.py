"""What the sparse regression proposes by itself: an equation from smoothed derivatives alone."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10
from typing import Any

from markupsafe import Markup

from discovery.report.equations import discovered_equation
from discovery.report.formula import formula
from discovery.report.mathml import block
from discovery.report.numbers import significant
from discovery.report.results import Run


def regression_equation(equation: Mapping[str, Any], system: str) -> Markup:
    """Return an equation of the regression with its numbers, as many digits as their intervals deserve."""
    terms: list[tuple[str, str]] = []
    inputs: list[tuple[str, str]] = []
    for term, value, sd in zip(equation["terms"], equation["coefficients"], equation["sd"], strict=True):
        side = inputs if term == "u" else terms
        side.append((significant(value, _digits(value, sd)), "" if term == "1" else formula(term)))
    return Markup(block(discovered_equation(terms, inputs, system)))


def found_terms(discovery: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return terms, coefficients and deviations of the discovered equation."""
    keys = {"terms": "term", "coefficients": "coefficient", "sd": "sd"}
    return {name: [t[key] for t in discovery["terms"]] for name, key in keys.items()}


def three_terms(discovery: Mapping[str, Any], system: str) -> Mapping[str, Any] | None:
    """Return the best equation of three terms where the discovered one has another size."""
    best = discovery.get("best_three")
    if not best or len(best["terms"]) == len(discovery["terms"]):
        return None
    return {"share": f"{100 * best['probability']:.0f} %", "equation": regression_equation(best, system)}


def _digits(value: float, sd: float | None) -> int:
    """Return the significant digits down to the first one of the standard deviation, between two and six."""
    if not value or not sd or sd <= 0:
        return 4
    return min(6, max(2, 1 + floor(log10(abs(value))) - floor(log10(sd))))


def standing(run: Run) -> str:
    """Return what the proposal is beside the final model, so that nobody takes what it leaves for what is missing."""
    words = (
        "This is an independent proposal, not the answer: a regression on smoothed derivatives, which knows sums of "
        "simple terms alone. It says which terms the motion shows before anything is assumed. "
    )
    if run.loop["verdict"] in ("explained", "nothing_missing"):
        return words + "What it leaves is what such a sum cannot say; the final model has it, and leaves noise."
    return words + "What it leaves is what such a sum cannot say; how much the final model leaves, the verdict states."
