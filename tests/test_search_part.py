"""Long recordings: effects are searched on a part of them, and the models before and after are fitted to the whole."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import discovery
from discovery.recordings import parts
from discovery.recordings.dataset import Dataset
from discovery.recordings.parts import searched_part, with_flag

BENCH = Path(__file__).parents[1] / "datasets" / "spring_bench" / "rig.toml"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Dataset:
    """Return recordings that are three times as long as a search of them may be."""
    whole = discovery.load_dataset(BENCH)
    rows = sum(e.recording.time.size for e in whole.train)
    monkeypatch.setattr(parts, "SEARCHED", rows // 3)
    monkeypatch.setattr(parts, "_FEWEST", 10)
    return discovery.load_dataset(BENCH)


def test_recordings_that_are_short_are_searched_whole() -> None:
    whole = discovery.load_dataset(BENCH).train
    assert searched_part(whole) == tuple(whole)
    assert [e.recording.flags for e in with_flag(whole)] == [e.recording.flags for e in whole]


def test_the_part_is_the_first_of_each_and_a_note_says_so(bench: Dataset) -> None:
    for whole, part in zip(bench.train, searched_part(bench.train), strict=True):
        count = part.recording.time.size
        assert 0.32 < count / whole.recording.time.size < 0.35
        assert part.recording.time.tolist() == whole.recording.time[:count].tolist()
        if whole.fitted_samples is not None and part.fitted_samples is not None:
            assert part.fitted_samples / count == pytest.approx(
                whole.fitted_samples / whole.recording.time.size, abs=0.01
            )
        assert f"on the first {count} of {whole.recording.time.size} readings" in " ".join(whole.recording.notes)


@pytest.mark.parametrize("fitted", [None, 700])
def test_the_part_holds_motion_where_a_recording_rests_first(bench: Dataset, fitted: int | None) -> None:
    whole = bench.train[0]
    output = np.concatenate([np.zeros((600, 1)), whole.recording.output[:200]])
    late = replace(whole, recording=replace(whole.recording, output=output), fitted_samples=fitted)
    part = searched_part([late, *bench.train[1:]])[0]
    assert part.recording.time.size < 800
    assert np.ptp(part.recording.output[part.fitted]) > 0.0


def test_the_answer_is_fitted_to_the_whole(bench: Dataset) -> None:
    found = discovery.close_loop(bench)
    assert found.verdict == "explained"
    assert found.added == ("coulomb_friction",)
    for fitted, predicted in ((found.before, found.predictions["before"]), (found.after, found.predictions["after"])):
        assert [e.recording.time.size for e in fitted.problem.bench.experiments] == [
            e.recording.time.size for e in bench.train
        ]
        assert len(predicted[0]) == bench.train[0].recording.time.size
    # The simulated friction is 0.06 N on 0.5 kg, and twice the readings tell it better than half of them.
    assert found.after.values["f_c"] == pytest.approx(0.12, rel=0.01)
    assert found.after.sd["f_c"] < 0.01 * 0.12
    assert found.errors["after"]["holdout"]["rms"] < 1.2 * found.errors["noise_floor"]
