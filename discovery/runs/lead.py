"""What a search refused with the highest odds, where a model error is left."""

from __future__ import annotations

from collections.abc import Mapping

from discovery.selection.decision import Decision
from discovery.selection.search import Search
from discovery.selection.verdict import Named


def strongest_lead(search: Search, found: Mapping[str, Named]) -> Decision | None:
    """Return what was refused beside the set found, or taken out of it, with the highest odds; None where none speak.

    What serves as well as an effect that is named (`found`) is told with that. Of a pair, a member with odds that are
    as good as those of both is told alone.
    """
    told, changes = search.decisions, ("add", "exchange", "mechanics")
    made = max((i for i, d in enumerate(told) if d.accepted and d.action in changes), default=-1)
    # What gains and moves nothing is a change of Occam's factor.
    gains = [i for i, d in enumerate(told) if d.numbers.get("train", 0) > 0 < d.numbers.get("size", 1)]
    weighed = (i for i in gains if told[i].accepted == (told[i].action == "remove"))
    rivals = {rival for own in found.values() for rival in own.group}
    left = [i for i in weighed if (new := {*told[i].effects} - {*search.best.added}) and not new & rivals]
    # A force of no law, whose size is not weighed, leads where no law explains as much.
    gained = {i: told[i].numbers["train"] + min(told[i].numbers["held"], 0.0) for i in left if i > made}
    left = [i for i in left if told[i].code != "unknown" or i not in gained or gained[i] >= max(gained.values())]
    # What was refused before the last change was refused beside another set.
    odds = {i: told[i].numbers["odds"] for i in left if told[i].numbers["odds"] > 0}
    best = max(odds, key=lambda i: (i > made, odds[i]), default=None)
    if best is None:
        return None
    near = [i for i in odds if (i > made) == (best > made) and odds[i] > odds[best] - search.context.settings.nats]
    smaller = [i for i in near if {*told[i].effects} < {*told[best].effects}]
    return told[max(smaller, key=lambda i: odds[i], default=best)]
