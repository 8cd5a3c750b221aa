"""The step that a motion leaves to the classical method, which others use who simulate a fitted model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from discovery.equations.program import Program
from discovery.foundation.arrays import FloatArray
from discovery.simulation.grid import Grid
from discovery.simulation.kernel.compile import numpy_derivative

#: Part of the time in which a state forgets: the method is stable up to 2.8, and right by some tenths of that.
_PART = 1.0


def classical_step(program: Program, grid: Grid, motion: FloatArray, parameters: FloatArray) -> float:
    """Return the longest step of the classical method on a motion on which the kernel's own may be longer [s].

    Infinite where nothing forgets faster than it moves, see `discovery.simulation.kernel.fused`.

    `program`: what moves. `grid`: the steps of the motion. `motion` (steps, 4 states): from
    `discovery.simulation.simulate.Simulator.motion`. `parameters` (p,): in the order of the program.
    """
    states = motion[:, : len(program.states)].T
    # The memory of an effect that is absent rests.
    moving = [rate for z, rate in program.relaxation if states[program.states.index(z)].any()]
    if not moving:
        return np.inf
    rates = numpy_derivative(replace(program, slopes=tuple(moving)))
    return _PART / max(float(np.max(rate)) for rate in rates(grid.times, grid.drive[:, 0].T, states, parameters))
