"""Stamps that err are told from readings at uneven times."""

from __future__ import annotations

import numpy as np
import pytest

from discovery.diagnosis.stamps import erring_stamps
from discovery.recordings.recording import Recording
from discovery.report.doubt_sentences import caution_sentence

STEP, NOISE = 0.05, 0.01


def swing(time: np.ndarray) -> np.ndarray:
    """Six readings in a period, too few for a polynomial through neighbours."""
    return np.exp(-0.1 * time) * np.cos(2 * np.pi * time / (6 * STEP))


def pair(*, late: float = 0.0, uneven: float = 0.0, lost: bool = False, jitter: float = 0.0, seed: int = 0):
    """Return a recording taken at uneven times, with stamps that err beside, and what a true model leaves of it."""
    rng = np.random.default_rng(seed)
    count = np.delete(np.arange(180), slice(60, 63)) if lost else np.arange(180)
    taken = STEP * count + uneven * rng.standard_normal(count.size)
    time = taken + late * rng.standard_normal(count.size)
    output = swing(taken) + NOISE * rng.standard_normal(count.size)
    recording = Recording(
        "r", time, None, output[:, None], ("output",), ("m",), np.array([NOISE]), "", "r.csv", jitter=jitter
    )
    return recording, (swing(time) - output)[:, None]


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("late", [0.002, 0.007])
def test_stamps_that_err_are_told_with_their_clock_and_size(late: float, lost: bool) -> None:
    found = erring_stamps([pair(late=late, lost=lost)])
    assert found is not None
    assert (found.code, found.about) == ("stamps", "r")
    assert found.numbers["deviation"] == pytest.approx(late, rel=0.15)
    assert found.numbers["step"] == pytest.approx(STEP, rel=1e-3)
    assert "rate_hz = 20" in caution_sentence(found.summary())


@pytest.mark.parametrize("seed", range(20))
def test_right_stamps_at_uneven_times_and_steady_ones_are_not(seed: int) -> None:
    assert erring_stamps([pair(uneven=0.007, seed=seed)]) is None
    assert erring_stamps([pair(seed=seed)]) is None


def test_nothing_is_said_where_the_error_is_stated_or_nothing_is_read() -> None:
    assert erring_stamps([pair(late=0.007, jitter=0.007)]) is None
    recording, left = pair(late=0.007)
    assert erring_stamps([(recording, np.full_like(left, np.nan))]) is None
    assert erring_stamps([]) is None


def test_a_model_that_misses_the_motion_says_nothing_of_the_stamps() -> None:
    recording, left = pair(uneven=0.007)
    assert erring_stamps([(recording, left + 0.3 * np.sin(recording.time)[:, None])]) is None
