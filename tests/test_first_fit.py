"""The first fit of a declared model: not in a minimum that explains nothing while a better one is in reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from discovery.estimation import declared as module
from discovery.estimation.declared import declared_model, first_fit
from discovery.estimation.fit import fit
from discovery.estimation.natural_units import natural_units
from discovery.recordings.dataset import load_dataset
from discovery.recordings.experiment import Experiment

FloatArray = NDArray[np.float64]
RIG = """
name = "driven"
kind = "KIND"

[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "INPUT" }
output = { name = "y", unit = "OUTPUT", noise = NOISE }
"""


def sines(frequencies: tuple[float, ...], size: float, order: int = 0) -> Callable[[FloatArray], FloatArray]:
    """Return a sum of sines of one size with spread phases, or its derivative of an order."""
    w, phases = np.array(frequencies), np.arange(len(frequencies)) ** 2 + 0.5 * np.pi * order
    return lambda t: size * (w**order * np.sin(np.multiply.outer(t, w) + phases)).sum(axis=-1)


def recorded(
    folder: Path, time: FloatArray, u: FloatArray, force: Callable, *, words: dict[str, str], noise: float
) -> tuple[Experiment, ...]:
    """Return the recording of q'' = force(t, q, q') from rest beside its input."""
    q = solve_ivp(lambda t, s: [s[1], force(t, *s)], time[[0, -1]], [0, 0], "DOP853", time, rtol=1e-9, atol=1e-10).y[0]
    text = RIG.replace("NOISE", repr(noise))
    for word, value in words.items():
        text = text.replace(word, value)
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    read = q + np.random.default_rng(1).normal(0.0, noise, time.size)
    table = np.column_stack([time, u, read])
    np.savetxt(folder / "record.csv", table, "%.9g", ",", header="t,u,y", comments="")
    return load_dataset(folder / "rig.toml", [folder / "record.csv"]).train


def shaken(folder: Path, hardening: float, size: float) -> tuple[Experiment, ...]:
    """Return a mass on a hardening spring of 30 rad/s on a shaker."""
    frequencies, time = (49.0, 34.0, 37.0, 47.0, 32.0, 41.0, 44.0, 16.0), np.arange(1200) / 200
    base = sines(frequencies, size, 2)
    words = {"KIND": "base_excited", "INPUT": "m", "OUTPUT": "m"}
    return recorded(
        folder,
        time,
        sines(frequencies, size)(time),
        lambda t, q, rate: -3.0 * rate - 900.0 * q - hardening * q**3 - base(t),
        words=words,
        noise=1e-5,
    )


def turned(folder: Path) -> tuple[Experiment, ...]:
    """Return a pendulum of 5 rad/s that a torque turns over the top."""
    torque, time = sines((1.3, 2.9, 4.3, 6.1), 8.0), np.arange(1200) / 60
    words = {"KIND": "pendulum", "INPUT": "N m", "OUTPUT": "rad"}
    return recorded(
        folder,
        time,
        torque(time),
        lambda t, q, rate: torque(t) - 25.0 * np.sin(q) - 0.3 * rate,
        words=words,
        noise=1e-3,
    )


def test_a_hardening_spring_on_a_shaker_is_not_taken_for_a_body_that_leaves_its_base(tmp_path: Path) -> None:
    train = shaken(tmp_path, 4e5, 2.8e-3)
    units = natural_units(train)
    guessed, found = fit(declared_model(train[0]), train, units=units), first_fit(train, units)
    # A base that moves to the right leaves the mass behind: p is about one whatever the spring is like.
    assert guessed.values["p"] < 0
    assert found.values["p"] == pytest.approx(1.0, abs=0.1)
    assert found.chi2 < 0.5 * guessed.chi2


def test_a_pendulum_that_goes_over_the_top_is_followed_from_its_first_swings(tmp_path: Path) -> None:
    train = turned(tmp_path)
    units = natural_units(train)
    assert fit(declared_model(train[0]), train, units=units).reduced_chi2 > 1e6
    found = first_fit(train, units)
    assert found.reduced_chi2 < 1.2
    assert [found.values[n] for n in ("g", "g_c", "xi")] == pytest.approx([1.0, 25.0, 0.3], rel=1e-3)


def test_the_first_parts_reach_over_a_gap(tmp_path: Path) -> None:
    (whole,) = turned(tmp_path)
    output = whole.recording.output.copy()
    output[1:70] = np.nan
    gap = replace(whole, recording=replace(whole.recording, output=output))
    assert first_fit([gap], natural_units([gap])).reduced_chi2 < 1.2


@pytest.mark.parametrize("stopped", ["", "p", "xi"])
def test_only_a_fit_that_may_be_wrong_is_tried_again(
    stopped: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = shaken(tmp_path, 0.0, 1e-3)
    units = natural_units(train)
    good = fit(declared_model(train[0]), train, units=units)
    # A loss of zero is an answer, a participation of a hundred is a search that was stopped.
    x = good.minimum.x.copy()
    at_bound = np.array([name == stopped for name in good.problem.names])
    x[at_bound] = 100.0 if stopped == "p" else 0.0
    ended = replace(good, minimum=replace(good.minimum, x=x, at_bound=at_bound))
    tried = []
    monkeypatch.setattr(module, "fit", lambda *_, **__: ended)
    monkeypatch.setattr(module, "led", lambda *_: (tried.append(True), ({}, 0.5))[1])
    assert first_fit(train, units) is ended
    assert bool(tried) == (stopped == "p")


def test_what_a_declared_law_holds_by_convention_is_free(tmp_path: Path) -> None:
    frequencies, time, creep = (2.0, 3.1, 4.3, 0.7), np.arange(1200) / 60, 6e-4
    u = sines(frequencies, 0.5)
    (experiment,) = recorded(
        tmp_path,
        time,
        u(time),
        lambda t, q, v: u(t) - 0.1 * v - 9.0 * q - 0.1 * v / np.hypot(v, creep),
        words={
            "KIND": "oscillator",
            "INPUT": "V",
            "OUTPUT": "m",
            "[columns]": '[model]\neffects = ["viscous_damping", "linear_stiffness", "coulomb_friction"]\n[columns]',
        },
        noise=1e-6,
    )
    units = natural_units([experiment])
    found = first_fit([experiment], units)
    law = found.model.parameters["v_c"]
    assert abs(creep - law.default * units.scale(law)) > 0.5 * creep
    assert found.values["v_c"] == pytest.approx(creep, rel=0.1)
    assert found.values["f_c"] == pytest.approx(0.1, rel=0.01)


def test_a_damper_may_hold_more_than_inertia_does(tmp_path: Path) -> None:
    """A motion far slower than an overdamped system itself: its damping is many times the frequency of the motion."""
    time = np.arange(1500) / 100
    push = sines((1.3, 2.1, 0.7, 3.1), 0.3)

    def force(t: float, q: float, rate: float) -> float:
        return 2.0 * push(t) - 60.0 * rate - 100.0 * q

    words = {"KIND": "oscillator", "INPUT": "N", "OUTPUT": "m"}
    train = recorded(tmp_path, time, push(time), force, words=words, noise=2e-5)
    found = first_fit(train, natural_units(train))
    assert found.minimum.bound(found.problem.names) == []
    assert found.values["xi"] == pytest.approx(60.0, rel=0.1)
    assert found.values["xi"] > 20.0 / natural_units(train).time


@pytest.mark.parametrize("width", [0.6, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_declared_law_of_any_size_begins_at_each_of_its_declared_starts(tmp_path: Path, width: float) -> None:
    push, time = sines((1.3, 2.9, 4.1, 6.7, 0.7), 6.0), np.arange(1500) / 100

    def force(t: float, q: float, rate: float) -> float:
        beyond = max(abs(q) - width, 0.0)
        return push(t) - 60.0 * np.sign(q) * beyond - rate * (beyond > 0) - 0.3 * rate

    words = {"KIND": "oscillator", "INPUT": "N", "OUTPUT": "m"}
    recorded(tmp_path, time, push(time), force, words=words, noise=1e-3)
    rig = tmp_path / "rig.toml"
    rig.write_text(rig.read_text() + '[model]\neffects = ["viscous_damping", "linear_stiffness", "play"]\n')
    train = load_dataset(rig, [tmp_path / "record.csv"]).train
    units = natural_units(train)
    lost = fit(declared_model(train[0]), train, units=units)
    found = first_fit(train, units)
    assert found.chi2 < 0.1 * lost.chi2
    assert found.values["w_b"] == pytest.approx(width, rel=0.03)
    assert found.values["alpha"] == pytest.approx(60.0, rel=0.05)


CART = """
name = "cart in syrup"
kind = "drive"
[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "N", interpolation = "hold" }
output = { name = "y", unit = "cm", noise = 0.2 }
[model]
effects = ["viscous_damping"]
"""


@pytest.mark.parametrize("declared", ["viscous_damping", "quadratic_drag"])
def test_a_cart_that_constant_forces_push_is_begun_from_its_regression(tmp_path: Path, declared: str) -> None:
    """Of a drive without damping, as its guesses have it, the motion leaves what was measured a hundred times over."""
    time, files = np.arange(0.0, 10.0, 0.1), []
    for i, force in enumerate((0.5, 1.0)):
        way = solve_ivp(lambda _, s, f=force: [s[1], (f - 5.0 * s[1]) / 0.5], (0.0, 10.0), [0.0, 0.0], t_eval=time).y[0]
        read = 100 * way + 0.2 * np.random.default_rng(i).standard_normal(time.size)
        files.append(tmp_path / f"{i}.csv")
        table = np.column_stack([time, np.full(time.size, force), read])
        np.savetxt(files[-1], table, delimiter=",", header="t,u,y", comments="")
    (tmp_path / "rig.toml").write_text(CART.replace("viscous_damping", declared))
    train = load_dataset(tmp_path / "rig.toml", files).train
    found = first_fit(train, natural_units(train))
    if declared == "quadratic_drag":  # no damping of its own to begin with
        assert np.isfinite(found.chi2)
        return
    assert found.values["g"] / found.values["xi"] == pytest.approx(0.2, rel=0.01)
    assert found.values["xi"] == pytest.approx(10.0, rel=0.3)
    assert found.chi2 < 1.3 * found.problem.bench.n_data
