"""Numerical derivatives of energies and powers: the generalised forces that an effect must have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Load
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.testing.equations import bare_base, energy, loaded_end_of
from discovery.testing.states import Sample, derivative


def elastic_pull(base: str, sample: Sample) -> FloatArray:
    """Return the force of the base's own elastic energy on each coordinate."""

    def elastic(i: int) -> FloatArray:
        return derivative(lambda by: bare_base(base, sample.moved(i, by)).of(s.alpha * s.U))

    return -np.array([elastic(i) for i in range(get_base(base).n_coordinates)])


def push_of(effect: Effect, base: str, sample: Sample, acceleration: FloatArray) -> FloatArray:
    """Return the force of an effect on each coordinate, from its energy or power."""
    n, end = get_base(base).n_coordinates, loaded_end_of(effect, base)
    stored = energy(effect, base) if end is None else end.kinetic(energy(effect, base))

    def push(row: int, at: Sample) -> FloatArray:
        return derivative(lambda by: bare_base(base, at.moved(row, by)).of(stored))

    def momentum_rate(i: int) -> FloatArray:
        return derivative(lambda tau: push(n + i, sample.along(tau, acceleration, n)))

    # Of a load or a memory: the gradient of its power in the rates.
    rows: dict[str, Callable[[int], FloatArray]] = {
        "potential": lambda i: -push(i, sample),
        "dissipation": lambda i: -push(n + i, sample),
        "kinetic": lambda i: push(i, sample) - momentum_rate(i),
    }
    row = rows.get(effect.kind, lambda i: push(n + i, sample))
    if isinstance(effect, Load) and (on := effect.on) is not None:
        force = bare_base(base, sample).of(effect.expression())

        def row(i: int) -> FloatArray:
            return force * derivative(lambda by: bare_base(base, sample.moved(n + i, by)).of(on))

    expected = np.array([row(i) for i in range(n)])
    if end is not None:
        moment = bare_base(base, sample).of(end.moment)

        def turned(i: int) -> FloatArray:
            return derivative(lambda by: bare_base(base, sample.moved(i, by)).of(s.slope))

        expected += np.array([turned(i) for i in range(n)]) * moment
    return expected
