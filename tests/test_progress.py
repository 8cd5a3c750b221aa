"""What long work tells: sentences with numbers, a time where it is known, one argument everywhere."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator
from typing import Any

import pytest

import discovery
from discovery.foundation import progress
from discovery.foundation.errors import InputError
from discovery.foundation.progress import Counter, Course, Progress, counted, silent, teller


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(300.0, r", about 5 min left, until \d\d:\d\d:\d\d"), (42.4, ", about 42 s left.*"), (0.4, ""), (math.nan, "")],
)
def test_a_time_is_said_where_it_is_known(seconds: float, said: str) -> None:
    told = Progress.counting("sampling", 400.2, 4000, "samples", beside="R-hat 1.020", seconds_left=seconds)
    assert re.fullmatch(r"sampling: 400 of 4000 samples, R-hat 1\.020" + said, told)
    assert (told.done, told.total) == (400.2, 4000)
    assert told.seconds_left == pytest.approx(seconds, nan_ok=True)


def test_what_is_left_takes_as_long_as_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 16.0, 22.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    told: list[Any] = []
    counter = Counter(told.append, "cases", 8, "done")
    counter.told(0)
    counter.told(2)
    counter.told(4, "1 failed")
    assert math.isnan(told[0].seconds_left)
    assert told[0] == "cases: 0 of 8 done"
    assert [t.seconds_left for t in told[1:]] == [18.0, 12.0]
    assert told[2].startswith("cases: 4 of 8 done, 1 failed, about 12 s left, until ")


def test_items_are_counted_before_each() -> None:
    told: list[str] = []
    assert list(counted("ab", told.append, "fitting", "models")) == ["a", "b"]
    assert told == ["fitting: 0 of 2 models", "fitting: 1 of 2 models"]


def test_a_search_says_which_share_of_its_budget_is_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 8.0, 20.0, 24.0])
    monkeypatch.setattr("discovery.foundation.progress.time.monotonic", lambda: next(clock))
    told: list[Any] = []
    course, extended = Course(told.append), []
    course("refitting")
    with course.searching(lambda: len(extended), 7):
        course("screening")
        extended += [1, 2]
        course("refitting pairs")
        # What the third set takes is not what each of two took.
        course("refitting")
    course("comparing")
    two = "2 of at most 7 sets are extended, about 4 s each"
    assert told == ["refitting", "screening", f"refitting pairs; {two}", f"refitting; {two}", "comparing"]
    assert (told[2].done, told[2].total) == (2, 7)
    assert math.isnan(told[2].seconds_left)


def test_nobody_need_be_told() -> None:
    assert teller(None) is silent
    assert teller(print) is print
    with pytest.raises(InputError, match="`progress` is a function of one sentence"):
        teller("yes")  # type: ignore[arg-type]


def public() -> Iterator[tuple[str, inspect.Signature]]:
    """Yield public functions and methods of public classes."""
    for name in discovery.__all__:
        value = getattr(discovery, name)
        if not inspect.isclass(value):
            yield name, inspect.signature(value)
            continue
        for inner, method in inspect.getmembers(value, callable):
            if not inner.startswith("_") and getattr(method, "__module__", "").startswith("discovery"):
                yield f"{name}.{inner}", inspect.signature(method)


OTHER_NAMES = {"rng", "random_state", "generator", "callback", "on_progress", "tell", "verbose", "heard"}


@pytest.mark.parametrize(
    ("name", "signature"), list(public()), ids=lambda given: given if isinstance(given, str) else ""
)
def test_seed_and_progress_have_one_name_one_meaning_and_a_default(name: str, signature: inspect.Signature) -> None:
    found = signature.parameters
    assert not OTHER_NAMES & found.keys(), name
    if "progress" in found:
        assert found["progress"].default is None
        assert found["progress"].annotation == "Tell | None"
    if "seed" in found:
        assert found["seed"].default in (1, None)


def test_long_work_takes_both() -> None:
    for name in ("close_loop", "discover", "run", "sample", "choose_noise", "compare_models"):
        assert {"seed", "progress"} <= inspect.signature(getattr(discovery, name)).parameters.keys(), name
