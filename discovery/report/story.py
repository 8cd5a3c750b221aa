"""The search as the page tells it: what was compared beside which effects, and what was decided."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from discovery.report.results import Run
from discovery.report.sentences import OUTCOMES, decision_sentence, doubts_answer
from discovery.report.words import effect_name, effect_title, listed
from discovery.selection.settings import LoopSettings

#: Head of a step, and its outcome if accepted or not.
_WORDS = {
    "declare": ("Fitted the declared model", "", "most of the motion is left"),
    "mechanics": ("Compared the mechanics", "kept", "not kept"),
    "add": ("Tried", "added", "not added"),
    "remove": ("Tried without", "taken out", "kept in the model"),
    "exchange": ("Exchanged", "", ""),
    "integrate": ("Integrated", "by importance sampling", "by Laplace's method"),
    "stop": ("Stopped", "", ""),
}


@dataclass(frozen=True)
class Search:
    """One search through the catalogue: every candidate weighed `beside` the same effects, the most likely first.

    `taken` joined the model, empty if nothing did; `refused` has the code of the reason by what was tried in vain.
    """

    beside: tuple[str, ...]
    candidates: Sequence[Mapping[str, Any]]
    taken: tuple[str, ...]
    refused: Mapping[tuple[str, ...], str]

    def kind(self, effects: Sequence[str]) -> str:
        """Return "added", "tied" (as likely as what was added), "refused" or "other"."""
        key = tuple(effects)
        if key == self.taken:
            return "added"
        if key in self.refused:
            return "refused"
        joint = {tuple(c["effects"]): c["train"] + c["held"] for c in self.candidates}
        behind = joint.get(self.taken, float("inf")) - joint[key]
        return "tied" if behind < LoopSettings.nats else "other"

    def outcome(self, effects: Sequence[str]) -> str:
        """Return what became of a candidate in a few words; empty where it was not tried and does not blow up."""
        kind = self.kind(effects)
        if kind == "refused":
            return OUTCOMES[self.refused[tuple(effects)]]
        if any(blows_up(c) for c in self.candidates if tuple(c["effects"]) == tuple(effects)):
            return OUTCOMES["finite"]
        return {"added": "added", "tied": "as likely"}.get(kind, "")


def blows_up(candidate: Mapping[str, Any]) -> bool:
    """Return whether the motion of a candidate blows up in training or held out: it has no evidence there.

    Examples
    --------
    >>> blows_up({"train": -math.inf, "held": 0.0}), blows_up({"train": -40.0, "held": 2.0})
    (True, False)
    """
    return min(candidate["train"], candidate["held"]) == -math.inf


def searches(run: Run) -> list[Search]:
    """Return every search through the catalogue once, although several candidates may have been tried after it."""
    found: list[Search] = []
    model: list[str] = []
    for _, group in groupby(run.loop["steps"], lambda s: (s["action"], s["candidates"])):
        decided = list(group)
        first = decided[0]
        if first["candidates"]:
            # What an exchange puts in the place of a member was weighed without this member.
            away = first["effects"][:1] if first["action"] == "exchange" else []
            beside = tuple(e for e in model if e not in away)
            taken = [tuple(s["effects"][len(away) :]) for s in decided if s["accepted"]]
            refused = {tuple(s["effects"]): s["code"] for s in decided if not s["accepted"]}
            found.append(Search(beside, first["candidates"], taken[0] if taken else (), refused))
        for step in decided:
            model = _after(model, step)
    return found


def _after(model: Sequence[str], step: Mapping[str, Any]) -> list[str]:
    """Return the effects of the model after a step."""
    effects = step["effects"]
    if not step["accepted"] or step["action"] in ("mechanics", "integrate", "stop"):
        return list(model)
    if step["action"] == "add":
        return [*model, *effects]
    left = [e for e in model if e != effects[0]]
    if step["action"] == "exchange":
        # What was added beside a declared loss goes with it.
        return [*left, *effects[1:]] if effects[0] in model else effects[1:]
    return left


def named(run: Run, effects: Sequence[str]) -> bool:
    """Return whether effects are in the final model."""
    return set(effects) <= {e["id"] for e in run.loop["effects"]}


def fate(run: Run, effects: Sequence[str]) -> str:
    """Return what became of effects that were added once, as the end of a clause; empty if they are in the model."""
    if named(run, effects):
        return ""
    exchanged = {s["effects"][0]: s["effects"][1:] for s in run.loop["steps"] if s["action"] == "exchange"}
    if len(effects) == 1 and (new := exchanged.get(effects[0])) and named(run, new):
        return f", later exchanged for {listed(map(effect_name, new))}"
    return ", later dropped"


def steps(run: Run) -> list[dict[str, Any]]:
    """Return the decisions of the search: head, outcome, what the effects are, the reason, whether it is a doubt."""
    found = []
    complete, named = run.loop["complete"], [e.get("probability") for e in run.loop["effects"]]
    for step in run.loop["steps"]:
        head, yes, no = _WORDS[step["action"]]
        effects = [effect_name(e) for e in step["effects"]]
        what = f"{effects[0]} for {listed(effects[1:])}" if step["action"] == "exchange" else listed(effects)
        titles = [effect_title(e) for e in step["effects"]] if step["action"] in ("mechanics", "add") else []
        told = {
            "head": f"{head}: {what}" if what else head,
            "outcome": yes if step["accepted"] else no,
            "title": "; ".join(t for t, name in zip(titles, effects, strict=False) if t != name),
            "reason": decision_sentence(step),
            "doubt": doubts_answer(step["code"], complete=complete, named=named),
        }
        # A set that is refused beside two others, of which it holds both, is tried twice and told once.
        if told not in found:
            found.append(told)
    return found
