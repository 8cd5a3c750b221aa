"""What differs between systems in the exported Python source: how inputs and readings are interpolated, and words."""

from __future__ import annotations

__all__ = [
    "ARM_WORDS",
    "AT_SAMPLES",
    "FREE_WORDS",
    "INPUT_DRIVE",
    "LATE_INPUT",
    "MEMORY",
    "MOTION_DRIVE",
    "MOTOR",
    "MOVED_WORDS",
    "OSCILLATOR_WORDS",
    "RATES",
    "READ",
    "READ_LATE",
]

MOTION_DRIVE = '''def _drive(time, inputs, piece, fraction):
    """Return the moving input, its rate and its acceleration at fractions of the intervals between samples."""
    samples = np.array([np.broadcast_to(np.asarray(v, float), time.shape) for v in inputs])
    return np.array(_hermite(fraction, np.diff(time)[piece], samples[:, piece], samples[:, piece + 1]))'''

INPUT_DRIVE = '''def _drive(time, inputs, piece, fraction):
    """Return the input at fractions of the intervals between samples."""
    (u,) = inputs
    at = time[piece] + fraction * np.diff(time)[piece]
    if callable(u):
        return np.broadcast_to(np.asarray(u(at), float), at.shape)[None]
    samples = np.broadcast_to(np.asarray(u, float), time.shape)
    return ((1.0 - fraction) * samples[piece] + fraction * samples[piece + 1])[None]'''

READ = '''def _read(time, begin, h, states, slopes, first, drive, inputs, parameters):
    """Return the readings at the sample times."""
    everything = np.concatenate([states[0], states[1, -1:]])[first].swapaxes(0, 1)
    return reading(time[:, None], everything, @SAMPLED@parameters)'''

READ_LATE = '''def _read(time, begin, h, states, slopes, first, drive, inputs, parameters):
    """Return the readings at the sample times, of the state as it was a little earlier."""
    lanes = np.arange(states.shape[-1])
    at = time[:, None] - np.broadcast_to(lateness(time[:, None], parameters), (time.size, lanes.size))
    i = np.clip(np.searchsorted(begin, at, side="right") - 1, 0, begin.size - 1)
    step = h[i]
    f = (at - begin[i]) / step
    ends = [[x[k, i, :, lanes[None]] for x in (states, slopes)] for k in (0, 1)]
    n = @N@
    both = [np.moveaxis(np.stack([y[..., :n], v[..., :n], v[..., n : 2 * n]]), -1, 1) for y, v in ends]@MOTOR@
    between = _hermite(f, step, *both)[0]
    # Before the first or after the last step: Taylor's series from the nearer end.
    before, after = f * step, (f - 1.0) * step
    early = both[0][0] + before * both[0][1] + 0.5 * before**2 * both[0][2]
    late = both[1][0] + after * both[1][1] + 0.5 * after**2 * both[1][2]
    state = np.where(f < 0.0, early, np.where(f > 1.0, late, between))@RATES@
    return reading(at, state, @LATE_INPUT@parameters)'''

MOTOR = """
    angle = [np.asarray(drive[k])[:, None, i] for k in (0, 2)]
    both = [np.concatenate([y, a], axis=1) for y, a in zip(both, angle, strict=True)]"""

#: Where the reading needs rates as well.
RATES = """
    early, late = (end[1] + away * end[2] for end, away in zip(both, (before, after), strict=True))
    rate = np.where(f < 0.0, early, np.where(f > 1.0, late, _hermite(f, step, *both)[1]))
    state = np.concatenate([state[:n], rate[:n], state[n:]])"""

#: Where it needs states of memory, of which only value and slope are known.
MEMORY = """
    (z0, z1), (dz0, dz1) = ([np.moveaxis(end[k][..., 2 * n :], -1, 0) for end in ends] for k in (0, 1))
    turn = f * (1.0 - f) * ((1.0 - f) * (step * dz0 + z0 - z1) - f * (step * dz1 + z0 - z1))
    memory = np.where(f < 0.0, z0 + before * dz0, np.where(f > 1.0, z1 + after * dz1, z0 + f * (z1 - z0) + turn))
    state = np.concatenate([state[: 2 * n], memory, state[2 * n :]])"""


#: Inputs that a reading needs at the sample times, and at the times of a late state, by whether the input is a motion.
AT_SAMPLES = {
    True: "np.broadcast_to(np.asarray(inputs[{}], float), time.shape)[:, None], ",
    False: "np.broadcast_to(inputs[{0}](time) if callable(inputs[{0}]) else inputs[{0}], time.shape)[:, None], ",
}
LATE_INPUT = {
    True: "_hermite(f, step, drive[0][:, i], drive[2][:, i])[{}], ",
    False: "inputs[{0}](at.ravel()).reshape(at.shape) if callable(inputs[{0}]) "
    "else np.interp(at, time, np.broadcast_to(inputs[{0}], time.shape)), ",
}

#: What differs between the systems in the template.
ARM_WORDS = {
    "LATE_INPUT": "state[-1], ",
    "START_ARGUMENTS": ", theta_m=0.0, theta_m_dot=0.0",
    "START_VALUES": ", *drive[0][:2, 0]",
    "INPUTS": "theta_m, theta_m_dot, theta_m_ddot",
    "INPUT_WORDS": "theta_m and its derivatives: the recorded motor angle [rad, rad/s, rad/s^2]",
    "READING_WORDS": "tip x, y [m]",
    "JUMPS": "the motor's acceleration",
    "SIMULATE_WORDS": "theta_m, theta_m_dot, theta_m_ddot: the motor's angle, rate and acceleration at these times.",
}
OSCILLATOR_WORDS = {
    **dict.fromkeys(("START_ARGUMENTS", "START_VALUES"), ""),
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
