"""What differs between systems in the words of exported sources."""

from __future__ import annotations

from collections.abc import Mapping

from discovery.declarations import symbols as s
from discovery.equations.model import Model
from discovery.export.symbolic import SymbolicModel

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


def input_words(model: Model, program: SymbolicModel) -> Mapping[str, str]:
    """Return what input and readings of a model are called."""
    if model.mechanics.system.has_rod:
        return _ARM
    if model.mechanics.input_moves:
        return _MOVED
    written = (*program.slopes, *program.reading, *dict(program.assignments).values())
    return _FORCED if any(s.u in e.free_symbols for e in written) else _FREE
