"""What a rough recording is made of: an ingredient acts on the motion, on the instrument, or on the readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from discovery_datasets.disturbances import Disturbance
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Optics = Callable[[FloatArray, FloatArray], FloatArray]
Scatter = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]


@dataclass(frozen=True)
class Action:
    """What one ingredient of a given strength does.

    Attributes
    ----------
    laws : mapping of str to float
        Coefficients of `one_coordinate.Laws`, for a body.
    disturbance : Disturbance, optional
        The same for an arm.
    push, inertia : callable, optional
        Force over inertia [q/s^2], and the inertia over its nominal value, at given times.
    late : callable, optional
        Time at which the body was where the instrument reports it, for given times.
    optics : callable, optional
        What an instrument without noise reports, of times (n,) and true readings (n, c).
    scatter : callable, optional
        The same with what no model foretells, of times, readings and a source of random numbers.
    """

    laws: Mapping[str, float] = field(default_factory=dict)
    disturbance: Disturbance | None = None
    push: Callable[[FloatArray], FloatArray] | None = None
    inertia: Callable[[FloatArray], FloatArray] | None = None
    late: Callable[[FloatArray], FloatArray] | None = None
    optics: Optics | None = None
    scatter: Scatter | None = None


@dataclass(frozen=True)
class Ingredient:
    """An effect to hide, an outsider, or an error of the model, drawn but for its strength.

    Attributes
    ----------
    id : str
        Its name.
    act : callable
        The action of a given strength; about 1 is plainly seen.
    most : float
        Largest strength that a laboratory would not notice otherwise.
    family : str
        Which effects act in a like way, for statistics.
    accepted : tuple of str
        Ids of the catalogue that name the very same physics.
    resembles : tuple of str
        Ids that would describe a good part of an error of the model without being right.
    catalogue : callable, optional
        Parameters of the catalogue's law nearest to this one, at a given strength.
    exact : bool
        Whether those are the values that a right answer has, not only near to them.
    shape : mapping
        What was drawn, for the sealed truth.
    """

    id: str
    act: Callable[[float], Action]
    most: float
    family: str = ""
    accepted: tuple[str, ...] = ()
    resembles: tuple[str, ...] = ()
    catalogue: Callable[[float], Mapping[str, float]] | None = None
    exact: bool = True
    shape: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Readings:
    """A recording free of scatter.

    Attributes
    ----------
    time : (n,) array
        Times [s].
    inputs : mapping of str to (n,) array
        Columns of what drives the system.
    outputs : mapping of str to (n,) array
        Columns of what the instrument reports.
    reach : float
        Largest deflection.
    """

    time: FloatArray
    inputs: Mapping[str, FloatArray]
    outputs: Mapping[str, FloatArray]
    reach: float


def nothing(_: float) -> dict[str, float]:
    """Return no parameters."""
    return {}


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
