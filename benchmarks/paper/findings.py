"""What checking the paper found, a to i: each with the paper's number or form, ours, and the reason."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from benchmarks.paper.items import Item, percent
from discovery.report.numbers import GREEK, MISSING, significant
from discovery.report.references import paper_numbers

#: Errata of the list; the others were found beside them.
_LISTED = "abcdef"
_DOTS = {1: "\N{COMBINING DOT ABOVE}", 2: "\N{COMBINING DIAERESIS}"}
_SUBSCRIPT = {"m": "ₘ", "n": "ₙ", "t": "ₜ"}
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def finding_items(results: Mapping[str, Any]) -> list[Item]:
    """Return the rows of findings a to i, and of the misprints found beside them."""
    rows, differences = {}, _differences(results)
    for key, e in results["misprints"].items():
        printed, right, sentence = (typeset(e[n]) for n in ("printed", "right", "sentence"))
        rows[key] = Item("", e["where"], printed, right, differences.get(key, MISSING), sentence)
    listed = [replace(row, key=f"erratum {key}") for key, row in rows.items() if key in _LISTED]
    others = [replace(row, key="misprint") for key, row in rows.items() if key not in _LISTED]
    return [*listed, *_statics(results["statics"], results["comparison"]), *_steps(results["steps"]), *others]


def _differences(results: Mapping[str, Any]) -> dict[str, str]:
    """Return by how much what is printed is off, by erratum."""
    n = {key: e["numbers"] for key, e in results["misprints"].items()}
    return {
        "a": f"{significant(n['a']['rms_error_printed'] / n['a']['rms_acceleration'], 2)} accelerations",
        "b": f"{significant(n['b']['smallest_distance_printed_lengths'], 2)} lengths",
        "c": f"{significant(1 / n['c']['stiffness_over_printed'], 2)} times at {n['c']['length_m']:g} m",
        "d": " and ".join(percent(n["d"][k], n["d"]["alpha_fitted"]) for k in ("alpha_massless", "alpha_with_rod")),
        "e": percent(n["e"]["largest_mm"], n["e"]["printed_mm"]),
        "f": percent(n["f"]["ideal_rad"], n["f"]["printed_rad"]),
    }


def typeset(text: str) -> str:
    """Return plain formulas as a page prints them: Greek letters, dots for rates, sub- and superscripts, minus signs."""
    text = re.sub(r"theta_(\w)('+)", lambda m: f"θ{_DOTS[len(m[2])]}_{m[1]}", text)
    text = re.sub(r"\bp('+)", lambda m: f"p{_DOTS[len(m[1])]}", text)
    text = re.sub(r"sqrt\((\w+)\)", r"√\1", text).replace("sqrt(", "√(")
    text = re.sub(r"\b(theta|rho|alpha|delta|phi|Phi|Gamma)(?=\b|_)", lambda m: GREEK[m[1]], text)
    text = re.sub(r"_([mnt])\b", lambda m: _SUBSCRIPT[m[1]], text)
    text = re.sub(r"\b(\d)e-(\d+)", lambda m: f"{m[1]} × 10^-{int(m[2])}", text)
    text = (
        re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_SUPERSCRIPT), text).replace("1/s²", "s⁻²").replace("'s ", "’s ")
    )
    return re.sub(r"(?<![\w⁻])-(?=[\dΦR])", "−", text)


def _statics(statics: Mapping[str, Any], comparison: Mapping[str, Any]) -> list[Item]:
    fitted, paper = statics["least_squares"], paper_numbers()["parameters"]
    ratio, swing = paper["beta"] / paper["alpha"], comparison["printed"]["free_swing"]["ratio"]
    return [
        Item(
            "g", "the elastica alone, a force across the radius",
            f"β/α = {significant(ratio, 3)}, γ = {significant(paper['gamma'], 4)} (fitted)",
            f"β/α = 13/210 = 0.0619, γ = 1/√5 = 0.4472 in the limit; {significant(fitted['ratio'], 3)} and "
            f"{significant(fitted['gamma'], 4)} by least squares up to {significant(fitted['delta_max'], 2)} rad",
            f"{percent(fitted['ratio'], ratio)} and {percent(fitted['gamma'], paper['gamma'])}",
            "β/α of a motion is not that of a static force: a free swing of small amplitude has 12/175 = 0.0686 as its effective "
            f"value at constant radius, the twin’s free swing from 0.83 rad {significant(swing, 3)}, its whole record with the move "
            f"{significant(comparison['printed']['cubic']['values']['beta'] / comparison['printed']['cubic']['values']['alpha'], 3)}",
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
            f"{significant(plain['errors']['trained']['angle_rms'] / held['errors']['trained']['angle_rms'], 2)} times smaller",
            f"freed they come out at {significant(c['c_cen'], 3)}, {significant(c['c_cor'], 3)}, {significant(c['c_rad'], 3)} instead of 0.2, −0.4, 0.04: "
            f"they stand in for the fifth order of the trained manoeuvre ({mean(free, 'trained')} against {mean(held, 'trained')} held; inside it "
            f"{mean(free, 'inside')} against {mean(held, 'inside')}, beyond {mean(free, 'beyond')} against {mean(held, 'beyond')}); "
            f"c₁ alone makes β negative ({significant(one['values']['beta'], 2)} s⁻²)",
        ),
        Item(
            "i", "the exact arm, from the rig file with only ξ fitted", "left for further research",
            f"{mean(rungs['exact, 3 modes', 'rig'], 'trained')} mean on the trained manoeuvre, {mean(rungs['exact, 3 modes', 'rig'], 'inside')} inside, "
            f"{mean(rungs['exact, 3 modes', 'rig'], 'beyond')} beyond",
            f"at most {significant(1e3 * max(e['mean'] for e in exact.values()), 2)} mm",
            "three modes; with one the second bending mode is missing, with two the change of the static shape at large deflection",
        ),
    ]  # fmt: skip
