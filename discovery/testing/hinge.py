"""Numbers from the equations of a base whose root turns in a joint, from its bare mechanics alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Load
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.testing.equations import bare_base, energy, loaded_end_of, slopes_of
from discovery.testing.states import Sample, derivative, whole


def _root_torque(base_name: str, sample: Sample) -> FloatArray:
    """Return the moment of the rod at its root (k,), per unit of effective inertia."""
    root = get_base(base_name).mechanics(whole(base_name).rod).root
    assert root is not None
    bare = bare_base(base_name, sample)
    return bare.symbols["alpha"] * bare.of(root[0])


def joint_power(base_name: str, sample: Sample) -> FloatArray:
    """Return the power (k,) that the joint at the root takes from the rod, with its sign turned."""
    turning = bare_base(base_name, sample).symbols["omega_m"] - sample.recorded[1]
    return -_root_torque(base_name, sample) * turning


def turning_energy(base_name: str, sample: Sample) -> FloatArray:
    """Return the part of the kinetic energy (k,) that a turning root adds to that of the coordinates' rates."""
    rate, momentum = (bare_base(base_name, sample).symbols[name] for name in ("omega_m", "h"))

    def faster(by: float) -> FloatArray:
        recorded = sample.recorded + by * np.array([[0.0], [1.0], [0.0]])
        return bare_base(base_name, replace(sample, recorded=recorded)).symbols["h"]

    return rate * (momentum - derivative(faster) * rate / 2)


def hinge_residual(base_name: str, sample: Sample) -> FloatArray:
    """Return what is left of Lagrange's equations (n, k) where the root turns in a joint: nothing.

    The turn of the root is imposed on the bare base; what the joint then has to hold is the balance of angular
    momentum, which acts on each coordinate as much as that one turns the root.
    """
    n, slopes = get_base(base_name).n_coordinates, slopes_of(base_name, sample)
    acceleration, drift = slopes[n : 2 * n], slopes[2 * n :]

    def turning(at: Sample) -> FloatArray:
        return bare_base(base_name, at).symbols["omega_m"]

    def stored(at: Sample) -> FloatArray:
        return bare_base(base_name, at).of(s.alpha * s.U)

    def momentum(tau: float) -> FloatArray:
        return bare_base(base_name, sample.along(tau, acceleration, n, drift)).symbols["h"]

    def along(row: int, of: Callable[[Sample], FloatArray]) -> FloatArray:
        return derivative(lambda by: of(sample.moved(row, by)))

    gain = np.array([along(n + i, turning) for i in range(n)])
    imposed = sample.recorded.copy()
    imposed[2] += (gain * acceleration).sum(axis=0)
    left = np.einsum("ijk,jk->ik", bare_base(base_name, sample).mass, acceleration)
    left += np.array([along(i, stored) for i in range(n)])
    left -= bare_base(base_name, replace(sample, recorded=imposed)).force
    return left + gain * (derivative(momentum) + _root_torque(base_name, sample))


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
