"""The loop's story: which sets of effects were tried, what came of it and why, in the words of a reader."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from discovery.report.numbers import significant
from discovery.report.results import Run
from discovery.report.words import effect_name, effect_title, listed

__all__ = ["Search", "decisions", "in_the_end", "searches", "steps"]

#: What a step removed of how much.
_REMOVED = re.compile(r"removes (-?\d+) of (-?\d+)( excess chi-square)?")
#: Head of a step that is about no effect.
_ALONE = {"refine": "Went on upon finer mechanics", "stop": "Stopped"}
#: Head of a step and its outcome, accepted or not.
_WORDS = {
    "upgrade": ("Compared the mechanics", "kept", "not kept"),
    "add": ("Tried", "added", "not added"),
    "remove": ("Tried without", "taken out", "kept in the model"),
    "renew": ("Fitted anew", "other values", ""),
    "exchange": ("Exchanged", "taken out", "kept in the model"),
    "withdraw": ("Withdrew", "not named", ""),
}


@dataclass(frozen=True)
class Search:
    """One search through the catalogue: every candidate, refitted beside the same set of effects.

    Parameters
    ----------
    beside : tuple of str
        Effects that had been added to the model of the search.
    ranking : sequence of mapping
        Every candidate with its linear score and its refitted chi-square, best first.
    without : float
        Chi-square of the best set before the search.
    added, refused : tuple of str
        Candidates that joined the model, and those that were tried in vain.
    """

    beside: tuple[str, ...]
    ranking: Sequence[Mapping[str, Any]]
    without: float
    added: tuple[str, ...]
    refused: tuple[str, ...]


def decisions(run: Run) -> list[list[Mapping[str, Any]]]:
    """Return the steps, those of a set of effects that was tried or withdrawn together as one."""

    def decision(step: Mapping[str, Any]) -> list[Any]:
        return [step[key] for key in ("action", "accepted", "reason", "numbers")]

    return [list(group) for _, group in groupby(run.loop["steps"], decision)]


def in_the_end(run: Run, effect: str) -> bool:
    """Return whether an effect is in the final model."""
    return any(e["id"] == effect for e in run.loop["effects"])


def searches(run: Run) -> list[Search]:
    """Return every search through the catalogue once, although several sets may have been tried after it."""
    told = run.loop["steps"]
    found: list[Search] = []
    for i, step in enumerate(told):
        ranking, numbers = step["ranking"], step["numbers"]
        if not ranking or "chi2_before" not in numbers or any(ranking == s.ranking for s in found):
            continue
        names = {r["effect"] for r in ranking}
        after = [s for s in told if s["action"] == "add" and s["ranking"] == ranking]
        earlier = [s for s in told[:i] if s["action"] == "add"]
        found.append(
            Search(
                # What is in the model is no candidate.
                tuple(dict.fromkeys(s["effect"] for s in (*earlier, *after) if s["effect"] not in names)),
                ranking,
                numbers["chi2_before"],
                tuple(s["effect"] for s in after if s["accepted"] and s["effect"] in names),
                tuple(s["effect"] for s in after if not s["accepted"] and s["effect"] in names),
            )
        )
    return found


def steps(run: Run) -> list[dict[str, str]]:
    """Return the loop's decisions: head, outcome, what the effects are, and the reason."""
    found = []
    for group in decisions(run):
        first, effects = group[0], [s["effect"] for s in group]
        action, reason = first["action"], first["reason"]
        if action in _ALONE:
            found.append({"head": _ALONE[action], "outcome": "", "title": "", "reason": reason})
            continue
        head, yes, no = _WORDS[action]
        outcome = yes if first["accepted"] else no
        if action == "upgrade":
            reason = _mechanics(first["numbers"], reason)
            if not first["accepted"] and in_the_end(run, first["effect"]):
                outcome, reason = "kept", f"{reason}, and a search on the declared mechanics ends no better"
        elif action == "add" and len(effects) > 1:
            reason = re.sub(r"\bit removes\b", "they remove", reason)
        elif action == "remove" and first["accepted"]:
            reason = f"beside the others it explains too little: {reason.removeprefix('not enough: ')}"
        reason = _REMOVED.sub(_removed, reason)
        titles = [effect_title(e) for e in effects] if action in ("upgrade", "add") else []
        found.append(
            {
                "head": f"{head}: {listed(effect_name(e) for e in effects)}",
                "outcome": outcome,
                "title": "; ".join(titles),
                "reason": reason,
            }
        )
    return found


def _removed(found: re.Match[str]) -> str:
    """Return how much of the excess a step removed; a model may also fit some of the noise, and so beat the excess."""
    gain, excess, what = int(found[1]), int(found[2]), found[3] or ""
    if excess <= 0:
        return f"removes {gain}, where chi-square is no more than noise,"
    return f"removes all {excess}{what}" if gain >= excess else found[0]


def _mechanics(numbers: Mapping[str, float], reason: str) -> str:
    """Return what better mechanics does to the held-out error, in words where there are no numbers."""
    if not {"chi2_holdout_before", "chi2_holdout_after", "n_holdout"} <= numbers.keys():
        return reason
    before, after = (significant(numbers[f"chi2_holdout_{k}"] / numbers["n_holdout"], 4) for k in ("before", "after"))
    if before == "∞":
        return reason
    return f"the held-out mean squared residual is {after} noise variances, with the simpler mechanics {before}"
