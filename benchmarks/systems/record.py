"""A recording of a machine with a law at one of its joints, by LSODA."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.systems.laws import Law
from benchmarks.systems.machines import Machine

#: Parts of an input, and the times at which one in steps changes [s].
_PARTS, _STEPS = 9, (0.5, 2.5, 4.5, 6.5)


def record(machine: Machine, joint: str, law: Law, path: Path, seed: int) -> None:
    """Simulate a machine from rest, and write what its instruments read, in columns t, u and y.

    Parameters
    ----------
    machine : Machine
        The machine.
    joint : str
        Where the law acts; empty for a law of the drive.
    law : Law
        What its declaration lacks.
    path : Path
        The file.
    seed : int
        Of input and noise.
    """
    rng = np.random.default_rng(seed)
    n, time = machine.coordinates, np.arange(round(machine.seconds * machine.rate)) / machine.rate
    drive = _input(machine, rng)
    way = machine.joints.get(joint, (0.0,) * n)

    def motion(t: float, state: NDArray) -> list[float]:
        return moved(float(drive(t)), state.tolist())

    def moved(u: float, state: list[float]) -> list[float]:
        q, v, (slip, arrived) = state[:n], state[n : 2 * n], state[2 * n :]
        asked = law.received(u)
        arrived, rise = (arrived, (asked - arrived) / law.behind) if law.behind else (asked, 0.0)

        def at(place: str, d: float, rate: float) -> float:
            return law.force(d, rate, slip) if place == joint else 0.0

        twist, turning = (sum(a * b for a, b in zip(way, x, strict=True)) for x in (q, v))
        return [*v, *machine.accelerations(arrived, q, v, at), law.slip(twist, turning, slip), rise]

    state = np.array([*(machine.start or (0.0,) * n), *(0.0,) * (n + 2)])
    parts = []
    # An input in steps is integrated from step to step.
    edges = [0.0, *(_STEPS if machine.drive[2] == 0 else ()), time[-1] + 1 / machine.rate]
    for begin, end in pairwise(edges):
        here = time[(time >= begin - 1e-9) & (time < end - 1e-9)]
        found = solve_ivp(
            motion, (begin, end), state, "LSODA", [*here, end], rtol=1e-9, atol=1e-11, max_step=2.0 / machine.rate
        )
        parts.append(found.y[:, :-1])
        state = found.y[:, -1]
    states = np.concatenate(parts, axis=1).T.tolist()
    given = [float(drive(t)) for t in time]
    read = [machine.read(x[:n], x[n : 2 * n], moved(u, x)[n : 2 * n]) for u, x in zip(given, states, strict=True)]
    seen = np.array(read) + rng.normal(0.0, machine.noise, time.size)
    table = np.column_stack([time, machine.input_factor * np.array(given), seen])
    np.savetxt(path, table, "%.7g", ",", header="t,u,y", comments="")


def _input(machine: Machine, rng: np.random.Generator):
    """Return the input as a function of time: a sum of sines that swells, or steps."""
    size, low, high = machine.drive
    if high == 0.0:
        levels = np.array([0.0, *(size * rng.uniform(0.5, 1.0, len(_STEPS)) * rng.choice([-1.0, 1.0], len(_STEPS)))])
        return lambda t: levels[np.searchsorted(_STEPS, np.asarray(t) + 1e-9)]
    frequency = 2 * np.pi * rng.uniform(low, high, _PARTS)
    parts, phase = size * rng.uniform(0.3, 1.0, _PARTS) * np.sqrt(2 / _PARTS), rng.uniform(0, 2 * np.pi, _PARTS)
    return lambda t: float(np.sin(frequency * t + phase) @ parts) * min(1.0, (t / 0.5) ** 2)
