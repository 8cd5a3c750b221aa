"""Fits of an arm that starts at rest: Levenberg-Marquardt on a whole recording, the initial state known to be zero.

This is how the paper fitted its models (section IV-C); the initial state cannot absorb what a model lacks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.paper.stand import Stand
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.problem import known_values
from discovery.estimation.step import choose_step
from discovery.foundation.errors import NotConverged, NotIdentifiable
from discovery.rigs.rig import Rig
from discovery.theory.elastica.static_law import SMALL_DEFLECTION

FloatArray = NDArray[np.float64]

ROD_SHARE = 33 / 140
"""Part of the rod's mass that counts at the tip."""
_TRAJECTORY_ERROR = 1e-5
#: Singular value of the Jacobian, relative to the largest, below which round-off of its differences decides.
_ROUND_OFF = 1e-6
#: Effects of the studies: one simulator of a base serves all fits on it, and an absent effect costs next to nothing.
_SIMULATED = (
    *("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law"),
    *("centrifugal_stiffening", "coriolis_coupling", "radial_inertia", "distributed_mass"),
    *("coulomb_friction", "quadratic_drag", "amplitude_dependent_damping"),
)
#: Starts and typical sizes of what the rig file does not say.
_START = {"xi": 0.05}
_SIZE = {"xi": 0.05, "beta": 1.0, "gamma": 0.1}


@dataclass(frozen=True)
class RestFit:
    """A model whose parameters were fitted to a recording from rest.

    Parameters
    ----------
    model : Model
        The model; what it knows was not fitted.
    values, sd : dict of str to float
        Estimates and the standard deviations that least squares reports, residuals taken as independent.
    step : float
        Integration step [s].
    """

    model: Model
    values: dict[str, float]
    sd: dict[str, float]
    step: float

    def tip(self, stand: Stand) -> FloatArray:
        """Return the predicted tip [m], shape (n, 2), for any manoeuvre from rest."""
        bench = Bench(self.model.base, _simulated(self.model), [stand.experiment], self.step)
        return _predict(bench, {**known_values(stand.experiment), **self.model.known, **self.values})


def _simulated(model: Model) -> tuple[str, ...]:
    """Return the effects of the simulator of a model: those of the studies that its base has not, and its own."""
    others = (e for e in _SIMULATED if e not in model.mechanics.provides and e not in model.effects)
    return tuple(sorted({*model.effects, *others}))


def _predict(bench: Bench, values: Mapping[str, float]) -> FloatArray:
    known = Model(bench.base, bench.effects).parameters
    column = np.array([[values.get(n, known[n].default)] for n in bench.names])
    return bench.predict(column, np.zeros((1, 2, 1)))[0][:, :, 0]


def rig_alpha(rig: Rig, *, rod: bool = True) -> float:
    """Return 3 EI / (m l^3) [s^-2] (P7), with 33/140 of the rod's mass at the tip or without."""
    quantities = (rig.flexural_rigidity, rig.tip_mass, rig.beam_mass, rig.length)
    rigidity, tip, beam, length = (q.value for q in quantities if q is not None)
    return 3 * rigidity / ((tip + ROD_SHARE * beam * rod) * length**3)


def rig_values(stand: Stand, *, rod: bool = True) -> dict[str, float]:
    """Return what the rig file and the static elastica say of alpha, beta, gamma, length and rod mass (finding g)."""
    alpha = rig_alpha(stand.experiment.rig, rod=rod)
    law = {"alpha": alpha, "beta": alpha * float(SMALL_DEFLECTION.cubic), "gamma": float(SMALL_DEFLECTION.gamma)}
    return {**known_values(stand.experiment), **law}


def fit_from_rest(
    base: str, effects: tuple[str, ...], stand: Stand, known: Mapping[str, float] | None = None, *, angle: bool = False
) -> RestFit:
    """Fit what is not known.

    Parameters
    ----------
    base : str
        Name of the base.
    effects : tuple of str
        Effect ids.
    stand : Stand
        The recording.
    known : mapping of str to float, optional
        Parameters to hold; length and rod mass are held in any case.
    angle : bool
        Fit the recorded angle, as the paper did, in place of the position.

    Raises
    ------
    NotConverged
        If the minimisation gives up.
    NotIdentifiable
        If the recording leaves a combination of parameters undetermined.
    """
    experiment = stand.of_angle() if angle else stand.experiment
    rig = rig_values(stand)
    declared = Model(base, effects).parameters
    held = {n: v for n, v in {**known_values(experiment), **(known or {})}.items() if n in declared}
    model = Model(base, effects, held)
    names = model.free
    start = {n: {**rig, **_START}.get(n, 0.0) for n in names}
    step = _step(model, stand, start)
    bench = Bench(base, _simulated(model), [experiment], step)
    measured, noise = experiment.recording.output, experiment.recording.noise

    def residual(x: FloatArray, stop: int) -> FloatArray:
        predicted = _predict(bench, {**held, **dict(zip(names, x, strict=True))})
        return ((predicted - measured) / noise)[:stop].ravel()

    x = np.array([start[n] for n in names])
    size = np.array([_SIZE.get(n, max(abs(start[n]), 0.1)) for n in names])
    # The frequency has local minima over a long record: the first quarter leads the way.
    for stop in (len(measured) // 4, len(measured)):
        found = least_squares(residual, x, method="lm", x_scale=size, args=(stop,))
        x = found.x
    if not found.success:
        raise NotConverged(f"The fit from rest on {experiment.recording.name} gave up: {found.message}")
    jacobian = np.asarray(found.jac)
    _, singular, rows = np.linalg.svd(jacobian * size, full_matrices=False)
    if singular[-1] <= _ROUND_OFF * singular[0]:
        direction = dict(zip(names, rows[-1].tolist(), strict=True))
        raise NotIdentifiable([direction], f"{experiment.recording.name} does not determine all parameters.")
    variance = 2 * found.cost / (measured.size - x.size)
    sd = np.sqrt(np.diag(variance * np.linalg.inv(jacobian.T @ jacobian)))
    return RestFit(model, dict(zip(names, x.tolist(), strict=True)), dict(zip(names, sd.tolist(), strict=True)), step)


def _step(model: Model, stand: Stand, start: Mapping[str, float]) -> float:
    from discovery.estimation.natural_units import natural_units

    still = {f"{n}[{stand.experiment.recording.name}]": 0.0 for n in ("delta_0_init", "rate_0_init")}
    units = natural_units([stand.experiment])
    return choose_step(model, [stand.experiment], units, {**start, **still}, _TRAJECTORY_ERROR, _simulated(model))
