"""The sentences of the report: what was found, in plain words, with the numbers of the result files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from markupsafe import Markup, escape

from discovery.declarations.effect import first_sentence
from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.registry import effect_name as effect_name
from discovery.foundation.start_names import start_of
from discovery.mechanics import base_names, get_base
from discovery.mechanics.upgrades import UPGRADES
from discovery.report.numbers import GREEK, Scale, power_of_ten, scale_for_change, uncertain, unit_text
from discovery.report.numbers import listed as listed
from discovery.report.results import Run
from discovery.report.sentences import lead_sentence, verdict_sentence
from discovery.results.judging import held_group

#: Models that are fitted side by side.
FITS = {"linear": "linear spring", "constant_radius": "nonlinear spring, constant radius", "declared": "declared model"}
MASSES = {"as_printed": "massless", "rod_counted": "counted"}
LAWS = {
    "static_small": "static, small deflection",
    "static_least_squares": "static, least squares",
    "dynamic": "dynamic, with its inertial terms",
    "dynamic_effective": "dynamic, as constant radius sees it",
}


#: Symbols of the result files' sentences.
_WRITTEN = (
    (r"\btheta_t'", "θ̇ₜ"),
    (r"\btheta_t\b", "θₜ"),
    (r"\bdelta'", "δ̇"),
    (r"\bq'", "q̇"),
    *((rf"\b{name}(?=\b(?!-)|_)", letter) for name, letter in GREEK.items()),
    *((rf"\b(\w)_{digit}\b", rf"\g<1>{chr(0x2080 + digit)}") for digit in range(10)),
    *((rf"\^{digit}\b", power) for digit, power in zip("12345", "¹²³⁴⁵", strict=True)),
    *((rf"\^-{digit}\b", f"⁻{power}") for digit, power in zip("12345", "¹²³⁴⁵", strict=True)),
    (r"\+-", "±"),
    (r" - ", " − "),
    (r" -> ", " → "),
    (r"(?<![\w.-])-(?=\d)", "−"),
    (r"(?<=\d) x (?=\d)", " × "),
)
#: Ids, and whole numbers that are long enough to be grouped.
_ID = re.compile(r"\b[a-z]+(?:_[a-z]+)+\b")
_LONG = re.compile(r"(?<![\w.])\d{5,}(?![\w.])")
#: A letter with an index; the name of a file is none.
_SYMBOL = re.compile(r"(?<![\w./-])([^\W\d_])_(\w+)\b(?!\.\w)")
#: A word that no sentence capitalises: one with an index, a digit or a capital inside, of a function, or with a value.
_IDENTIFIER = re.compile(r"[^\W\d][^\W\d_A-Z]*(?:[\dA-Z_<(]| = )")
_TENS = re.compile(r"(?<=[\d)])e([+-]?\d+)\b")


def in_catalogue(effect_id: str) -> bool:
    """Return whether a word is the id of an effect of the catalogue, at a place or without one."""
    return effect_id.partition("_at_")[0] in catalogue()


def prose(text: str) -> str:
    """Return a sentence of a result file with its symbols, effects and numbers as a reader writes them."""
    text = _ID.sub(lambda m: effect_name(m[0]) if m[0] in UPGRADES or in_catalogue(m[0]) else m[0], text)
    text = _LONG.sub(lambda m: f"{int(m[0]):,}".replace(",", "\N{NARROW NO-BREAK SPACE}"), text)
    text = _TENS.sub(lambda m: f"\N{NARROW NO-BREAK SPACE}{power_of_ten(int(m[1]))}", text)
    for pattern, written in _WRITTEN:
        text = re.sub(pattern, written, text)
    return text


def page_prose(text: str) -> Markup:
    """Return a sentence of a result file for a page: as `prose`, the indices of its symbols below the line.

    Examples
    --------
    >>> page_prose("f_c_load +- 0.1 < 1 N m")
    Markup('f<sub>c,load</sub> ± 0.1 &lt; 1 N m')
    """
    return Markup(_SYMBOL.sub(lambda m: f"{m[1]}<sub>{m[2].replace('_', ',')}</sub>", str(escape(prose(text)))))


def values_text(parameters: Mapping[str, Mapping[str, Any]], coordinate: str) -> str:
    """Return parameters of loop.json with their values and units; `coordinate` is the unit that q stands for."""
    return "; ".join(
        f"{name} = {uncertain(p['value'], p['sd'])} {unit_text(p['unit'], coordinate)}".strip()
        for name, p in parameters.items()
    )


def sentence(text: str) -> str:
    """Return text with a capital first letter, unless it begins with a symbol or another identifier.

    Examples
    --------
    >>> sentence("a force is left"), sentence("motor_loss = 3 is far off"), sentence("mass = 3 kg is far off")
    ('A force is left', 'motor_loss = 3 is far off', 'mass = 3 kg is far off')
    """
    return text if not text[:2].isascii() or _IDENTIFIER.match(text) else text[:1].upper() + text[1:]


def clause(text: str) -> Markup:
    """Return a title as part of a sentence of a page."""
    return page_prose(text[:1].lower() + text[1:])


def effect_title(effect_id: str) -> str:
    """Return one sentence on what an effect is, or what mechanics are."""
    if effect_id in UPGRADES:
        return UPGRADES[effect_id].title()
    if effect_id in base_names():
        return first_sentence(type(get_base(effect_id)))
    return get_effect(effect_id).title() if in_catalogue(effect_id) else effect_name(effect_id)


def deflection_unit(run: Run) -> str:
    """Return the unit of recorded deflections: that of the coordinate, or of an acceleration that is read."""
    return str(run.results["recordings"][0].get("deflection_unit", run.coordinate_unit))


def error_groups(run: Run) -> dict[str, str]:
    """Return the groups of recordings by which errors are reported, in the words of a reader."""
    errors = run.loop["errors"]["before"]
    reach = "deflection" if run.system.has_rod else "range"
    inside, outside = f"held out, inside the trained {reach}", f"held out, beyond the trained {reach}"
    moving = {"holdout_moving": "held out, while it moves"} if "holdout_moving" in errors else {}
    held = {}
    if {"holdout_inside", "holdout_outside"} <= errors.keys():
        held = {"holdout": "held out, all", "holdout_inside": inside, "holdout_outside": outside}
    elif "holdout_inside" in errors:
        held = {"holdout_inside": inside}
    elif (errors.get("holdout") or {}).get("rms") is not None:
        held = {"holdout": outside if "holdout_outside" in errors else "held out"}
    return {"train": "training", **held, **moving}


def compared_groups(run: Run) -> dict[str, str]:
    """Return the groups whose errors stand side by side: not all held out where two kinds of them are told apart."""
    names = error_groups(run)
    return {group: name for group, name in names.items() if group != "holdout" or "holdout_inside" not in names}


def error_scale(errors: Mapping[str, Any]) -> Scale:
    """Return the unit in which the errors of a loop are printed."""
    group = held_group(errors)
    return scale_for_change(errors["unit"], *(errors[when][group]["rms"] for when in ("before", "after")))


def headline(run: Run) -> str:
    """Return the verdict in a few sentences."""
    loop = run.told
    verdict, why = loop["verdict"], sentence(verdict_sentence(loop))
    left, floor, change = _errors_in_words(run)
    added = [_with_rivals(e) for e in loop["effects"]]
    away = "".join(f", in the place of the {effect_name(loss)} that it declares" for loss in loop.get("given_up", ()))
    found = f"the declared model lacked {listed(added)}{away}; with {'it' if len(added) == 1 else 'them'}, {change}."
    if verdict == "nothing_missing":
        return f"Nothing is missing: the declared model leaves {left}, which is noise (floor {floor})."
    if verdict == "explained":
        return f"Explained: {found}"
    if verdict == "partly_explained":
        return f"Partly explained: {found} {why}."
    lead = f" {sentence(lead_sentence(loop['lead']))}." if loop.get("lead") else ""
    if added:
        return f"Not explained: with {listed(added)}, {change}. {why}.{lead}"
    return f"Not explained: the declared model leaves {left} (floor {floor}). {why}.{lead}"


def _errors_in_words(run: Run) -> tuple[str, str, str]:
    """Return the error that is left, the noise floor, and how the error changed."""
    errors = run.loop["errors"]
    group, scale = held_group(errors), error_scale(errors)
    before, after = (scale.text(errors[k][group]["rms"]) for k in ("before", "after"))
    floor = scale.quantity(errors["noise_floor"])
    seen = {
        "holdout_moving": "on motion that no fit saw",
        "holdout_inside": "on a recording that no fit saw",
        "holdout": "on data that no fit saw",
    }.get(group, "in training")
    # What is another number in every recording is fitted to each that judges, too.
    own = {found[0] for e in run.loop["effects"] for n in e["parameters"] if (found := start_of(n))}
    seen += f" but for its {listed(sorted(own))}" if own and group.startswith("holdout") else ""
    better = errors["after"][group]["rms"] < errors["before"][group]["rms"]
    change = f"the rms error {seen} {'falls' if better else 'goes'} from {before} to {after} {scale.symbol}".rstrip()
    left = f"{after} {scale.symbol}".rstrip()
    return f"{left} rms {seen}", floor, f"{change} (noise floor {floor})"


def _with_rivals(effect: Mapping[str, Any]) -> str:
    """Return an added effect with those that explain the recordings as well."""
    rivals = [effect_name(e) for e in effect.get("ambiguous_with", ())]
    return effect_name(effect["id"]) + (f" (or {' or '.join(rivals)})" if rivals else "")


def origin(run: Run) -> str:
    """Return the note that was given on the data, from which alone its origin is known: a rig's name says nothing."""
    return str(run.results.get("data_note") or "")
