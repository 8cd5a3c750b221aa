"""Faults put into signals are found, and ordinary motions are not taken for faults."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from discovery.recordings.dataset import load_dataset
from discovery.recordings.flags import OVERSTATED, UNDERSTATED, Flag, doubted, misstated
from discovery.recordings.range_ends import cut_off
from discovery.recordings.reading_flags import bend_flags, clean_output, gap_flags, swing_flags, time_flags
from discovery.recordings.reading_noise import noise_flags
from discovery.recordings.recording import read_recording
from discovery.recordings.rounding import quantum, resolution
from discovery.recordings.sensor_faults import drift, flat_runs, lost, spikes
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.rigs.rig_file import read_rig

T = 0.005 * np.arange(8000)
DECAY = np.exp(-0.05 * T) * np.cos(6.0 * T)
NOISE = 1e-4
OTHER = Flag("rate_unknown")


def noisy(signal, seed=0, noise=NOISE):
    return signal + np.random.default_rng(seed).normal(0.0, noise, signal.size)


def sliding(friction=0.4):
    """Free swing with dry friction, which comes to rest: amplitudes fall linearly, half cycle by half cycle."""
    half = np.floor(6.0 * T / np.pi)
    amplitude = np.maximum(1.0 - 2 * friction * 0.05 * half, 0.0)
    centre = 0.05 * friction * np.where(half % 2 == 0, 1.0, -1.0) * (amplitude > 0)
    return np.where(amplitude > 0, centre + (amplitude - 0.05 * friction) * np.cos(6.0 * T), 0.0)


ORDINARY = {
    "free decay": noisy(DECAY),
    "without noise": DECAY,
    "coarse encoder": np.round(DECAY / 0.01) * 0.01,
    "very coarse encoder": np.round(DECAY / 0.1) * 0.1,
    "steady swing, coarse": np.round(np.cos(6.0 * T) / 0.003) * 0.003,
    "sliding to rest": np.round(sliding() / 1e-3) * 1e-3,
    "moves between rests": np.round(np.clip(np.cumsum(np.clip(np.sin(2.0 * T), 0, 1) ** 2) / 200, 0, 99) / 1e-4) * 1e-4,
    "fall": np.round(40.0 - 4.9 * T[:500] ** 2, 2),
}


@pytest.mark.parametrize("motion", ORDINARY)
def test_ordinary_motions_are_left_alone(motion):
    values = ORDINARY[motion]
    found = flat_runs(values, max(NOISE, quantum(values)))
    assert not found.stretches
    assert not found.limits
    assert spikes(T[: values.size], values, max(NOISE, resolution(values))).size == 0


@given(st.integers(300, 3000), st.integers(25, 150), st.booleans())
@example(1152, 25, True)
def test_stuck_readings_are_found(start, length, coarse):
    values = np.round(DECAY / 1e-3) * 1e-3 if coarse else noisy(DECAY)
    # Beside a turning point a sensor that sticks cannot be told from a motion that turns.
    if np.abs(values[start + length] - values[start]) < 0.15:
        return
    values = values.copy()
    values[start : start + length] = values[start]
    found = flat_runs(values, max(NOISE, quantum(values)))
    assert found.stuck[start + 1 : start + length].all()
    assert found.stuck.sum() <= length + 2
    # A coarse reading may be the one before, too.
    assert found.stuck[start] == (values[start - 1] == values[start])


@given(st.integers(300, 3000), st.integers(10, 150), st.sampled_from([12.3456, -7.0, 0.0]), st.booleans())
def test_a_dead_value_is_left_out_from_its_first_reading_on(start, length, dead, coarse):
    values = np.round(DECAY / 1e-3) * 1e-3 if coarse else noisy(DECAY)
    # Where the motion passes through the dead value, it does not jump to it.
    if np.abs(values[[start - 1, start + length]] - dead).min() < 0.2:
        return
    values = values.copy()
    values[start : start + length] = dead
    found = flat_runs(values, max(NOISE, quantum(values)))
    assert found.stretches == ((start, length),)
    assert np.flatnonzero(found.stuck).tolist() == list(range(start, start + length))


@pytest.mark.parametrize("samples", [20, 40, 200])
def test_a_motion_that_is_clipped_at_speed_does_not_jump(samples):
    values = np.minimum(np.sin(2 * np.pi * np.arange(50 * samples) / samples + 0.1), 0.5)
    found = flat_runs(values, NOISE)
    assert found.limits == (0.5,)
    assert found.stretches == ()


@pytest.mark.parametrize("step", [0.003, 0.01])
def test_a_speed_that_friction_ends_stands_still_and_a_sensor_that_sticks_does_not(step):
    """Dry friction slows a train evenly to a standstill, from which it is pushed off again."""
    speed = np.clip(2.0 * np.abs(1.0 - 0.5 * np.arange(800) * 0.01) - 0.3, 0.0, None)
    values = np.round(speed / step) * step
    assert flat_runs(values, step).stretches  # as a position it would be stuck
    assert flat_runs(values, step, rate=True).stretches == ()
    for place, dead in ((40, values[40]), (60, 0.0)):  # stuck at speed; a dead reading
        fault = values.copy()
        fault[place : place + 50] = dead
        (found,) = flat_runs(fault, step, rate=True).stretches
        assert abs(found[0] - place) <= 1
        assert sum(found) == place + 50


def test_a_jump_is_told_from_a_fast_motion():
    values = noisy(DECAY)[::10]  # twenty samples a swing
    for start in range(60, 81):
        frozen = values.copy()
        frozen[start : start + 29] = 0.2
        away = abs(values[start] - 0.2)
        if away > 0.5:
            assert flat_runs(frozen, NOISE).stretches == ((start, 29),)
        frozen[start : start + 29] = values[start]
        assert flat_runs(frozen, NOISE).stretches in ((), ((start + 1, 28),))


def test_a_dead_value_that_comes_back_is_no_limit():
    values = noisy(DECAY)
    values[1000:1040] = values[5000:5004] = -99.0
    values[4998] = np.nan
    found = flat_runs(values, NOISE)
    assert found.stretches == ((1000, 40), (5000, 4))
    assert found.limits == ()


@given(st.floats(0.5, 0.95))
def test_clipped_readings_are_found(limit):
    values = noisy(np.cos(6.0 * T))
    clipped = np.clip(values, -limit, 2.0)
    found = flat_runs(clipped, NOISE)
    assert found.limits == (-limit,)
    assert (found.clipped == (clipped == -limit))[50:-50].mean() > 0.995


@given(st.integers(100, 7900), st.floats(0.02, 0.5))
def test_spikes_are_found(at, size):
    values = noisy(DECAY)
    values[at] += size
    assert spikes(T[: values.size], values, NOISE).tolist() == [at]


@pytest.mark.parametrize("seed", range(3))
def test_lost_rows_are_no_spikes_and_hide_none(seed):
    rng = np.random.default_rng(seed)
    t, lone = 0.01 * np.arange(2000), rng.integers(50, 1950)
    values = np.sin(2 * np.pi * 0.6 * t) + 3e-4 * rng.standard_normal(t.size)
    near = np.abs(np.arange(t.size) - lone) < 4
    for kept in (rng.random(t.size) > 0.15, (t < 7) | (t > 8.3)):
        kept = kept | near
        assert spikes(t[kept], values[kept], 3e-4).size == 0
        wild = values + 0.02 * (np.arange(t.size) == lone)
        assert t[kept][spikes(t[kept], wild[kept], 3e-4)].tolist() == [t[lone]]


def test_the_mean_that_creeps():
    assert drift(T, noisy(DECAY), NOISE) == 0.0
    assert drift(T, noisy(np.cos(6.0 * T)) + 0.2 * T / T[-1], NOISE) == pytest.approx(0.2, rel=0.03)
    assert drift(T, noisy(np.cos(6.0 * T)) + 0.01 * T / T[-1], NOISE) == 0.0
    assert drift(T[:3000], noisy(np.cos(6.0 * T) + T)[:3000], NOISE) == 0.0
    # Stamps whose steps grow: what swings about one place by them does not by their numbers.
    late = T[-1] * (T / T[-1]) ** 1.3
    assert drift(late, noisy(np.cos(6.0 * late)), NOISE) == 0.0
    assert drift(late, noisy(np.cos(6.0 * late)) + 0.2 * late / late[-1], NOISE) == pytest.approx(0.2, rel=0.05)


def test_a_body_that_dry_friction_stops_off_its_middle_does_not_creep():
    swings = sliding(0.4)[:6000]
    stopped = np.where(swings == 0.0, 0.06, swings)
    assert drift(T[:6000], noisy(stopped), NOISE) == 0.0
    assert drift(T[:6000], noisy(stopped + 0.1 * T[:6000] / 30), NOISE) == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize("drifts", [0.0, 0.2])
def test_the_slow_part_of_a_driven_motion_does_not_creep(drifts):
    found = []
    time = np.arange(3000) / 250.0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rates, phases, sizes = rng.uniform(2.5, 31.0, 10), rng.uniform(0.0, 6.3, 10), rng.uniform(0.3, 1.0, 10)
        own = rng.uniform(9.0, 31.0)
        waves = np.exp(1j * (np.multiply.outer(time, rates) + phases))
        motion = (waves @ (sizes / (own**2 - rates**2 + 0.1j * own * rates))).real
        motion *= 1.0 / motion.std()
        found.append(drift(time, noisy(motion) + drifts * time / time[-1], NOISE, (waves @ sizes).real))
    # A swing that is slow for the length of the record has no mean that could be told from it.
    assert found.count(0.0) == 20 if drifts == 0.0 else found.count(0.0) <= 3
    assert np.median(found) == pytest.approx(drifts, rel=0.05)


def test_a_ramp_is_not_read_in_steps_and_one_that_is_has_them():
    time = np.arange(300) * 0.015
    speed = 40.0 + 1e-3 * np.random.default_rng(2).normal(size=time.size)
    assert quantum(speed * time) == 0.0
    # Each count is read once as long as none is passed over; then a gap is of two.
    counts = np.floor(41.3 * time / 0.6)
    assert quantum(0.6 * counts) == pytest.approx(0.6)


def test_a_hoist_that_stops_at_either_end_and_elsewhere_is_not_clipped():
    rng, tops, value, rows = np.random.default_rng(3), (11308, 11308, 11019, 10697, 11308, 10801), 0, []
    for top in tops:
        for goal, speed in ((top, 2100.0), (-int(rng.integers(15, 45)), -780.0)):
            way = np.arange(value, goal, speed)
            rows += [*np.round(way + rng.normal(0.0, 20.0, way.size)), *[goal] * int(rng.integers(6, 15))]
            value = goal
    read = np.array(rows, float)
    assert cut_off(read, 1.0)[1] == ()
    # The same motion before an instrument that ends at 8000 is cut off there.
    below, limits = cut_off(np.minimum(read, 8000.0), 1.0)
    assert limits == (8000.0,)
    assert below.sum() == np.sum(read >= 8000.0)


def test_a_servo_that_rests_at_home_between_its_moves_is_not_clipped(tmp_path):
    # A geared motor that goes off from its home and comes back, where friction holds it: home is its largest reading.
    out = np.array([0, 0, -95, -230, -375, -398, -398, -341, -226, -93, 0])
    push = np.array([0, -12, -250, -387, -150, -25, 25, 221, 379, 121, 0]) / 100.0
    read, volts = (np.concatenate([np.r_[part, np.zeros(14)] for _ in range(4)]) for part in (out, push))
    table = np.column_stack([0.1 * np.arange(read.size), volts, 2347 + read])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,u,count", comments="")
    text = """
name = "servo"
[system]
like = "dc_motor"
output = "phi"
[system.constants]
inertia = { guess = 0.05, unit = "kg m^2" }
loss = { value = 0.0, unit = "N m s" }
torque_constant = { guess = 2.0, unit = "N m / A" }
resistance = { value = 1.0, unit = "ohm" }
[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "V", interpolation = "linear" }
output = { name = "count", unit = "rev", zero = 2347, scale = 0.000244140625 }
"""
    (tmp_path / "rig.toml").write_text(text)
    recording = read_recording(tmp_path / "a.csv", read_rig(tmp_path / "rig.toml"))
    assert np.isfinite(recording.output).all()
    # Where something pushes throughout, what is flat at an end is cut off.
    table[:, 1] += 1.0
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,u,count", comments="")
    recording = read_recording(tmp_path / "a.csv", read_rig(tmp_path / "rig.toml"))
    assert not np.isfinite(recording.output).all()


@pytest.mark.parametrize("step", [0.08789062590975255, 1.0, 2 * np.pi / 40000])
def test_the_quantum_is_found_through_conversions(step):
    values = np.round(300 * step * DECAY / step) * step
    assert quantum(values) == pytest.approx(step, rel=1e-6)
    assert quantum(np.radians(np.degrees(values + 0.3))) == pytest.approx(step, rel=1e-6)
    assert resolution(values) == pytest.approx(step / np.sqrt(12.0), rel=1e-6)
    assert quantum(noisy(values, noise=step)) == 0.0


def test_a_step_is_seen_in_readings_that_hardly_repeat():
    step = 2 * np.pi / 14400
    values = np.round(np.cos(9.0 * T[:400]) / step) * step
    assert np.unique(values).size > 0.8 * values.size
    assert quantum(values) == pytest.approx(step, rel=1e-6)


def test_coarse_readings_raise_the_noise_to_that_of_rounding(tmp_path):
    frame = pd.DataFrame({"t": T, "y": np.round(DECAY / 0.01) * 0.01})
    frame.to_csv(tmp_path / "r.csv", index=False)
    for stated in (None, 1e-5):
        rig = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("y", "m", stated)))
        recording = read_recording(tmp_path / "r.csv", rig)
        assert recording.noise[0] == pytest.approx(0.01 / np.sqrt(12.0), rel=0.2 if stated is None else 1e-6)
        assert any("reads in steps of 0.01 m" in note for note in recording.notes)


def test_faulty_samples_become_gaps_with_a_note(tmp_path):
    values = noisy(DECAY)
    values[1000:1080] = values[1000]
    values = np.minimum(values, 0.8)
    values[5000] += 0.3
    frame = pd.DataFrame({"t": T, "y": values})
    frame.to_csv(tmp_path / "r.csv", index=False)
    rig = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("y", "m")))
    recording = read_recording(tmp_path / "r.csv", rig)
    text = " ".join(recording.notes)
    assert "'y' is stuck for 79 samples from 5.005 s, while the system moves" in text
    assert "'y' saturates at 0.8 m" in text
    assert "'y' has 1 spike," in text
    gaps = np.isnan(recording.output[:, 0])
    assert gaps[1001:1080].all()
    assert gaps[values == 0.8].all()
    assert gaps.sum() == 79 + (values == 0.8).sum()


def test_several_stretches_are_counted():
    values = noisy(DECAY)
    values[1000:1080] = values[1000]
    values[3000:3029] = 12.3456
    _, (note,) = clean_output("y", "m", T, values, NOISE, False)
    assert "stuck in 2 stretches, 108 samples in all, the longest of 79 samples from 5.005 s" in str(note)
    _, (note,) = clean_output("y", "m", T, np.where(np.arange(T.size) < 2000, 0.0, values), NOISE, True)
    assert "stuck for 29 samples from 15 s" in str(note)


@pytest.mark.parametrize(
    ("values", "stated", "words"),
    [
        (noisy(DECAY), NOISE, []),
        (noisy(DECAY), NOISE / 1.4, []),
        (noisy(DECAY), NOISE / 2, ["'y' scatters by 0.000101 m", "states a noise of 5e-05 m", "too small"]),
        (noisy(DECAY), 2 * NOISE, ["'y' scatters by 0.000101 m", "states a noise of 0.0002 m", "too large"]),
        (np.round(noisy(DECAY), 4), NOISE / 2, ["too small"]),
        (np.round(noisy(DECAY), 3), 4e-4, []),  # what scatters is mostly rounding
        (np.round(noisy(DECAY), 3), 1e-4, []),  # rounding may hide how little it is
        (np.round(noisy(DECAY), 3), 1e-3, []),  # the step itself
        (np.round(noisy(DECAY), 3), 2e-3, ["'y' scatters by 0.000293 m", "states a noise of 0.002 m", "too large"]),
        (np.full(T.size, 0.01), 1e-3, []),  # it rests
        (noisy(DECAY)[:150], NOISE / 2, []),
        (noisy(np.sin(400.0 * T)), NOISE, []),  # the signal itself is rough
        (np.where(np.arange(T.size) % 7 < 2, np.nan, noisy(DECAY)), NOISE / 2, []),
    ],
)
def test_a_stated_noise_is_held_against_the_scatter(values, stated, words):
    text = " ".join(map(str, noise_flags("y", "m", T[: values.size], values, stated)))
    assert bool(text) == bool(words)
    for word in words:
        assert word in text


def test_scatter_that_may_come_of_jitter_contradicts_no_statement():
    time = T + np.random.default_rng(2).uniform(-1e-3, 1e-3, T.size)
    moved = noisy(np.exp(-0.05 * time) * np.cos(6.0 * time))
    assert noise_flags("y", "m", time, moved, NOISE) == []
    assert noise_flags("y", "m", T, moved, NOISE)


def test_a_recording_says_that_its_noise_is_not_the_stated_one(tmp_path):
    pd.DataFrame({"t": T, "y": noisy(DECAY)}).to_csv(tmp_path / "r.csv", index=False)
    rig = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("y", "m", NOISE / 2)))
    recording = read_recording(tmp_path / "r.csv", rig)
    assert recording.noise[0] == NOISE / 2
    assert [note[:16] for note in recording.notes] == ["'y' scatters by "]


@pytest.mark.parametrize("place", ["rig file", "call"])
def test_the_scatter_is_used_where_that_is_asked_for(place, tmp_path):
    pd.DataFrame({"t": T[:2000], "y": noisy(DECAY)[:2000]}).to_csv(tmp_path / "r.csv", index=False)
    stated = '"estimate"' if place == "rig file" else str(NOISE / 2)
    (tmp_path / "rig.toml").write_text(
        'name = "o"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        f'output = {{ name = "y", unit = "m", noise = {stated} }}\n'
    )
    asked = {"estimate_noise": True} if place == "call" else {}
    (experiment,) = load_dataset(tmp_path / "rig.toml", [tmp_path / "r.csv"], **asked).train
    assert experiment.recording.noise_estimated
    assert 0.9 * NOISE < experiment.recording.noise[0] < 1.1 * NOISE
    assert experiment.recording.notes == ()


def test_a_clean_signal_is_passed_on_itself():
    values = noisy(DECAY)
    kept, notes = clean_output("y", "m", T, values, NOISE, True)
    assert kept is values
    assert notes == []


REGULAR = 0.01 * np.arange(1000)
JITTERED = REGULAR + np.random.default_rng(3).uniform(-3e-3, 3e-3, 1000)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (REGULAR, []),
        (np.round(np.arange(500) / 30.0, 3), []),
        (np.delete(REGULAR, [100, 101, 102, 700]), ["4 samples are missing in 2 gaps", "longest lasts 0.04 s"]),
        (REGULAR[np.random.default_rng(4).random(1000) > 0.15], ["samples are missing in 1", "gaps of the times"]),
        (np.delete(REGULAR, 100), ["1 sample is missing in 1 gap of the times"]),
        (JITTERED, ["stamps are uneven", "taken as they are"]),
        (np.sort(np.concatenate([REGULAR[::5] + k * 1e-4 for k in range(5)])), ["come in bursts"]),
        (1e3 * REGULAR, ["10 s apart by their unit, s:", "correct the unit"]),
        (1e-5 * REGULAR, ["1e-07 s apart by their unit, s:", "Correct the unit"]),
    ],
)
def test_notes_on_times(time, words):
    text = " ".join(map(str, time_flags(time, TimeColumn())))
    assert bool(text) == bool(words)
    for word in words:
        assert word in text


def test_a_reading_a_second_is_noted_and_no_doubt():
    for step, severity in ((1.0, "note"), (1e-7, "doubt")):
        (flag,) = time_flags(step * np.arange(1000), TimeColumn())
        assert flag.severity == severity


@pytest.mark.parametrize(("amplitude", "length"), [(0.1, None), (1.0, None), (2.5, 1.0)])
@pytest.mark.parametrize(
    ("swings", "told"),
    [(0.3, "of a swing"), (0.8, "of a swing"), (1.6, "swings"), (2.5, "swings"), (4.0, ""), (30.0, "")],
)
def test_how_few_swings_there_are_is_told(amplitude, length, swings, told):
    period = 2.0 * np.pi / np.sqrt(9.81)
    time = np.linspace(0.0, swings * period, 500)
    found = solve_ivp(
        lambda _, s: [s[1], -9.81 * np.sin(s[0]) - 0.05 * s[1]], time[[0, -1]], [amplitude, 0.0], t_eval=time, rtol=1e-8
    )
    values = found.y[0] + 2e-3 * np.random.default_rng(4).standard_normal(time.size)
    slow = amplitude > 2.0  # a large swing takes longer
    notes = swing_flags("a", time, values, None if length is None else period)
    if not slow or swings > 10.0 or swings < 1.0:
        assert bool(notes) is bool(told)
    if told and not slow:
        share = float(re.search(rf"'a' holds about (\S+) {told} ", str(notes[0]))[1])
        assert share == pytest.approx(swings, abs=0.11)


@pytest.mark.parametrize(("period", "rate", "duration"), [(1.0, 30, 300), (1.003, 100, 300), (2.0, 60, 600)])
def test_many_swings_are_no_part_of_one_where_every_so_many_th_sample_is_looked_at(period, rate, duration):
    time = np.arange(duration * rate) / rate
    values = np.cos(2.0 * np.pi * time / period) + 2e-3 * np.random.default_rng(4).standard_normal(time.size)
    assert swing_flags("a", time, values) == []


def test_a_short_film_is_read_and_told_and_one_that_is_driven_is_not(tmp_path):
    time = np.arange(60) / 30.0
    frame = pd.DataFrame({"t": time, "u": np.sin(time), "a": np.degrees(0.4 * np.cos(2.0 * time))})
    frame.to_csv(tmp_path / "film.csv", index=False)
    for inputs, told in ((None, 1), (InputColumn("u", "V", "spline"), 0)):
        columns = Columns(TimeColumn("t"), inputs, OutputColumn("a", "deg", 2e-3))
        notes = read_recording(tmp_path / "film.csv", Rig("p", kind="pendulum", columns=columns)).notes
        assert sum("'a' holds about 0.6 of a swing (1.97 s)" in note for note in notes) == told


@pytest.mark.parametrize(("swings", "told"), [(2.0, 1), (0.5, 0), (8.0, 0)])
@pytest.mark.parametrize("output", ["swing", "dot(swing)"])
def test_few_swings_of_a_declared_system_are_told_and_part_of_one_may_be_any_motion(tmp_path, output, swings, told):
    unit = "rad/s" if "dot" in output else "rad"
    time = np.arange(200) / 50.0
    rig = tmp_path / "rig.toml"
    rig.write_text(
        f"""name = "p"
[system]
coordinates = {{ swing = "rad" }}
kinetic = "inertia*dot(swing)^2/2"
potential = "-weight*cos(swing)"
places = {{ joint = "swing" }}
output = "{output}"
[system.constants]
inertia = {{ value = 1.0, unit = "kg m^2" }}
weight = {{ guess = 1.0, unit = "N m" }}
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "a", unit = "{unit}" }}
"""
    )
    values = 0.3 * np.cos(2.0 * np.pi * swings * time / 4.0) + 2e-3 * np.random.default_rng(5).standard_normal(200)
    pd.DataFrame({"t": time, "a": values}).to_csv(tmp_path / "a.csv", index=False)
    flags = read_recording(tmp_path / "a.csv", read_rig(rig)).flags
    assert sum(flag.code in ("swings_few", "swing_cut") for flag in flags) == told


def test_empty_cells_are_told(tmp_path):
    values = noisy(DECAY)
    assert gap_flags("y", T, values) == []
    values[[100, 700, 701, 702, 900]] = np.nan
    pd.DataFrame({"t": T, "y": values}).to_csv(tmp_path / "r.csv", index=False)
    rig = Rig("o", kind="oscillator", columns=Columns(TimeColumn("t"), None, OutputColumn("y", "m", NOISE)))
    (note,) = read_recording(tmp_path / "r.csv", rig).notes
    assert f"'y' has 5 empty cells in {T.size} rows, up to 3 in a row, from {T[700]:.4g} s" in note
    assert "1 empty cell in 3 rows, the first at 1 s" in str(
        gap_flags("y", np.arange(3.0), np.array([0.0, np.nan, 1.0]))[0]
    )


@pytest.mark.parametrize(("last", "words"), [(2.0, "up to 2 s of 9.5 s"), (1746445282.5, "up to 1746445282.5 s")])
def test_a_moment_of_a_clock_far_from_zero_is_told_from_the_next(last, words):
    told = Flag("at_rest", numbers={"count": 9, "kept": 3, "last": last, "end": last + 7.5})
    assert words in str(told)


def test_notes_quote_the_unit_of_the_file():
    (note,) = noise_flags("y", "mm", T, noisy(DECAY), NOISE / 2)
    assert "'y' scatters by 0.101 mm beside its motion, but the rig file states a noise of 0.05 mm" in str(note)
    assert note.code == UNDERSTATED
    assert [f.code for f in noise_flags("y", "mm", T, noisy(DECAY), 2 * NOISE)] == [OVERSTATED]


def test_a_fault_of_several_columns_is_told_once():
    small = [noise_flags(c, "mm", T, noisy(DECAY, seed), NOISE / 2)[0] for seed, c in enumerate(("x", "y"))]
    (large,) = noise_flags("z", "mm", T, noisy(DECAY), 2.5 * NOISE)
    (hardly,) = noise_flags("z", "mm", T, noisy(DECAY), 1.8 * NOISE)
    assert misstated({"one": [OTHER, small[0]]}) == [f"one: {small[0]}"]
    assert misstated({"one": [hardly], "two": [OTHER]}) == []
    first, second = misstated({"one": [*small, large], "two": small})
    assert re.fullmatch(r"one, two: 'x', 'y' scatter by (0\.\d+) to (0\.\d+) mm beside its motion, .*", first)
    assert first.endswith(str(small[0]).partition(", but ")[2])
    assert second == f"one: {large}"


def swinging_arm():
    """Motor angle, and position of the tip of a rod that swings about the motor's direction."""
    motor = np.interp(T, [1.0, 2.0, 20.0, 21.0], [0.0, 1.0, 1.0, 0.4])
    direction = motor + 0.4 * np.cos(6.0 * T)
    return motor, np.cos(direction), np.sin(direction)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m, x, y: (m, {"tip_x": x, "tip_y": y}), None),
        (lambda m, x, y: (m, {"tip_angle": np.arctan2(y, x)}), None),
        (lambda m, x, y: (0 * m, {"tip_x": x, "tip_y": y}), None),  # bent, but by no known mistake
        (lambda m, x, y: (m, {"tip_deflection": y}), None),
        (lambda m, x, y: (m, {"tip_x": y, "tip_y": x}), "With tip_x and tip_y exchanged it would lie"),
        (lambda m, x, y: (-m, {"tip_x": x, "tip_y": y}), "With the motor's angle or tip_y of opposite sign"),
        (lambda m, x, y: (m, {"tip_x": -x, "tip_y": y}), "With tip_x of opposite sign"),
        (lambda m, x, y: (m, {"tip_angle": -np.arctan2(y, x)}), "With the motor's angle or the tip's of opposite"),
        (lambda m, x, y: (np.degrees(m), {"tip_x": x, "tip_y": y}), "more than a rod bends in use. Are its columns"),
    ],
)
def test_a_tip_that_does_not_point_where_the_motor_does_is_told(change, words):
    motor, x, y = swinging_arm()
    x[100:110] = np.nan
    notes = bend_flags(*change(motor, x, y))
    assert len(notes) == (words is not None)
    assert words is None or words in str(notes[0])
    # Each mistake is told once, however far the tip lies beside the motor's direction.
    again = [replace(note, numbers={**note.numbers, "bend": 1.7}) for note in notes]
    doubt = [f"a: {note} So in b." for note in notes]
    assert doubted({"a": [OTHER, *notes], "b": again}) == doubt
    assert len(doubted({"a": notes, "c": bend_flags(-motor, {"tip_x": x, "tip_y": y})})) == (
        1 if words is None or "or tip_y of opposite" in words else 2
    )


def test_an_assumed_rate_is_said():
    assert "per sample" in str(time_flags(REGULAR, TimeColumn(assumed=True))[0])


def braked(rest: int = 20, away: float = 1.0) -> np.ndarray:
    """A trolley on a coarse encoder: it is driven off, brakes to a standstill, and is driven on or back, evenly."""
    ramp = 0.02 * np.arange(60)
    speed = np.concatenate([np.zeros(30), ramp, ramp[::-1], np.zeros(rest), away * ramp, np.full(60, away * ramp[-1])])
    return np.cumsum(speed)


@pytest.mark.parametrize("step", [0.005, 0.02])
@pytest.mark.parametrize("away", [1.0, -1.0])
def test_what_is_driven_may_come_to_rest_anywhere_and_a_sensor_sticks_with_a_jump(step, away):
    values = np.round(braked(30, away) / step) * step
    assert flat_runs(values, step, driven=True).stretches == ()
    for place in (70, 195):  # where it moves, and goes on behind the reading
        fault = values.copy()
        fault[place : place + 15] = values[place]
        (found,) = flat_runs(fault, step, driven=True).stretches
        assert abs(found[0] - place) <= 2
        assert sum(found) == place + 15
    dead = values.copy()
    dead[112:128] = -9.0
    assert flat_runs(dead, step, driven=True).stretches == ((112, 16),)


def test_a_trolley_that_brakes_within_its_resolution_and_is_dragged_on_is_not_stuck():
    """It overshoots by two steps, rests, and what hangs from it drags it on, slowly: a free body would not do that."""
    steps = [1000] * 60 + [957, 1057, 777, 477, 322, 65, 22, -2] + [0] * 15 + [-1, -5, -16, -19, -8, -7, -10, -6, -4]
    values = 1e-5 * np.cumsum([*steps, *[-6, -5, -2], *[0] * 12])
    assert flat_runs(values, 2.7e-5).stretches
    assert flat_runs(values, 2.7e-5, driven=True).stretches == ()


def test_a_doubt_of_two_columns_is_told_of_each():
    swings = [Flag("swings_few", column, "deg", {"swings": 3.0, "duration": 2.0}) for column in ("x", "z")]
    assert doubted({"a": swings, "b": swings[:1]}) == [f"a: {swings[0].sentence} So in b.", f"a: {swings[1].sentence}"]


@pytest.mark.parametrize("count", [2, 3, 20])
@pytest.mark.parametrize("step", [0.0, 5.0])
def test_zeros_of_a_counter_that_read_nothing_are_lost_once_they_come_back(count: int, step: float) -> None:
    rng, t = np.random.default_rng(count), np.arange(300)
    speed = 2000.0 * (1.0 - np.exp(-t / 60.0)) + 20.0 * rng.standard_normal(t.size)
    speed = np.round(speed / step) * step if step else speed
    speed[:5] = 0.0  # at rest
    gone = rng.choice(np.arange(60, 290, 8), count, replace=False)
    speed[gone] = speed[gone[: count // 2] + 1] = 0.0
    found = lost(speed, step)
    assert found.any() == (count > 2)
    assert not found.any() or (found == (speed == 0.0) & (t >= 5)).all()


@pytest.mark.parametrize("motion", ["swing", "coarse speed", "stick and slip", "rests"])
def test_zeros_of_a_motion_are_readings(motion: str) -> None:
    t = np.arange(400)
    values = {
        "swing": np.round(1000.0 * np.sin(2.0 * np.pi * t / 8.0)),  # through zero, to the other side
        "coarse speed": 5.0 * (t % 3 == 0),  # a count in every third interval
        "stick and slip": np.maximum(0.0, 40.0 * np.sin(2.0 * np.pi * t / 40.0)),
        "rests": np.where(t % 20 < 10, 30.0, 0.0),
    }[motion]
    assert not lost(values, 5.0 if motion == "coarse speed" else 0.0).any()
