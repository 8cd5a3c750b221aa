"""The page of the dashboard, from the files of the runs alone."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.report.page import environment, written
from discovery.report.results import read_run
from discovery.report.sentences import chances
from discovery.report.words import effect_name, error_scale, origin, sentence, values_text
from discovery.results.judging import held_group
from discovery.results.provenance import read_json

#: The first picture of a page, which stands on its card.
_PICTURE = re.compile(r'<div class="static">.*?<img src="(data:image/[^"]+)" alt="([^"]*)"', re.DOTALL)
_PAGES = {
    "paper": (
        "The source paper, whole",
        "Every equation, number, figure and claim of the paper that this project starts from, beside its own: what "
        "holds, what does not, and why.",
    ),
    "measured/index.html": (
        "Measured sets of other laboratories",
        "Public recordings of real systems, each from one rig file, side by side: what the loop added, and the error "
        "beside the best figure known from elsewhere.",
    ),
    "closed_loop/report.html": (
        "A controller from a discovered model",
        "The twin of the arm in a loop with two controllers, one tuned on the declared and one on the discovered "
        "model: tip error and energy, before and after.",
    ),
}


def build_index(folder: Path) -> Path:
    """Write ``index.html`` in a folder of runs, and return it; pictures are embedded, pages of the runs are linked.

    A subfolder holds a whole run (``results.json``), a loop (``loop.json``), or a page over several recordings (see
    `_PAGES`). InputError if none holds results.
    """
    whole = [read_run(p.parent) for p in sorted(folder.glob("*/results.json"))]
    loops = [p.parent for p in sorted(folder.glob("*/loop.json")) if not (p.parent / "results.json").exists()]
    if not whole and not loops:
        raise InputError(f"{folder} holds no finished run; make one with `discovery run ... --out {folder}/NAME`.")
    context = {
        "cards": [
            *(_card(r.folder, r.results["rig"]["name"], r.loop, origin(r)) for r in whole),
            *(_card(p, effect_name(p.name), read_json(p / "loop.json")) for p in loops),
        ],
        "pages": _pages(folder),
    }
    template = environment("benchmarks.dashboard").get_template("index.html.j2")
    return written(folder / "index.html", template.render(context))


def _pages(folder: Path) -> list[tuple[str, str, str]]:
    """Return the pages over several recordings that are there: link, title, and what they say."""
    studies = sorted(folder.glob("*/studies.json"))[:1]
    found = [(f"{path.parent.name}/report.html", *_PAGES["paper"]) for path in studies]
    return found + [(path, *words) for path, words in _PAGES.items() if path != "paper" and (folder / path).exists()]


def _card(folder: Path, name: str, loop: Mapping[str, Any], about: str = "") -> dict[str, Any]:
    """Return what a card says of a run."""
    errors = loop["errors"]
    group, scale = held_group(errors), error_scale(errors)
    page, system = folder / "report.html", get_base(loop["model"]["after"]["model"]["base"]).system
    picture = _PICTURE.search(page.read_text(encoding="utf-8")) if page.is_file() else None
    return {
        "folder": folder.name,
        "page": f"{folder.name}/report.html" if page.is_file() else "",
        "name": sentence(name),
        "about": about,
        "verdict": loop["verdict"],
        "verdict_words": effect_name(loop["verdict"]),
        "found": [_effect(e, system.coordinate_unit(str(errors["unit"]))) for e in loop["effects"]],
        **{when: scale.text(errors[when][group]["rms"]) for when in ("before", "after")},
        "floor": scale.text(errors["noise_floor"]),
        "unit": scale.symbol,
        "where": "in training" if group == "train" else "held out",
        "picture": picture[1] if picture else "",
        "alt": picture[2] if picture else "",
    }


def _effect(effect: Mapping[str, Any], coordinate: str) -> str:
    """Return an added effect with its parameters, its rivals and its odds."""
    values = values_text(effect["parameters"], coordinate)
    rivals = "".join(f" or {effect_name(r)}" for r in effect["ambiguous_with"])
    told = list(filter(None, [values, chances(effect["evidence"]["odds"]) if effect["evidence"] else ""]))
    return effect_name(effect["id"]) + rivals + (f" ({'; '.join(told)})" if told else "")
