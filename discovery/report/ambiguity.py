"""What the recordings cannot decide: rivals with the manoeuvre that separates them, and contradictions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.diagnosis.manoeuvre_design import Move, hub_drive
from discovery.report.contradiction_sentences import contradiction_sentences
from discovery.report.doubt_sentences import caution_sentence, stand_in_sentence
from discovery.report.estimates import symbol_of
from discovery.report.manoeuvre_sentences import laws_apart, laws_of, separation_sentence
from discovery.report.numbers import MISSING, significant, uncertain, unit_text
from discovery.report.results import Run
from discovery.report.sentences import probability_words
from discovery.report.style import BLUE, GREEN, ORANGE, Picture, label, new_figure
from discovery.report.tables import Table
from discovery.report.words import effect_name, listed, page_prose, values_text

_PULL = (
    " k_g = √(g_c² + g_s²): the pull of gravity, gravity over length of a simple pendulum. It is negative where "
    "gravity pushes away from where the pendulum swings."
)


def _undecided(run: Run) -> list[str]:
    """Return for each added effect that others explain as well, or an error of the rig file, one sentence."""
    found = []
    for e in run.loop["effects"]:
        if other := e.get("stands_for"):
            words = stand_in_sentence(e["id"], other)
            found.append(f"{words[0].upper()}{words[1:]}.")
        rivals = e["ambiguous_with"]
        if rivals:
            others = " or ".join(effect_name(r) for r in rivals)
            found.append(
                f"{effect_name(e['id']).capitalize()}, or {others} in its place: their odds differ by less than 20 to "
                f"1. The probability of the one named is {probability_words(e['probability'])}, that of the group "
                f"{probability_words(e['group_probability'])}."
            )
    return found


def told(run: Run) -> dict[str, list[str]]:
    """Return the sentences of the page on what questions the answer, as the console says them."""
    cautions = map(caution_sentence, run.loop.get("cautions", ()))
    return {
        "undecided": _undecided(run),
        "advice": [separation_sentence(design) for design in run.loop.get("separation") or ()],
        "contradictions": contradiction_sentences(run.loop.get("contradiction")),
        "cautions": [words if words.endswith("?") else f"{words}." for words in cautions],
    }


def reconciliations_table(run: Run) -> Table | None:
    """Return the effects that were asked to reconcile what contradicts."""
    tested = run.loop.get("contradiction") or {"contradictions": []}
    cells, raw = [], []
    for c in tested["contradictions"]:
        for t in c["tried"]:
            values = page_prose(values_text(t["parameters"], run.coordinate_unit))
            apart = [significant(t["value"], 5), significant(t["z"], 2), significant(t["odds"])]
            reconciles = "yes" if t["reconciles"] else "no"
            cells.append([symbol_of(c["parameter"]), effect_name(t["id"]), values, *apart, reconciles])
            raw.append([c["parameter"], t["id"], t["value"], t["z"], t["odds"], t["reconciles"]])
    if not cells:
        return None
    shown = ("value then", "difference [sds]", "log odds [nats]", "reconciles")
    head = ("parameter", "with the effect", "its parameters", *shown)
    keys = ("parameter", "effect", "value", "z", "odds", "reconciles")
    caption = (
        "Effects that could take the contradicting value to its prediction, with the log odds of each against an error "
        "of the rig file. None of them is excluded that reconciles."
    )
    return Table("reconciliations", caption, head, cells, keys, raw, text=(0, 1, 2, 6))


def separation_table(run: Run) -> Table | None:
    """Return how far rival effects lie apart, on the given recordings and on the designed manoeuvre."""
    designs = run.loop.get("separation")
    if not designs:
        return None
    cells, raw = [], []
    for i, d in enumerate(designs):
        values = [_likeness(d), d["given"]["projected"], d["designed"]["projected"], d["designed"]["chi2"]]
        laws = [" or ".join(map(effect_name, names)) for names in laws_of(d)]
        cells.append([f"{i + 1}", "; ".join(laws), *(significant(v) for v in values)])
        raw.append([i + 1, "; ".join(" = ".join(names) for names in laws_of(d)), *values])
    apart = ("apart, given", "apart, designed", "chi-square expected")
    head = ("manoeuvre", "rivals, simplest first", "similarity", *apart)
    keys = ("manoeuvre", "rivals", "similarity", "given_projected", "designed_projected", "designed_chi2")
    caption = (
        "Effects that these recordings cannot tell apart; “or” joins those that are one law here, numbers are "
        "between laws. Similarity: largest cosine between sensitivities of their fits. Apart: rms difference of their "
        "predictions that readjusted parameters cannot absorb [noise sds]. "
        f"Expected: chi-square by which the right one will win once the designed manoeuvre is recorded; below "
        f"{designs[0]['decides_from']:g} it may be chance, and no manoeuvre within the limits decides; where laws lie "
        "apart by less than the model error that is left, none does either."
    )
    if files := [f"manoeuvre_{i}.csv" for i, d in enumerate(designs, 1) if d["decides"]]:
        caption += f" The course, or what is predicted after a release, is in {listed(files)}."
    return Table("separation", caption, head, cells, keys, raw, text=(0, 1))


def _likeness(design: Mapping[str, Any]) -> float | None:
    """Return the largest similarity between rivals of different laws, or of one where there is no other."""
    law = {name: i for i, names in enumerate(laws_of(design)) for name in names}
    labels = [law[name] for name in design["rivals"]]
    pairs = [
        value
        for i, row in enumerate(design["similarity"])
        for j, value in enumerate(row[:i])
        if value is not None and (labels[i] != labels[j] or len(laws_of(design)) == 1)
    ]
    return max(pairs, default=None)


def _input_of(design: Mapping[str, Any]) -> tuple[str, str]:
    """Return the name and the unit of the input that a designed manoeuvre moves."""
    column = design["columns"][1]
    if column == "motor_angle_rad":
        return "motor angle", "rad"
    return "input", unit_text(column.removeprefix("input_").replace("_", " "), "q")


def moves_table(run: Run) -> Table | None:
    """Return the moves of the input in every designed manoeuvre."""
    designs = [(i, d) for i, d in enumerate(run.loop.get("separation") or ()) if d["decides"] and d["moves"]]
    if not designs:
        return None
    cells, raw = [], []
    for i, d in designs:
        for m in d["moves"]:
            # A trapezoid of this angle, speed and share of ramps.
            ramp = m["ramp"] * abs(m["angle"]) / m["speed"] / (1 - m["ramp"])
            values = [m["start"], m["angle"], m["speed"], ramp]
            cells.append([f"{i + 1}", *(significant(v) for v in values)])
            raw.append([i + 1, *values])
    name, unit = _input_of(designs[0][1])
    arm = name == "motor angle"
    head = ("manoeuvre", "start [s]", f"{'turn' if arm else 'by'} [{unit}]", f"speed [{unit}/s]", "each ramp [s]")
    keys = ("manoeuvre", "start_s", *(("angle_rad", "speed_rad_per_s") if arm else ("by", "speed")), "ramp_s")
    return Table("moves", "Moves of the designed manoeuvres, with a trapezoidal speed.", head, cells, keys, raw)


def contradictions_table(run: Run) -> Table | None:
    """Return every fitted value that was tested against the rig."""
    tested = run.loop.get("contradiction")
    if not tested or not tested["checks"]:
        return None
    reconciling = {c["parameter"]: c["reconciling"] for c in tested["contradictions"]}
    keys = ("parameter", "unit", "value", "sd", "predicted", "predicted_sd", "z", "odds")
    cells, raw = [], []
    for c in tested["checks"]:
        names = reconciling.get(c["parameter"], [])
        outcome = listed(effect_name(e) for e in names) or "nothing in the catalogue" if c["contradicts"] else MISSING
        values = [uncertain(c["value"], c["sd"]), uncertain(c["predicted"], c["predicted_sd"])]
        unit, tests = unit_text(c["unit"], run.coordinate_unit), [significant(c[k], 2) for k in ("z", "odds")]
        cells.append([symbol_of(c["parameter"]), *values, unit, *tests, outcome])
        raw.append([*(c[k] for k in keys), "; ".join(names)])
    apart = ("difference [sds]", "log odds [nats]", "reconciled by")
    head = ("parameter", "fitted ± sd", "predicted ± sd", "unit", *apart)
    caption = (
        "Fitted values against what the rig predicts; log odds that what is stated is too narrow. An "
        "effect that free parameters absorb leaves no residual, but contradicts a prediction."
    )
    if any(c["parameter"] == "k_g" for c in tested["checks"]):
        caption += _PULL
    return Table("contradictions", caption, head, cells, (*keys, "reconciled_by"), raw, text=(0, 3, 6))


#: Characters of a legend, with four for each line, that one row of a figure holds.
_ROW = 50


def draw_manoeuvres(run: Run) -> list[Picture] | None:
    """Draw the course of the input in every manoeuvre that decides, or what is predicted of a release."""
    pictures = []
    for i, design in enumerate(run.loop.get("separation") or ()):
        if design["decides"] and (design["moves"] or design["predicted"]):
            pictures.append((_course if design["moves"] else _release)(i + 1, design))
    return pictures or None


def _course(number: int, design: Mapping[str, Any]) -> Picture:
    """Draw the course of the input."""
    moves = [Move(**m) for m in design["moves"]]
    time = np.linspace(0.0, design["limits"]["duration"], 600)
    figure = new_figure(2.0)
    axes = figure.subplots()
    axes.plot(time, hub_drive(moves).evaluate(time)[0], color=BLUE, linewidth=1.3)
    name, unit = _input_of(design)
    axes.set(xlabel="time [s]", ylabel=label(name, unit))
    rivals = listed(map(effect_name, laws_apart(design)))
    caption = (
        f"Manoeuvre {number}, from where the {'hub' if name == 'motor angle' else 'input'} starts: designed to tell "
        f"{rivals} apart."
    )
    alt = f"{name.capitalize()} against time of the manoeuvre that tells {rivals} apart: {len(moves)} moves with rests."
    return Picture(f"manoeuvre_{number}", figure, caption, alt)


def _release(number: int, design: Mapping[str, Any]) -> Picture:
    """Draw what each law predicts after a release, and below it how far the others lie from the first."""
    time, *every = np.array(design["predicted"]).T
    own = dict(zip(design["rivals"], every, strict=True))
    shown = laws_apart(design)
    names, predicted = [*map(effect_name, shown)], [own[name] for name in shown]
    rows = 1 if sum(len(name) + 4 for name in names) <= _ROW else len(names)
    figure = new_figure(2.8 + 0.2 * rows)
    above, below = figure.subplots(2, sharex=True)
    for name, reading, colour in zip(names, predicted, (BLUE, ORANGE, GREEN), strict=False):
        above.plot(time, reading, color=colour, linewidth=1.1, label=name)
        if reading is not predicted[0]:
            below.plot(time, reading - predicted[0], color=colour, linewidth=1.1)
    above.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(names) if rows == 1 else 1, frameon=False)
    above.set_ylabel(label("reading", design["unit"]))
    below.set(ylabel=label("apart", design["unit"]), xlabel="time [s]")
    rivals, place = listed(names), f"{design['release']:.3g} {design['unit']}"
    caption = (
        f"Manoeuvre {number}: let go at {place}, at no speed, to tell {rivals} apart. Above what each predicts with "
        "its parameters as they are, below how far they lie apart."
    )
    alt = f"Predictions of {rivals} against time after a release at {place}, and their difference."
    return Picture(f"manoeuvre_{number}", figure, caption, alt)
