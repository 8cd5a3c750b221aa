r"""What first principles predict for the arm's parameters, as distributions, before any motion is fitted.

Length, masses and flexural rigidity of the rig fix :math:`\alpha = 3EI / (m_\mathrm{eff} l^3)`; the elastica fixes
everything else relative to it. Two readings of the mass and four of the law are predicted side by side:

* ``as_printed`` takes the rod as massless, ``rod_counted`` adds 33/140 of its mass to the tip;
* ``static_small`` is the force law of a perpendicular tip force to third order,
  :math:`\beta / \alpha = 13/210`, :math:`\gamma = 1 / \sqrt 5`;
* ``static_least_squares`` is the same law, fitted over the deflections that were reached;
* ``dynamic`` is Lagrange's equation of a mass on that radius law, see `discovery.theory.dynamic_reduction`;
* ``dynamic_effective`` is the cubic spring that gives the frequency of ``dynamic`` in free vibration when the terms in
  the rates are left out: what a model of constant radius should find.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from discovery.foundation.arguments import as_generator, check_number, check_whole, expect
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.rigs.rig import Rig
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION
from discovery.theory.elastica.static_law import SMALL_DEFLECTION, StaticLaw, fitted_law, usable_deflections

if TYPE_CHECKING:
    from discovery.rigs.rig import Quantity

MASSES = ("as_printed", "rod_counted")
LAWS = ("static_small", "static_least_squares", "dynamic", "dynamic_effective")
# As the effects that carry these parameters declare them, q being the radian.
_PER_SQUARE = ("beta/alpha", "c1", "c2", "c3")
UNITS = {"alpha": "s^-2", "beta": "s^-2 q^-2", "gamma": "q^-1", **dict.fromkeys(_PER_SQUARE, "q^-2")}
_NEEDED = ("length", "tip_mass", "beam_mass", "flexural_rigidity")


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


@dataclass(frozen=True, repr=False)
class Prediction:
    """Predicted parameters of an arm."""

    rig: str  # name of the rig
    delta_max: float | None  # largest deflection of the least-squares law [rad]; None if that law was not asked for
    #: For each pair of a name in ``MASSES`` and one in ``LAWS``: draws of ``alpha``, ``beta`` [s^-2], ``beta/alpha``,
    #: ``gamma`` and, for the law ``dynamic``, ``c1``, ``c2``, ``c3``, ``A`` [-]; each of shape (n,). The pairs share
    #: the draws of the rig. What the elastica fixes without the rig has no spread.
    draws: Mapping[tuple[str, str], Mapping[str, FloatArray]]

    def __repr__(self) -> str:
        """Return the rig and how much was drawn of what."""
        laws = ", ".join(dict.fromkeys(law for _, law in self.draws))
        count = next((values.size for *_, values in self._walk()), 0)
        return f"<Prediction of {self.rig!r}: {count} draws of {laws}>"

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
            rounding = 8 * np.finfo(float).eps * max(abs(mean), abs(predicted))
            if scale > rounding:
                discrepancy = difference / scale
            else:
                discrepancy = np.copysign(np.inf, difference) if abs(difference) > rounding else 0.0
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
    seed: np.random.Generator | int = 1,
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
    seed : int or numpy.random.Generator
        Of the draws.
    delta_max, deflection : optional
        As in `discovery.theory.elastica.static_law.usable_deflections`; without either, the law
        ``static_least_squares`` is left out.
    draws : int
        Number of draws, n.

    Raises
    ------
    InputError
        If the rig lacks a quantity, or the deflections cannot be used.

    Examples
    --------
    >>> rig = read_rig("datasets/arm/rig.toml")
    >>> row = predict_elastica(rig, draws=2000).summary()[0]
    >>> row.parameter, row.unit, round(row.mean)
    ('alpha', 's^-2', 9)
    """
    expect(rig, Rig, "rig", "Read one with read_rig(path), or take dataset.rig.")
    rng, draws = as_generator(seed), check_whole(draws, "draws", 2)
    if delta_max is not None:
        check_number(delta_max, "delta_max")
    missing = [name for name in _NEEDED if getattr(rig, name) is None]
    if missing:
        raise InputError(
            f"The elastica cannot predict the parameters of rig {rig.name!r}: its rig file does not state "
            f"{', '.join(missing)}. Add the missing entries, or do without the prediction."
        )
    length, tip, rod, rigidity = (_positive_draws(getattr(rig, name), rng, draws) for name in _NEEDED)
    delta = None if delta_max is None and deflection is None else usable_deflections(delta_max, deflection)
    fitted = None if delta is None else fitted_law(delta)
    result: dict[tuple[str, str], Mapping[str, FloatArray]] = {}
    for mass, rod_mass in zip(MASSES, (np.zeros(draws), rod), strict=True):
        alpha = 3.0 * rigidity / ((tip + 33.0 / 140.0 * rod_mass) * length**3)
        # The motor's acceleration drives the rod's own mass through the cubic shape of a tip-loaded beam.
        a = 11.0 * rod_mass / (2.0 * (140.0 * tip + 33.0 * rod_mass))
        inertial = {name: np.full(draws, float(getattr(DYNAMIC_REDUCTION, name))) for name in ("c1", "c2", "c3")}
        dynamic = StaticLaw(1.0, float(DYNAMIC_REDUCTION.beta), SMALL_DEFLECTION.gamma)
        effective = StaticLaw(1.0, float(DYNAMIC_REDUCTION.effective_beta), SMALL_DEFLECTION.gamma)
        result[mass, "static_small"] = _scaled(alpha, SMALL_DEFLECTION)
        if fitted is not None:
            result[mass, "static_least_squares"] = _scaled(alpha, fitted)
        result[mass, "dynamic"] = {**_scaled(alpha, dynamic), **inertial, "A": a}
        result[mass, "dynamic_effective"] = _scaled(alpha, effective)
    return Prediction(rig.name, None if delta is None else float(np.max(delta)), result)


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
