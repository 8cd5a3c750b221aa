"""Random manoeuvres of the twin, fitted by an incomplete and by a complete model, with naive and with honest intervals.

The twin is a geometrically exact beam; the paper's model is not, so its parameters have no true values. What least
squares finds instead, the pseudo-true value, depends on the deflections that the manoeuvres reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from discovery_datasets.manoeuvres import Manoeuvre, trapezoid
from discovery_datasets.quick import readings
from discovery_datasets.twin import PAPER_RIG
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.stats import norm, t

from benchmarks.calibration.pooled import pooled
from benchmarks.calibration.studies import PAPER
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.declared import rig_uncertainty
from discovery.estimation.fit import Fit, fit
from discovery.estimation.problem import known_values
from discovery.posterior.likelihood import log_posterior
from discovery.posterior.marginal_likelihood import log_evidence
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Quantity, Rig
from discovery.theory.prediction import predict

FloatArray = NDArray[np.float64]
ARM = replace(PAPER_RIG, retardation=1.5e-4)
NOISE, ANGLE_NOISE = 3e-4, 7e-5  # m per axis; half width [rad]
TIME = np.arange(501) / 50.0
GROUP = 6  # manoeuvres that are fitted together
LEVEL = 0.9
DISTRIBUTION = (
    "one trapezoidal move of the motor from rest, by 0.6 to 1.2 rad to either side at 0.8 to 1.4 rad/s with ramps of "
    "10 to 30 % of its duration, all uniform; 10 s at 50 Hz, fresh noise of 0.3 mm per axis"
)
#: Base and effects by model.
MODELS = {
    "paper": ("constant_radius", PAPER, "the paper's model (constant radius, cubic spring): incomplete"),
    "exact": ("elastica", ("viscous_damping", "linear_stiffness"), "the exact arm: complete"),
}
#: Parameters that are compared with the targets.
SHOWN = {"paper": ("alpha", "beta", "gamma"), "exact": ("alpha", "xi", "mu")}


@dataclass(frozen=True)
class Move:
    """One manoeuvre: angle [rad], rate [rad/s], ramps as a part of the duration."""

    angle: float
    rate: float
    ramp: float

    @property
    def manoeuvre(self) -> Manoeuvre:
        """The motion of the motor."""
        return trapezoid(self.angle, self.rate, ramp=self.ramp)


def drawn_move(rng: Generator) -> Move:
    """Draw from `DISTRIBUTION`."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    return Move(sign * rng.uniform(0.6, 1.2), rng.uniform(0.8, 1.4), rng.uniform(0.1, 0.3))


def stated_rig(relative: float = 1.0) -> Rig:
    """Return what the experimenter states; `relative` scales the uncertainties."""
    sizes = {"length": 1e-3, "tip_mass": 5e-3, "beam_mass": 2e-2, "flexural_rigidity": 5e-2}
    stated = {n: Quantity(getattr(ARM, n), relative * sd * getattr(ARM, n)) for n, sd in sizes.items()}
    return Rig("arm", **stated, position_noise=NOISE, angle_noise=ANGLE_NOISE)


def recorded(move: Move, rng: Generator | None) -> Experiment:
    """Return the twin's recording of a manoeuvre; free of noise without a generator."""
    seen = readings(ARM, move.manoeuvre, TIME)
    tip = np.column_stack([seen.reading_x, seen.reading_y])
    motor = seen.motor_angle
    if rng is not None:
        tip = tip + NOISE * rng.standard_normal(tip.shape)
        motor = motor + rng.uniform(-ANGLE_NOISE, ANGLE_NOISE, motor.size)
    name = f"{move.angle:+.3f}"
    recording = Recording(name, TIME, motor, tip, ("tip_x", "tip_y"), ("m", "m"), np.full(2, NOISE), name, "")
    return make_experiment(recording, stated_rig())


def fitted(model: str, experiment: Experiment) -> Fit:
    """Fit one recording."""
    base, effects, _ = MODELS[model]
    gaussian = rig_uncertainty(experiment) if base == "elastica" else {}
    start = {"alpha": 8.1, "xi": 0.046}
    tolerance = 2e-5 if base == "elastica" else 1e-6
    made = Model(base, effects, known_values(experiment))
    return fit(made, [experiment], start=start, gaussian=gaussian, tolerance=tolerance)


def _around(value: float, sd: float, quantile: float) -> list[float]:
    return [value - quantile * sd, value + quantile * sd]


def intervals(found: Fit, rng: Generator) -> dict[str, dict[str, list[float]]]:
    """Return 90 % intervals by method and parameter: independent residuals, their spectrum, correlated noise."""
    free = found.problem.free
    quantile = float(norm.ppf(0.5 + LEVEL / 2))
    white = log_posterior(found)
    naive = np.linalg.norm(white.factor, axis=1)
    correlated = log_evidence(log_posterior(found, "correlated"), rng, 1000).intervals()
    return {
        "independent": {n: _around(found.values[n], float(naive[k]), quantile) for k, n in enumerate(free)},
        "spectrum": {n: _around(found.values[n], found.sd[n], quantile) for n in free},
        "correlated noise": {n: [correlated[n][0], correlated[n][2]] for n in free},
    }


def together(fits: Sequence[Fit]) -> dict[str, dict[str, list[float]]]:
    """Return 90 % intervals of the common fit of several manoeuvres: naive, from how they differ, the wider of both.

    Of a few manoeuvres, two or three may decide a parameter: their scatter alone then says too little of it.
    """
    free = fits[0].problem.free
    common = pooled([f.problem for f in fits], [f.minimum.x for f in fits])
    quantiles = {
        "together, independent": (common.naive, float(norm.ppf(0.5 + LEVEL / 2))),
        "together, by manoeuvre": (common.clustered, float(t.ppf(0.5 + LEVEL / 2, len(fits) - 1))),
    }
    found = {
        method: {n: _around(float(common.x[k]), float(np.sqrt(c[k, k])), q) for k, n in enumerate(free)}
        for method, (c, q) in quantiles.items()
    }
    wider = {n: max((found[method][n] for method in quantiles), key=lambda i: i[1] - i[0]) for n in free}
    return {**found, "together, wider": wider}


def group(model: str, rng: Generator) -> dict[str, Any]:
    """Record, fit and bound `GROUP` manoeuvres, each alone and all together."""
    moves = [drawn_move(rng) for _ in range(GROUP)]
    fits = [fitted(model, recorded(move, rng)) for move in moves]
    return {
        "model": model,
        "moves": [[m.angle, m.rate, m.ramp] for m in moves],
        "deflections": [float(np.abs(f.problem.bench.experiments[0].deflection).max()) for f in fits],
        "estimates": [{n: f.values[n] for n in f.problem.free} for f in fits],
        "alone": [intervals(f, rng) for f in fits],
        "together": together(fits),
        "reduced_chi2": [f.reduced_chi2 for f in fits],
    }


def noise_free(model: str, moves: Sequence[Sequence[float]]) -> dict[str, float]:
    """Return the least-squares estimate of all manoeuvres together, free of noise: the pooled target."""
    fits = [fitted(model, recorded(Move(*move), None)) for move in moves]
    finest = min(f.problem.bench.step for f in fits)
    problems = [replace(f.problem, bench=Bench.like(f.problem.bench, finest)) for f in fits]
    common = pooled(problems, [f.minimum.x for f in fits])
    return dict(zip(fits[0].problem.free, common.x.tolist(), strict=True))


def first_principles(model: str) -> dict[str, float]:
    """Return what the rig predicts of each parameter: the elastica for the springs, the stated masses and friction."""
    rig = stated_rig(1e-9)
    drawn = predict(rig, np.random.default_rng(0), draws=16).draws["rod_counted", "dynamic_effective"]
    spring = {n: float(drawn[n].mean()) for n in ("alpha", "beta", "gamma")}
    rest = {"xi": ARM.disc_friction / ARM.effective_mass, "mu": ARM.beam_mass / ARM.tip_mass}
    return {n: {**spring, **rest}[n] for n in SHOWN[model]}
