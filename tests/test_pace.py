"""Clocks by which all steps are as long."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from discovery.recordings.drive import Drive
from discovery.simulation.grid import Grid, Pace

SHARES = st.lists(st.floats(0.01, 1.0), min_size=1, max_size=20)


@given(SHARES, st.floats(-5.0, 30.0))
def test_a_clock_is_read_both_ways(shares: list[float], when: float) -> None:
    pace = Pace.of(np.linspace(2.0, 9.0, len(shares) + 1), np.array(shares))
    np.testing.assert_allclose(pace.when(pace.shown(np.array([when]))), [when], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(pace.least, min(shares), rtol=1e-9)


def test_a_clock_goes_as_time_does_where_no_pace_is_known() -> None:
    pace = Pace.of(np.array([2.0, 3.0, 5.0]), np.array([0.5, 0.25]))
    np.testing.assert_allclose(pace.shown(np.array([0.0, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0])), [0, 2, 3, 4, 8, 12, 14])


@given(SHARES, st.floats(0.03, 0.6))
def test_no_step_is_longer_than_its_share_and_none_crosses_a_kink(shares: list[float], step: float) -> None:
    edges = np.linspace(0.0, 4.0, len(shares) + 1)
    kinks = np.array([0.7, 1.9, 3.333])
    drive = Drive(np.concatenate([[0.0], kinks, [4.0]]), np.zeros((3, 4)), kinks)
    time = np.linspace(0.0, 4.0, 41)
    grid = Grid.build(time, drive, step, pace=Pace.of(edges, np.array(shares)))
    ends = grid.times + grid.steps
    np.testing.assert_array_equal(ends[:-1], grid.times[1:])
    assert (grid.times[0], ends[-1]) == (0.0, 4.0)
    assert set(kinks) <= set(grid.times)
    np.testing.assert_array_equal(grid.times[grid.restart], [0.0, *kinks])
    # A step that reaches into the next part is as long as its way through both.
    inside = [(max(a, e), min(b, f), s) for a, b in zip(grid.times, ends, strict=True)
              for e, f, s in zip(edges[:-1], edges[1:], shares, strict=True) if min(b, f) > max(a, e)]  # fmt: skip
    assert all(b - a <= s * step * (1 + 1e-9) for a, b, s in inside)
    # Where each output lies.
    np.testing.assert_allclose(grid.times[grid.out_step] + grid.out_fraction * grid.steps[grid.out_step], time)


def test_an_even_pace_is_that_of_shorter_steps() -> None:
    time = np.linspace(0.0, 4.0, 41)
    paced = Grid.build(time, None, 0.1, pace=Pace.of(np.array([0.0, 1.0, 4.0]), np.full(2, 0.5)))
    np.testing.assert_allclose(paced.times, Grid.build(time, None, 0.05).times, atol=1e-12)


@given(SHARES, st.floats(0.03, 0.6))
def test_steps_beyond_the_last_output_change_none_before_it(shares: list[float], step: float) -> None:
    pace, time = Pace.of(np.linspace(0.0, 4.0, len(shares) + 1), np.array(shares)), np.linspace(0.0, 4.0, 41)
    plain, longer = (Grid.build(time, None, step, pace=pace, beyond=share) for share in (0.0, 0.1))
    n = plain.times.size
    np.testing.assert_allclose(longer.times[:n], plain.times, atol=1e-12)
    np.testing.assert_allclose(longer.times[n], 4.0)
    np.testing.assert_allclose(longer.times[-1] + longer.steps[-1], 4.4)
    np.testing.assert_array_equal(longer.out_step, plain.out_step)
