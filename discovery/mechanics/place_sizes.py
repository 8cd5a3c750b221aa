"""How far the places of a declared system move in a motion of some frequency."""

from __future__ import annotations

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.mechanics.declared import DeclaredBase
from discovery.mechanics.declared_equations import INPUT

#: Structural loss factor of a free motion whose frequencies are guessed.
_BLUNT = 0.2


def place_sizes(base: DeclaredBase, frequency: float, drive: float, output: float) -> dict[str, tuple[float, float]]:
    """Return how far each place moves, and in which time its forces would bring it there.

    `frequency`: angular frequency of the motion [rad/s]. `drive`, `output`: amplitudes of input and output, in SI
    units. Returned: displacement [unit of the place] and time [s] in the linear motion at that frequency with that
    output, at the constants as declared and guessed: they say of which size a law at the place can be.
    """
    turn, (q, rates, accelerations) = 1j * frequency, base.moving
    force = sp.Matrix(base.mechanics().force)
    # Drag along a way in a plane has no slope at rest that could be worked out: 0 over 0.
    stiffness, loss = (np.nan_to_num(-base.numbers(force.jacobian(a)), posinf=0, neginf=0) for a in (q, rates))
    pushed = [*enumerate(INPUT), (0, s.u)]
    push = sum(base.numbers(force.diff(a))[:, 0] * turn**k for k, a in pushed)
    driven, moving = bool(np.any(push)), loss * turn + base.inertia * turn**2
    yields = np.linalg.pinv(stiffness + moving)
    # What moves freely does so as if it were shaken at the output: near a natural frequency that is its mode. Guesses
    # may put that elsewhere, or where the output rests: a loss blunts both.
    motion = yields @ push if driven else np.linalg.pinv(stiffness * (1.0 + _BLUNT * 1j) + moving) @ base.gradient
    read = sum(
        base.numbers(sp.Matrix([[sp.diff(base.equations.output, a) for a in own]]))[0] @ motion * turn**k
        for k, own in enumerate((q, rates, accelerations))
    )
    scale = output / abs(read) if abs(read) > 0 else drive
    found = {}
    for name in base.equations.places:
        way = base.way(name)
        moved, weight = scale * abs(way @ motion), base.places()[name].inertia
        if not moved > 0:
            found[name] = output, 1.0 / frequency
            continue
        # What would hold the place still: a loss there cannot be much larger.
        still = (max(scale, drive) if driven else scale) * abs(way @ motion) / abs(way @ yields @ way)
        found[name] = float(moved), float(np.sqrt(weight * moved / max(still, weight * moved * frequency**2)))
    return found
