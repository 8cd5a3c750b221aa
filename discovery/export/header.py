"""The head of an exported file: where its numbers come from, as lines that no name in them can break."""

from __future__ import annotations

from collections.abc import Iterable

from discovery.export.fitted import FittedModel
from discovery.foundation.estimate_text import estimate_text


def composition(found: FittedModel) -> str:
    """Return the base of a model and its effects in words."""
    return f"{found.model.base} with {', '.join(found.model.effects) or 'no effects'}"


def initial_states(found: FittedModel) -> list[str]:
    """Return lines that say from which states the recordings start; none without recordings."""
    starts = [f"{n}: deflection {d:.9g}, rate {r:.9g}" for n, (d, r) in found.initial.items()]
    return ["Initial states of the recordings:", *starts] if starts else []


def origin(found: FittedModel) -> list[str]:
    """Return lines that say where the numbers come from, version, rig file, recordings, hashes, and what they weigh.

    What the provenance does not hold is left out.
    """
    p = found.provenance
    lines = []
    if "discovery" in p:
        revision = f", revision {p['git_revision']}" if p.get("git_revision") else ""
        lines.append(f"Written by discovery {p['discovery']}{revision}.")
    if "rig" in p:
        lines.append(f"Rig: {p['rig']['name']} (sha256 {p['rig']['sha256'][:16]}).")
    lines += [f"Fitted to {d['source']} (sha256 {d['sha256'][:16]})." for d in p.get("data", ())]
    for name, (value, sd, unit) in found.physical.items():
        lines.append(f"In physical units: {name} = {estimate_text(value, sd, unit)}.")
    return [_one_line(line) for line in lines]


def _one_line(text: str) -> str:
    """Return text without line ends, which would leave a comment, and characters that no source may hold."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def comment(lines: Iterable[str]) -> str:
    """Return lines of plain text as those of a comment in C; none can end it, begin another or go on in the next."""
    plain = (_one_line(line).replace("*/", "* /").replace("/*", "/ *").rstrip("\\") for line in lines)
    return "\n".join(f" * {line}".rstrip() for line in plain)


def docstring(*paragraphs: str) -> str:
    """Return paragraphs of plain text as the body of a docstring; empty ones are left out, and none can end it."""
    text = "\n\n".join(p for p in paragraphs if p)
    return text.replace("\\", "\\\\").replace('"""', "'''")
