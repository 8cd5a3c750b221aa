"""What checking the paper found, a to i: each with the paper's number or form, ours, and the reason."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from discovery.report.mathml import GREEK
from discovery.report.numbers import MISSING, significant
from discovery.reproduction.items import Item

__all__ = ["finding_items"]

#: Errata of the list; the others were found beside them.
_LISTED = "abcdef"
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def finding_items(results: Mapping[str, Any]) -> list[Item]:
    """Return the rows of findings a to i, and of the misprints found beside them."""
    rows = {}
    for key, e in results["misprints"].items():
        printed, right, sentence = (typeset(e[n]) for n in ("printed", "right", "sentence"))
        rows[key] = Item("", e["where"], printed, right, MISSING, sentence)
    listed = [replace(row, key=f"erratum {key}") for key, row in rows.items() if key in _LISTED]
    others = [replace(row, key="misprint") for key, row in rows.items() if key not in _LISTED]
    return [*listed, *_statics(results["statics"]), *_steps(results["steps"]), *others]


def typeset(text: str) -> str:
    """Return plain formulas as a page prints them: Greek letters, dots for rates, superscripts, a true minus sign."""
    text = re.sub(r"\bp\'\'", "p̈", re.sub(r"theta_(\w)(\'+)", lambda m: f"θ{'̇̈'[len(m[2]) - 1]}_{m[1]}", text))
    text = re.sub(r"sqrt\((\w+)\)", r"√\1", text).replace("sqrt(", "√(")
    text = re.sub(r"\b(theta|rho|alpha|phi|Phi|Gamma)(?=\b|_)", lambda m: GREEK[m[1]], text)
    text = re.sub(r"\b(\d)e-(\d+)", lambda m: f"{m[1]} × 10^-{int(m[2])}", text)
    text = (
        re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_SUPERSCRIPT), text).replace("1/s²", "s⁻²").replace("'s ", "’s ")
    )
    return re.sub(r"(?<![\w⁻])-(?=[\dΦR])", "−", text)


def _statics(statics: Mapping[str, Any]) -> list[Item]:
    fitted = statics["least_squares"]
    return [
        Item(
            "g", "the elastica alone, a force across the radius",
            "β/α = 0.0585, γ = 0.4462 (fitted)",
            f"β/α = 13/210 = 0.0619, γ = 1/√5 = 0.4472 in the limit; {significant(fitted['ratio'], 3)} and "
            f"{significant(fitted['gamma'], 4)} by least squares up to {significant(fitted['delta_max'], 2)} rad",
            MISSING,
            "the paper’s β/α is 4 % below the static law; the spring that a constant radius should find in free motion is 12/175 = 0.0686, and β is its least robust number",
        )
    ]  # fmt: skip


def _steps(steps: Mapping[str, Any]) -> list[Item]:
    rungs = {(r["model"], r["how"]): r for r in steps["ladder"]}
    freed = {r["model"]: r for r in steps["freed"]}
    plain, held, free, one = (
        freed[n] for n in ("none of the terms", "all held at first principles", "all free", "centrifugal alone")
    )
    exact = rungs["exact, 3 modes", "rig"]["errors"]

    def angle(row: Mapping[str, Any]) -> str:
        return f"{significant(1e3 * row['errors']['trained']['angle_rms'], 2)} mrad"

    def mean(row: Mapping[str, Any], where: str) -> str:
        return f"{significant(1e3 * row['errors'][where]['mean'], 2)} mm"

    c = free["values"]
    return [
        Item(
            "h", "third-order terms in the rates, without a free parameter", "left out",
            f"angle error {angle(plain)} rms without them, {angle(held)} held at their values, {angle(free)} all free",
            MISSING,
            f"freed they are {significant(c['c_cen'], 2)}, {significant(c['c_cor'], 2)}, {significant(c['c_rad'], 2)}: they fit the "
            f"trained manoeuvre better ({mean(free, 'trained')} against {mean(held, 'trained')}) by standing in for the fifth order, "
            f"and predict others no better (inside {mean(free, 'inside')} against {mean(held, 'inside')}, beyond {mean(free, 'beyond')} "
            f"against {mean(held, 'beyond')}); c₁ alone makes β negative ({significant(one['values']['beta'], 2)} s⁻²)",
        ),
        Item(
            "i", "the exact arm, from the rig file with only ξ fitted", "left for further research",
            f"{mean(rungs['exact, 3 modes', 'rig'], 'trained')} mean on the trained manoeuvre, {mean(rungs['exact, 3 modes', 'rig'], 'inside')} inside, "
            f"{mean(rungs['exact, 3 modes', 'rig'], 'beyond')} beyond",
            f"at most {significant(1e3 * max(e['mean'] for e in exact.values()), 2)} mm",
            "three modes; with one the second bending mode is missing, with two the change of the static shape at large deflection",
        ),
    ]  # fmt: skip
