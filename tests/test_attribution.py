from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from discovery.declarations.effect import Sensor
from discovery.declarations.registry import catalogue, get_effect
from discovery.equations.lacking import candidates, eventual_candidates
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.mechanics.systems import system_base
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.rigs.rig_system import ready_made
from discovery.screening.attribution import Candidate, grid_of, screen
from discovery.screening.likeness import likely_pairs, similarity
from discovery.screening.refits import Refit, refit
from discovery.screening.responses import Grid, plan, respond

TRUTH = {"g": 1.0, "xi": 0.08, "alpha": 9.0}
DECLARED = ("viscous_damping", "linear_stiffness")
EFFECTS = eventual_candidates(Model("oscillator", ()))
UNITS = NaturalUnits(1 / 3, 0.3, 1.0)
NOISE = 1e-3
TIME = np.linspace(0.0, 20.0, 801)
RIG = Rig("o", "oscillator", columns=Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V")))
#: Three constant pushes, then rest: quadratic pieces are exact.
_EDGES = np.array([0.0, 1.0, 2.5, 6.0, 20.0])
PUSHES = Drive(_EDGES, np.array([[1.0, -1.5, 0.7, 0.0]]), _EDGES[1:-1])


def experiment(output: np.ndarray) -> Experiment:
    recording = Recording(
        "r", TIME, PUSHES.evaluate(TIME)[0], output[:, None], ("output",), ("V",), np.array([NOISE]), "", ""
    )
    return Experiment(recording, PUSHES, RIG)


def bench(e: Experiment) -> Bench:
    return Bench("oscillator", EFFECTS, [e], 0.02)


@cache
def recorded(seed: int = 0, **effects: float) -> Experiment:
    """Simulate a recording of the declared model with the given parameters of other effects, in SI units."""
    b = bench(experiment(np.zeros(TIME.size)))
    whole = Model("oscillator", EFFECTS)
    values = {n: p.default * UNITS.scale(p) for n, p in whole.parameters.items()} | TRUTH | effects
    parameters = np.array([[values[n]] for n in b.names])
    (clean,) = b.predict(parameters, np.array([[[0.25], [0.0]]]))
    return experiment(clean[:, 0, 0] + NOISE * np.random.default_rng(seed).standard_normal(TIME.size))


@cache
def declared_fit(seed: int = 0, **effects: float) -> Fit:
    e = recorded(seed, **effects)
    start = {"g": 0.9, "xi": 0.05, "alpha": 8.8}
    return fit(Model("oscillator", DECLARED), [e], start=start, bench=bench(e), units=UNITS)


@cache
def screened(seed: int = 0, **effects: float) -> list[Candidate]:
    found = declared_fit(seed, **effects)
    return screen(found.minimum, found.problem, candidates(found.model))


@cache
def refitted(seed: int = 0, **effects: float) -> list[Refit]:
    found = declared_fit(seed, **effects)
    return refit(found.minimum, found.problem, screened(seed, **effects))


# Who may be missing.


def test_candidates_are_what_acts_here_and_is_not_there_yet() -> None:
    of_the_untied = ("cogging", "constant_force", "recording_force", "negative_stiffness")
    assert set(candidates(Model("oscillator", DECLARED))) == set(EFFECTS) - {*DECLARED, *of_the_untied}
    arm = candidates(Model("elastica", DECLARED))
    assert {"table_tilt", "camera_origin_offset"} <= set(arm)
    # The exact rod has its own law of the spring, its own radius and its own mass.
    assert not {"cubic_stiffness", "radius_law", "distributed_mass"} & set(arm)
    assert "table_tilt" not in candidates(Model("oscillator", DECLARED))


def test_what_another_law_contains_is_not_offered_beside_it() -> None:
    several = candidates(Model("servo", ("viscous_damping", "recording_force", "stribeck_friction")))
    assert not {"constant_force", "coulomb_friction"} & set(several)
    assert "recording_force" in candidates(Model("servo", ("viscous_damping", "constant_force")))
    placed = Model(system_base(ready_made()["dc_motor"]).name, ("recording_force_at_shaft",))
    assert "constant_force_at_shaft" not in candidates(placed)


def test_pairs_with_a_flexible_law_do_not_crowd_out_the_others() -> None:
    found = declared_fit(beta=0.5)
    scored = screened(beta=0.5)
    target = found.minimum.residual[: found.problem.bench.n_rows]
    for pliable in (False, True):
        pairs = likely_pairs(scored, target, 8, pliable=pliable)
        assert len(pairs) == 8
        assert all(any(get_effect(c.effect).pliable for c in pair) is pliable for pair in pairs)


# The linear score.


@pytest.mark.parametrize(
    ("effect", "name", "value", "step"),
    [
        ("cubic_stiffness", "beta", 0.3, 1e-3),
        ("quadratic_stiffness", "k_2", 0.05, 1e-4),
        ("angle_offset", "theta_0", 0.001, 1e-5),
        ("sensor_delay", "tau", 0.002, 1e-5),
    ],
)
def test_the_score_is_the_gain_of_a_full_linear_refit(effect: str, name: str, value: float, step: float) -> None:
    found = declared_fit(**{name: value})
    (score,) = [c.score for c in screened(**{name: value}) if c.effect == effect]
    # By the book: one column more, its derivative by central differences, all parameters free.
    extended = Problem(found.model.with_effect(effect), found.problem.bench, UNITS, {})
    x = [found.values.get(n, 0.0) for n in extended.names]
    points = np.array([x, x]).T
    points[extended.names.index(name)] = [step, -step]
    moved = found.problem.bench.residuals(*extended.expand(points))
    column = (moved[:, 0] - moved[:, 1]) / (2 * step)
    residual, jacobian = found.minimum.residual, found.minimum.jacobian

    def left(matrix: np.ndarray) -> float:
        solution = np.linalg.lstsq(matrix / np.linalg.norm(matrix, axis=0), residual, rcond=None)[0]
        return float(np.sum((residual - matrix / np.linalg.norm(matrix, axis=0) @ solution) ** 2))

    gain = left(jacobian) - left(np.column_stack([jacobian, column]))
    assert gain > 50
    # The screen uses a finite size of the effect.
    assert score == pytest.approx(gain, rel=0.06)


def test_beside_a_motion_that_blows_up_nothing_is_gained() -> None:
    found = declared_fit()
    blown = replace(
        found.minimum,
        x=found.problem.start({**found.values, "xi": -50.0}),
        residual=np.full_like(found.minimum.residual, np.inf),
        jacobian=np.full_like(found.minimum.jacobian, np.nan),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scored = screen(blown, found.problem, ["quadratic_drag", "sensor_delay"])
    assert [c.score for c in scored] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("effect", "name", "value"), [("cubic_stiffness", "beta", 0.2), ("sensor_delay", "tau", 0.002)]
)
def test_the_score_of_a_small_effect_is_what_its_refit_gains(effect: str, name: str, value: float) -> None:
    before = declared_fit(**{name: value})
    (score,) = [c.score for c in screened(**{name: value}) if c.effect == effect]
    (after,) = [r for r in refitted(**{name: value}) if r.effect == effect]
    assert before.chi2 - after.chi2 == pytest.approx(score, rel=0.1)


def test_physical_signs_hold_in_the_score() -> None:
    # A motion that dry friction of negative size would explain: energy is fed in at a constant rate.
    e = recorded()
    b = bench(e)
    values = {n: p.default * UNITS.scale(p) for n, p in Model("oscillator", EFFECTS).parameters.items()} | TRUTH
    values["f_c"] = -0.03
    (clean,) = b.predict(np.array([[values[n]] for n in b.names]), np.array([[[0.25], [0.0]]]))
    driven = experiment(clean[:, 0, 0])
    found = fit(
        Model("oscillator", DECLARED),
        [driven],
        start={"g": 1.0, "xi": 0.06, "alpha": 9.0},
        bench=bench(driven),
        units=UNITS,
    )
    assert found.chi2 > 1000
    (friction,) = screen(found.minimum, found.problem, ["coulomb_friction"])
    assert friction.score == pytest.approx(0.0, abs=1.0)
    (again,) = refit(found.minimum, found.problem, [friction])
    size = dict(zip(again.problem.names, again.minimum.x, strict=True))["f_c"]
    assert 0 <= size < 1e-4


def test_white_noise_gives_no_candidate_a_high_score() -> None:
    for candidate in screened():
        # Chi-square of at most three parameters, the best of a grid of shapes, of fourteen candidates.
        assert candidate.score < 25


def test_scores_come_highest_first_with_as_many_starts_as_asked_for() -> None:
    scores = [c.score for c in screened(beta=0.2)]
    assert scores == sorted(scores, reverse=True)
    found = declared_fit(beta=0.2)
    names = ["periodic_disturbance", "hysteresis"]
    few, many = ({c.effect: c for c in screen(found.minimum, found.problem, names, keep=keep)} for keep in (1, 3))
    # Many frequencies have many minima.
    assert (len(few["periodic_disturbance"].starts), len(few["hysteresis"].starts)) == (3, 1)
    assert (len(many["periodic_disturbance"].starts), len(many["hysteresis"].starts)) == (9, 3)
    assert few["periodic_disturbance"].score == many["periodic_disturbance"].score


# What is simulated for it.


def responses_of(effect: str, points: list[dict[str, float]]) -> tuple[Grid, np.ndarray]:
    """Return the grid of an effect and the responses (samples, sets) to its points around a fit."""
    found = declared_fit()
    grids, settings = plan({effect: points}, "oscillator")
    known, _ = np.linalg.qr(found.minimum.jacobian)
    around = found.problem.expand(found.minimum.x[:, None])
    with ThreadPoolExecutor(2) as pool:
        answer = respond(pool, found.problem.bench, around, settings, found.minimum.residual, known)
    left = answer.left.astype(float)
    assert left @ known == pytest.approx(0.0, abs=1e-6 * max(1.0, np.abs(left).max()))
    return grids[effect], answer.moved(np.arange(len(settings)))


def simulated(values: dict[str, float]) -> np.ndarray:
    """Return how much given parameters move the residual of the fit, simulated alone."""
    found = declared_fit()
    parameters, initial = found.problem.expand(found.minimum.x[:, None])
    for name, value in values.items():
        parameters[found.problem.bench.names.index(name)] = value
    return found.problem.bench.residuals(parameters, initial)[:, 0] - found.minimum.residual


@pytest.mark.parametrize("effect", EFFECTS)
def test_responses_are_those_of_each_amplitude_alone_with_its_shapes(effect: str) -> None:
    law = catalogue()[effect]
    every = grid_of(law, "oscillator", UNITS)
    points = [every[i] for i in np.linspace(0, len(every) - 1, 6).astype(int)]
    grid, moved = responses_of(effect, points)
    shapes = [p.name for p in grid.fitted if p.shape]
    # What is read late is known to first order.
    near = 0.01 if isinstance(law, Sensor) and law.lateness() != 0 else 1e-7
    for i, point in enumerate(points):
        for k, amplitude in enumerate(grid.fitted[j].name for j in grid.sizes):
            # All shapes are set here, also those that are said not to matter.
            alone = simulated({n: point[n] for n in (*shapes, amplitude)})
            assert moved[:, grid.rows[i, k]] == pytest.approx(alone, abs=near * max(1.0, np.abs(alone).max()))


def test_a_body_that_falls_is_tied_to_nothing() -> None:
    names = candidates(Model("falling_body", ()), "m")
    assert {"viscous_damping", "quadratic_drag", "position_scale"} <= set(names)
    assert not {"linear_stiffness", "hysteresis", "amplitude_dependent_damping", "coulomb_friction"} & set(names)
    assert "cubic_stiffness" in eventual_candidates(Model("oscillator", ()), "m")


def test_what_does_not_depend_on_a_shape_is_simulated_once() -> None:
    every = grid_of(catalogue()["time_base_error"], "oscillator", UNITS)
    grids, settings = plan({"time_base_error": every}, "oscillator")
    rows = grids["time_base_error"].rows
    # The drift of a clock has nothing to do with its sawtooth.
    assert len(np.unique(rows[:, 0])) == 1
    assert len(np.unique(rows[:, 1])) == len(every)
    assert len(settings) == len(every) + 1


def test_a_motion_that_blows_up_says_nothing() -> None:
    grid, moved = responses_of("cubic_stiffness", [{"beta": 0.1}, {"beta": -1e6}])
    assert np.isfinite(moved).all()
    assert np.abs(moved[:, grid.rows[0, 0]]).max() > 1
    assert np.abs(moved[:, grid.rows[1, 0]]).max() == 0


def test_of_shapes_that_promise_the_same_the_first_comes_first() -> None:
    # Friction that is smallest at creep: the bump is best absent, at whatever Stribeck speed.
    friction = next(c for c in screened(f_k=0.03, f_b=-0.03, v_s=0.35) if c.effect == "stribeck_friction")
    grid = grid_of(catalogue()["stribeck_friction"], "oscillator", UNITS)
    equal = [g for g in friction.shapes.gains if g == pytest.approx(friction.score, rel=1e-9)]
    assert friction.score > 100
    assert len(equal) > 2
    names = [p.name for p in catalogue()["stribeck_friction"].fitted("oscillator")]
    start = dict(zip(names, friction.starts[0].values, strict=True))
    assert start["f_b"] == 0
    assert start["v_s"] == min(g["v_s"] for g in grid)


# Refits.

#: Injected effects (SI units), each small beside the declared model, and parameters that must be found.
INJECTED = {
    "cubic_stiffness": {"beta": 0.5},
    "quadratic_stiffness": {"k_2": 0.1},
    "coulomb_friction": {"f_c": 0.016},
    "quadratic_drag": {"c_2": 0.02},
    "stiffness_drift": {"r": 2e-4},
    "sensor_delay": {"tau": 0.004},
    "periodic_disturbance": {"a_s": 0.012, "a_c": -0.02, "Omega": 5.1},
    "viscoelastic_relaxation": {"v": 0.02, "tau_v": 0.6},
}
#: A spring, a friction, an instrument and a memory.
SHOWN = ("cubic_stiffness", "coulomb_friction", "sensor_delay", "viscoelastic_relaxation")
#: Laws that hold an injected one as a limit, or do nearly the same, may fit the noise a little better.
WIDER = {"coulomb_friction": "stribeck_friction", "cubic_stiffness": "gravity_torque", "sensor_delay": "input_lag"}


@pytest.mark.parametrize("effect", [e if e in SHOWN else pytest.param(e, marks=pytest.mark.slow) for e in INJECTED])
def test_an_injected_effect_comes_first_with_its_parameters(effect: str) -> None:
    truth = INJECTED[effect]
    before, found = declared_fit(**truth), refitted(**truth)
    assert [r.chi2 for r in found] == sorted(r.chi2 for r in found)
    found = [r for r in found if r.effect != WIDER.get(effect)]
    assert before.chi2 - found[0].chi2 > 100
    assert found[0].effect == effect
    # Chi-square of 801 readings: three standard deviations.
    assert found[0].chi2 == pytest.approx(TIME.size, abs=120)
    values = dict(zip(found[0].problem.names, found[0].minimum.x, strict=True))
    for name, value in truth.items():
        assert values[name] == pytest.approx(value, rel=0.25)


def test_every_candidate_is_refitted_within_its_bounds() -> None:
    assert len(refitted(beta=0.5)) == len(candidates(Model("oscillator", DECLARED)))
    for found in refitted(beta=0.5):
        lower, upper = found.problem.bounds
        assert ((found.minimum.x >= lower) & (found.minimum.x <= upper)).all()


def test_what_the_rig_knows_stays_with_its_prior() -> None:
    e = recorded(beta=0.5)
    known = {"xi": (0.1, 0.001)}
    held = fit(Model("oscillator", DECLARED), [e], start=TRUTH, bench=bench(e), units=UNITS, gaussian=known)
    scored = screen(held.minimum, held.problem, ["cubic_stiffness"])
    (after,) = refit(held.minimum, held.problem, scored)
    assert after.problem.gaussian == known
    values = dict(zip(after.problem.names, after.minimum.x, strict=True))
    # The prior is 20 sds off and bounds the damping at three of its own.
    assert values["xi"] == pytest.approx(0.097, abs=1e-6)
    assert values["beta"] > 0.3


# Similarity.


def test_parallel_sensitivities_are_the_same_and_orthogonal_ones_are_not() -> None:
    rng = np.random.default_rng(0)
    a = rng.standard_normal((50, 2))
    b = rng.standard_normal((50, 3))
    assert similarity(a, a @ np.array([[2.0, 1.0], [0.0, -3.0]])) == pytest.approx(1.0)
    assert similarity(a[:, :1], -3 * a[:, :1]) == pytest.approx(1.0)
    # One shared direction is enough to be confused.
    assert similarity(a, np.column_stack([b[:, :2], a[:, 0]])) == pytest.approx(1.0)
    q, _ = np.linalg.qr(np.column_stack([a, b]))
    assert similarity(q[:, :2], q[:, 2:]) == pytest.approx(0.0, abs=1e-12)
    assert similarity(a, b) == pytest.approx(similarity(b, a), rel=1e-12)
    # What moves nothing is like nothing, and so are its columns.
    assert similarity(a, np.zeros((50, 2))) == 0
    assert similarity(q[:, :2], np.column_stack([q[:, 2], np.zeros(50)])) == pytest.approx(0.0, abs=1e-12)


def test_a_shifted_instrument_and_a_shifted_spring_are_the_same_to_a_linear_system() -> None:
    found = {c.effect: c.sensitivity for c in screened(theta_0=0.01)}
    assert similarity(found["angle_offset"], found["equilibrium_offset"]) == pytest.approx(1.0, abs=1e-6)
    assert similarity(found["angle_offset"], found["sensor_delay"]) < 0.5


def test_no_refit_ends_above_the_model_without_its_effect() -> None:
    """A first-order step that goes far astray leads to another minimum, or to none."""
    found = declared_fit(beta=60.0)
    astray = [
        replace(c, starts=tuple(replace(s, values=-300 * np.abs(s.values) - 1.0) for s in c.starts))
        for c in screened(beta=60.0)
    ]
    refits = refit(found.minimum, found.problem, astray)
    above = {r.effect: r.chi2 for r in refits if r.chi2 > 2 * found.minimum.cost}
    assert len(refits) > 20
    assert not above
