"""Dry friction at rest on steps that are too long: derivatives are taken over steps that stand out of the chatter."""

from __future__ import annotations

import numpy as np
from pushed_oscillator import UNITS, pushes, recorded

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.chatter import clear_of_chatter
from discovery.estimation.covariance import Probed, simulated
from discovery.estimation.problem import Problem

MODEL = Model("oscillator", ("viscous_damping", "linear_stiffness", "coulomb_friction"))
FRICTION = 1.5  # more than the pushes: the body stands still for most of the time


def problem(creep: float, noise: float) -> tuple[Problem, np.ndarray]:
    """Return a stuck oscillator on steps of 20 ms, whose friction forgets within creep / FRICTION, and its values."""
    experiment = recorded("r", pushes(1.0, -1.2, 0.9, 0.0), 0, f_c=FRICTION, v_c=0.05)
    experiment.recording.noise[:] = noise
    model = Model(MODEL.base, MODEL.effects, {"v_c": creep})
    found = Problem(model, Bench(model.base, model.effects, [experiment], 0.02), UNITS, {})
    return found, found.start({"g": 1.0, "xi": 0.08, "alpha": 9.0, "f_c": FRICTION})


def slopes(found: Problem, x: np.ndarray, size: np.ndarray) -> np.ndarray:
    (columns,) = simulated(found.bench, [found], [Probed.around(found, x, size)])
    return np.sqrt(np.square(columns[0][:, :, :-1]).sum(axis=(0, 1)))


def test_where_nothing_chatters_steps_stay() -> None:
    found, x = problem(creep=0.2, noise=1e-3)
    size = 1e-4 * found.scale
    (kept,), _ = clear_of_chatter(found.bench, [found], [x], [size])
    np.testing.assert_array_equal(kept, size)


def test_chatter_is_no_knowledge_of_a_parameter() -> None:
    """Derivatives by tiny steps are hundreds of times those by steps that the chatter does not hide, or of none."""
    found, x = problem(creep=1e-4, noise=1e-5)
    tiny = 1e-7 * found.scale
    (size,), _ = clear_of_chatter(found.bench, [found], [x], [tiny])
    assert ((size == 0.0) | (size > 10.0 * tiny)).all()
    wild, sound = slopes(found, x, tiny), slopes(found, x, size)
    assert (wild > 30.0 * sound)[size > 0.0].all()
    # Over other steps of that size they are the same.
    again = slopes(found, x, 1.5 * size)
    np.testing.assert_allclose(again, sound, rtol=0.7)
