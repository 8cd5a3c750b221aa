"""A periodic force that meets every recording at a phase of its own, in another's simulation."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.held_states import fitted_states
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.recordings.dataset import load_dataset
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, OutputColumn, Rig, TimeColumn
from discovery.runs.loop import close_loop
from discovery.screening.attribution import screen
from discovery.screening.refits import refit

FORCE, DECLARED = "periodic_disturbance", ("viscous_damping", "linear_stiffness")
SIZE, FREQUENCY, NOISE = 0.02, 5.1, 1e-3
TIME = np.arange(0.0, 15.0, 0.02)
UNITS = NaturalUnits(1 / 3, 0.3, 1.0)
#: Release and phase: the sum of the forces of the first two recordings is nothing.
FITTED = ((0.25, 0.6), (0.18, 0.6 + np.pi))
HELD = ((-0.2, 2.9), (0.22, -1.4))


@cache
def decay(release: float, phase: float) -> np.ndarray:
    """Return y'' = -9 y - 0.1 y' + size sin(frequency t + phase), read with noise."""

    def slopes(t: float, state: np.ndarray) -> list[float]:
        return [state[1], -9 * state[0] - 0.1 * state[1] + SIZE * np.sin(FREQUENCY * t + phase)]

    true = solve_ivp(slopes, (0.0, TIME[-1]), [release, 0.0], "DOP853", TIME, rtol=1e-9, atol=1e-11).y[0]
    return true + NOISE * np.random.default_rng(abs(int(1e3 * release))).standard_normal(TIME.size)


def experiments(*given: tuple[float, float]) -> list[Experiment]:
    rig = Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "m")))
    return [
        Experiment(Recording(f"r{p}", TIME, None, decay(q, p)[:, None], ("output",), ("m",), np.array([NOISE]), "", ""),
                   None, rig)
        for q, p in given
    ]  # fmt: skip


@cache
def declared() -> Fit:
    model, train = Model("oscillator", DECLARED, {"g": 0.0}), experiments(*FITTED)
    bench = Bench("oscillator", (*DECLARED, FORCE), train, 0.02)
    return fit(model, train, start={"xi": 0.1, "alpha": 9.0}, bench=bench, units=UNITS)


def test_opposite_phases_are_screened_and_refitted() -> None:
    before = declared()
    (candidate,) = screen(before.minimum, before.problem, [FORCE])
    # All that stands out of the noise: a common phase would explain nothing of it.
    assert candidate.score > 0.9 * (before.chi2 - before.problem.bench.n_data) > 100
    (found,) = refit(before.minimum, before.problem, [candidate])
    assert found.chi2 == pytest.approx(before.problem.bench.n_data, rel=0.1)
    assert found.values["Omega"] == pytest.approx(FREQUENCY, abs=0.03)
    assert np.hypot(found.values["a_s"], found.values["a_c"]) == pytest.approx(SIZE, rel=0.1)
    (second,) = [v for n, v in found.values.items() if n.startswith("psi")]
    assert np.cos(second) < -0.98


def test_the_phases_of_held_out_recordings_are_fitted_with_their_starts() -> None:
    known = {"g": 0.0, "xi": 0.1, "alpha": 9.0, "a_s": SIZE, "a_c": 0.0, "Omega": FREQUENCY}
    bench = Bench("oscillator", (*DECLARED, FORCE), experiments(*HELD), 0.02)
    problem = Problem(Model("oscillator", (*DECLARED, FORCE), known), bench, UNITS, {}, reference="")
    found = problem.named(fitted_states([problem])[0])
    phases = [found[f"psi_0_init[{e.recording.name}]"] for e in bench.experiments]
    assert np.exp(1j * np.array(phases)) == pytest.approx(np.exp(1j * np.array([p for _, p in HELD])), abs=0.15)


def test_the_first_recording_has_no_phase_and_one_alone_has_none() -> None:
    problem = Problem(Model("oscillator", (*DECLARED, FORCE)), declared().problem.bench, UNITS, {})
    assert [n for n in problem.names if n.startswith("psi")] == [f"psi_0_init[r{FITTED[1][1]}]"]
    alone = Problem(problem.model, Bench("oscillator", (*DECLARED, FORCE), experiments(FITTED[0]), 0.02), UNITS, {})
    assert not any(n.startswith("psi") for n in alone.names)
    # Another bench does not change from where they are counted.
    assert Problem(problem.model, alone.bench, UNITS, {}, reference="elsewhere").names[-1] == "psi_0_init[r0.6]"


def test_forces_of_several_phases_are_gathered_to_one() -> None:
    effect = get_effect(FORCE)
    force, phases = np.array([0.3, -0.1, 0.2, 0.4, 0.0, -0.2]), np.array([0.0, 2.0, -3.0])
    each = np.array([effect.turned(force, p) for p in phases])
    common, found = effect.gathered(each)
    assert common == pytest.approx(force)
    assert found == pytest.approx(phases)
    t = np.linspace(0, 3, 7)
    turned = each[1, 0] * np.sin(4 * t) + each[1, 1] * np.cos(4 * t)
    assert turned == pytest.approx(force[0] * np.sin(4 * t + 2) + force[1] * np.cos(4 * t + 2))


@pytest.mark.slow
@pytest.mark.parametrize("same", [False, True])
def test_it_is_named_whatever_the_phases(tmp_path: Path, same: bool) -> None:
    (tmp_path / "rig.toml").write_text(
        'name = "o"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        f'output = {{ name = "y", unit = "m", noise = {NOISE} }}\n',
        encoding="utf-8",
    )
    paths = []
    for release, phase in (*FITTED, *HELD):
        paths.append(tmp_path / f"{release}.csv")
        table = np.column_stack([TIME, decay(release, 0.6 if same else phase)])
        np.savetxt(paths[-1], table, delimiter=",", header="t,y", comments="", fmt="%.9g")
    found = close_loop(load_dataset(tmp_path / "rig.toml", paths[:2], paths[2:]))
    assert (found.verdict, found.added) == ("explained", (FORCE,))
    values, sd = found.after.values, found.after.sd
    assert values["Omega"] == pytest.approx(FREQUENCY, abs=4 * sd["Omega"])
    assert np.hypot(values["a_s"], values["a_c"]) == pytest.approx(SIZE, rel=0.1)
    before, after = (found.errors[when]["holdout"]["rms"] for when in ("before", "after"))
    assert after < 1.05 * NOISE < 1.2 * NOISE < before
