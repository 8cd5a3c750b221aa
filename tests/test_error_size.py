"""The model error of the recordings held out counts in their own noise."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pushed_oscillator import DECLARED, NOISE, RIG, pushes, recorded

from discovery.runs.loop import close_loop


@pytest.mark.parametrize("quieter", [1.0, 10.0])
def test_a_hold_out_with_less_noise_is_missed_by_no_more_than_it_is(quieter: float) -> None:
    rig = replace(RIG, declared=DECLARED)
    train = recorded("train", pushes(1.0, -1.5, 0.7, 0.0), 1)
    # Stiffer than in training: no law of one system holds in both.
    other = recorded("other", pushes(1.2, -0.8, 0.4, 0.0), 2, alpha=9.3)
    own = replace(other.recording, noise=other.recording.noise / quieter)
    result = close_loop([replace(train, rig=rig)], [replace(other, recording=own, rig=rig)])
    missed = result.errors["after"]["holdout"]["rms"]
    assert missed > 5 * NOISE
    assert 0.5 * missed < result.model_error.held < 1.5 * missed
