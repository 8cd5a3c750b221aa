"""What the page of a declared model without a fit says: why, what would help, what was declared and recorded."""

from __future__ import annotations

from typing import Any

from discovery.report.caution_sentences import failure_sentence, remedy_sentence
from discovery.report.equations import model_formulas
from discovery.report.figures import motion
from discovery.report.measures import recordings_table
from discovery.report.results import Run
from discovery.report.scripts import policy, scripts
from discovery.report.style import Picture
from discovery.report.words import origin


def failed_pictures(run: Run) -> list[Picture]:
    """Return the pictures of the page: what was recorded."""
    drawn = motion.draw(run)
    return [] if drawn is None else [drawn]


def failed_context(run: Run) -> dict[str, Any]:
    """Return what the template of the page asks for, but for its pictures."""
    failure = run.loop["failure"]
    formulas = model_formulas(run.loop["model"]["before"]["model"], run.results["rig"]["kind"])
    return {
        "policy": policy(chart=False),
        "scripts": scripts(chart=False),
        "name": run.results["rig"]["name"],
        "origin": origin(run),
        "why": failure_sentence(failure),
        "remedy": remedy_sentence(failure),
        "message": failure["message"],
        "declared_formulas": [f.shown for f in formulas],
        "recordings": recordings_table(run).html(),
        "notes": [(r["name"], n) for r in run.results["recordings"] for n in r.get("notes", ())],
        "provenance": run.results["provenance"],
    }
