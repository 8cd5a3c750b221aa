"""The paper's own models and fits (P7 to P9, P12): the angle by (13) or (15), the radius by (16)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.paper.rest_fit import RestFit, fit_from_rest
from benchmarks.paper.stand import Stand

FloatArray = NDArray[np.float64]

LINEAR = ("viscous_damping", "linear_stiffness")
"""Equation (13)."""
CUBIC = (*LINEAR, "cubic_stiffness")
"""Equation (15)."""


@dataclass(frozen=True)
class PaperModels:
    """The paper's three models fitted to one recording (P12), and the tip that each predicts.

    Parameters
    ----------
    linear, cubic : RestFit
        Equations (13) and (15), fitted to the angle.
    gamma, gamma_sd : float
        Law (16), fitted to radius and deflection.
    tips : dict of str to ndarray
        "linear", "cubic" and "with_radius": predicted tip [m], each (n, 2).
    """

    linear: RestFit
    cubic: RestFit
    gamma: float
    gamma_sd: float
    tips: dict[str, FloatArray]


def fit_radius(stand: Stand) -> tuple[float, float]:
    """Return gamma of law (16) and its standard deviation, fitted to the recorded radius and deflection."""
    e = stand.experiment
    rho = np.hypot(*e.recording.output.T) / stand.arm.length
    delta = e.deflection

    def residual(gamma: FloatArray) -> FloatArray:
        return np.cos(gamma * delta) - rho

    found = least_squares(residual, [0.4], method="lm")
    variance = 2 * found.cost / (rho.size - 1)
    return float(found.x[0]), float(np.sqrt(variance / np.sum(np.square(np.asarray(found.jac)))))


def paper_models(stand: Stand) -> PaperModels:
    """Fit the paper's models to one recording: (13), (15), and (16) on top of (15)."""
    linear, cubic = (fit_from_rest("constant_radius", e, stand, angle=True) for e in (LINEAR, CUBIC))
    gamma, gamma_sd = fit_radius(stand)
    tips = {"linear": linear.tip(stand), "cubic": cubic.tip(stand)}
    theta_t = np.unwrap(np.arctan2(*tips["cubic"].T[::-1]))
    tips["with_radius"] = tips["cubic"] * np.cos(gamma * (theta_t - stand.experiment.motor_angle))[:, None]
    return PaperModels(linear, cubic, gamma, gamma_sd, tips)
