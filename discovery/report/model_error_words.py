"""Words for the model error: its size before and after, the part that is left, and what it depends on."""

from __future__ import annotations

import math

from discovery.declarations.registry import effect_name
from discovery.report.numbers import Record, listed, plain, sizes

_TIMES = 2.0  # the model error of training, one held out that is told beside it
AS_NONE = "nothing_missing", "explained"  #: Verdicts by which a model error counts as none.


def model_error_words(loop: Record) -> str:
    """Return the model error before and after, the part that is left, what it depends on, and what counts as none.

    One that counts as none depends on nothing.
    """
    error = loop["model_error"]
    values = [*(error[k] for k in ("before", "after", "least")), told := _told_held(error)]
    (before, after, least, held), unit = sizes(values, error["unit"])
    words = (after if before == after else f"{before} -> {after}") + f" {unit}".rstrip()
    words += f", {share_words(error)} is left" if before != after and share_words(error) else ""
    none = loop["verdict"] in AS_NONE
    hidden = none and not _is_small(error)
    limit = "it cannot be told from none" if hidden else f"up to {least} {unit}".strip() + " counts as none"
    words += f", {held} {unit}".rstrip() + " held out" if told is not None else ""
    return f"{words}{'' if none else depends_words(error)}; {limit}"


def share_words(error: Record) -> str:
    """Return the part of the model error that is left; empty where there is nothing to compare, as beside none."""
    share, before = error["share"], error["before"]
    if not (share and before) or not all(map(math.isfinite, (share, before))) or before <= error["least"]:
        return ""
    return f"{plain(100 * share, 2)} %"


def as_none(error: Record) -> str:
    """Return why a model error counts as none: how large one may be, or that it cannot be told from none."""
    if not _is_small(error):
        return "cannot be told from none"
    (*_, limit), unit = sizes([error[k] for k in ("before", "after", "least")], error["unit"])
    return f"counts as none (up to {limit} {unit})"


def held_words(error: Record) -> str:
    """Return the model error held out, where it is told beside that of training."""
    if (held := _told_held(error)) is None:
        return ""
    (*_, size), unit = sizes([error["before"], error["after"], held], error["unit"])
    return f", {size} {unit}".rstrip() + " held out"


def depends_words(error: Record) -> str:
    """Return what a model error depends on; empty where that is nothing."""
    return f"; it depends on {listed(map(effect_name, error['depends_on']))}" if error["depends_on"] else ""


def _told_held(error: Record) -> float | None:
    """Return the model error held out, where that alone is more than none, or twice as large as in training."""
    after, held, least = error["after"], error.get("held"), error["least"]
    if after is None or held is None or not held > (_TIMES * after if after > least else least):
        return None
    return float(held)


def _is_small(error: Record) -> bool:
    return error["after"] is not None and max(error["after"], error.get("held") or 0.0) <= error["least"]
