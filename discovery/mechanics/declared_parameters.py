"""Parameters of a declared system: its constants, and where coordinates begin that are not read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.parameters import Flat, LogUniform, Normal, Parameter
from discovery.declarations.system import Constant

#: A free constant keeps the sign of its guess, and is no farther from it than by this factor.
_FARTHEST = 1e4


def constant_parameter(name: str, constant: Constant) -> Parameter:
    """Return the parameter that a constant is, in SI units: known, free, or known within an uncertainty."""
    size = abs(constant.value)
    bounds = (-np.inf, np.inf)
    prior: Flat | LogUniform | Normal = Flat(size)
    if constant.free:
        prior = LogUniform(size, _FARTHEST)
        near, far = constant.value / _FARTHEST, constant.value * _FARTHEST
        bounds = (min(near, far), max(near, far))
    elif constant.sd is not None:
        prior = Normal(constant.value, constant.sd)
    return Parameter(
        constant.unit, name.replace("_", " "), bounds, prior, default=constant.value, starts=(constant.value,),
        fixed=not constant.free, physical=True, name=name,
    )  # fmt: skip


@dataclass(frozen=True)
class Unread:
    """A coordinate that may begin anywhere, whatever is read."""

    way: NDArray  # (n,), displacement of the coordinates per unit of it, which leaves alone what is read
    starts: tuple[Parameter, ...]  # its displacement from where a static force leads it, and its rate


def unread_coordinates(
    coordinates: Mapping[str, str], gradient: NDArray, shape: NDArray, inertia: NDArray, order: int
) -> tuple[Unread, ...]:
    """Return all coordinates but the one that shows most in what is read, none where nothing shows at rest.

    Each is believed to begin as far away as a displacement that is as heavy as that by one unit of what is read.

    `coordinates`: units by name. `gradient` (n,): what is read per coordinate. `shape` (n,): displacement per unit of
    what is read. `inertia` (n, n). `order`: 1 where what is read is a rate.
    """
    if len(gradient) == 1 or not gradient.any():
        return ()
    heavy = float(np.sqrt(shape @ inertia @ shape))
    read = int(np.argmax(np.abs(gradient) / np.sqrt(np.diag(inertia))))
    # Of a rate that is read, a displacement is so many natural times.
    natural = ("q s", "q") if order == 1 else ("q", "q s^-1")
    found = []
    for j, (name, unit) in enumerate(coordinates.items()):
        if j == read:
            continue
        way = np.zeros(len(gradient))
        way[j], way[read] = 1.0, -gradient[j] / gradient[read]
        size = Normal(0.0, heavy / float(np.sqrt(inertia[j, j])))
        told = ((f"{name}_start", "displacement", unit), (f"{name}_rate_start", "rate", f"{unit} s^-1"))
        starts = (
            Parameter(
                by, f"{what} of {name.replace('_', ' ')} at the start", prior=size, shape=True, fixed=True, own=True,
                name=label, measured=measured,
            )
            for by, (label, what, measured) in zip(natural, told, strict=True)
        )  # fmt: skip
        found.append(Unread(way, tuple(starts)))
    return tuple(found)
