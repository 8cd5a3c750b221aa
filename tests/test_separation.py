from __future__ import annotations

import io
import json
import re
from copy import copy
from dataclasses import asdict, replace
from functools import cache, reduce
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from discovery_datasets.disturbances import Disturbance, EncoderRipple, StructuralDamping, TableTilt
from discovery_datasets.manoeuvres import Manoeuvre, sequence, trapezoid
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from synthetic_run import write_arm_run
from twin_arm import fitted, recorded, rig_file

from discovery.declarations.registry import simplicity
from discovery.declarations.system import ARM
from discovery.diagnosis.manoeuvre_design import (
    MotorLimits,
    Move,
    allowed_limits,
    demonstrated_limits,
    hub_drive,
    moves_from_unit,
    reach,
)
from discovery.diagnosis.rival_distance import MoveSearch
from discovery.diagnosis.rival_pairs import Distance, Laws, Pairs, absorbed
from discovery.diagnosis.separation import Separation, separate, similarity_matrix
from discovery.estimation.fit import Fit
from discovery.foundation.errors import InputError
from discovery.recordings.experiment import Experiment
from discovery.report import build_report, figures
from discovery.report.ambiguity import draw_manoeuvres
from discovery.report.manoeuvre_sentences import separation_sentence
from discovery.rigs.rig import Rig
from discovery.runs.around_search import separations, told_apart
from discovery.runs.loop_files import write_loop

LIMITS = MotorLimits(angle=1.5, speed=2.0, acceleration=12.0, duration=6.0, deflection=0.95)
#: The same in a rig file; but for the duration, which is that of the recordings.
STATED = {
    "motor_angle_limit": LIMITS.angle,
    "motor_speed_limit": LIMITS.speed,
    "motor_acceleration_limit": LIMITS.acceleration,
    "deflection_limit": LIMITS.deflection,
}
#: Two explanations, the first of which is true: they fit one short recording of a poor camera equally well.
CASES: dict[tuple[str, str], Disturbance] = {
    ("encoder_ripple", "table_tilt"): EncoderRipple(2e-3, 3.0, 0.3),
    ("table_tilt", "encoder_ripple"): TableTilt(3e-4, -4e-4),
    ("structural_damping", "sensor_delay"): StructuralDamping(1.5e-3),
}
#: What the sheet of the encoder says: one move holds product of amplitude and squared count, and no count up to six.
SHEETS = {("encoder_ripple", "table_tilt"): dict.fromkeys(("r_s", "r_c"), (0.0, 3e-3))}
#: The same; the second is the one that the tests below design for, too.
QUICK_FIRST = [pair if pair[0] == "table_tilt" else pytest.param(pair, marks=pytest.mark.slow) for pair in CASES]
ONE_MOVE = trapezoid(1.0, 1.2)
POOR_CAMERA = rig_file(noise=1e-3)


def on_the_twin(moves: tuple[Move, ...]) -> Manoeuvre:
    """Return the manoeuvre in the words of the twin, which has its own code for it."""
    return reduce(sequence, [trapezoid(m.angle, m.speed, start=m.start, ramp=m.ramp) for m in moves])


@cache
def old(pair: tuple[str, str]) -> Experiment:
    return recorded(ONE_MOVE, CASES[pair], stated=POOR_CAMERA, seed=3)


@cache
def rivals(pair: tuple[str, str]) -> dict[str, Fit]:
    return {name: fitted([old(pair)], name, gaussian=sheet(pair, name)) for name in pair}


def sheet(pair: tuple[str, str], name: str) -> dict[str, tuple[float, float]]:
    """Return what is known of the true one of a pair."""
    return SHEETS.get(pair, {}) if name == pair[0] else {}


def stating(pair: tuple[str, str], **limits: float) -> dict[str, Fit]:
    """Return the rivals with limits of the motor in their rig file: no fit depends on these."""
    stated = {}
    for name, found in rivals(pair).items():
        bench = copy(found.problem.bench)
        bench.experiments = tuple(replace(e, rig=replace(e.rig, **limits)) for e in bench.experiments)
        stated[name] = replace(found, problem=replace(found.problem, bench=bench))
    return stated


@cache
def designed(pair: tuple[str, str], evaluations: int = 40) -> Separation:
    return separate(stating(pair, **STATED), np.random.default_rng(1), evaluations=evaluations)


# Moves of the hub.


@settings(max_examples=60)
@given(
    st.lists(st.floats(0, 1), min_size=4, max_size=12).filter(lambda u: len(u) % 4 == 0),
    st.floats(0.2, 3.0),
    st.floats(0.2, 3.0),
    st.floats(0.5, 20.0),
)
def test_every_point_of_the_cube_keeps_the_limits(unit, angle, speed, acceleration) -> None:
    limits = MotorLimits(angle, speed, acceleration, 12.0)
    moves = moves_from_unit(np.array(unit), limits)
    assert len(moves) <= len(unit) // 4
    if not moves:
        return
    time = np.linspace(0, limits.duration, 4001)
    hub, rate, acc = hub_drive(moves, 0.3).evaluate(time)
    assert np.abs(hub - 0.3).max() <= angle * (1 + 1e-9)
    assert np.abs(rate).max() <= speed * (1 + 1e-9)
    assert np.abs(acc).max() <= acceleration * (1 + 1e-6)
    assert hub[0] == 0.3
    assert hub[-1] == pytest.approx(0.3 + sum(m.angle for m in moves))
    assert rate[-1] == 0
    # Position and rate are continuous.
    drive = hub_drive(moves, 0.3)
    left, right = (drive.evaluate(drive.breakpoints, side) for side in ("left", "right"))
    np.testing.assert_allclose(left[:2], right[:2], atol=1e-9)


def test_the_hub_moves_as_the_twin_s_own_manoeuvre() -> None:
    # A long move, a short one without a plateau, and one back.
    moves = moves_from_unit(np.array([0.8, 0.6, 0.9, 0.2, 0.9, 1.0, 0.1, 0.5, 0.3, 0.9, 1.0, 0.0]), LIMITS)
    assert [m.ramp == pytest.approx(0.5) for m in moves] == [False, True, False]
    time = np.linspace(0, 6, 1201)
    np.testing.assert_allclose(hub_drive(moves).evaluate(time), on_the_twin(moves)(time), atol=1e-9)


def test_impossible_manoeuvres_and_limits_are_refused() -> None:
    with pytest.raises(InputError, match="at least one move"):
        hub_drive(())
    with pytest.raises(InputError, match="after the one before"):
        hub_drive((Move(0.5, 1.0, 1.0, 0.2), Move(1.0, -1.0, 1.0, 0.2)))
    for wrong in ({"speed": 0.0}, {"angle": np.nan}, {"moves": 4}, {"duration": -1.0}):
        with pytest.raises(InputError, match="Limits of a motor"):
            MotorLimits(**{"angle": 1.0, "speed": 1.0, "acceleration": 5.0, "duration": 6.0, **wrong})


def test_a_recording_shows_what_the_motor_can_do() -> None:
    shown = demonstrated_limits([old(("table_tilt", "encoder_ripple"))])
    ramp = 0.12 * 1.0 / 1.2 / 0.88
    assert shown.angle == pytest.approx(1.0, rel=1e-3)
    assert shown.speed == pytest.approx(1.2, rel=1e-2)
    assert shown.acceleration == pytest.approx(1.2 / ramp, rel=5e-2)
    assert shown.duration == 6.0


# What a rival can absorb.


def test_what_is_left_of_a_difference_is_the_bounded_least_squares() -> None:
    rng = np.random.default_rng(0)
    difference, jacobian, root = rng.standard_normal(30), rng.standard_normal((30, 3)), np.diag([2.0, 0.5, 0.0])
    free = np.array([[-np.inf] * 3, [np.inf] * 3])
    by_normal_equations = difference - jacobian @ np.linalg.solve(
        jacobian.T @ jacobian + root.T @ root, jacobian.T @ difference
    )
    assert absorbed(difference, jacobian, root, free) == pytest.approx(difference @ by_normal_equations)
    narrow = np.array([[-0.01, -np.inf, 0.0], [0.02, 0.05, np.inf]])
    found = minimize(
        lambda p: np.sum((difference - jacobian @ p) ** 2) + np.sum((root @ p) ** 2),
        np.array([0.0, 0.0, 0.1]),
        bounds=list(zip(*np.where(np.isfinite(narrow), narrow, np.sign(narrow) * 1e6), strict=True)),
        options={"ftol": 1e-15, "gtol": 1e-10},
    )
    assert absorbed(difference, jacobian, root, narrow) == pytest.approx(found.fun, rel=1e-6)
    # Knowing nothing and everything about the parameters.
    assert absorbed(jacobian @ [1.0, 2.0, 3.0], jacobian, 0 * root, free) == pytest.approx(0, abs=1e-20)
    assert absorbed(difference, jacobian, 1e9 * np.eye(3), free) == pytest.approx(difference @ difference)


def test_rivals_are_alike_on_one_move() -> None:
    fits = list(rivals(("table_tilt", "encoder_ripple")).values())
    matrix = similarity_matrix(fits)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    assert 0.95 < matrix[0, 1] <= 1.0
    # What the rig leaves free absorbs no more than that: the rod's own slight damping is not any damping.
    losses = similarity_matrix(list(rivals(("structural_damping", "sensor_delay")).values()))
    assert 0.3 < losses[0, 1] < 0.99
    # What is common to all counts for none.
    assert np.isnan(similarity_matrix([fits[0], fits[0]])).all()


def test_the_physically_simplest_comes_first() -> None:
    names = ["periodic_disturbance", "encoder_ripple", "sensor_delay", "table_tilt", "structural_damping"]
    ordered = sorted(names, key=lambda n: (simplicity(n, "flexible_arm"), n))
    assert ordered == ["structural_damping", "sensor_delay", "table_tilt", "encoder_ripple", "periodic_disturbance"]


# The manoeuvre, and that it works.


@pytest.mark.slow
@pytest.mark.parametrize("pair", QUICK_FIRST)
def test_the_designed_manoeuvre_separates_what_one_move_could_not(pair: tuple[str, str]) -> None:
    right, wrong = pair
    before = {n: f.chi2 for n, f in rivals(pair).items()}
    assert before[wrong] < 1.04 * before[right]
    found = designed(pair, 150)
    assert found.designed.projected > 5 * found.given.projected
    assert found.designed.chi2 > 50

    new = recorded(
        on_the_twin(found.moves), CASES[pair], stated=POOR_CAMERA, duration=LIMITS.duration, seed=4, name="second"
    )
    both = [old(pair), new]
    after = {n: fitted(both, n, start=f, gaussian=sheet(pair, n)).chi2 for n, f in rivals(pair).items()}
    gained = (after[wrong] - after[right]) - (before[wrong] - before[right])
    # The promise is that of the worse direction, to first order.
    assert gained > 0.5 * found.designed.chi2
    assert after[wrong] - after[right] > 50
    # The right one still fits to the noise.
    assert after[right] == pytest.approx(2 * 2 * 601, rel=0.06)


def test_the_manoeuvre_keeps_the_stated_limits() -> None:
    found = designed(("table_tilt", "encoder_ripple"))
    assert found.limits == LIMITS
    time, angle = found.table.T
    assert time[0] == 0
    assert time[-1] == pytest.approx(LIMITS.duration)
    assert np.abs(angle - angle[0]).max() <= LIMITS.angle
    assert all(m.speed <= LIMITS.speed + 1e-9 and m.acceleration <= LIMITS.acceleration + 1e-9 for m in found.moves)
    assert found.deflection <= LIMITS.deflection
    new = recorded(on_the_twin(found.moves), duration=LIMITS.duration)
    assert np.nanmax(np.abs(new.deflection)) == pytest.approx(found.deflection, rel=0.05)


def test_the_design_can_be_given_to_a_motor_and_to_a_report() -> None:
    found = designed(("encoder_ripple", "table_tilt"))
    table = pd.read_csv(io.StringIO(found.csv()))
    assert list(table.columns) == ["time_s", "motor_angle_rad"]
    np.testing.assert_allclose(table.to_numpy(), found.table, atol=1e-8)
    summary = json.loads(json.dumps(found.summary(), allow_nan=False))
    assert summary["rivals"] == ["table_tilt", "encoder_ripple"]
    assert len(summary["moves"]) == len(found.moves)
    assert "table_tilt, encoder_ripple" in separation_sentence(summary)


def test_what_no_manoeuvre_decides_is_said_and_no_course_is_written(tmp_path: Path) -> None:
    found = designed(("encoder_ripple", "table_tilt"))
    assert found.decides
    assert separation_sentence(found.summary()).startswith("To tell table_tilt, encoder_ripple apart: at ")
    weak = replace(found, designed=replace(found.designed, chi2=2.13))
    assert not weak.summary()["decides"]
    assert separation_sentence(weak.summary()).startswith("No manoeuvre within the safe limits (1.5 rad, 2 rad/s, ")
    assert "tells table_tilt, encoder_ripple apart" in separation_sentence(weak.summary())
    assert "an expected chi-square of 2.1, and less than 10 may be chance" in separation_sentence(weak.summary())
    assert found.left < 1.0 < found.designed.projected
    hidden = replace(found, left=2.0 * found.designed.projected)
    assert not hidden.decides
    said = r"table_tilt, encoder_ripple apart: the [\d.]+ noise sds rms of model error that are left hide the [\d.]+ of"
    assert re.search(said, separation_sentence(hidden.summary()))
    result: Any = SimpleNamespace(separations=(weak, found), summary=dict)
    (tmp_path / "manoeuvre_1.csv").touch()
    write_loop(tmp_path, result)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["loop.json", "manoeuvre_2.csv"]


def test_the_same_seed_gives_the_same_manoeuvre() -> None:
    pair = ("table_tilt", "encoder_ripple")
    first, second = (separate(rivals(pair), np.random.default_rng(7), evaluations=20) for _ in range(2))
    assert first.moves == second.moves
    assert first.designed == second.designed
    # By default the motor does nothing that it has not shown.
    assert first.limits == demonstrated_limits([old(pair)])


# What the rig file states.


def test_the_hub_reaches_no_farther_than_time_allows() -> None:
    # From rest to rest, without a plateau and with one, by the integral of the trapezoid of speeds.
    for speed, acceleration, duration in ((5.0, 2.0, 3.0), (0.5, 2.0, 3.0)):
        time = np.linspace(0.0, duration, 20001)
        rate = np.minimum(speed, acceleration * np.minimum(time, duration - time))
        assert reach(speed, acceleration, duration) == pytest.approx(np.trapezoid(rate, time), rel=1e-6)


def test_limits_are_those_of_the_rig_file_and_else_those_shown() -> None:
    recording = old(("table_tilt", "encoder_ripple"))
    shown = demonstrated_limits([recording])

    def allowed(**stated: float) -> MotorLimits:
        return allowed_limits([replace(recording, rig=replace(recording.rig, **stated))])

    assert allowed() == shown
    assert allowed(motor_speed_limit=5.0) == replace(shown, speed=5.0)
    assert allowed(motor_angle_limit=0.4, deflection_limit=0.2) == replace(shown, angle=0.4, deflection=0.2)
    assert allowed(motor_acceleration_limit=3.0) == replace(shown, acceleration=3.0)
    # A slow motor does not get there in time.
    assert allowed(motor_speed_limit=0.1).angle == pytest.approx(0.3, rel=0.01)


@pytest.mark.parametrize(
    "stated",
    [
        {"motor_angle_limit": 0.5, "motor_speed_limit": 0.6, "motor_acceleration_limit": 4.0},
        {"motor_angle_limit": 1.8, "motor_speed_limit": 2.5, "motor_acceleration_limit": 30.0, "deflection_limit": 1.2},
        {"deflection_limit": 0.1},
    ],
    ids=["smaller", "larger", "deflection"],
)
def test_the_course_that_is_written_keeps_what_the_rig_file_states(stated: dict[str, float]) -> None:
    pair = ("structural_damping", "sensor_delay")
    found = separate(stating(pair, **stated), np.random.default_rng(3), evaluations=40)
    time, angle = pd.read_csv(io.StringIO(found.csv())).to_numpy().T
    gap = time[1] - time[0]
    shown = demonstrated_limits([old(pair)])
    most = {
        name: stated.get(f"motor_{name}_limit", getattr(shown, name)) for name in ("angle", "speed", "acceleration")
    }
    # Nine digits of an angle are so many of its second difference.
    assert np.abs(angle - angle[0]).max() <= most["angle"] + 1e-8
    assert np.abs(np.diff(angle)).max() / gap <= most["speed"] + 1e-6
    assert np.abs(np.diff(angle, 2)).max() / gap**2 <= most["acceleration"] + 1e-4
    assert found.deflection <= stated.get("deflection_limit", shown.deflection)
    # It is the deflection that the twin shows.
    new = recorded(on_the_twin(found.moves), CASES[pair], duration=6.0)
    assert np.nanmax(np.abs(new.deflection)) == pytest.approx(found.deflection, rel=0.05, abs=3e-3)


@pytest.mark.parametrize("pair", QUICK_FIRST)
def test_limits_that_are_wider_than_what_is_shown_gain_no_less(pair: tuple[str, str]) -> None:
    shown = demonstrated_limits([old(pair)])
    plain = separate(rivals(pair), np.random.default_rng(5), evaluations=30)
    wide = {"motor_speed_limit": 2.5 * shown.speed, "motor_acceleration_limit": 2.5 * shown.acceleration}
    wider = separate(stating(pair, **wide, deflection_limit=1.2), np.random.default_rng(5), evaluations=30)
    assert wider.designed.chi2 >= plain.designed.chi2
    assert (plain.evaluations, wider.evaluations) == (30, 60)
    if pair[0] == "structural_damping":
        # What tells them apart is beyond what the recording shows, and is used.
        assert wider.designed.chi2 > 3 * plain.designed.chi2
        assert max(m.speed for m in wider.moves) > shown.speed


def test_limits_as_shown_change_nothing() -> None:
    pair = ("table_tilt", "encoder_ripple")
    shown = asdict(demonstrated_limits([old(pair)]))
    names = {"angle": "motor_angle_limit", "speed": "motor_speed_limit", "acceleration": "motor_acceleration_limit"}
    same = stating(pair, **{key: shown[name] for name, key in names.items()}, deflection_limit=shown["deflection"])
    first, second = (separate(fits, np.random.default_rng(7), evaluations=20) for fits in (rivals(pair), same))
    assert first.csv() == second.csv()
    assert first.designed == second.designed


def test_the_loop_designs_within_what_the_rig_file_states(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = ("table_tilt", "encoder_ripple")
    fits = stating(pair, motor_speed_limit=0.7)
    monkeypatch.setattr("discovery.runs.around_search.fit_near", lambda problem, values: problem)
    chosen, other = (SimpleNamespace(refit=SimpleNamespace(problem=fits[name], values={})) for name in pair)
    settings, train = SimpleNamespace(seed=1, follow_up=True), [SimpleNamespace(system=ARM)]
    context: Any = SimpleNamespace(progress=lambda text: None, settings=settings, train=train)
    named: Any = {pair[0]: SimpleNamespace(rivals=(other,), group=(pair[1],))}
    search: Any = SimpleNamespace(best=chosen)
    (found,) = separations(search, named, context)
    assert found.limits.speed == 0.7
    assert 0 < max(m.speed for m in found.moves) <= 0.7


def test_where_no_manoeuvre_keeps_the_deflection_that_is_the_result() -> None:
    pair = ("table_tilt", "encoder_ripple")
    # Less than any move deflects the arm.
    found = separate(stating(pair, deflection_limit=1e-4), np.random.default_rng(0), evaluations=4)
    assert found.deflection > 1e-4
    assert not found.decides
    assert found.designed == Distance(0.0, 0.0, 0.0)
    assert (
        "tip deflected by 0.0001 rad) tells table_tilt, encoder_ripple apart: of 8 tried, the gentlest"
        in separation_sentence(found.summary())
    )
    assert "other limits, stated in the rig file" in separation_sentence(found.summary())


class Bowl:
    """A trial whose rivals lie apart by how near a manoeuvre is to one: cheap, and its best is known."""

    angle = 0.0

    def compare(self, moves: tuple[Move, ...]) -> tuple[Pairs, float]:
        first = moves[0]
        miss = ((first.angle - 1.0) / 0.5) ** 2 + (first.speed - 1.5) ** 2 + 0.2 * (len(moves) - 2) ** 2
        return Pairs(np.full((2, 2), np.exp(-miss)), np.ones((2, 2)), 1), 0.0


def searched(evaluations: int, seed: int) -> MoveSearch:
    """Return the search for the best manoeuvre of the bowl."""
    search, rng = MoveSearch(Bowl(), LIMITS), np.random.default_rng(seed)  # type: ignore[arg-type]
    search.explore(evaluations, rng)
    search.improve(evaluations, Laws.of(2, []), rng)
    return search


def test_a_simplex_is_begun_only_where_it_can_be_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[tuple[int, int]] = []

    def watched(loss: Any, centre: Any, **settings: Any) -> Any:
        begun.append((settings["options"]["maxfev"], len(settings["options"]["initial_simplex"])))
        return minimize(loss, centre, **settings)

    monkeypatch.setattr("discovery.diagnosis.rival_distance.minimize", watched)
    for evaluations in (1, 2, 5, 20, 50, 100):
        for seed in range(6):
            search = searched(evaluations, seed)
            assert search.count == evaluations
            assert search.moves
    assert begun
    assert all(trials >= 2 * corners for trials, corners in begun)
    # A hundred always suffice.
    assert sum(trials == 40 for trials, _ in begun) == 6


def test_few_trials_find_more_than_chance_and_than_an_unfinished_simplex(monkeypatch: pytest.MonkeyPatch) -> None:
    def missed() -> float:
        return float(np.log(2) - np.mean([searched(20, seed).merit for seed in range(60)]))

    found = missed()
    with monkeypatch.context() as changed:
        changed.setattr("discovery.diagnosis.rival_distance._RANDOM", 1.0)
        assert found < 0.85 * missed()
    monkeypatch.setattr(MoveSearch, "_steps", lambda self, count, rng: self._simplex(count))
    assert found < 0.85 * missed()


def test_three_rivals_are_separated_at_once() -> None:
    pair = ("table_tilt", "encoder_ripple")
    three = {**rivals(pair), "structural_damping": fitted([old(pair)], "structural_damping")}
    found = separate(three, np.random.default_rng(2), evaluations=12)
    assert found.rivals == ("structural_damping", "table_tilt", "encoder_ripple")
    assert found.similarities.shape == (3, 3)
    # The nearest pair decides.
    two = separate(rivals(pair), np.random.default_rng(2), evaluations=12)
    assert found.given.chi2 <= two.given.chi2 + 1e-9


def test_what_cannot_be_separated_is_refused() -> None:
    pair = ("table_tilt", "encoder_ripple")
    alone = {"table_tilt": rivals(pair)["table_tilt"]}
    with pytest.raises(InputError, match="at least two fits"):
        separate(alone, np.random.default_rng(0))
    o = old(pair)
    with pytest.raises(InputError, match="where an input is recorded"):
        demonstrated_limits([Experiment(o.recording, None, Rig("o", "oscillator"))])


@pytest.mark.usefixtures("undrawn")
def test_the_report_shows_rivals_and_the_manoeuvre(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(figures.SECTIONS, "undecided", (draw_manoeuvres,))
    results = write_arm_run(tmp_path)
    found = designed(("table_tilt", "encoder_ripple"))
    results["loop"]["separation"] = [found.summary()]
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert "What to do next: what would decide" in page
    assert "table tilt and encoder ripple" in page
    moves = pd.read_csv(tmp_path / "tables" / "moves.csv")
    assert moves["angle_rad"].tolist() == [m.angle for m in found.moves]
    assert moves["ramp_s"].tolist() == pytest.approx([m.ramp * m.duration for m in found.moves])
    rivals_table = pd.read_csv(tmp_path / "tables" / "separation.csv")
    assert rivals_table["designed_chi2"][0] == found.designed.chi2
    assert rivals_table["similarity"][0] == pytest.approx(found.similarities[0, 1])
    assert (tmp_path / "figures" / "manoeuvre_1.svg").exists()


def test_a_law_is_told_from_those_that_do_not_contain_it() -> None:
    friction = "coulomb_friction"
    assert told_apart(friction, ("stribeck_friction", "constant_force", "cogging")) == ["constant_force", "cogging"]
    assert told_apart("constant_force", (friction, "stribeck_friction")) == [friction]
    assert told_apart(f"{friction}_at_load", ("stribeck_friction_at_load",)) == ["stribeck_friction_at_load"]
