"""The numbers by which the paper judges its models: P11 and P13 to P15, from a recording and predicted tips."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.stand import Stand

FloatArray = NDArray[np.float64]


def mean_and_peak(error: FloatArray) -> dict[str, float]:
    """Return mean and largest magnitude of an error."""
    size = np.abs(error)
    return {"mean": float(size.mean()), "peak": float(size.max())}


def recorded_angle(stand: Stand) -> FloatArray:
    """Return the recorded tip angle [rad], shape (n,)."""
    return np.unwrap(np.arctan2(*stand.experiment.recording.output.T[::-1]))


def recorded_radius(stand: Stand) -> FloatArray:
    """Return the recorded tip radius [m], shape (n,)."""
    return np.hypot(*stand.experiment.recording.output.T)


def angle_error(stand: Stand, tip: FloatArray) -> FloatArray:
    """Return predicted minus recorded tip angle [rad] (Fig. 7), shape (n,)."""
    return np.unwrap(np.arctan2(tip[:, 1], tip[:, 0])) - recorded_angle(stand)


def radius_error(stand: Stand, rho: FloatArray | float) -> FloatArray:
    """Return predicted minus recorded radius [m] (Fig. 8), shape (n,)."""
    return rho - recorded_radius(stand)


def distance(tip: FloatArray, other: FloatArray) -> FloatArray:
    """Return the distance of two paths of the tip [m] (Fig. 9), shape (n,)."""
    return np.hypot(*(tip - other).T)


def excursion(stand: Stand) -> dict[str, float]:
    """Return what the manoeuvre does to the arm (P11): largest deflection [rad], variation of the radius [m]."""
    rho = recorded_radius(stand)
    return {
        "deflection": stand.reached,
        "radius_variation": float(np.hypot(*stand.tip.T).max() - np.hypot(*stand.tip.T).min()),
        "recorded_radius_variation": float(rho.max() - rho.min()),
    }


def model_errors(stand: Stand, tips: Mapping[str, FloatArray]) -> dict[str, dict[str, dict[str, float]]]:
    """Return errors of each predicted tip against recording and truth (P13 to P15): angle [rad], the others [m]."""
    recorded = stand.experiment.recording.output
    return {
        name: {
            "angle": mean_and_peak(angle_error(stand, tip)),
            "radius": mean_and_peak(radius_error(stand, np.hypot(*tip.T))),
            "position": mean_and_peak(distance(tip, recorded)),
            "noise_free": mean_and_peak(distance(tip, stand.tip)),
        }
        for name, tip in tips.items()
    }
