"""What a user would do today: sparse regression of the acceleration that the arm's known mechanics leave over.

The motion is smoothed as the project does it, the best that is at hand. From the measured acceleration of the tip's
angle the parameter-free terms of third-order mechanics are taken; friction and stiffness are always in the model, and
every other column stands for an effect. Columns are scaled; the threshold of STLSQ (pysindy) and the penalty of LASSO
(scikit-learn) are those with the smallest error on held-out stretches, one standard error towards fewer terms.

A column is a function of the state and the drive at one time. These effects of the benchmark have none:

- viscoelastic_relaxation, hysteresis, base_hysteresis: memory, the past of the motion acts;
- periodic_disturbance: a function of time whose frequency is not known;
- position_scale: a reading fault, along the radius, which the angle of the tip does not have;
- camera_origin_offset, initial_curvature: theirs would be those of table_tilt and of equilibrium_offset;
- base_compliance: a softer spring, and the stiffness is in the model already.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FloatArray = np.ndarray
STRETCHES = 6
TRIALS = 40
CYCLES = (4, 8, 16)  # of a ripple a turn of the hub
SLOW = (0.1, 0.3)  # speeds of Stribeck's peak over the largest


class Moving(NamedTuple):
    """A recording as columns are made of it: SI units, each (n,) but for the noise of the angle [rad]."""

    clock: FloatArray
    hub: FloatArray
    push: FloatArray
    angle: FloatArray
    rate: FloatArray
    acceleration: FloatArray
    delta: FloatArray
    bending: FloatArray
    noise: float

    @property
    def dry(self) -> FloatArray:
        """Direction of the motion, smooth through rest."""
        return np.tanh(self.rate / (3 * self.noise))

    @property
    def spring(self) -> FloatArray:
        """Restoring force per stiffness."""
        return self.delta + 0.122 * self.delta**3


#: Column (n,) or columns (n, k) that stand for an effect.
COLUMNS: dict[str, Callable[[Moving], FloatArray]] = {
    "coulomb_friction": lambda m: m.dry,
    "stribeck_friction": lambda m: np.stack(
        [m.dry * np.exp(-((m.rate / (share * np.abs(m.rate).max())) ** 2)) for share in SLOW], axis=1
    ),
    "quadratic_drag": lambda m: m.rate * np.abs(m.rate),
    "structural_damping": lambda m: m.bending,
    "amplitude_dependent_damping": lambda m: m.delta**2 * m.rate,
    "nonlinear_structural_damping": lambda m: m.delta**2 * m.bending,
    "asymmetric_viscous_damping": lambda m: np.abs(m.rate),
    "quadratic_stiffness": lambda m: m.delta**2,
    "material_nonlinearity": lambda m: m.delta**3,
    "quintic_stiffness": lambda m: m.delta**5,
    "stiffness_drift": lambda m: m.spring * m.clock,
    "equilibrium_offset": lambda m: np.ones_like(m.delta),
    "base_backlash": lambda m: np.tanh(m.delta / (3 * m.noise)),
    "table_tilt": lambda m: np.stack([np.sin(m.angle), np.cos(m.angle)], axis=1),
    "sensor_delay": lambda m: np.gradient(m.acceleration, m.clock),
    "time_base_error": lambda m: m.rate * m.clock,
    "input_gain": lambda m: m.hub,
    "tip_rotary_inertia": lambda m: m.push,
    "encoder_ripple": lambda m: np.stack([f(n * m.hub) for f in (np.sin, np.cos) for n in CYCLES], axis=1),
}


def nameable(accepted: Iterable[str]) -> bool:
    """Whether one of the names that count as right has a column."""
    return not COLUMNS.keys().isdisjoint(accepted)


def columns(case: Path) -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """Target (n,), columns that are always used (n, 2), candidates (n, p) and the effects they stand for."""
    from discovery.recordings.dataset import load_dataset
    from discovery.signals.motion import motion_of

    dataset = load_dataset(case / "rig.toml", sorted(case.glob("train*.csv")), keep_third=False)
    mu = dataset.rig.beam_mass.value / dataset.rig.tip_mass.value
    inertia = 11 * mu / (2 * (140 + 33 * mu))
    targets, known, candidates = [], [], []
    for e in dataset.train:
        time = e.recording.time
        inner = time[(time > time[0] + 0.3) & (time < time[-1] - 0.3)]
        s = motion_of(e.recording, dataset.rig, e.drive).state(inner)
        hub, _, push = e.drive.evaluate(inner)
        noise = dataset.rig.position_noise / dataset.rig.length.value
        m = Moving(inner - time[0], hub, push, s.q, s.q_dot, s.q_ddot, s.delta, s.delta_dot, noise)
        centripetal = m.delta * m.rate**2 / 5 - 2 / 5 * m.delta * m.bending * m.rate + m.delta * m.bending**2 / 25
        targets.append(m.acceleration + centripetal + (inertia - m.delta**2 / 25) * push)
        known.append(np.column_stack([m.rate, m.spring]))
        made = {name: make(m).reshape(inner.size, -1) for name, make in COLUMNS.items()}
        candidates.append(np.hstack(list(made.values())))
    names = [name for name, own in made.items() for _ in range(own.shape[1])]
    return np.concatenate(targets), np.concatenate(known), np.concatenate(candidates), names


def _chosen(path: list[FloatArray], x: FloatArray, y: FloatArray, fits: list[list[FloatArray]]) -> FloatArray:
    """Coefficients of the sparsest trial within one standard error of the best on held-out stretches."""
    stretch = np.arange(y.size) * STRETCHES // y.size
    error = np.array([[np.mean((y - x @ c)[stretch == k] ** 2) for c in fits[k]] for k in range(STRETCHES)])
    mean, spread = error.mean(axis=0), error.std(axis=0) / np.sqrt(STRETCHES)
    best = int(np.argmin(mean))
    good = np.flatnonzero(mean <= mean[best] + spread[best])
    return path[min(good, key=lambda i: (np.count_nonzero(path[i]), mean[i]))]


def peers(case: Path) -> dict[str, Any]:
    """Effects that STLSQ and LASSO name, largest share of variance first."""
    import pysindy
    from sklearn.linear_model import lasso_path

    y, known, x, names = columns(case)
    basis, _ = np.linalg.qr(known)
    y, x = y - basis @ (basis.T @ y), x - basis @ (basis.T @ x)
    x = x / np.maximum(x.std(axis=0), 1e-12)
    scale = y.std()
    y = y / scale
    stretch = np.arange(y.size) * STRETCHES // y.size
    thresholds = np.geomspace(3e-3, 1.0, TRIALS)

    def stlsq(rows: np.ndarray) -> list[FloatArray]:
        found = []
        for threshold in thresholds:
            optimiser = pysindy.STLSQ(threshold=threshold, alpha=1e-6, max_iter=30)
            found.append(np.asarray(optimiser.fit(x[rows], y[rows, None]).coef_).ravel())
        return found

    def lasso(rows: np.ndarray) -> list[FloatArray]:
        _, coefficients, _ = lasso_path(x[rows], y[rows], alphas=thresholds[::-1], max_iter=5000)
        return list(coefficients.T[::-1])

    result = {}
    for label, method in (("pysindy", stlsq), ("lasso", lasso)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            path = method(np.ones(y.size, bool))
            fits = [method(stretch != k) for k in range(STRETCHES)]
        found = _chosen(path, x, y, fits)
        share: dict[str, float] = {}
        for name, value in zip(names, found, strict=True):
            if value:
                share[name] = max(share.get(name, 0.0), abs(float(value)))
        result[label] = sorted(share, key=lambda n: -share[n])
    return result
