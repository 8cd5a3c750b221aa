r"""What first principles predict for the arm's parameters, as distributions, before any motion is fitted.

Length, masses and flexural rigidity of the rig fix :math:`\alpha = 3EI / (m_\mathrm{eff} l^3)`; the elastica fixes
everything else relative to it. Two readings of the mass and four of the law are predicted side by side:

* ``as_printed`` takes the rod as massless, ``rod_counted`` adds 33/140 of its mass to the tip;
* ``static_small`` is the force law of a perpendicular tip force to third order,
  :math:`\beta / \alpha = 13/210`, :math:`\gamma = 1 / \sqrt 5`;
* ``static_least_squares`` is the same law, fitted over the deflections that were reached;
* ``dynamic`` is Lagrange's equation of a mass on that radius law (:data:`DYNAMIC_REDUCTION`);
* ``dynamic_effective`` is the cubic spring that gives the frequency of ``dynamic`` in free vibration when the terms in
  the rates are left out: what a model of constant radius should find.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from discovery.elastica import DEFLECTION_MAX, perpendicular_law
from discovery.errors import InputError

if TYPE_CHECKING:
    from discovery.rig import Quantity, Rig

__all__ = [
    "DYNAMIC_REDUCTION",
    "LAWS",
    "MASSES",
    "Comparison",
    "DynamicReduction",
    "Prediction",
    "PredictionRow",
    "StaticLaw",
    "predict",
    "radius_law",
    "spring_law",
    "static_law",
    "torque_law",
]

FloatArray = npt.NDArray[np.float64]

MASSES = ("as_printed", "rod_counted")
LAWS = ("static_small", "static_least_squares", "dynamic", "dynamic_effective")
UNITS = {"alpha": "s^-2", "beta": "s^-2"}
_NEEDED = ("length", "tip_mass", "beam_mass", "flexural_rigidity")
_SMALLEST_DEFLECTION = 1e-3


@dataclass(frozen=True)
class StaticLaw:
    """Cubic force law and radius law of the elastica.

    Parameters
    ----------
    stiffness : float
        Linear stiffness over that of the small-deflection beam, ``3 EI / l^3`` [-].
    cubic : float
        Cubic stiffness over the same [-].
    gamma : float
        Coefficient of the radius law, eq. (16) of the paper [-].
    """

    stiffness: float
    cubic: float
    gamma: float


@dataclass(frozen=True)
class DynamicReduction:
    r"""Coefficients of the third-order equation of a mass that moves along the elastica's radius law.

    .. math::
        \ddot\theta_t + \xi \dot\theta_t + \alpha \delta + \beta \delta^3 + c_1 \delta \dot\theta_t^2
        + c_2 \delta \dot\delta \dot\theta_t + c_3 \delta \dot\delta^2
        - c_m \delta^2 \ddot\theta_m + A \ddot\theta_m = 0

    With :math:`\rho = l (1 - \delta^2 / 10)` the generalised force is :math:`\rho F`, the inertia
    :math:`\rho^2 + \rho'^2`; so :math:`\beta / \alpha = 13/210 - 1/10 + 1/5 - 1/25`. Nothing is free.
    """

    beta: Fraction = Fraction(13, 210) - Fraction(1, 10) + Fraction(1, 5) - Fraction(1, 25)
    c1: Fraction = Fraction(1, 5)
    c2: Fraction = Fraction(-2, 5)
    c3: Fraction = Fraction(1, 25)
    c_m: Fraction = Fraction(1, 25)

    @property
    def effective_beta(self) -> Fraction:
        """Cubic stiffness over alpha of the constant-radius oscillator of equal frequency, by harmonic balance.

        In free vibration both angles have the same rate, and a term ``delta delta'^2`` acts at the fundamental like
        ``omega^2 / 3`` times ``delta^3``.
        """
        return self.beta + (self.c1 + self.c2 + self.c3) / 3


DYNAMIC_REDUCTION = DynamicReduction()
_SMALL = StaticLaw(1.0, float(Fraction(13, 210)), 1.0 / np.sqrt(5.0))


@dataclass(frozen=True)
class PredictionRow:
    """One predicted parameter: mean, standard deviation and quantiles of its distribution, in `unit`."""

    mass: str
    law: str
    parameter: str
    unit: str
    mean: float
    sd: float
    q05: float
    q50: float
    q95: float


@dataclass(frozen=True)
class Comparison:
    """One parameter, measured and predicted: `discrepancy` is their `difference` over its standard deviation."""

    mass: str
    law: str
    parameter: str
    unit: str
    posterior_mean: float
    posterior_sd: float
    predicted_mean: float
    predicted_sd: float
    difference: float
    discrepancy: float


@dataclass(frozen=True)
class Prediction:
    """Predicted parameters of an arm.

    Parameters
    ----------
    rig : str
        Name of the rig.
    delta_max : float or None
        Largest deflection of the least-squares law [rad]; None if that law was not asked for.
    draws : mapping of (str, str) to mapping of str to ndarray
        For each pair of a name in ``MASSES`` and one in ``LAWS``: draws of ``alpha``, ``beta`` [s^-2], ``beta/alpha``,
        ``gamma`` and, for the law ``dynamic``, ``c1``, ``c2``, ``c3``, ``A`` [-]; each of shape (n,). The pairs share
        the draws of the rig. What the elastica fixes without the rig has no spread.
    """

    rig: str
    delta_max: float | None
    draws: Mapping[tuple[str, str], Mapping[str, FloatArray]]

    def summary(self) -> tuple[PredictionRow, ...]:
        """Mean, standard deviation, 5, 50 and 95 % of every parameter of every variant."""
        return tuple(
            PredictionRow(mass, law, name, UNITS.get(name, "1"), *_moments(values), *_quantiles(values))
            for mass, law, name, values in self._walk()
        )

    def compare(self, posterior: Mapping[str, npt.ArrayLike]) -> tuple[Comparison, ...]:
        """Set a posterior against every variant of the prediction.

        Parameters
        ----------
        posterior : mapping of str to array_like
            Draws by parameter name, in the units of the prediction. ``beta/alpha`` is formed from paired draws of
            ``beta`` and ``alpha``; parameters that are not predicted (``xi``, the noise) are passed over.

        Returns
        -------
        tuple of Comparison
            The discrepancy is in standard deviations of the difference, ``sqrt(sd_posterior^2 + sd_predicted^2)``;
            infinite if neither has a spread and they differ.

        Raises
        ------
        InputError
            If no parameter of the posterior is predicted, or its draws are not finite, or cannot be paired.
        """
        measured = {name: np.ravel(np.asarray(values, dtype=np.float64)) for name, values in posterior.items()}
        if {"alpha", "beta"} <= measured.keys():
            if measured["alpha"].shape != measured["beta"].shape:
                raise InputError("The posterior's draws of alpha and beta must be paired, but their numbers differ.")
            measured["beta/alpha"] = measured["beta"] / measured["alpha"]
        rows = []
        for mass, law, name, values in self._walk():
            if name not in measured:
                continue
            if not measured[name].size or not np.all(np.isfinite(measured[name])):
                raise InputError(f"The posterior's draws of {name} are empty or not finite; sample it again.")
            (mean, sd), (predicted, spread) = _moments(measured[name]), _moments(values)
            difference = mean - predicted
            scale = float(np.hypot(sd, spread))
            discrepancy = difference / scale if scale else np.copysign(np.inf, difference) if difference else 0.0
            row = (mean, sd, predicted, spread, difference, float(discrepancy))
            rows.append(Comparison(mass, law, name, UNITS.get(name, "1"), *row))
        if not rows:
            raise InputError(f"None of the posterior's parameters ({', '.join(posterior) or 'none'}) is predicted.")
        return tuple(rows)

    def _walk(self) -> Iterator[tuple[str, str, str, FloatArray]]:
        for (mass, law), parameters in self.draws.items():
            for name, values in parameters.items():
                yield mass, law, name, values


def predict(
    rig: Rig,
    rng: np.random.Generator,
    *,
    delta_max: float | None = None,
    deflection: npt.ArrayLike | None = None,
    draws: int = 20_000,
) -> Prediction:
    """Predict the parameters of an arm from its rig file.

    Each quantity of the rig is drawn from the log-normal distribution of its value and standard deviation, which keeps
    it positive.

    Parameters
    ----------
    rig : Rig
        With length, tip mass, beam mass and flexural rigidity.
    rng : numpy.random.Generator
        Source of the draws.
    delta_max, deflection : optional
        As in :func:`static_law`; the law ``static_least_squares`` is left out if neither is given.
    draws : int
        Number of draws, n.

    Returns
    -------
    Prediction

    Raises
    ------
    InputError
        If the rig lacks a quantity, or the deflections cannot be used.
    """
    missing = [name for name in _NEEDED if getattr(rig, name) is None]
    if missing:
        raise InputError(
            f"The elastica cannot predict the parameters of rig {rig.name!r}: its rig file does not state "
            f"{', '.join(missing)}. Add the missing entries, or do without the prediction."
        )
    length, tip, rod, rigidity = (_positive_draws(getattr(rig, name), rng, draws) for name in _NEEDED)
    delta = None if delta_max is None and deflection is None else _deflections(delta_max, deflection)
    fitted = None if delta is None else _fit(delta)
    result: dict[tuple[str, str], Mapping[str, FloatArray]] = {}
    for mass, rod_mass in zip(MASSES, (np.zeros(draws), rod), strict=True):
        alpha = 3.0 * rigidity / ((tip + 33.0 / 140.0 * rod_mass) * length**3)
        # The motor's acceleration drives the rod's own mass through the cubic shape of a tip-loaded beam.
        a = 11.0 * rod_mass / (2.0 * (140.0 * tip + 33.0 * rod_mass))
        inertial = {name: np.full(draws, float(getattr(DYNAMIC_REDUCTION, name))) for name in ("c1", "c2", "c3")}
        dynamic = StaticLaw(1.0, float(DYNAMIC_REDUCTION.beta), _SMALL.gamma)
        effective = StaticLaw(1.0, float(DYNAMIC_REDUCTION.effective_beta), _SMALL.gamma)
        result[mass, "static_small"] = _scaled(alpha, _SMALL)
        if fitted is not None:
            result[mass, "static_least_squares"] = _scaled(alpha, fitted)
        result[mass, "dynamic"] = {**_scaled(alpha, dynamic), **inertial, "A": a}
        result[mass, "dynamic_effective"] = _scaled(alpha, effective)
    return Prediction(rig.name, None if delta is None else float(np.max(delta)), result)


def static_law(delta_max: float | None = None, deflection: npt.ArrayLike | None = None) -> StaticLaw:
    """Least-squares cubic and cosine through the elastica's force and radius.

    Parameters
    ----------
    delta_max : float, optional
        Largest deflection that counts [rad].
    deflection : array_like, optional
        Deflections at which the laws are compared, as a recording has them [rad]; NaN is left out. By default they are
        equally spaced up to `delta_max`.

    Returns
    -------
    StaticLaw

    Raises
    ------
    InputError
        If neither is given, no deflection is left, or they reach beyond the elastica's domain or less than 1e-3 rad.
    """
    return _fit(_deflections(delta_max, deflection))


def spring_law(delta: npt.ArrayLike) -> FloatArray:
    """Tangential force of the elastica over its linear stiffness, ``F_n / 3``.

    Comparable with the discovered ``delta + (beta / alpha) delta^3`` of eq. (14) of the paper.

    Parameters
    ----------
    delta : array_like
        Deflection [rad], within the domain of :func:`discovery.elastica.perpendicular_law`.

    Returns
    -------
    ndarray
        Normalised force [rad].
    """
    return perpendicular_law(delta)[0] / 3.0


def torque_law(delta: npt.ArrayLike) -> FloatArray:
    """Torque of the elastica's tip force about the clamp over its linear stiffness, ``rho F_n / (3 l)``.

    It is the generalised force of the dynamic reduction: the derivative of the bending energy along the tip's curve.

    Parameters
    ----------
    delta : array_like
        Deflection [rad], as in :func:`spring_law`.

    Returns
    -------
    ndarray
        Normalised torque [rad].
    """
    force, rho = perpendicular_law(delta)
    return rho * force / 3.0


def radius_law(delta: npt.ArrayLike) -> FloatArray:
    """Radius of the elastica's tip, ``rho_t / l``; comparable with ``cos(gamma delta)`` of eq. (16) of the paper.

    Parameters
    ----------
    delta : array_like
        Deflection [rad], as in :func:`spring_law`.

    Returns
    -------
    ndarray
        Normalised radius [-].
    """
    return perpendicular_law(delta)[1]


def _deflections(delta_max: float | None, deflection: npt.ArrayLike | None) -> FloatArray:
    if deflection is None and delta_max is None:
        raise InputError("The least-squares law of the elastica needs the largest deflection or the deflections.")
    if deflection is None:
        delta = np.linspace(0.0, np.float64(delta_max), 401)
    else:
        delta = np.abs(np.ravel(np.asarray(deflection, dtype=np.float64)))
        delta = delta[np.isfinite(delta)]
        delta = delta if delta_max is None else delta[delta <= delta_max]
    if not delta.size or not _SMALLEST_DEFLECTION <= np.max(delta) <= DEFLECTION_MAX:
        raise InputError(
            f"The least-squares law of the elastica needs deflections that reach between {_SMALLEST_DEFLECTION:g} and "
            f"{DEFLECTION_MAX:.4f} rad; got {f'{np.max(delta):.4g} rad' if delta.size else 'none'}. Check their unit."
        )
    return delta


def _fit(delta: FloatArray) -> StaticLaw:
    force, rho = perpendicular_law(delta)
    (stiffness, cubic), *_ = np.linalg.lstsq(np.stack([delta, delta**3], axis=1), force / 3.0)

    def error(gamma: FloatArray) -> FloatArray:
        return np.cos(gamma * delta) - rho

    def slope(gamma: FloatArray) -> FloatArray:
        return -(delta * np.sin(gamma * delta))[:, None]

    fit = least_squares(error, [_SMALL.gamma], jac=slope, gtol=1e-15)
    return StaticLaw(float(stiffness), float(cubic), float(fit.x[0]))


def _scaled(alpha: FloatArray, law: StaticLaw) -> dict[str, FloatArray]:
    constants = {"beta/alpha": law.cubic / law.stiffness, "gamma": law.gamma}
    fixed = {name: np.full(alpha.shape, value) for name, value in constants.items()}
    return {"alpha": law.stiffness * alpha, "beta": law.cubic * alpha, **fixed}


def _positive_draws(quantity: Quantity, rng: np.random.Generator, draws: int) -> FloatArray:
    variance = np.log1p((quantity.sd / quantity.value) ** 2)
    return quantity.value * np.exp(np.sqrt(variance) * rng.standard_normal(draws) - variance / 2.0)


def _moments(values: FloatArray) -> tuple[float, float]:
    # np.std of equal numbers is their rounding error, which would turn into a false spread.
    if np.ptp(values) == 0.0:
        return float(values[0]), 0.0
    return float(np.mean(values)), float(np.std(values, ddof=1))


def _quantiles(values: FloatArray) -> tuple[float, float, float]:
    low, middle, high = np.quantile(values, (0.05, 0.5, 0.95))
    return float(low), float(middle), float(high)
