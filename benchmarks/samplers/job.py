"""The job of all samplers: 3001 readings of the arm's deflection, and the paper's equation of the angle.

The hub turns by 1 rad in 1.2 s; delta = theta_t - theta_m starts at rest and follows
delta'' = -theta_m'' - xi delta' - alpha delta - beta delta^3. The truth is integrated by scipy, with noise added.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from arviz_stats.base import array_stats
from scipy.integrate import solve_ivp

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.covariance import covariance_of, solver_shift
from discovery.estimation.fit import Fit, fit
from discovery.estimation.problem import Problem
from discovery.posterior.likelihood import LogPosterior, log_posterior
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

NAMES = ("xi", "alpha", "beta", "log sigma")
TRUTH = {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139}
NOISE = 1e-3  # rad
TIME = np.linspace(0.0, 30.0, 3001)  # s
START, LENGTH = 0.5, 1.2  # s
EFFECTS = ("viscous_damping", "linear_stiffness", "cubic_stiffness")


def hub_acceleration(t, xp=np):
    """Return theta_m'' [rad/s^2] of a turn by 1 rad with a smooth profile of fifth order."""
    s = xp.clip((t - START) / LENGTH, 0.0, 1.0)
    return 60 * s * (1 - s) * (1 - 2 * s) / LENGTH**2


class Hub:
    """The motion of the hub."""

    kinks = np.array([START, START + LENGTH])

    def evaluate(self, time, side="right"):
        t = np.asarray(time, float)
        s = np.clip((t - START) / LENGTH, 0.0, 1.0)
        return np.array([s**3 * (10 - 15 * s + 6 * s**2), 30 * (s * (1 - s)) ** 2 / LENGTH, hub_acceleration(t)])


def slope(t, y, xi, alpha, beta):
    """Return the derivative of (delta, delta')."""
    return y[1], -hub_acceleration(t) - xi * y[1] - alpha * y[0] - beta * y[0] ** 3


def truth() -> np.ndarray:
    """Return the deflection without noise, restarted where the hub's acceleration has a kink."""
    out, y = np.zeros(TIME.size), [0.0, 0.0]
    for first, last in pairwise([0.0, *Hub.kinks, TIME[-1]]):
        inside = (first <= TIME) & (last >= TIME)
        path = solve_ivp(
            slope, (first, last), y, "DOP853", rtol=1e-12, atol=1e-12, args=TRUTH.values(), dense_output=True
        )
        out[inside], y = path.sol(TIME[inside])[0], path.y[:, -1]
    return out


class FromRest(Problem):
    """A problem whose initial state is known: at rest, without deflection."""

    @property
    def states(self):
        """Return nothing that is free of a recording."""
        return ()


@dataclass(frozen=True)
class Job:
    """The readings [rad], their fit, and the log posterior in coordinates whitened by it."""

    readings: np.ndarray
    fitted: Fit
    target: LogPosterior

    def parameters(self, z: np.ndarray) -> np.ndarray:
        """Return xi, alpha, beta and log sigma (..., 4) of whitened coordinates (..., 4), which all samplers see."""
        values = self.target.vectors(z)
        values[..., 3] += np.log(NOISE)
        return values

    def scaled(self, z: np.ndarray) -> np.ndarray:
        """Return (parameters - fit) / sd of whitened coordinates (..., 4)."""
        return (self.target.vectors(z) - self.target.centre) / np.linalg.norm(self.target.factor, axis=1)

    def log_density(self, values: np.ndarray, deflection: np.ndarray) -> float:
        """Return the log posterior of one set with the deflection that it gives; its priors are flat."""
        misfit = self.readings - deflection
        return -0.5 * float(misfit @ misfit) * np.exp(-2 * values[3]) - TIME.size * values[3]


def make_job(seed: int = 1) -> Job:
    """Simulate and fit."""
    readings = truth() + NOISE * np.random.default_rng(seed).standard_normal(TIME.size)
    recording = Recording(
        "turn",
        TIME,
        Hub().evaluate(TIME)[0],
        readings[:, None],
        ("output",),
        ("rad",),
        np.array([NOISE]),
        "",
        "simulated by scipy",
    )
    experiment = Experiment(recording, Hub(), Rig("arm seen from its hub", "base_excited", declared=EFFECTS))
    free = fit(Model("base_excited", EFFECTS, {"p": 1.0}), [experiment])
    problem = FromRest(free.problem.model, free.problem.bench, free.problem.units, {})
    (minimum,) = fit_problems([problem], [problem.start(free.values)])
    covariance, reasons, directions = covariance_of(problem, minimum)
    shift = solver_shift(problem, minimum, covariance)
    fitted = Fit(problem, minimum, covariance, reasons, directions, shift)
    return Job(readings, fitted, log_posterior(fitted))


@dataclass(frozen=True)
class Result:
    """What a sampler achieved.

    Parameters
    ----------
    name : str
    seconds : float
        Sampling with burn-in, without compilation.
    kept : ndarray, shape (chains, draws, 4)
        After burn-in: (parameters - fit) / sd.
    evaluations : int
        Of the log density or its gradient.
    effective : ndarray, shape (4,)
        Bulk effective samples.
    note : str
        What a reader has to know.
    figures : dict
        More numbers.
    """

    name: str
    seconds: float
    kept: np.ndarray
    evaluations: int
    effective: np.ndarray
    note: str = ""
    figures: dict = field(default_factory=dict)


def bulk_effective(kept: np.ndarray) -> np.ndarray:
    """Return arviz's bulk effective samples of draws (chains, draws, 4)."""
    return np.asarray(array_stats.ess(np.moveaxis(kept, -1, 0), chain_axis=1, draw_axis=2, method="bulk"))
