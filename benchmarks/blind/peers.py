"""What a user would do today: sparse regression of the acceleration that the arm's known mechanics leave over.

The motion is smoothed as the project does it, the best that is at hand. From the measured acceleration of the tip's
angle the parameter-free terms of third-order mechanics are taken; friction and stiffness are always in the model, and
every other column stands for an effect. Columns are scaled; the threshold of STLSQ (pysindy) and the penalty of LASSO
(scikit-learn) are those with the smallest error on held-out stretches, one standard error towards fewer terms.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

FloatArray = np.ndarray
STRETCHES = 6
TRIALS = 40


def columns(case: Path) -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """Target (n,), columns that are always used (n, 2), candidates (n, p) and the effects they stand for."""
    from discovery.dataset import load_dataset
    from discovery.motion import motion_of

    dataset = load_dataset(case / "rig.toml", sorted(case.glob("train*.csv")), keep_third=False)
    mu = dataset.rig.beam_mass.value / dataset.rig.tip_mass.value
    inertia = 11 * mu / (2 * (140 + 33 * mu))
    width = 3 * dataset.rig.position_noise / dataset.rig.length.value
    targets, known, candidates = [], [], []
    for e in dataset.train:
        time = e.recording.time
        inner = time[(time > time[0] + 0.3) & (time < time[-1] - 0.3)]
        s = motion_of(e.recording, dataset.rig, e.drive).state(inner)
        hub, _, push = e.drive.evaluate(inner)
        d, rate, bending = s.delta, s.q_dot, s.delta_dot
        centripetal = d * rate**2 / 5 - 2 / 5 * d * bending * rate + d * bending**2 / 25
        targets.append(s.q_ddot + centripetal + (inertia - d**2 / 25) * push)
        spring = d + 0.122 * d**3
        known.append(np.column_stack([rate, spring]))
        clock = inner - time[0]
        table = {
            "coulomb_friction": np.tanh(rate / width),
            "quadratic_drag": rate * np.abs(rate),
            "structural_damping": bending,
            "amplitude_dependent_damping": d**2 * bending,
            "asymmetric_viscous_damping": np.abs(rate),
            "quadratic_stiffness": d**2,
            "material_nonlinearity": d**3,
            "quintic_stiffness": d**5,
            "stiffness_drift": spring * clock,
            "equilibrium_offset": np.ones_like(d),
            "table_tilt_x": np.sin(s.q),
            "table_tilt_y": np.cos(s.q),
            "sensor_delay": np.gradient(s.q_ddot, inner),
            "time_base_error": rate * clock,
            "input_gain": hub,
            "tip_rotary_inertia": push,
            **{f"encoder_ripple_s{n}": np.sin(n * hub) for n in (4, 8, 16)},
            **{f"encoder_ripple_c{n}": np.cos(n * hub) for n in (4, 8, 16)},
        }
        candidates.append(np.column_stack(list(table.values())))
    names = [n.removesuffix("_x").removesuffix("_y") for n in table]
    names = ["encoder_ripple" if n.startswith("encoder_ripple") else n for n in names]
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
