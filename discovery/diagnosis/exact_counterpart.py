"""What a simpler model would find if the arm were the exact one: its own errors, in the same manoeuvre."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.declared import RETARDATION
from discovery.estimation.fit import Fit
from discovery.estimation.problem import Problem
from discovery.estimation.step import choose_step
from discovery.recordings.experiment import Experiment

__all__ = ["ExactCounterpart", "exact_counterpart"]

#: Rounds in which the exact arm's parameters are adjusted until the simpler model finds those that it found.
_ROUNDS = 3


@dataclass(frozen=True)
class ExactCounterpart:
    """The exact arm in which a model finds what it found on recordings, and what else it finds there.

    Parameters
    ----------
    arm, found : mapping of str to float
        Parameters of the exact arm, and of the model fitted to it.
    chi2 : float
        Chi-square that the model's own errors leave there, in units of the camera's noise.
    """

    arm: Mapping[str, float]
    found: Mapping[str, float]
    chi2: float


def exact_counterpart(fit: Fit, *, longer: float = 0.0) -> ExactCounterpart:
    """Fit a model on a simpler base to noise-free recordings of the exact arm.

    The exact arm gets the parameters that it shares with the model such that the model, fitted to it, finds the values
    that it found on the recordings; what the exact arm has not, such as beta and gamma, then shows what it should be.

    Parameters
    ----------
    fit : Fit
        On another base than the exact one, of an arm.
    longer : float
        Part by which the exact arm is longer than the model believes.

    Returns
    -------
    ExactCounterpart

    Raises
    ------
    ComputationError
        If no integration step reaches the tolerance.
    """
    bench, units = fit.problem.bench, fit.problem.units
    # What is known within an uncertainty, such as the speed within which friction turns, stays where it was found.
    held = {n: fit.values[n] for n in fit.problem.gaussian if n in fit.problem.free}
    model = replace(fit.model, known={**fit.model.known, **held})
    arm = model.on_base("elastica")
    arm = replace(arm, known={**arm.known, "tau_r": RETARDATION, "length": (1 + longer) * arm.known["length"]})
    wanted = {n: v for n, v in fit.values.items() if "[" in n or n in arm.free}
    step = choose_step(arm, bench.experiments, units, wanted)
    source = Problem(arm, Bench(arm.base, arm.effects, bench.experiments, step), units, {})
    lower, upper = source.bounds
    given = source.start(wanted)
    for _ in range(_ROUNDS):
        recorded = [_recorded(e, c) for e, c in zip(bench.experiments, source.predict(given), strict=True)]
        problem = Problem(model, Bench(bench.base, bench.effects, recorded, bench.step), units, {})
        (minimum,) = fit_problems([problem], [problem.start(fit.values)])
        arm_values = source.named(given)
        found = problem.named(minimum.x)
        given = np.clip(given + [wanted[n] - found[n] for n in source.names], lower, upper)
    return ExactCounterpart(arm_values, found, 2 * minimum.cost)


def _recorded(experiment: Experiment, output: NDArray[np.float64]) -> Experiment:
    """Return the experiment with another output, with the same gaps."""
    old = experiment.recording
    return replace(experiment, recording=replace(old, output=np.where(np.isfinite(old.output), output, np.nan)))
