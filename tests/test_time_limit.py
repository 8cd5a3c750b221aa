from __future__ import annotations

import signal
import time

import pytest

from discovery.runs.processes import TimeIsUp, time_limit


def test_what_takes_longer_is_interrupted() -> None:
    before, began = signal.getsignal(signal.SIGALRM), time.monotonic()
    with pytest.raises(TimeIsUp), time_limit(0.05):
        time.sleep(30)
    assert time.monotonic() - began < 10
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_what_is_quicker_is_not() -> None:
    with time_limit(60):
        pass
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    with time_limit():
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.parametrize("seconds", [0.0, -3.0])
def test_no_time_is_none_at_all(seconds: float) -> None:
    done = []
    with pytest.raises(TimeIsUp), time_limit(seconds):
        done.append(1)
    assert not done
