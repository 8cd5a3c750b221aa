"""The catalogue of effects as one page of Markdown: ``python docs/catalogue_page.py OUT.md``.

Everything on the page is taken from the declarations: formula and meaning from the class docstring, parameters with
units, bounds and priors, and the source of each law. The steps of the mechanics are declared alike.
"""

from __future__ import annotations

import inspect
import math
import re
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from discovery.declarations.effect import ARM, Effect
from discovery.declarations.parameters import Parameter
from discovery.declarations.registry import catalogue
from discovery.equations.lacking import candidates, ever_candidates
from discovery.equations.model import Model
from discovery.foundation.io import atomic_write
from discovery.mechanics import base_names, get_base
from discovery.mechanics.upgrades import UPGRADES, Upgrade
from discovery.rigs.rig_system import taken_names

_KINDS = {
    "mechanics": "Mechanics of the arm",
    "kinetic": "Kinetic energy",
    "potential": "Potential energy",
    "dissipation": "Dissipation",
    "load": "Loads",
    "closure": "Closures",
    "memory": "Memory",
    "mode": "Modes",
    "shape": "Shape of the rod",
    "joint": "Joint at the root of the rod",
    "drive": "Drive",
    "sensor": "Sensor",
}
_OPENING = """# Catalogue of effects

Written by `make docs` from the declarations in `discovery/effects`; [how to add one](ADD_AN_EFFECT.md). The first two
are steps to better [mechanics](MECHANICS.md#three-bases), which the loop names as it names effects.

Energies are per unit of inertia, lengths in lengths of the arm, q is the unit of the coordinate (rad for an arm, the
output's unit for an oscillator), u that of the recorded input. Bounds and priors are in natural units: time in 1/omega
of the small oscillation, an oscillator's coordinate and its input in their largest amplitudes. A shape parameter does
not switch its effect; a fixed one is a convention, which the loop fits at its end where it has added the effect. Where
bases are named, the others contain the effect or cannot show it.
"""
_TAKEN = (
    "A constant of a [declared system](YOUR_SYSTEM.md) has another name than what effects and mechanics call theirs, "
    "whether a model has them or not: {}."
)
_PROGRAM = (
    "The compiled program needs these, and every name that begins with one of them and an underscore, such as "
    "`drive_loss`: {}."
)


def _block(found: re.Match[str]) -> str:
    """Return a displayed formula, its lines below each other."""
    lines = [line.strip().removesuffix(r"\qquad") for line in found[1].splitlines()]
    body = lines[0] if len(lines) == 1 else "\n".join([r"\begin{gathered}", " \\\\\n".join(lines), r"\end{gathered}"])
    return f"```math\n{body}\n```"


def _formula(text: str) -> str:
    """Return a docstring with its mathematics as Markdown knows it."""
    text = re.sub(r"``([^`]*)``", r"`\1`", text)
    text = re.sub(r":math:`([^`]*)`", r"$`\1`$", text)
    return re.sub(r"^\.\. math:: (.*(?:\n +\S.*)*)$", _block, text, flags=re.MULTILINE)


def _prior(parameter: Parameter) -> str:
    law, *numbers = parameter.prior.summary().items()
    return ", ".join([law[1], *(f"{name.replace('_', ' ')} {value:g}" for name, value in numbers)])


def _bound(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else "any"


def _row(parameter: Parameter) -> str:
    role = "fixed" if parameter.fixed else "shape" if parameter.shape else "amplitude"
    bounds = f"{_bound(parameter.bounds[0])} to {_bound(parameter.bounds[1])}"
    symbol = parameter.latex or parameter.name
    return (
        f"| $`{symbol}`$ | `{parameter.name}` | {parameter.unit} | {parameter.meaning} | {role} | {bounds} "
        f"| {_prior(parameter)} |"
    )


def _where(effect_id: str, effect: Effect) -> str:
    """Say on what an effect acts, with its bases where that is not all of them."""
    if isinstance(effect, Upgrade):
        return effect.switch()
    systems = "arms" if effect.systems == {ARM} else "arms and oscillators" if ARM in effect.systems else "oscillators"
    bases = [b for b in base_names() if get_base(b).system in effect.systems]
    open_to = [f"`{b}`" for b in bases if effect_id in candidates(Model(b, ()))]
    if not open_to:
        return "Acts at a place of a declared system."
    on = systems if len(open_to) == len(bases) else f"{systems} (bases: {', '.join(open_to)})"
    return f"Acts on {on}{' and in declared systems' if effect_id in ever_candidates(()) else ''}."


def _section(effect_id: str, effect: Effect) -> list[str]:
    words = _formula(inspect.getdoc(type(effect)) or "")
    lines = [f"### `{effect_id}`", "", words, "", _where(effect_id, effect)]
    lines += [f"Source: {effect.cite}.", ""]
    if effect.parameters():
        lines += ["| symbol | name | unit | meaning | role | bounds | prior |", "|---|---|---|---|---|---|---|"]
        lines += [_row(p) for p in effect.parameters()]
        lines.append("")
    return lines


def catalogue_page() -> str:
    """Return the page, effects by kind and then by name."""
    lines = [_OPENING]
    shown: dict[str, Effect] = {**UPGRADES, **catalogue()}
    for kind, heading in _KINDS.items():
        members = {e: effect for e, effect in shown.items() if effect.kind == kind}
        if members:
            lines += [f"## {heading}", ""]
        for effect_id, effect in members.items():
            lines += _section(effect_id, effect)
    return "\n".join([*lines, *_taken()]).rstrip() + "\n"


def _taken() -> list[str]:
    """Return the section of the names that a constant of a declared system may not have."""
    names, beginnings = taken_names()
    single = [n for n in names if len(n) > 1 and n.partition("_")[0] not in beginnings]
    told = (_TAKEN, sorted(single, key=lambda n: (n.lower(), n))), (_PROGRAM, beginnings)
    filled = (textwrap.fill(text.format(", ".join(f"`{n}`" for n in each)), 118) for text, each in told)
    return ["## Names that are taken", "", "\n\n".join(filled), ""]


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the page to the file named on the command line."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if len(given) != 1:
        sys.exit("usage: python docs/catalogue_page.py OUT.md")
    with atomic_write(Path(given[0])) as temporary:
        Path(temporary).write_text(catalogue_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
