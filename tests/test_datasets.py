"""The committed recordings, the words on their cards, and the registry of public measurements."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tomllib
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from discovery_datasets import registry
from discovery_datasets.generate import generate, main
from discovery_datasets.recordings import ARMS, CONTENTS, MANOEUVRES, SEED, make_recording, make_set, set_seed
from discovery_datasets.registry import FILES, DataUnavailable, MeasuredFile
from discovery_datasets.twin import PAPER_RIG

DATASETS = Path(__file__).parents[1] / "datasets"
LAST_DIGIT = 1e-6


def read(arm, name):
    return pd.read_csv(DATASETS / arm / f"{name}.csv")


def largest_deflection(arm, name):
    frame = read(arm, name)
    angle = np.arctan2(frame["tip_y_m"], frame["tip_x_m"]) - frame["motor_angle_rad"]
    return np.abs(np.angle(np.exp(1j * angle))).max()


# --- the recordings of the twin


@pytest.mark.parametrize("arm", ARMS)
def test_a_set_holds_its_recordings_and_nothing_else(arm):
    expected = {f"{name}.csv" for name in CONTENTS[arm]}
    expected |= {f"{name}_clean.csv" for name in CONTENTS[arm] if name.startswith("holdout")}
    assert {path.name for path in (DATASETS / arm).iterdir()} == expected | {"rig.toml", "CARD.md"}


@pytest.mark.parametrize(("arm", "name"), [(arm, name) for arm in ARMS for name in CONTENTS[arm]])
def test_recordings_are_25_s_at_100_hz_and_begin_at_rest(arm, name):
    frame = read(arm, name)
    assert list(frame) == ["time_s", "motor_angle_rad", "tip_x_m", "tip_y_m"]
    np.testing.assert_allclose(frame["time_s"], np.arange(2501) / 100, atol=1e-12)
    before = frame[frame["time_s"] < 0.5]
    assert before["motor_angle_rad"].abs().max() <= 7e-5 + LAST_DIGIT
    assert before[["tip_x_m", "tip_y_m"]].std().max() < 5e-4


def test_manoeuvres_reach_the_deflections_they_are_defined_by():
    reached = {name: largest_deflection("arm", name) for name in MANOEUVRES}
    assert reached["train_paper"] == pytest.approx(0.69, abs=0.01)
    assert 0.80 <= reached["train_large"] <= 0.85
    assert 0.6 <= reached["holdout_inside"] <= 0.95 * reached["train_large"]
    assert 1.15 <= reached["holdout_beyond"] / reached["train_large"] <= 1.25


@pytest.mark.parametrize("name", ["holdout_inside", "holdout_beyond"])
def test_noise_of_the_hold_outs_is_the_stated_one(name):
    noisy, clean = read("arm", name), read("arm", f"{name}_clean")
    np.testing.assert_allclose((noisy - clean)[["tip_x_m", "tip_y_m"]].std(), 3e-4, rtol=0.05)
    distance = np.hypot(noisy["tip_x_m"] - clean["tip_x_m"], noisy["tip_y_m"] - clean["tip_y_m"])
    assert distance.mean() == pytest.approx(3e-4 * np.sqrt(np.pi / 2), rel=0.03)
    assert (noisy - clean)["motor_angle_rad"].abs().max() <= 7e-5 + LAST_DIGIT


def test_hidden_effects_are_seen_and_differ_between_sets():
    clean = {arm: read(arm, "holdout_inside_clean")[["tip_x_m", "tip_y_m"]].to_numpy() for arm in ARMS}
    for arm in ARMS:
        others = [np.sqrt(((clean[arm] - clean[other]) ** 2).mean()) for other in ARMS if other != arm]
        assert min(others) > 5 * 3e-4


def test_seeds_are_distinct():
    seeds = {tuple(set_seed(arm, name)) for arm in ARMS for name in CONTENTS[arm]}
    assert len(seeds) == sum(map(len, CONTENTS.values()))


@pytest.mark.slow
def test_regenerated_recordings_have_the_committed_digits():
    made = make_recording("train_large", set_seed("arm_tilt", "train_large"), disturbances=ARMS["arm_tilt"])
    committed = read("arm_tilt", "train_large")
    np.testing.assert_allclose(made.to_numpy(), committed.to_numpy(), atol=1.5 * LAST_DIGIT, rtol=0)


@pytest.mark.slow
@pytest.mark.parametrize("arm", ARMS)
def test_every_regenerated_recording_has_the_committed_digits(arm):
    for stem, frame in make_set(arm).items():
        np.testing.assert_allclose(frame.to_numpy(), read(arm, stem).to_numpy(), atol=1.5 * LAST_DIGIT, rtol=0)


def test_generate_writes_the_named_sets_only(tmp_path, monkeypatch, capsys):
    frame = read("arm", "train_paper").head(3)
    monkeypatch.setattr("discovery_datasets.generate.make_set", lambda arm: {"train_paper": frame})
    assert generate(tmp_path, ["arm_delay"]) == [tmp_path / "arm_delay" / "train_paper.csv"]
    committed = (DATASETS / "arm" / "train_paper.csv").read_text().splitlines()
    assert (tmp_path / "arm_delay" / "train_paper.csv").read_text().splitlines() == committed[:4]
    with pytest.raises(SystemExit):
        main([str(tmp_path), "arm_unknown"])
    assert "unknown set 'arm_unknown'" in capsys.readouterr().err


@pytest.mark.parametrize("arm", ARMS)
def test_rig_files_describe_the_arm_that_was_simulated(arm):
    rig = tomllib.loads((DATASETS / arm / "rig.toml").read_text())
    assert rig["length_m"] == PAPER_RIG.length
    assert rig["tip_mass_kg"] == PAPER_RIG.tip_mass
    assert rig["beam_mass_kg"] == PAPER_RIG.beam_mass
    assert rig["flexural_rigidity_N_m2"] == pytest.approx(PAPER_RIG.flexural_rigidity, rel=1e-9)
    assert (rig["position_noise_m"], rig["angle_noise_rad"]) == (3e-4, 7e-5)


@pytest.mark.parametrize("arm", ARMS)
def test_cards_state_seed_and_truth(arm):
    card = (DATASETS / arm / "CARD.md").read_text()
    assert str(SEED) in card
    assert "Licence" in card
    for effect in ARMS[arm]:
        assert effect.id in card
        for name, value in asdict(effect).items():
            assert f"{name} = {value:g}" in card


def test_the_twin_imports_nothing_of_the_package_it_tests():
    command = (
        "import sys, pkgutil, importlib, discovery_datasets as d\n"
        "[importlib.import_module(m.name) for m in pkgutil.iter_modules(d.__path__, 'discovery_datasets.')]\n"
        "sys.exit(int(any(m == 'discovery' or m.startswith('discovery.') for m in sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", command], check=False).returncode == 0


# --- the registry of public measurements


@pytest.fixture
def no_data(tmp_path, monkeypatch):
    """Nothing here: neither a named folder nor a cache."""
    monkeypatch.delenv(registry.VARIABLE, raising=False)
    monkeypatch.setattr(registry, "cache_folder", lambda: tmp_path / "cache")
    return tmp_path


@pytest.fixture
def toy(no_data, monkeypatch):
    """Registry of one small file, its content in a named folder."""
    content = b"1 2 3\n"
    entry = MeasuredFile(
        name="toy/toy.dat",
        repository="someone/something",
        commit="0" * 40,
        path="toy.dat",
        sha256=hashlib.sha256(content).hexdigest(),
        measured="three numbers",
        citation="nobody",
        licence="MIT",
    )
    monkeypatch.setattr(registry, "FILES", {entry.name: entry})
    path = no_data / "data" / entry.name
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    return path


def test_entries_are_complete():
    assert len(FILES) == 27
    for name, entry in FILES.items():
        assert entry.name == name
        assert len(bytes.fromhex(entry.sha256)) == 32
        assert entry.citation
        assert entry.licence
        assert entry.measured
        at = f"{entry.repository}/{entry.commit}/{entry.path.replace(' ', '%20')}"
        assert entry.url == f"https://raw.githubusercontent.com/{at}"
        assert len(entry.commit) == 40 or entry.derived


def test_an_absent_file_is_said_to_be_absent_with_the_remedy(no_data):
    assert {state.state for state in registry.check()} == {"absent"}
    with pytest.raises(DataUnavailable, match=r"no copy.*Set DISCOVERY_DATA.*discovery data fetch silverbox/SNLS80mV"):
        registry.locate("SNLS80mV.mat")


def test_an_unknown_name_lists_the_known_ones(no_data):
    for search in (registry.locate, registry.fetch, registry.state_of):
        with pytest.raises(DataUnavailable, match=r"registered as 'nothing\.mat'; known are silverbox/SNLS80mV\.mat"):
            search("nothing.mat")


def test_a_file_is_found_in_the_named_folder_then_in_the_cache(toy, no_data, monkeypatch):
    monkeypatch.setenv(registry.VARIABLE, str(no_data / "data"))
    assert registry.locate("toy.dat") == registry.fetch("toy/toy.dat") == toy
    cached = no_data / "cache" / "toy" / "toy.dat"
    cached.parent.mkdir(parents=True)
    toy.rename(cached)
    assert registry.locate("toy.dat") == cached
    assert registry.check()[0].state == "ok"


def test_a_file_is_found_in_every_named_folder(toy, no_data, monkeypatch):
    monkeypatch.setenv(registry.VARIABLE, os.pathsep.join(map(str, (no_data / "other", no_data / "data"))))
    assert registry.locate("toy/toy.dat") == toy
    # The first sound copy wins over one that is not.
    altered = no_data / "other" / "toy" / "toy.dat"
    altered.parent.mkdir(parents=True)
    altered.write_bytes(b"1 2 4\n")
    assert registry.locate("toy/toy.dat") == toy
    toy.unlink()
    assert registry.state_of("toy/toy.dat") == registry.FileState("toy/toy.dat", "altered", altered)


def test_a_name_that_several_sets_have_takes_its_folder(no_data):
    with pytest.raises(DataUnavailable, match=r"balloon_globo_chico/drop\.csv and balloon_globo_mediano/drop\.csv"):
        registry.locate("drop.csv")
    assert registry.entry_of("balloon_globo_mediano/drop.csv").name == "balloon_globo_mediano/drop.csv"
    assert registry.registered(no_data / "balloon_globo_chico" / "drop.csv") == "balloon_globo_chico/drop.csv"
    assert registry.registered(Path("drop.csv")) is None


def test_make_finds_the_circuit_in_any_named_folder(no_data):
    file = no_data / "two of them" / "silverbox" / "SNLS80mV.mat"
    file.parent.mkdir(parents=True)
    file.touch()
    # A make around the tests would hand its own variables down.
    outside = {n: v for n, v in os.environ.items() if not n.startswith(("MAKE", "MFLAGS"))}
    named = {"DISCOVERY_DATA": f"{no_data / 'one'}:{no_data / 'two of them'}", "XDG_CACHE_HOME": str(no_data)}
    for folders, found in ((named, "silverbox"), ({**named, "DISCOVERY_DATA": ""}, "")):
        said = subprocess.run(
            ["make", "-pn", "help"], cwd=DATASETS.parent, env=outside | folders | {"HOME": str(no_data)}, text=True,
            capture_output=True, check=False,
        ).stdout  # fmt: skip
        assert f"\nSILVERBOX := {found}\n" in said


def test_an_altered_file_is_refused(toy, no_data, monkeypatch):
    monkeypatch.setenv(registry.VARIABLE, str(no_data / "data"))
    toy.write_bytes(b"1 2 4\n")
    assert registry.check()[0].state == "altered"
    with pytest.raises(DataUnavailable, match="another SHA-256"):
        registry.locate("toy.dat")


def test_fetching_without_a_network_says_so(no_data, monkeypatch):
    def no_network(*_, **__):
        raise OSError("no route to host")

    monkeypatch.setattr("pooch.retrieve", no_network)
    with pytest.raises(DataUnavailable, match=r"could not be fetched from https://raw.*no route to host.*DISC"):
        registry.fetch("silverbox/SNLS80mV.mat")


def test_fetching_downloads_to_the_cache_and_checks_the_hash(toy, no_data, monkeypatch):
    monkeypatch.setattr(MeasuredFile, "url", property(lambda self: toy.as_uri()))
    monkeypatch.setattr("pooch.retrieve", copying(toy))
    assert registry.fetch("toy.dat") == no_data / "cache" / "toy" / "toy.dat"
    assert registry.locate("toy.dat").read_bytes() == b"1 2 3\n"


def copying(source):
    """Stand-in for a download that obeys the same contract: target folder, name and hash."""

    def retrieve(url, known_hash, fname, path, downloader):
        assert url == source.as_uri()
        content = source.read_bytes()
        if f"sha256:{hashlib.sha256(content).hexdigest()}" != known_hash:
            raise ValueError("hash mismatch")
        path.mkdir(parents=True, exist_ok=True)
        (path / fname).write_bytes(content)

    return retrieve


def test_a_download_has_an_end(tmp_path, monkeypatch):
    class Downloader:
        def __init__(self, timeout):
            assert timeout > 0

        def __call__(self, url, output_file, _):
            for _ in range(int(url)):
                output_file.write(b"x")

    monkeypatch.setattr("pooch.HTTPDownloader", Downloader)
    monkeypatch.setattr(registry, "LARGEST", 10)
    registry._download("10", tmp_path / "x", None)
    assert (tmp_path / "x").read_bytes() == b"x" * 10
    with pytest.raises(ValueError, match="larger than"):
        registry._download("11", tmp_path / "y", None)
    assert (tmp_path / "y").stat().st_size == 10


def test_a_download_that_is_not_the_registered_file_is_refused(toy, monkeypatch):
    monkeypatch.setattr(MeasuredFile, "url", property(lambda self: toy.as_uri()))
    monkeypatch.setattr("pooch.retrieve", copying(toy))
    toy.write_bytes(b"<html>not found</html>")
    with pytest.raises(DataUnavailable, match="hash mismatch"):
        registry.fetch("toy.dat")


def test_a_derived_file_is_not_fetched_but_its_origin_told(no_data):
    with pytest.raises(DataUnavailable, match=r"derived \(.*10 kHz to 1 kHz.*dynamicslab/MultiArm-Pendulum at e99a7e1"):
        registry.fetch("clean_single_largeswing_1kHz.csv")


@pytest.mark.measured
@pytest.mark.parametrize("folder", sorted({name.partition("/")[0] for name in FILES}))
def test_the_measured_data_here_are_the_registered_ones(folder):
    states = [state for state in registry.check() if state.name.startswith(f"{folder}/")]
    if {state.state for state in states} == {"absent"}:
        pytest.skip(f"{folder} is not here; set {registry.VARIABLE} to the folder that holds it")
    assert [state.name for state in states if state.state != "ok"] == []


def test_a_card_tells_the_origin_of_every_file_of_its_set(no_data):
    for name in ("emps", "DATA_EMPS.mat"):
        card = registry.card(name)
        assert card.startswith("# EMPS (measured)")
        assert all(
            entry.url in card and entry.sha256 in card for key, entry in FILES.items() if key.startswith("emps/")
        )
    with pytest.raises(DataUnavailable, match="registered as 'nothing'"):
        registry.card("nothing")


def test_no_measured_data_lie_in_the_repository():
    hashes = {entry.sha256 for entry in FILES.values()}
    assert not [
        path for path in DATASETS.rglob("*")
        if path.is_file() and (registry.registered(path) or hashlib.sha256(path.read_bytes()).hexdigest() in hashes)
    ]  # fmt: skip
