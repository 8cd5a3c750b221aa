"""What exported files share: where their numbers come from, in lines that no name in them can break, and templates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from discovery.declarations import symbols as s
from discovery.equations.model import Model
from discovery.export.fitted import FittedModel
from discovery.export.symbolic import SymbolicModel
from discovery.foundation.estimate_text import estimate_text

#: What input and readings are called: of an arm, under a force, under a motion, and in free motion.
_ARM = {
    "INPUTS": "theta_m, theta_m_dot, theta_m_ddot",
    "INPUT_WORDS": "theta_m and its derivatives: the recorded motor angle [rad, rad/s, rad/s^2]",
    "READING_WORDS": "tip x, y [m]",
    "JUMPS": "the motor's acceleration",
    "SIMULATE_WORDS": "theta_m, theta_m_dot, theta_m_ddot: the motor's angle, rate and acceleration at these times.",
}
_FORCED = {
    "INPUTS": "u",
    "INPUT_WORDS": "u: the recorded input",
    "READING_WORDS": "the output",
    "JUMPS": "the input",
    "SIMULATE_WORDS": "u: the input at these times, straight in between, or a function of time.",
}
_MOVED = {
    **_FORCED,
    "INPUTS": "u, u_dot, u_ddot",
    "INPUT_WORDS": "u and its derivatives: the recorded motion",
    "JUMPS": "the acceleration of the input",
    "SIMULATE_WORDS": "u, u_dot, u_ddot: the input, its rate and its acceleration at these times.",
}
_FREE = {**_FORCED, **dict.fromkeys(("INPUT_WORDS", "SIMULATE_WORDS"), "u: there is no input; give 0")}


def composition(found: FittedModel) -> str:
    """Return the base of a model and its effects in words."""
    return f"{found.model.base} with {', '.join(found.model.effects) or 'no effects'}"


def initial_states(found: FittedModel) -> list[str]:
    """Return lines that say from which states the recordings start; none without recordings."""
    what = ("deflection", "rate", *found.model.begins)
    starts = [
        f"{recording}: " + ", ".join(f"{name} {number:.9g}" for name, number in zip(what, start, strict=True))
        for recording, start in found.initial.items()
    ]
    return ["Initial states of the recordings:", *starts] if starts else []


def origin(found: FittedModel) -> list[str]:
    """Return lines that say where the numbers come from, as far as it is known, and what they weigh."""
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


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        variable_start_string="@",
        variable_end_string="@",
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )


def filled(template: str, fields: Mapping[str, Any]) -> str:
    """Return the template in a file with its fields, ``@NAME@`` there; what a field holds is no template."""
    return _environment().get_template(template).render(fields)


def indented(lines: Iterable[str]) -> str:
    """Return lines as those of the body of a function."""
    return "\n".join(f"    {line}" for line in lines)


def input_words(model: Model, program: SymbolicModel) -> Mapping[str, str]:
    """Return what input and readings of a model are called."""
    if model.mechanics.system.has_rod:
        return _ARM
    read = {"READING_WORDS": ", ".join(("the output", *model.mechanics.channels[1:]))}
    if model.mechanics.input_moves:
        return _MOVED | read
    written = (*program.slopes, *program.reading, *dict(program.assignments).values())
    return (_FORCED if any(s.u in e.free_symbols for e in written) else _FREE) | read
