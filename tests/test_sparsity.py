from __future__ import annotations

import numpy as np
import pytest

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.differences import Probed, simulated
from discovery.estimation.least_squares import FloatArray, Minimum, levenberg_marquardt, minimise
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem
from discovery.estimation.sparsity import Sparsity
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn

T = np.linspace(0.0, 4.0, 50)
#: A common rate, then an offset and a size of each of three records: what a record has of its own moves it alone.
TRUE = np.array([0.8, 1.0, 2.0, -0.5, 1.5, 0.3, -1.0])
ROWS = tuple(slice(50 * i, 50 * i + 50) for i in range(3))
APART = Sparsity(np.array([0, 1, 2, 1, 2, 1, 2]), np.array([-1, 0, 0, 1, 1, 2, 2]), ROWS)


def records(x: FloatArray) -> FloatArray:
    """Return the residuals (151, k) of three records, and of what is believed of the rate."""
    parts = [x[1 + 2 * i] + x[2 + 2 * i] * np.exp(-np.outer(T, x[0])) for i in range(3)]
    at = [TRUE[1 + 2 * i] + TRUE[2 + 2 * i] * np.exp(-TRUE[0] * T) for i in range(3)]
    return np.concatenate([*(100 * (p - a[:, None]) for p, a in zip(parts, at, strict=True)), 0.1 * (x[:1] - 0.8)])


def solved(sparsity: Sparsity | None, **options: object) -> tuple[Minimum, int]:
    """Return the minimum, and how many points it asked for."""
    asked: list[int] = []

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        asked.extend(x.shape[1] for _, x in wanted)
        return [records(x) for _, x in wanted]

    free = np.full(7, 9.0)
    start = np.array([0.3, *(0.5 * TRUE[1:])])
    request = levenberg_marquardt(start, -free, free, np.ones(7), sparsity=sparsity, **options)
    return minimise([request], answer)[0], sum(asked)


@pytest.mark.parametrize("rough", [False, True])
def test_numbers_that_share_no_residual_are_differenced_together_to_the_same_digits(rough: bool) -> None:
    (plain, dear), (apart, cheap) = solved(None, rough=rough), solved(APART, rough=rough)
    assert apart.converged
    assert apart.x == pytest.approx(TRUE, abs=1e-6)
    assert np.array_equal(apart.x, plain.x)
    assert np.array_equal(apart.jacobian, plain.jacobian)
    assert cheap < 0.8 * dear


def test_a_quick_search_differences_only_what_is_unknown() -> None:
    known = np.zeros((151, 7))
    known[:, :3] = (records(TRUE[:, None] + 1e-7 * np.eye(7))[:, :3] - records(TRUE[:, None])) / 1e-7
    asked: list[FloatArray] = []

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        asked.extend(x for _, x in wanted)
        return [records(x) for _, x in wanted]

    free = np.full(7, 9.0)
    request = levenberg_marquardt(TRUE + 0.01, -free, free, np.ones(7), sparsity=APART, jacobian=known)
    (found,) = minimise([request], answer)
    assert asked[0].shape[1] == 1 + 2
    moved = asked[0][:, 1:] != asked[0][:, :1]
    assert [np.flatnonzero(m).tolist() for m in moved.T] == [[3, 5], [4, 6]]
    assert found.x == pytest.approx(TRUE, abs=1e-3)


def decay(name: str, size: float, count: int) -> Experiment:
    time = np.linspace(0.0, 6.0, count)
    output = size * np.exp(-0.2 * time) * np.cos(3.5 * time)
    rig = Rig("test", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "rad")))
    return Experiment(
        Recording(name, time, None, output[:, None], ("output",), ("rad",), np.array([1e-3]), "", ""), None, rig
    )


def test_derivatives_of_several_recordings_are_those_of_each_alone() -> None:
    decays = [decay("one", 0.4, 300), decay("two", 0.1, 240)]
    model, units = Model("oscillator", ("viscous_damping", "linear_stiffness"), {"g": 0.0}), natural_units(decays)
    problem = Problem(model, Bench("oscillator", model.effects, decays, 0.02), units, {})
    x = problem.start({"xi": 0.3, "alpha": 12.0})
    size = 1e-4 * problem.scale
    probe = Probed.around(problem, x, size)
    assert (probe.count, x.size) == (2 * (len(problem.free) + 2) + 1, len(problem.free) + 4)
    (together,) = simulated(problem.bench, [problem], [probe])
    for i, experiment in enumerate(problem.bench.experiments):
        bench = Bench(problem.bench.base, problem.bench.effects, [experiment], problem.bench.step)
        alone = Problem(problem.model, bench, problem.units, {})
        own = [*range(len(problem.free)), *(len(problem.free) + 2 * i + row for row in range(2))]
        ((columns,),) = simulated(bench, [alone], [Probed.around(alone, x[own], size[own])])
        assert np.array_equal(together[i][:, :, [*own, -1]], columns)
        others = [k for k in range(x.size) if k not in own]
        assert not together[i][:, :, others].any()
