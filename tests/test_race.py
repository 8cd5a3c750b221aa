from __future__ import annotations

import numpy as np
import pytest

from discovery.estimation.batch import Race, is_far_behind
from discovery.estimation.least_squares import Minimum, levenberg_marquardt, minimise


def test_far_behind_is_measured_by_the_excess_over_noise() -> None:
    assert not is_far_behind(1900.0, 1090.0, 1000)
    assert is_far_behind(2001.0, 1090.0, 1000)
    # Where the one ahead leaves noise alone, a tenth of a noise variance a sample counts as its excess.
    assert not is_far_behind(1999.0, 990.0, 1000)
    assert is_far_behind(3100.0, 1200.0, 1000)


def test_nobody_gives_up_before_it_is_warm() -> None:
    race = Race(100)
    ahead, behind = race.enter("a"), race.enter("b")
    assert not ahead(50.0, 9)
    assert not behind(1e6, 4)
    assert behind(1e6, 5)
    assert not ahead(50.0, 10)


def test_of_two_starts_of_one_model_that_meet_the_later_one_gives_up() -> None:
    race = Race(100)
    first, second, other = race.enter("a"), race.enter("a"), race.enter("b")
    assert not first(500.0, 6)
    assert second(500.04, 6)
    assert not other(500.04, 6)
    # Another minimum of the same model may still lead further.
    assert not second(510.0, 7)
    # Whoever is ahead goes on.
    assert not second(490.0, 8)
    assert first(490.0, 8)


def test_of_two_starts_that_are_equal_one_goes_on() -> None:
    race = Race(100)
    first, second = race.enter("a"), race.enter("a")
    assert not first(600.0, 4)
    assert not second(600.0, 4)
    assert not first(600.0, 5)
    assert second(600.0, 5)


def valleys(levels: list[float], *, race: bool) -> list[Minimum]:
    """Minimise narrow bent valleys that end on different levels, 100 residuals each."""

    def residuals(level: float, x: np.ndarray) -> np.ndarray:
        bent = np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])
        return np.vstack([bent, np.full((98, x.shape[1]), level)])

    entries = Race(100)
    requests = [
        levenberg_marquardt(
            np.array([-1.2, 1.0]),
            np.full(2, -np.inf),
            np.full(2, np.inf),
            np.ones(2),
            is_behind=entries.enter(i) if race else None,
        )
        for i, _ in enumerate(levels)
    ]
    return minimise(requests, lambda wanted: [residuals(levels[i], x) for i, x in wanted])


def test_what_is_far_behind_is_not_followed_to_its_minimum_and_what_is_ahead_is_the_same() -> None:
    alone, raced = valleys([1.0, 1.2, 9.0], race=False), valleys([1.0, 1.2, 9.0], race=True)
    for i in (0, 1):
        np.testing.assert_array_equal(alone[i].x, raced[i].x)
        assert raced[i].converged
        assert raced[i].x == pytest.approx([1.0, 1.0], abs=1e-6)
    assert alone[2].converged
    assert not raced[2].converged
    assert raced[2].iterations == 5 < alone[2].iterations


def test_how_far_is_far_can_be_said() -> None:
    assert is_far_behind(3000.0, 1000.0, 1000)
    assert not is_far_behind(3000.0, 1000.0, 1000, 100.0)
    patient = Race(100, 100.0)
    ahead, behind = patient.enter("a"), patient.enter("b")
    assert not ahead(50.0, 9)
    assert not behind(545.0, 9)
    assert behind(555.0, 9)
