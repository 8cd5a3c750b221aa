"""The Silverbox, a measured circuit: declared linear, it must turn out to have a cubic spring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from measured_data import needs

from discovery.recordings.dataset import Dataset, load_dataset
from discovery.runs.loop import close_loop
from discovery.runs.loop_result import LoopResult

pytestmark = pytest.mark.measured

#: An eighth of what is recorded for training says the same; `make reproduce` fits all of it.
FITTED = 8192
RIG = Path(__file__).parents[1] / "datasets" / "silverbox" / "rig.toml"


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    needs("silverbox")
    return load_dataset(RIG)


@pytest.fixture(scope="module")
def result(dataset: Dataset) -> LoopResult:
    return close_loop([e.first(FITTED) for e in dataset.train], dataset.holdout)


def test_the_parts_are_those_of_the_literature(dataset: Dataset) -> None:
    (train,), (test,) = dataset.train, dataset.holdout
    assert train.recording.time.size == 65062
    assert test.recording.time.size == 21688
    assert 1 / np.diff(train.recording.time).mean() == pytest.approx(1e7 / 2**14)
    assert dataset.rig.declared == ("viscous_damping", "linear_stiffness")


@pytest.mark.slow
def test_the_cubic_spring_is_found_first(result: LoopResult) -> None:
    added = [s for s in result.steps if s.action == "add" and s.accepted]
    assert added[0].effects == ("cubic_stiffness",)
    assert "cubic_stiffness" in result.added
    assert result.named["cubic_stiffness"].odds.total >= 3.0
    assert result.declared == ("viscous_damping", "linear_stiffness")
    # A spring of a circuit is no exact cubic: what it leaves is far below the motion and above the noise.
    assert result.verdict in {"explained", "partly_explained"}


@pytest.mark.slow
def test_the_held_out_multisine_is_predicted_to_a_quarter_of_a_millivolt(result: LoopResult) -> None:
    before, after = result.errors["before"]["holdout"], result.errors["after"]["holdout"]
    assert 6e-3 < before["rms"] < 9e-3
    assert after["rms"] <= 0.245e-3
    assert result.errors["unit"] == "V"


@pytest.mark.slow
def test_the_errors_are_those_of_the_predictions(dataset: Dataset, result: LoopResult) -> None:
    measured = dataset.holdout[0].recording.output
    for when in ("before", "after"):
        error = np.abs(result.predictions[when][1] - measured)
        assert result.errors[when]["holdout"]["rms"] == pytest.approx(np.sqrt(np.mean(error**2)))
        assert result.errors[when]["holdout"]["peak"] == pytest.approx(error.max())


@pytest.mark.slow
def test_the_circuit_is_a_weakly_damped_hard_spring(result: LoopResult) -> None:
    values = result.after.values
    # Small motions resonate near 68 Hz with a damping ratio near 0.05; at half a volt the spring is twice as stiff.
    assert np.sqrt(values["alpha"]) / (2 * np.pi) == pytest.approx(68.3, rel=0.02)
    assert values["xi"] / (2 * np.sqrt(values["alpha"])) == pytest.approx(0.048, abs=0.005)
    assert values["beta"] / values["alpha"] == pytest.approx(4.0, rel=0.15)
    assert result.after.solver_shift < 1.0
