from __future__ import annotations

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.covariance import Probed, simulated
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn


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
