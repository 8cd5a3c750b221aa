"""What differs between systems in the words of exported sources."""

from __future__ import annotations

__all__ = ["ARM_WORDS", "FREE_WORDS", "MOVED_WORDS", "OSCILLATOR_WORDS"]

ARM_WORDS = {
    "INPUTS": "theta_m, theta_m_dot, theta_m_ddot",
    "INPUT_WORDS": "theta_m and its derivatives: the recorded motor angle [rad, rad/s, rad/s^2]",
    "READING_WORDS": "tip x, y [m]",
    "JUMPS": "the motor's acceleration",
    "SIMULATE_WORDS": "theta_m, theta_m_dot, theta_m_ddot: the motor's angle, rate and acceleration at these times.",
}
OSCILLATOR_WORDS = {
    "INPUTS": "u",
    "INPUT_WORDS": "u: the recorded input",
    "READING_WORDS": "the output",
    "JUMPS": "the input",
    "SIMULATE_WORDS": "u: the input at these times, straight in between, or a function of time.",
}
MOVED_WORDS = {
    **OSCILLATOR_WORDS,
    "INPUTS": "u, u_dot, u_ddot",
    "INPUT_WORDS": "u and its derivatives: the recorded motion",
    "JUMPS": "the acceleration of the input",
    "SIMULATE_WORDS": "u, u_dot, u_ddot: the input, its rate and its acceleration at these times.",
}
FREE_WORDS = {**OSCILLATOR_WORDS, **dict.fromkeys(("INPUT_WORDS", "SIMULATE_WORDS"), "u: there is no input; give 0")}
