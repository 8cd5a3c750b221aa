from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from discovery.foundation.errors import InputError
from discovery.recordings.copies import shared_samples
from discovery.recordings.dataset import load_dataset
from discovery.recordings.recording import Recording

RIG = """
name = "circuit"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "V", interpolation = "spline" }
output = { name = "y", unit = "V", noise = 0.001 }
[model]
effects = ["viscous_damping", "linear_stiffness"]
"""
RECORDS = """
[records]
train = [{ file = "one.csv", samples = [0, 200] }, { file = "one.csv", samples = [200, 320] }]
holdout = [{ file = "two.csv" }]
"""


def write(folder: Path, name: str, seed: int, n: int = 320) -> Path:
    t = 0.02 * np.arange(n)
    rng = np.random.default_rng(seed)
    frame = pd.DataFrame({"t": t, "u": np.sin(t), "y": np.cos(3 * t) + 1e-3 * rng.standard_normal(n)})
    frame.to_csv(folder / name, index=False)
    return folder / name


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "records.toml").write_text(RIG + RECORDS)
    for seed, name in enumerate(("one.csv", "two.csv", "three.csv")):
        write(tmp_path, name, seed)
    (tmp_path / "sub").mkdir()
    write(tmp_path / "sub", "one.csv", 7)
    return tmp_path


def test_without_a_hold_out_the_last_third_of_each_recording_is_kept(folder: Path) -> None:
    write(folder, "short.csv", 5, n=100)
    data = load_dataset(folder / "rig.toml", [folder / "one.csv", folder / "short.csv"])
    assert [e.fitted_samples for e in data.train] == [213, 66]
    assert data.holdout == ()
    assert [role for role, _ in data.everything] == ["train", "train"]


@pytest.mark.parametrize("begin", [1027.5, -400.0, 1.7e9])
def test_times_are_counted_from_the_first_reading_where_the_clocks_zero_is_far(folder: Path, begin: float) -> None:
    frames = {name: pd.read_csv(folder / name) for name in ("one.csv", "two.csv")}
    for name, after in (("one.csv", 0.0), ("two.csv", 7.0)):
        frames[name].assign(t=frames[name]["t"] + begin + after).to_csv(folder / f"late_{name}", index=False)
    data = load_dataset(folder / "rig.toml", [folder / "late_one.csv"], [folder / "late_two.csv"])
    near = load_dataset(folder / "rig.toml", [folder / "one.csv"], [folder / "two.csv"])
    for own, plain, after in ((data.train[0], near.train[0], 0.0), (data.holdout[0], near.holdout[0], 7.0)):
        # What goes on from one recording to the next keeps its time between them.
        np.testing.assert_allclose(own.recording.time, plain.recording.time + after, atol=1e-6)
        assert own.rig.columns.time.zero == begin
        assert "clock_far" in [f.code for f in own.recording.flags]
        assert "clock_far" not in [f.code for f in plain.recording.flags]


@pytest.mark.parametrize("begin", [-1.0, 0.0, 5.0])
def test_a_clock_that_begins_near_the_recording_is_kept(folder: Path, begin: float) -> None:
    frame = pd.read_csv(folder / "one.csv")
    frame.assign(t=frame["t"] + begin).to_csv(folder / "late.csv", index=False)
    (found,) = load_dataset(folder / "rig.toml", [folder / "late.csv"]).train
    np.testing.assert_allclose(found.recording.time, frame["t"] + begin)
    assert found.recording.flags == load_dataset(folder / "rig.toml", [folder / "one.csv"]).train[0].recording.flags


def test_with_a_hold_out_everything_of_the_training_recordings_is_fitted(folder: Path) -> None:
    data = load_dataset(folder / "rig.toml", [folder / "one.csv"], [folder / "two.csv", folder / "three.csv"])
    assert [e.fitted_samples for e in (*data.train, *data.holdout)] == [None, None, None]
    assert [(role, e.recording.name) for role, e in data.everything] == [
        ("train", "one"),
        ("holdout", "two"),
        ("holdout", "three"),
    ]
    assert data.train[0].recording.sha256 == hashlib.sha256((folder / "one.csv").read_bytes()).hexdigest()


def test_the_rigs_own_records_are_the_default(folder: Path) -> None:
    data = load_dataset(folder / "records.toml")
    assert [e.recording.time.size for e in data.train] == [200, 120]
    assert data.train[1].recording.time[0] == pytest.approx(4.0)
    assert [e.recording.name for e in data.holdout] == ["two"]
    # Parts of one file are told apart.
    assert [e.recording.name for e in data.train] == ["one_0-200", "one_200-320"]


def test_recordings_on_the_command_line_replace_all_of_the_rigs(folder: Path) -> None:
    data = load_dataset(folder / "records.toml", [folder / "three.csv"])
    assert [e.recording.name for e in data.train] == ["three"]
    assert data.holdout == ()


def test_a_hold_out_of_ones_own_beside_the_rigs_training(folder: Path) -> None:
    data = load_dataset(folder / "records.toml", (), [folder / "three.csv"])
    assert len(data.train) == 2
    assert [e.recording.name for e in data.holdout] == ["three"]


def test_names_that_occur_twice_are_numbered_across_roles(folder: Path) -> None:
    data = load_dataset(folder / "rig.toml", [folder / "one.csv"], [folder / "sub" / "one.csv", folder / "two.csv"])
    assert [e.recording.name for _, e in data.everything] == ["one_1", "one_2", "two"]


def test_nothing_to_fit_is_refused_with_the_remedy(folder: Path) -> None:
    with pytest.raises(InputError, match="nothing to fit") as error:
        load_dataset(folder / "rig.toml")
    assert "--train" in str(error.value)


def test_a_recording_that_is_not_there_is_named(folder: Path) -> None:
    with pytest.raises(InputError) as error:
        load_dataset(folder / "rig.toml", [folder / "absent.csv"])
    message = str(error.value)
    assert str(folder / "absent.csv") in message
    # A misspelt file is not a public measurement.
    assert "registered" not in message


def test_public_data_that_are_not_here_are_refused_with_the_remedy(folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("DISCOVERY_DATA", str(folder))
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    with pytest.raises(InputError, match="DISCOVERY_DATA") as error:
        load_dataset(folder / "rig.toml", [folder / "silverbox" / "SNLS80mV.mat"])
    assert "fetch" in str(error.value)


def test_a_name_that_only_a_public_set_of_another_folder_has_is_not_taken_from_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "data" / "carter_cdip").mkdir(parents=True)
    (folder / "data" / "carter_cdip" / "train.csv").write_text("t_s,angle_rad\n0,0\n")
    monkeypatch.setenv("DISCOVERY_DATA", str(folder / "data"))
    with pytest.raises(InputError) as error:
        load_dataset(folder / "rig.toml", [folder / "train.csv"])
    assert "carter" not in str(error.value)


def test_a_public_file_with_another_hash_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "silverbox").mkdir()
    (folder / "silverbox" / "SNLS80mV.mat").write_bytes(b"something else")
    monkeypatch.setenv("DISCOVERY_DATA", str(folder))
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    with pytest.raises(InputError, match="SHA-256"):
        load_dataset(folder / "rig.toml", [folder / "elsewhere" / "silverbox" / "SNLS80mV.mat"])


PICKED = """
name = "drops"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "y", unit = "m" }
[records]
train = [
  { file = "drops.csv", where = { ball = "Tennis Ball", drop = 1 } },
  { file = "drops.csv", where = { ball = "Tennis Ball", drop = 2 }, samples = [0, 60] },
]
holdout = [{ file = "drops.csv", where = { ball = "Golf", drop = 1 }, name = "golf" }]
test = [{ file = "drops.csv", where = { ball = "Golf", drop = 2 } }]
"""


@pytest.fixture
def drops(tmp_path: Path) -> Path:
    frames = []
    for ball in ("Tennis Ball", "Golf"):
        for drop in (1, 2):
            t = 0.1 * np.arange(80)
            rate = 2.0 + 0.1 * len(frames)
            frames.append(pd.DataFrame({"ball": ball, "drop": drop, "t": t, "y": drop + np.cos(rate * t)}))
    pd.concat(frames).to_csv(tmp_path / "drops.csv", index=False)
    (tmp_path / "rig.toml").write_text(PICKED)
    return tmp_path / "rig.toml"


def test_recordings_picked_from_one_file_are_named_by_what_picks_them(drops: Path) -> None:
    data = load_dataset(drops)
    assert [e.recording.name for e in data.train] == ["tennis_ball_drop_1", "tennis_ball_drop_2_0-60"]
    assert [e.recording.name for e in data.holdout] == ["golf"]
    assert [e.recording.time.size for e in data.train] == [80, 60]


def test_recordings_that_are_only_scored_are_apart_and_give_way_to_the_command_line(drops: Path) -> None:
    data = load_dataset(drops)
    assert [e.recording.name for e in data.test] == ["golf_drop_2"]
    assert not {e.recording.name for _, e in data.everything} & {"golf_drop_2"}
    write(drops.parent, "other.csv", 3)
    assert load_dataset(drops, [drops.parent / "other.csv"]).test == ()


def test_the_same_rows_twice_are_refused(drops: Path) -> None:
    drops.write_text(PICKED.replace('ball = "Golf", drop = 2', 'ball = "Tennis Ball", drop = 1'))
    with pytest.raises(InputError, match="given twice, as train and as test"):
        load_dataset(drops)


@pytest.mark.parametrize("change", [lambda f: f[100:180], lambda f: f.assign(more=1.0), lambda f: f[7:].round(12)])
def test_a_hold_out_made_of_samples_that_are_fitted_is_refused(folder: Path, change) -> None:
    """It has another hash, but has been seen."""
    change(pd.read_csv(folder / "one.csv")).to_csv(folder / "part.csv", index=False)
    with pytest.raises(InputError, match=r"part.csv, from sample \d+ on, repeats readings of .*one.csv"):
        load_dataset(folder / "rig.toml", [folder / "one.csv"], [folder / "part.csv"])


@pytest.mark.parametrize(
    "change",
    [
        lambda f: f[::2],
        lambda f: f[1::3].assign(t=lambda x: x.t - 0.02),
        lambda f: f[40:240:2],
        lambda f: f.sample(frac=0.5, random_state=1).sort_index(),
    ],
)
def test_a_hold_out_with_some_rows_of_what_is_fitted_is_refused_and_so_is_the_reverse(folder: Path, change) -> None:
    change(pd.read_csv(folder / "one.csv")).to_csv(folder / "part.csv", index=False)
    for train, holdout in (("one", "part"), ("part", "one")):
        with pytest.raises(InputError, match=rf"{holdout}.csv, from sample \d+ on, repeats .*{train}.csv"):
            load_dataset(folder / "rig.toml", [folder / f"{train}.csv"], [folder / f"{holdout}.csv"])


@pytest.mark.parametrize("step", [0.002, 0.02, 0.1])
def test_another_trial_in_coarse_steps_is_no_repetition(folder: Path, step: float) -> None:
    for name, every, seed in (("fine.csv", 1, 1), ("rare.csv", 2, 2)):
        frame = pd.read_csv(write(folder, name, seed))[::every]
        frame["y"] = np.round(
            (frame["y"] + 0.1 * step * np.random.default_rng(seed).standard_normal(len(frame))) / step
        )
        frame.assign(y=step * frame["y"]).to_csv(folder / name, index=False)
    assert len(load_dataset(folder / "rig.toml", [folder / "fine.csv"], [folder / "rare.csv"]).holdout) == 1


def test_parts_of_one_file_and_equal_readings_at_rest_are_no_repetition(folder: Path) -> None:
    rest = pd.DataFrame({"t": 0.02 * np.arange(320), "u": np.sin(np.arange(320)), "y": np.zeros(320)})
    for name, sign in (("up.csv", 1), ("down.csv", -1)):
        rest.assign(y=[0.0] * 200 + (sign * np.sin(0.1 * np.arange(120))).tolist()).to_csv(folder / name, index=False)
    assert len(load_dataset(folder / "rig.toml", [folder / "up.csv"], [folder / "down.csv"]).holdout) == 1
    assert len(load_dataset(folder / "records.toml").train) == 2


def test_a_slow_passage_that_two_releases_share_in_coarse_steps_is_no_repetition(folder: Path) -> None:
    step, passage = 0.02, 0.02 * np.arange(40)
    for name, size in (("wide.csv", 3.0), ("narrow.csv", 2.0)):
        swing = size * np.cos(0.05 * np.arange(600))
        values = step * np.round(np.concatenate([swing[:150], passage, swing[150:]]) / step)
        frame = pd.DataFrame({"t": 0.02 * np.arange(640), "u": np.sin(size * np.arange(640)), "y": values})
        frame.to_csv(folder / name, index=False)
    assert len(load_dataset(folder / "rig.toml", [folder / "wide.csv"], [folder / "narrow.csv"]).holdout) == 1


def test_simulated_motions_that_begin_alike_are_no_repetition(folder: Path) -> None:
    time = 0.02 * np.arange(640)
    for name, later in (("slow.csv", 1.0), ("quick.csv", 3.0)):
        push = np.where(time < 0.8, 1.0, np.sin(later * time))
        motion = np.cos(3 * time) + np.where(time < 0.8, 0.0, (1 - np.cos(later * (time - 0.8))) ** 2)
        pd.DataFrame({"t": time, "u": push, "y": motion}).to_csv(folder / name, index=False)
    assert len(load_dataset(folder / "rig.toml", [folder / "slow.csv"], [folder / "quick.csv"]).holdout) == 1


def test_two_signals_of_one_column_are_refused(folder: Path) -> None:
    (folder / "rig.toml").write_text(RIG.replace('name = "y"', 'name = "t"'))
    with pytest.raises(InputError, match="time and output are both read from the column 't'"):
        load_dataset(folder / "rig.toml", [folder / "one.csv"])


def noisy(seed: int, n: int = 320) -> pd.DataFrame:
    """Return a motion whose noise is well above its last digit."""
    t = 0.02 * np.arange(n)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(n)
    return pd.DataFrame({"t": t, "u": np.sin(t), "y": np.cos(3 * t) + noise})


DISGUISES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "a little noise": lambda f: f.assign(y=f.y + 2e-3 * np.random.default_rng(9).standard_normal(len(f))),
    "rounded": lambda f: f.assign(y=f.y.round(2)),
    "a part, later": lambda f: f[100:].assign(t=f.t[: len(f) - 100].to_numpy(), y=f.y[100:] + 1e-3),
}


@pytest.mark.parametrize("change", DISGUISES.values(), ids=DISGUISES)
@pytest.mark.parametrize("role", ["train", "holdout"])
def test_readings_that_were_disguised_are_still_the_same(
    folder: Path, role: str, change: Callable[[pd.DataFrame], pd.DataFrame]
) -> None:
    noisy(1).to_csv(folder / "one.csv", index=False)
    change(noisy(1)).to_csv(folder / "two.csv", index=False)
    given = [folder / "one.csv"], [folder / "two.csv"]
    train, holdout = given if role == "holdout" else ([*given[0], *given[1]], [])
    with pytest.raises(InputError, match=r"two.csv, from sample \d+ on, repeats readings of .*one.csv"):
        load_dataset(folder / "rig.toml", train, holdout)


def test_marks_are_counted_alike_and_copied_only_with_their_times() -> None:
    """A wheel that slows down twice, counted from one on."""

    def wheel(speed: float, rows: slice) -> Recording:
        turns = np.arange(1.0, 161.0)
        passed = ((speed - np.sqrt(speed**2 - 2 * 0.002 * turns)) / 0.002)[rows]
        return Recording(
            "a", passed - passed[0], None, turns[rows, None], ("output",), ("rad",), np.array([1e-6]), "", "a.csv"
        )

    first = wheel(1.2, slice(None))
    assert shared_samples(first, wheel(0.9, slice(None))) is None
    assert shared_samples(first, wheel(1.21, slice(None))) is None  # its times between two marks are 1 % apart
    assert shared_samples(first, wheel(1.2, slice(30, None))) == 0
    assert shared_samples(first, wheel(1.2, slice(0, None, 2))) == 0


def test_the_same_manoeuvre_again_is_no_repetition(folder: Path) -> None:
    for seed, name in ((1, "one.csv"), (2, "two.csv")):
        noisy(seed).to_csv(folder / name, index=False)
    assert len(load_dataset(folder / "rig.toml", [folder / "one.csv"], [folder / "two.csv"]).holdout) == 1


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (320, r"26 of its 320 rows, and at least 30 are needed. Take more rows, by samples"),
        (26, r"one.csv is too short: 26 rows, and at least 30 are needed. Record longer"),
    ],
)
def test_too_few_rows_are_told_beside_those_of_the_file(folder: Path, rows: int, said: str) -> None:
    pd.read_csv(folder / "one.csv")[:rows].to_csv(folder / "one.csv", index=False)
    records = f'[records]\ntrain = [{{ file = "one.csv", samples = [{rows - 26}, {rows}] }}]\n'
    (folder / "records.toml").write_text(RIG + records)
    with pytest.raises(InputError, match=said):
        load_dataset(folder / "records.toml")


@pytest.mark.parametrize("power", [1, -1], ids=["an encoder", "a counter of periods, in uneven steps"])
@pytest.mark.parametrize("size", [0.3, 0.4])
def test_parts_at_one_steady_value_agree_by_chance(folder: Path, size: float, power: int) -> None:
    """More than half of their readings in coarse steps are equal at some shift."""
    steady = np.round(10.35 + size * np.random.default_rng(1).standard_normal(500))
    values = np.concatenate([np.minimum(np.arange(1, 101), steady[:100]), steady]) ** power
    frame = pd.DataFrame({"t": 0.02 * np.arange(600), "u": np.sin(np.arange(600)), "y": values})
    frame.to_csv(folder / "one.csv", index=False)
    parts = '[records]\ntrain = [{ file = "one.csv", samples = [0, 450] }]\n'
    (folder / "records.toml").write_text(RIG + parts + 'holdout = [{ file = "one.csv", samples = [450, 600] }]')
    assert len(load_dataset(folder / "records.toml").holdout) == 1


@pytest.mark.parametrize("parts", ["[0, 200] [120, 320]", "[0, 320] [200, 320]"])
def test_training_parts_that_overlap_are_refused(folder: Path, parts: str) -> None:
    one, other = (f"[{part.strip('[]')}]" for part in parts.split("] ["))
    records = f'[records]\ntrain = [{{ file = "one.csv", samples = {one} }}, {{ file = "one.csv", samples = {other} }}]'
    (folder / "records.toml").write_text(RIG + records)
    with pytest.raises(InputError, match="would count twice"):
        load_dataset(folder / "records.toml")


@pytest.mark.parametrize("scale", [1.0, -2.5])
def test_an_output_that_is_the_input_is_refused(folder: Path, scale: float) -> None:
    frame = noisy(1)
    frame.assign(u=scale * frame.y + 0.3).to_csv(folder / "one.csv", index=False)
    with pytest.raises(InputError, match=r"one.csv: the output is a copy of the input, column 'u'"):
        load_dataset(folder / "rig.toml", [folder / "one.csv"])
