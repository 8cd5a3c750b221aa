"""Discovery of the radius law of an arm: cos(gamma delta), equation (16), against polynomials.

gamma enters nonlinearly: it is scanned and refined with the linear coefficients eliminated (variable projection).

References
----------
G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413 (variable projection).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.estimate_text import estimate_text
from discovery.signals.motion import Motion
from discovery.sindy.evidence import CANNOT_TELL, log_ratio, loudness
from discovery.sindy.library import stretches

#: Resamples of whole stretches.
_RESAMPLES = 200


@dataclass(frozen=True)
class RadiusRival:
    """One candidate for rho_t / l as a function of the motion, least squares on all samples."""

    law: str
    parameters: dict[str, float]
    unexplained: float
    likelihood_ratio: float


@dataclass(frozen=True)
class RadiusLaw:
    """The radius law rho_t = l cos(gamma delta), equation (16), against its rivals."""

    gamma: float  # of the law (16) alone [-]
    sd: float  # from resamples of whole stretches
    #: Half the difference between gamma of the larger and of the smaller deflections: no beam follows (16) exactly.
    drift: float
    #: Change of gamma once the pull of the swinging mass is allowed for: the share of the motion in the static law.
    dynamic: float
    interval: tuple[float, float]  # 95 % interval from all three, added in squares
    preferred: RadiusRival  # the simplest of the laws that fit equally
    rivals: tuple[RadiusRival, ...]  # all of them, best first
    noise_ratio: float  # variance of what is left over that of the instrument's noise, at the frequencies of the motion
    status: str  # the result as a sentence

    def summary(self) -> list[dict[str, float | str]]:
        """One row for each rival, for a table of the report."""
        return [
            {
                "law": rival.law,
                "parameters": ", ".join(f"{k} = {v:.5g}" for k, v in rival.parameters.items()),
                "unexplained": rival.unexplained,
                "likelihood_ratio": rival.likelihood_ratio,
            }
            for rival in self.rivals
        ]


def _project(cosine: FloatArray, target: FloatArray, extra: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients of the linear columns, and the residual sum of squares, once the nonlinear part is taken off."""
    rest = target - cosine
    c: FloatArray = np.asarray(np.linalg.lstsq(extra, rest, rcond=None)[0]) if extra.shape[1] else np.zeros(0)
    return c, float(np.sum((rest - extra @ c) ** 2))


def _best_gamma(
    delta: FloatArray, ratio: FloatArray, sd: FloatArray, extra: FloatArray
) -> tuple[float, FloatArray, float]:
    """Variable projection: scan gamma, eliminate the linear coefficients, refine."""

    def rss(gamma: float) -> float:
        return _project(np.cos(gamma * delta) / sd, ratio / sd, extra)[1]

    grid = np.linspace(0.02, 1.5, 75)
    start = grid[int(np.argmin([rss(g) for g in grid]))]
    gamma = float(
        minimize_scalar(rss, bounds=(start - 0.02, start + 0.02), method="bounded", options={"xatol": 1e-7}).x
    )
    c, least = _project(np.cos(gamma * delta) / sd, ratio / sd, extra)
    return gamma, c, least


def discover_radius(motions: Sequence[Motion], *, rng: np.random.Generator) -> RadiusLaw:
    """Discover how the radius of an arm's tip depends on its motion.

    cos(gamma delta) and 1 - a delta^2 - b delta^4 compete, each alone and with kappa delta^2 theta_t'^2: the pull of
    the swinging mass straightens the rod, which a static law cannot describe.

    Raises InputError if no recording has a radius: they must be of an arm with tip x and y.
    """
    readings = _Readings.of(motions)
    fits = _fits(readings)
    noise = loudness(fits[0].left, (1.0 - readings.ratio) / readings.sd)
    evidence = log_ratio(np.array([fit.rss for fit in fits]), fits[0].rss, noise, readings.stretches)
    energy = float(np.sum(((1.0 - readings.ratio) / readings.sd) ** 2))
    rivals = tuple(
        RadiusRival(fit.law, fit.parameters, fit.rss / energy, float(np.exp(min(e, 700.0))))
        for fit, e in zip(fits, evidence, strict=True)
    )
    equal = [i for i, e in enumerate(evidence) if e <= np.log(CANNOT_TELL)]
    preferred = rivals[min(equal, key=lambda i: (fits[i].complexity, i))]

    gamma, moved = (f.parameters["gamma"] for kappa in (False, True) for f in fits if f.is_cosine(kappa))
    spread = readings.spread(gamma, rng)
    drift, dynamic = readings.drift(), abs(moved - gamma)
    width = 1.96 * float(np.linalg.norm([spread, drift, dynamic]))
    status = f"{preferred.law} is the simplest law that fits; in (16) alone gamma = {estimate_text(gamma, width)}."
    if len(equal) > 1:
        status += f" Cannot tell it from {'; '.join(rivals[i].law for i in equal if rivals[i] is not preferred)}."
    return RadiusLaw(
        gamma,
        spread,
        drift=drift,
        dynamic=dynamic,
        interval=(gamma - width, gamma + width),
        preferred=preferred,
        rivals=rivals,
        noise_ratio=noise,
        status=status,
    )


@dataclass(frozen=True)
class _Readings:
    """Deflection, radius over length with its deviation, and pull of the mass, of all recordings in `blocks`."""

    delta: FloatArray
    ratio: FloatArray
    sd: FloatArray
    pull: FloatArray
    blocks: np.ndarray

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> _Readings:
        tracks = [(motion.radius, motion.state(motion.radius.time)) for motion in motions if motion.radius is not None]
        if not tracks:
            raise InputError("The radius law needs recordings of the tip's x and y.")
        delta, rate = (np.concatenate([getattr(state, name) for _, state in tracks]) for name in ("delta", "q_dot"))
        ratio, sd = (np.concatenate([getattr(track, name) for track, _ in tracks]) for name in ("observed", "noise"))
        longest = max(float(track.time[-1] - track.time[0]) for track, _ in tracks)
        blocks = stretches([track.time for track, _ in tracks], longest / 12.0)
        return cls(delta, ratio, sd, (delta**2 * rate**2 / sd)[:, None], blocks)

    @property
    def stretches(self) -> int:
        return int(self.blocks.max()) + 1

    def drift(self) -> float:
        """Return half the difference between gamma of the larger and of the smaller deflections."""
        size = np.sort(np.abs(self.delta))
        weight = np.cumsum(size**4)
        half = size[int(np.searchsorted(weight, weight[-1] / 2.0))]  # equal information on either side
        sides = (np.abs(self.delta) <= half, np.abs(self.delta) > half)
        low, high = (_best_gamma(self.delta[k], self.ratio[k], self.sd[k], self.pull[k][:, :0])[0] for k in sides)
        return abs(high - low) / 2.0

    def spread(self, gamma: float, rng: np.random.Generator) -> float:
        """Return the deviation of gamma: one Gauss-Newton step for every resample, from sums over stretches."""
        delta, sd, count = self.delta, self.sd, self.stretches
        slope, rest = -delta * np.sin(gamma * delta) / sd, (self.ratio - np.cos(gamma * delta)) / sd
        upper, lower = (np.bincount(self.blocks, slope * other, minlength=count) for other in (rest, slope))
        draws = rng.multinomial(count, np.full(count, 1.0 / count), size=_RESAMPLES)
        return float(np.std((draws @ upper) / (draws @ lower)))


@dataclass(frozen=True)
class _LawFit:
    complexity: int
    law: str
    parameters: dict[str, float]
    rss: float
    left: FloatArray

    def is_cosine(self, dynamic: bool) -> bool:
        return "gamma" in self.parameters and ("kappa" in self.parameters) == dynamic


def _fits(readings: _Readings) -> list[_LawFit]:
    """Return the cosine and the polynomials, each alone and with the pull of the mass, the best first."""
    delta, ratio, sd, pull = readings.delta, readings.ratio, readings.sd, readings.pull
    fits = []
    for pulled in (False, True):
        extra = pull if pulled else pull[:, :0]
        tail = " + kappa delta^2 theta_t'^2" if pulled else ""
        gamma, c, rss = _best_gamma(delta, ratio, sd, extra)
        left = (ratio - np.cos(gamma * delta)) / sd - extra @ c
        labels = ["kappa"][: c.size]
        found = {"gamma": gamma, **dict(zip(labels, map(float, c), strict=True))}
        fits.append(_LawFit(2 + pulled, "cos(gamma delta)" + tail, found, rss, left))
        for degree, law in ((1, "1 - a delta^2"), (2, "1 - a delta^2 - b delta^4")):
            powers = -(delta[:, None] ** (2 * np.arange(1, degree + 1))) / sd[:, None]
            c, rss = _project(1.0 / sd, ratio / sd, columns := np.column_stack([powers, extra]))
            left = (ratio - 1.0) / sd - columns @ c
            found = dict(zip(["a", "b"][:degree] + labels, map(float, c), strict=True))
            fits.append(_LawFit(2 * degree - 1 + pulled, law + tail, found, rss, left))
    return sorted(fits, key=lambda fit: fit.rss)
