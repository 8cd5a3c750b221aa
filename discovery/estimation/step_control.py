"""Step control: a tolerance goes in, simulators come out that keep it, or finer ones, or None where none serves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.problem import NaturalUnits
from discovery.estimation.step import choose_step
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment

__all__ = ["affordable_bench", "finer", "tightened"]

#: Most steps of one recording: dry friction and play would ask for any number.
_MOST_STEPS = 200_000
#: Other mechanics may take so many times the steps: the tip does not feel what rings faster still.
_MORE = 8


def finer(bench: Bench, times: float) -> Bench | None:
    """Return a bench on steps so many times shorter; None where they would be too many."""
    found = bench.finer(times)
    return found if found.cost <= _MOST_STEPS else None


def tightened(bench: Bench, error: float, allowed: float) -> Bench | None:
    """Return a bench whose steps are so short that an error of the steps falls below what is allowed.

    By a factor of four at most at once; None where it is allowed already, or where the steps would be too many.
    """
    if not error > allowed:
        return None
    # The error falls with the fourth power of the step.
    return finer(bench, 1 / max(0.25, 0.8 * (allowed / error) ** 0.25))


def affordable_bench(
    model: Model,
    effects: Sequence[str],
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    *,
    tolerance: float,
    like: Bench,
) -> Bench | None:
    """Return simulators of another base, on as many more steps than a bench as these ask for, up to a limit.

    Parameters
    ----------
    model, effects, experiments, units, values, tolerance
        As for `discovery.estimation.step.choose_step`.
    like : Bench
        Of the base that is known.

    Returns
    -------
    Bench or None
        None where no step that is tried reaches the tolerance.
    """
    shortest = like.duration / min(_MOST_STEPS, _MORE * like.cost)
    try:
        step = choose_step(model, experiments, units, values, tolerance, effects, shortest=shortest)
    except ComputationError:
        return None
    return Bench(model.base, effects, experiments, step)
