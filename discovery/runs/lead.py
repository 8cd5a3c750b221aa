"""What a search refused with the highest odds, where a model error is left."""

from __future__ import annotations

from collections.abc import Mapping

from discovery.selection.decision import Decision
from discovery.selection.search import Search
from discovery.selection.verdict import Named


def leads(search: Search, found: Mapping[str, Named]) -> tuple[Decision | None, Decision | None]:
    """Return the strongest lead and, where that is a force of no law, the strongest law; None where there is none.

    A force, whose size is not weighed, leads where the strongest law does not explain as much. What serves as well as
    an effect that is named (`found`) is told with that.
    """
    left, made, nats = *_refused(search, found), search.context.settings.nats
    force = next((d for i, d in left.items() if d.code == "unknown" and i > made and d.numbers["odds"] > 0), None)
    laws = {i: d for i, d in left.items() if d.code != "unknown"}
    law = _strongest(laws if force is None else {i: d for i, d in laws.items() if i > made}, made, nats)
    if force is None or (law is not None and _gained(law) >= _gained(force)):
        return law, None
    return force, law


def _gained(decision: Decision) -> float:
    return decision.numbers["train"] + min(decision.numbers["held"], 0.0)


def _refused(search: Search, found: Mapping[str, Named]) -> tuple[dict[int, Decision], int]:
    """Return what was refused or taken out and no effect named stands for, by its place, and that of the last change.

    What was refused before the last change was refused beside another set.
    """
    told, changes = search.decisions, ("add", "exchange", "mechanics")
    made = max((i for i, d in enumerate(told) if d.accepted and d.action in changes), default=-1)
    # What gains and moves nothing is a change of Occam's factor.
    gains = [i for i, d in enumerate(told) if d.numbers.get("train", 0) > 0 < d.numbers.get("size", 1)]
    weighed = (i for i in gains if told[i].accepted == (told[i].action == "remove"))
    rivals = {rival for own in found.values() for rival in own.group}
    return {
        i: told[i] for i in weighed if (new := {*told[i].effects} - {*search.best.added}) and not new & rivals
    }, made


def _strongest(left: Mapping[int, Decision], made: int, nats: float) -> Decision | None:
    """Return what has the highest odds, after the last change where anything has; None where none speak.

    Of a pair, a member with odds that are as good as those of both is told alone.
    """
    odds = {i: d.numbers["odds"] for i, d in left.items() if d.numbers["odds"] > 0}
    best = max(odds, key=lambda i: (i > made, odds[i]), default=None)
    if best is None:
        return None
    near = [i for i in odds if (i > made) == (best > made) and odds[i] > odds[best] - nats]
    smaller = [i for i in near if {*left[i].effects} < {*left[best].effects}]
    return left[max(smaller, key=lambda i: odds[i], default=best)]
