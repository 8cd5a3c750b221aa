"""The rig files of the public measurements: read without the data; with them, and with faults put into them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from discovery_datasets import registry
from measured_data import DATASETS, needs

from discovery.declarations.registry import catalogue
from discovery.foundation.errors import InputError
from discovery.recordings.dataset import Dataset, load_dataset
from discovery.recordings.recording import Recording, read_recording
from discovery.rigs.rig import RecordPart, Rig
from discovery.rigs.rig_file import read_rig

SETS = sorted({name.partition("/")[0] for name in registry.FILES})
RIGS = sorted(str(path.relative_to(DATASETS)) for folder in SETS for path in (DATASETS / folder).glob("rig*.toml"))


def test_every_set_has_rig_files_and_a_card():
    for folder in SETS:
        assert any(rig.startswith(f"{folder}/") for rig in RIGS)
        card = (DATASETS / folder / "CARD.md").read_text()
        for heading in ("What", "Here", "Declared", "Split", "Noise", "Known figures", "Cite", "Licence"):
            assert f"**{heading}.**" in card
        assert card in registry.card(folder)
        assert all(e.sha256 in registry.card(folder) for n, e in registry.FILES.items() if n.startswith(f"{folder}/"))


@pytest.mark.parametrize("name", RIGS)
def test_rig_files_are_complete_and_refer_to_registered_files(name):
    rig = read_rig(DATASETS / name)
    assert set(rig.declared) <= set(catalogue())
    assert rig.records["train"]
    for part in (part for parts in rig.records.values() for part in parts):
        assert registry.registered(part.file).startswith(f"{name.partition('/')[0]}/")


def test_every_registered_recording_is_used():
    used = {registry.registered(p.file) for rig in RIGS for ps in read_rig(DATASETS / rig).records.values() for p in ps}
    assert registry.FILES.keys() - used == {"falling_balls/balls.txt"}


def test_no_ball_is_left_out():
    words = (DATASETS / "falling_balls" / "CARD.md").read_text()
    assert "Eleven" in words
    balls = {read_rig(path).records["train"][0].where[0] for path in (DATASETS / "falling_balls").glob("rig_*.toml")}
    assert len(balls) == 11


def here(part: RecordPart) -> Path:
    return registry.locate(registry.registered(part.file))


def load(name: str) -> Dataset:
    needs(name.partition("/")[0])
    return load_dataset(DATASETS / name)


@pytest.mark.measured
@pytest.mark.parametrize("name", [rig for rig in RIGS if not rig.startswith(("falling", "silverbox"))])
def test_measured_sets_are_read_and_nothing_is_left_out(name):
    dataset = load(name)
    for _, experiment in dataset.everything:
        recording = experiment.recording
        if dataset.rig.view is None:
            # Averages begin where nothing is read.
            read = np.isfinite(recording.output).all(axis=1)
            assert read[1:].all()
            assert read[0] != any(flag.code == "averaged" for flag in recording.flags)
        faults = {"readings_stuck", "readings_clipped", "samples_missing", "times_irregular", "mean_creeps"}
        assert not faults & {flag.code for flag in recording.flags}


@pytest.mark.measured
def test_what_is_known_of_the_instruments():
    small = load("multiarm_pendulum/rig_small.toml").holdout[0].recording
    assert small.noise[0] == pytest.approx(2 * np.pi / 40000 / np.sqrt(12.0), rel=1e-3)
    assert "steps of 0.0001571 rad" in small.notes[0]
    assert abs(np.median(small.output)) < 0.02
    hub = load("rotary_flexible_link/rig_hub.toml").train[0].recording
    assert hub.noise[0] == pytest.approx(2 * np.pi / 4096 / np.sqrt(12.0), rel=1e-3)
    assert any("steps of 1 pixel" in note for note in load("air_track/rig.toml").train[0].recording.notes)
    assert "per sample" in load("robot_arm/rig.toml").train[0].recording.notes[0]


@pytest.mark.measured
def test_the_length_of_the_video_pendulum_is_the_tracked_radius():
    needs("video_pendulum")
    frame = pd.read_csv(registry.locate("video_pendulum/clean_AAAtAmp3.csv"))
    rig = read_rig(DATASETS / "video_pendulum" / "rig.toml")
    assert np.hypot(frame["x_m"], frame["y_m"]).mean() == pytest.approx(rig.length.value, abs=1e-4)


@pytest.mark.measured
def test_the_pulses_of_the_drive_are_what_the_controller_did_not_command():
    needs("emps")
    rig = read_rig(DATASETS / "emps" / "rig_closed_loop.toml")
    (part,) = rig.records["holdout"]
    from discovery.foundation.io import read_table

    table = read_table(here(part))
    q = table.numbers("qm")
    c = rig.controller
    law = c.kv * (c.kp * (table.numbers("qg") - q) - np.gradient(q, 1e-3))
    command, pulses = table.numbers("vir"), table.numbers("pulses_N")
    assert np.std(command - law - pulses) < 0.1 * np.std(command - law)
    reference = read_recording(here(part), rig).input
    np.testing.assert_allclose(c.kv * c.kp * (reference - table.numbers("qg")), pulses, atol=1e-9)


@pytest.mark.measured
def test_balls_fall():
    for name in (rig for rig in RIGS if rig.startswith("falling")):
        dataset = load(name)
        assert dataset.train[0].recording.name.endswith("drop_1")
        assert dataset.holdout[0].recording.name.endswith("drop_2")
        assert 0.01 < dataset.train[0].recording.noise[0] < 0.06


def spoil(tmp_path: Path, rig: Rig, edit) -> Recording:
    """Read the training part of a set with a fault put into it; text files only."""
    needs(rig.path.parent.name)
    (part,) = rig.records["train"]
    assert isinstance(part, RecordPart)
    frame = pd.read_csv(here(part)).iloc[slice(*part.samples)].reset_index(drop=True)
    edit(frame).to_csv(tmp_path / "spoilt.csv", index=False)
    return read_recording(tmp_path / "spoilt.csv", rig)


ANGLE = {"multiarm_pendulum/rig_large.toml": "theta1_rad(pi=hanging)", "video_pendulum/rig.toml": "theta_rad"}
LINK = {"rotary_flexible_link/rig_link.toml": "alpha_deg"}


def hold(column, every):
    def edit(frame):
        frame.loc[600 : 600 + 100 * every, column] = frame.loc[600, column]
        return frame

    return edit


def clip(column, every):
    return lambda f: f.assign(**{column: f[column].clip(upper=f[column].quantile(0.9))})


@pytest.mark.measured
@pytest.mark.parametrize(("name", "column"), [*ANGLE.items(), *LINK.items()])
@pytest.mark.parametrize(("fault", "note"), [(hold, "is stuck for 100 samples"), (clip, "saturates at")])
def test_faults_of_the_sensor_are_found_in_measured_sets(tmp_path, name, column, fault, note):
    rig = read_rig(DATASETS / name)
    recording = spoil(tmp_path, rig, fault(column, rig.columns.every))
    assert note in " ".join(recording.notes)
    assert 50 < np.isnan(recording.output).sum() < 0.3 * recording.time.size


@pytest.mark.measured
@pytest.mark.parametrize(("name", "column"), [*ANGLE.items(), *LINK.items()])
def test_lost_rows_spikes_and_dead_sensors_are_found(tmp_path, name, column):
    rig = read_rig(DATASETS / name)
    lost = spoil(tmp_path, rig, lambda f: f.drop(index=range(500, 500 + 30 * rig.columns.every)))
    assert "30 samples are missing in 1 gap of" in " ".join(lost.notes)

    def jump(frame):
        frame.loc[[335, 775], column] += 3 * frame[column].std()
        return frame

    assert "spikes" in " ".join(spoil(tmp_path, rig, jump).notes)
    with pytest.raises(InputError, match="dead or not connected"):
        spoil(tmp_path, rig, lambda f: f.assign(**{column: 3.0}))


@pytest.mark.measured
@pytest.mark.parametrize(("name", "column"), ANGLE.items())
def test_wrong_units_of_a_pendulum_are_found(tmp_path, name, column):
    rig = read_rig(DATASETS / name)
    with pytest.raises(InputError, match='unit = "deg"'):
        spoil(tmp_path, rig, lambda f: f.assign(**{column: np.degrees(f[column])}))
    with pytest.raises(InputError, match="unit of the time"):
        spoil(tmp_path, rig, lambda f: f.assign(t_s=1e3 * f["t_s"]))


@pytest.mark.measured
def test_times_without_digits_are_those_of_a_steady_clock_or_refused(tmp_path):
    def round_off(frame):
        return frame.assign(t_s=frame["t_s"].round(1))

    logger = read_rig(DATASETS / "multiarm_pendulum" / "rig_large.toml")
    true, found = spoil(tmp_path, logger, lambda f: f), spoil(tmp_path, logger, round_off)
    assert "a steady clock of 200 readings a second explains all" in " ".join(found.notes)
    np.testing.assert_allclose(found.time, true.time, rtol=0.0, atol=1e-9)
    with pytest.raises(InputError, match="Times must strictly increase"):  # frames of a film are not as steady
        spoil(tmp_path, read_rig(DATASETS / "video_pendulum" / "rig.toml"), round_off)


@pytest.mark.measured
def test_a_drifting_instrument_is_found(tmp_path):
    rig = read_rig(DATASETS / "video_pendulum" / "rig.toml")
    drifted = spoil(tmp_path, rig, lambda f: f.assign(theta_rad=f["theta_rad"] + 0.05 * f.index / len(f)))
    (creep,) = re.findall(r"creeps by ([\d.]+) rad", " ".join(drifted.notes))
    assert float(creep) == pytest.approx(0.05, rel=0.1)


@pytest.mark.measured
def test_a_slow_clock_is_noted(tmp_path):
    rig = read_rig(DATASETS / "rotary_flexible_link" / "rig_link.toml")
    assert "2 s apart" in " ".join(spoil(tmp_path, rig, lambda f: f.assign(t_s=1e3 * f["t_s"])).notes)
