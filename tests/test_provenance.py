from __future__ import annotations

import hashlib
import json
import math
import subprocess
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.recordings.dataset import Dataset, load_dataset
from discovery.results import provenance as module
from discovery.results.provenance import plain, provenance, read_json, restored, write_json

ARM = Path(__file__).parents[1] / "datasets" / "arm"


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return load_dataset(ARM / "rig.toml", [ARM / "train_paper.csv"], [ARM / "holdout_inside.csv"])


# The record.


def test_hashes_are_those_of_the_files(dataset: Dataset) -> None:
    found = provenance(dataset, seed=7)
    assert found["seed"] == 7
    assert found["rig_sha256"] == hashlib.sha256((ARM / "rig.toml").read_bytes()).hexdigest()
    for entry, (role, name) in zip(
        found["data"], (("train", "train_paper"), ("holdout", "holdout_inside")), strict=True
    ):
        assert entry["role"] == role
        assert entry["name"] == name
        assert entry["source"] == f"{name}.csv"
        assert entry["sha256"] == hashlib.sha256((ARM / f"{name}.csv").read_bytes()).hexdigest()


def test_versions_are_those_installed(dataset: Dataset) -> None:
    found = provenance(dataset, seed=1)["versions"]
    for package in ("numpy", "scipy", "numba", "emcee"):
        assert found[package] == version(package)


@pytest.fixture
def afresh() -> Iterator[None]:
    """The revision is looked up anew, and again after the test."""
    module.git_revision.cache_clear()
    yield
    module.git_revision.cache_clear()


def test_a_package_that_is_absent_is_said(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_PACKAGES", ("numpy", "no-such-package"))
    assert provenance(dataset, seed=1)["versions"]["no-such-package"] == "not installed"


def test_the_command_names_no_folder_of_this_machine(dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    command = [str(tmp_path / "bin" / "discovery"), "run", str(tmp_path / "rig.toml"), "--seed", "3"]
    assert provenance(dataset, seed=3, command=command)["command"] == "discovery run rig.toml --seed 3"
    assert str(tmp_path) not in json.dumps(provenance(dataset, seed=3, command=command))
    assert provenance(dataset, seed=3, command=[])["command"] == ""


@pytest.mark.usefixtures("afresh")
def test_outside_a_repository_there_is_no_revision(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise subprocess.CalledProcessError(128, "git")

    monkeypatch.setattr(subprocess, "run", fail)
    assert provenance(dataset, seed=1)["git_revision"] is None


# Plain data.


def test_arrays_and_numbers_become_what_json_knows() -> None:
    found = plain({1: np.float64(2.5), "a": np.array([1, 2]), "b": (np.bool_(True), np.nan), "c": {"d": -math.inf}})
    assert found == {"1": 2.5, "a": [1, 2], "b": [True, None], "c": {"d": "-Infinity"}}
    assert type(found["b"][0]) is bool
    assert type(found["a"][0]) is int


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(VALUES)
def test_everything_plain_survives_json(value: object) -> None:
    once = plain(value)
    assert json.loads(json.dumps(once, allow_nan=False)) == once
    assert plain(restored(once)) == once


# Writing.


@given(st.lists(st.floats(), max_size=5))
def test_infinite_numbers_are_read_as_they_were_written(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[float]
) -> None:
    path = tmp_path_factory.mktemp("x") / "x.json"
    write_json(path, {"deep": [{"numbers": numbers}]})
    assert read_json(path) == {"deep": [{"numbers": [None if math.isnan(x) else x for x in numbers]}]}
    json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)


def test_numbers_are_written_in_full(tmp_path: Path) -> None:
    write_json(tmp_path / "deep" / "x.json", {"third": 1 / 3, "list": np.array([0.1, np.nan])})
    assert json.loads((tmp_path / "deep" / "x.json").read_text(encoding="utf-8")) == {
        "third": 1 / 3,
        "list": [0.1, None],
    }


def test_a_failed_write_leaves_the_old_content_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    write_json(path, {"a": 1})
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["x.json"]
