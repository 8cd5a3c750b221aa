"""The first screen: the verdict with its odds, the final equation with its numbers, and the error before and after."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from discovery.equations.latex import number, parameter_letter
from discovery.report.effect_formulas import known_constants, meanings
from discovery.report.equations import model_formulas
from discovery.report.estimates import declared_parameters, symbol_of, unit_of
from discovery.report.mathml import inline
from discovery.report.numbers import MISSING, in_newtons, significant, uncertain, unit_text
from discovery.report.results import Run
from discovery.report.sentences import chances, effect_sentence, inclusion_words
from discovery.report.words import compared_groups, effect_name, effect_title, error_scale, listed

#: Digits of a coefficient in the equation; the list beside it has them all.
_DIGITS = 4
#: What a short name of a group of recordings leaves out.
_SHORT = re.compile(" the trained .*")
#: A negative number that is added, or taken away, at the begin of a term.
_ADDED_NEGATIVE = re.compile(r"([+-]) \\left\(-((?:[\d.]|\\,|\\times 10\^\{-?\d+\}| )+)\\right\)(?!\^)")
#: What is part of a symbol, or of words: an index, what has dots above it, a name in letters.
_BODY = r"\{(?:[^{}]|\{[^{}]*\})*\}"
_PARTS = rf"_{_BODY}|_\\mathrm\{{\w*\}}|_\w|\\(?:text|mathrm|operatorname|begin|end|d+ot){_BODY}|\\[A-Za-z]+"


def certainty(run: Run) -> list[tuple[str, str]]:
    """Return added effects of which the same is said, with their odds, and the probability of one of the catalogue."""
    steps = run.loop["steps"]
    better = {s["effects"][0]: s["numbers"].get("odds") for s in steps if s["action"] == "mechanics" and s["accepted"]}
    alike: dict[str, list[str]] = {}
    for effect in run.loop["effects"]:
        odds = effect["evidence"]["odds"] if effect["evidence"] else better.get(effect["id"])
        if odds is None and not effect["evidence"]:
            continue
        words = chances(odds).removeprefix("odds of ")
        if not effect["evidence"]:
            words += ", over simpler mechanics"
        elif effect["probability"] is not None:
            words += f", {inclusion_words(effect)}"
        alike.setdefault(words, []).append(effect_name(effect["id"]))
    return [(listed(names), words) for words, names in alike.items()]


def _parameters(run: Run) -> dict[str, Mapping[str, Any]]:
    return {name: p for name, p in run.loop["model"]["after"]["parameters"].items() if "[" not in name}


def equation_lines(run: Run) -> list[tuple[str, str]]:
    """Return the formulas of the final model with its numbers: words, and mathematics in LaTeX."""
    after = run.loop["model"]["after"]
    known = known_constants(after["model"]["base"])
    printed = {name: significant(value, _DIGITS) for name, value in known.items()}
    printed |= {name: significant(p["value"], _digits(p["value"], p["sd"])) for name, p in _parameters(run).items()}
    values = {parameter_letter(name): text for name, text in printed.items()}
    lines = []
    plain = {name: p["value"] for name, p in _parameters(run).items()}
    for formula in model_formulas(after["model"], run.results["rig"]["kind"], after["model"].get("known", {}) | plain):
        told = _with_numbers(formula.latex, values)
        if told != formula.latex or formula.needed:
            lines.append((formula.words, told))
    return lines


def where(run: Run, lines: Sequence[tuple[str, str]]) -> Markup:
    """Return what the symbols of an arm's equation mean; empty for other systems."""
    if not run.system.has_rod or len(lines) < 2:
        return Markup("")
    return Markup(meanings(" ".join(tex for _, tex in lines)))


def in_one(lines: Sequence[tuple[str, str]]) -> str:
    """Return the LaTeX of lines as that of one formula."""
    body = " \\\\\n".join(tex for _, tex in lines)
    return f"\\begin{{gathered}}\n{body}\n\\end{{gathered}}" if len(lines) > 1 else body


def _digits(value: float, sd: float | None) -> int:
    """Return the digits of a coefficient: those that two digits of its deviation leave, but few."""
    if not value or not sd or not math.isfinite(sd):
        return _DIGITS
    known = math.floor(math.log10(abs(value))) - math.floor(math.log10(sd)) + 2
    return min(_DIGITS, max(1, known))


def _with_numbers(formula: str, values: Mapping[str, str]) -> str:
    """Return a formula with printed numbers for symbols; a symbol that is part of another one stays."""

    def told(found: re.Match[str]) -> str:
        if not found["symbol"]:
            return found[0]
        printed = number(values[found["symbol"]])
        # A power of ten that is raised itself would be read as one number.
        raised = r"\times" in printed and formula[found.end() :].startswith("^")
        return rf"\left({printed}\right)" if raised or printed.startswith("-") else printed

    symbols = "|".join(re.escape(symbol) for symbol in sorted(values, key=len, reverse=True))
    body = re.sub(rf"(?P<symbol>{symbols})(?![A-Za-z_])|{_PARTS}", told, formula) if values else formula
    body = _ADDED_NEGATIVE.sub(lambda found: f"{'-' if found[1] == '+' else '+'} {found[2]}", body)
    # Two numbers side by side would be read as one.
    return re.sub(r"(?<=[\d}]) (?=\d)", r" \\cdot ", body)


def given_up(run: Run) -> str:
    """Return the declared losses in whose place an effect stands, in words; empty without."""
    return listed([effect_name(loss) for loss in run.loop.get("given_up", ())])


def added_effects(run: Run) -> list[tuple[str, str, list[tuple[str, str]], str, str]]:
    """Return what the loop added: name, title, parameters with their values, odds and rivals, in words."""
    found = []
    for e in run.loop["effects"]:
        values = [
            (symbol_of(name), f"{uncertain(p['value'], p['sd'])} {unit_text(p['unit'], run.coordinate_unit)}".strip())
            for name, p in e["parameters"].items()
        ]
        rivals = listed(effect_name(r) for r in e["ambiguous_with"])
        found.append((effect_name(e["id"]), effect_title(e["id"]), values, effect_sentence(e), rivals))
    return found


def parameter_lines(run: Run) -> list[tuple[str, str, str, str]]:
    """Return the parameters of the final model: symbol, value with its deviation, unit, and what it is."""
    after = run.loop["model"]["after"]
    declared = declared_parameters(after["model"])
    physical = after.get("physical", {})
    # Where a force is read it tells the inertia, which is the row below, and the others are forces.
    forces = physical if run.reads_force and "inertia" in physical else {}
    found = []
    for name, row in _parameters(run).items():
        if forces and name == "m":
            continue
        p = {**row, **forces.get(name, {})}
        meaning = [declared[name].meaning] if name in declared else []
        value = significant(p["value"]) if "reason" in p else uncertain(p["value"], p["sd"])
        words = ", ".join([*meaning, *([p["reason"]] if "reason" in p else [])])
        told = f": {force}" if not forces and (force := in_newtons(physical.get(name))) else ""
        found.append((symbol_of(name), value, unit_of(name, p["unit"], run), words + told))
    if "inertia" in physical:
        weight = physical["inertia"]
        symbol = inline("m" if weight["unit"] == "kg" else "J")
        value, words = uncertain(weight["value"], weight["sd"]), "inertia that the force or the rig file tells"
        found.append((symbol, value, unit_text(weight["unit"]), words))
    return found


def error_bars(run: Run) -> dict[str, Any]:
    """Return the error of every group before and after, with where each lies between the smallest and the largest.

    A row has the short and the whole name of its group, both errors, and the places of both [%].
    """
    errors, groups = run.loop["errors"], compared_groups(run)
    scale = error_scale(errors)
    floor = errors["noise_floor"]
    sizes = {g: [errors[w][g]["rms"] for w in ("before", "after")] for g in groups}
    known = [v for pair in sizes.values() for v in (*pair, floor) if v and math.isfinite(v)]
    low, high = math.log(0.7 * min(known)), math.log(1.1 * max(known))

    def place(value: float) -> float:
        return round(100 * min(1.0, max(0.0, (math.log(value) - low) / (high - low))), 1) if value else 0.0

    def shown(value: float) -> str:
        return "blows up" if math.isinf(value) else scale.text(value)

    rows = []
    for g, pair in sizes.items():
        name = _SHORT.sub("", groups[g]) if len(groups) > 2 else groups[g].partition(",")[0]
        rows.append((name, groups[g], *map(shown, pair), *map(place, pair)))
    told = scale.text(floor) if floor else MISSING
    return {"rows": rows, "unit": scale.symbol, "floor": told, "floor_at": place(floor)}
