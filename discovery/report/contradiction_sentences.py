"""The sentences on fitted values that contradict the rig file."""

from __future__ import annotations

import math
from collections.abc import Sequence

from discovery.foundation.estimate_text import estimate_text, figures
from discovery.report.numbers import Record

#: A value so many standard deviations from its prediction agrees with it.
_AGREES = 3.0


def contradiction_sentences(tested: Record | None) -> list[str]:
    """Return every contradiction of loop.json in words."""
    if not tested:
        return []
    checks = {c["parameter"]: c for c in tested["checks"]}
    return [_contradiction(c, checks[c["parameter"]]) for c in tested["contradictions"]]


def _contradiction(found: Record, check: Record) -> str:
    head = (
        f"{check['parameter']} = {estimate_text(check['value'], check['sd'], check['unit'])} contradicts "
        f"{check['source']}, {estimate_text(check['predicted'], check['predicted_sd'])} "
        f"({figures(abs(check['z']), 2)} standard deviations apart); "
    )
    if found["overruled"] is not None:
        kept = "the fit keeps to what is stated, and added effects may make up for it"
        told = [f"{o['name']} = {estimate_text(o['value'], o['sd'], o['unit'])}" for o in found["instead"]]
        other = f", or {' or '.join(told)} in its place, which fits as well" if told else ""
        return head + f"{'the recordings overrule it' if found['overruled'] else kept}{other}. Is the rig file right?"
    if not found["sought"]:
        return head + "what is left is not noise, so no effect is sought to reconcile them. Is the rig file right?"
    if not found["reconciling"]:
        doubt = " Is the rig file right?" if found["gross"] else ""
        return head + f"no effect of the catalogue reconciles them{_nearest(found['tried'])}.{doubt}"
    best, *others = found["reconciling"]
    odds = next(t["odds"] for t in found["tried"] if t["id"] == best)
    also = f"; so would {', '.join(others)}" if others else ""
    return head + f"{best} reconciles them, {figures(odds)} nats against an error of the rig file{also}."


def _nearest(tried: Sequence[Record]) -> str:
    """Return the likeliest effect with which the parameter is as predicted, though an error of the rig is likelier."""
    near = [t for t in tried if abs(t["z"]) < _AGREES and math.isfinite(t["odds"])]
    if not near:
        return ""
    best = max(near, key=lambda t: t["odds"])
    return f"; the nearest is {best['id']}, {figures(-best['odds'], 2)} nats less likely than an error of the rig file"
