"""How far the massless rod of the general model is from a rod with mass, measured on the `elastica` base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.massless_arm.model import GeneralModel, GeneralMotion
from benchmarks.paper.theory.massless_arm.simulation import simulate_general
from discovery.mechanics import get_base
from discovery.simulation.grid import DriveLike
from discovery.simulation.simulate import Simulator, check_finite

FloatArray = npt.NDArray[np.float64]

ROD_SHARE = 33 / 140
"""Part of a light rod's mass that its first mode feels at the tip."""
_PHASE = 0.5  # of the fastest mode of the rod a step


@dataclass(frozen=True)
class TipDistance:
    """Distance of two tips over a record.

    Parameters
    ----------
    mean, peak : float
        Mean and largest distance [m].
    """

    mean: float
    peak: float


def tip_distance(motion: GeneralMotion, x: FloatArray, y: FloatArray) -> TipDistance:
    """Return the distance of a motion from the tip positions ``x``, ``y`` (n,) at its times [m]."""
    own_x, own_y = motion.position
    distance = np.hypot(own_x - x, own_y - y)
    return TipDistance(float(distance.mean()), float(distance.max()))


def distance_to_rod(
    model: GeneralModel, drive: DriveLike, time: FloatArray, mass_ratio: float, *, effective: bool
) -> TipDistance:
    """Compare an arm with the same arm whose rod has mass, started at rest.

    Parameters
    ----------
    model : GeneralModel
        Rigidity, length, friction of the disc and its mass `tip_mass`.
    drive : DriveLike
        Hub angle [rad].
    time : ndarray, shape (n,)
        Times of the comparison [s], increasing.
    mass_ratio : float
        Rod mass over tip mass ``mu`` [-], at least 0.005.
    effective : bool
        Give the massless arm the tip mass ``m + 33/140 m_r`` instead of ``m``, the friction unchanged in N s/m.

    Returns
    -------
    TipDistance
        Of the massless arm from the one with a rod.

    Raises
    ------
    SimulationFailure
        If either motion cannot be completed.
    """
    felt = 1.0 + ROD_SHARE * mass_ratio
    alpha, xi = 3.0 / model.time_scale**2 / felt, model.xi / felt
    values = {"alpha": alpha, "xi": xi, "mu": mass_ratio, "length": model.length, "tau_r": 0.0}
    fastest = get_base("elastica").highest_frequency(values) * np.sqrt(alpha)
    rod = Simulator("elastica", ("viscous_damping", "linear_stiffness"), time, drive, step=_PHASE / fastest)
    parameters = np.array([[values[name]] for name in rod.names])
    tip = rod(parameters, np.zeros(1), np.zeros(1))
    check_finite(tip, rod.time, rod.names, parameters)
    if effective:
        model = GeneralModel(model.flexural_rigidity, model.tip_mass * felt, model.length, xi)
    return tip_distance(simulate_general(model, drive, time), tip[:, 0, 0], tip[:, 1, 0])
