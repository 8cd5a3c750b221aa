"""Sparse discovery of the equation of motion and of the radius law.

SINDy proposes, trajectories decide: what is found here are names and start values; coefficients are estimated again on
trajectories before anything is reported. Terms are judged by the variance that they explain, never by the size of a
coefficient, so that a friction 200 times smaller than the stiffness counts for what it does to the motion.

References
----------
S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016) 3932 (SINDy); U. Fasel et al., Proc. R. Soc. A 478 (2022)
20210904 (inclusion probabilities); G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413 (variable projection).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
import pysindy
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from discovery.differentiate import FloatArray, Motion, Smoother
from discovery.errors import InputError
from discovery.library import Library, RowKind, build_library, stretches

PHYSICAL_BOUNDS: dict[str, tuple[float, float]] = {
    "viscous_damping": (0.0, np.inf),
    "structural_damping": (0.0, np.inf),
    "coulomb_friction": (0.0, np.inf),
    "quadratic_drag": (0.0, np.inf),
}
"""Passive friction takes energy out of the motion."""

FALSE_ALARM = 1e-3
"""Probability that noise alone adds a term, over the whole library."""

CANNOT_TELL = 10.0
"""Rivals within this ratio of likelihoods fit equally."""

MISFIT = 2.0
"""Ratio of residual to instrument noise beyond which an equation counts as incomplete."""

_KEPT = 100  # equations of each size that are followed through the resamples


class BestSubset(pysindy.optimizers.BaseOptimizer):
    """The k candidates that explain most variance, k = 1, 2, ..., as an optimizer of pysindy.

    Parameters
    ----------
    threshold : float
        A term stays if it explains more than this share of the target's variance.
    max_terms : int
        Largest equation looked at.
    signs : ndarray of int, shape (p,), optional
        1 for a coefficient that must not be negative, -1 for one that must not be positive, 0 for any.

    Attributes
    ----------
    table_ : list of tuple
        For each k the best equations: indices (m, k) and residual sums of squares (m,), best first.
    """

    def __init__(
        self, threshold: float = 1e-6, max_terms: int = 5, signs: np.ndarray | None = None, unbias: bool = False
    ) -> None:
        super().__init__(max_iter=max_terms, unbias=unbias)
        self.threshold, self.max_terms, self.signs = threshold, max_terms, signs

    def _reduce(self, x: FloatArray, y: FloatArray) -> None:
        signs = np.zeros(x.shape[1], int) if self.signs is None else self.signs
        gram, moment, energy = x.T @ x, x.T @ y[:, 0], float(y[:, 0] @ y[:, 0])
        self.table_: list[tuple[np.ndarray, FloatArray]] = []
        for k in range(1, min(self.max_terms, x.shape[1]) + 1):
            rivals = _subsets(x.shape[1], k, self.table_[-1][0] if self.table_ else None)
            rss = _residuals(gram, moment, energy, rivals, signs)
            order = np.argsort(rss)[:_KEPT]
            self.table_.append((rivals[order], rss[order]))
        best = np.array([energy, *(rss[0] for _, rss in self.table_)])
        size = _size(best, np.full(best.size, self.threshold * energy))
        self.coef_, self.ind_ = np.zeros((1, x.shape[1])), np.zeros((1, x.shape[1]), bool)
        if size:
            chosen = self.table_[size - 1][0][0]
            self.coef_[0, chosen] = np.linalg.lstsq(x[:, chosen], y[:, 0], rcond=None)[0]
            self.ind_[0, chosen] = True
        self.history_.append(self.coef_)


def _subsets(p: int, k: int, smaller: np.ndarray | None) -> np.ndarray:
    """Every set of k candidates, or beyond 200 000 of them every extension of the best smaller ones."""
    if comb(p, k) <= 200_000 or smaller is None:
        return np.array(list(combinations(range(p), k)))
    grown = {tuple(sorted((*s, j))) for s in smaller.tolist() for j in range(p) if j not in s}
    return np.array(sorted(grown))


def _residuals(gram: FloatArray, moment: FloatArray, energy: float, sets: np.ndarray, signs: np.ndarray) -> FloatArray:
    """Residual sum of squares of each set; infinite where a coefficient has the wrong sign."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    unit = gram / np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
    right = (moment / scale)[sets]
    coefficients = np.linalg.solve(unit[sets[:, :, None], sets[:, None, :]], right[..., None])[..., 0]
    rss = np.maximum(energy - np.sum(coefficients * right, axis=1), 0.0)
    return np.where(np.any(coefficients * signs[sets] < 0.0, axis=1), np.inf, rss)


def _size(best: FloatArray, cost: FloatArray) -> int:
    """Smallest number of terms after which neither one more nor two more pay their cost.

    ``best[k]`` is the residual sum of squares of the best equation of k terms, ``cost[k]`` the price of a k-th term.
    """
    for k in range(best.size - 1):
        ahead = best[k] - best[k + 1 : k + 3]
        if np.all(ahead < cost[k + 1 : k + 3] * np.arange(1, ahead.size + 1)):
            return k
    return best.size - 1


@dataclass(frozen=True)
class Equation:
    """One candidate equation, theta_t'' + sum of coefficient * term = 0 (an input stands on the right).

    Attributes
    ----------
    terms, effects : tuple
        Names of the terms, and the ids of the effects that they stand for (None where there is none).
    coefficients, sd : tuple of float
        Start values for the fit on trajectories [s^-2 over the unit of the term], and their standard deviations.
    unexplained : float
        Share of the target's variance that the equation leaves.
    likelihood_ratio : float
        Likelihood of the best equation of this size over that of this one.
    probability : float
        Share of the resamples in which this is the preferred equation of its size.
    """

    terms: tuple[str, ...]
    effects: tuple[str | None, ...]
    coefficients: tuple[float, ...]
    sd: tuple[float, ...]
    unexplained: float
    likelihood_ratio: float
    probability: float

    def __str__(self) -> str:
        return " ".join(f"{c:+.5g} {name}" for c, name in zip(self.coefficients, self.terms, strict=True)) or "0"


@dataclass(frozen=True)
class Discovery:
    """What the recordings say about the structure of the equation.

    Attributes
    ----------
    equation : Equation
        The smallest equation that leaves nothing which noise could not explain; of equal ones the simplest.
    rivals : tuple of Equation
        Equations of the same size that fit equally (likelihood ratio under 10): "cannot tell".
    inclusion : dict of str to float
        Share of the resamples of whole stretches in which a term is part of the chosen equation.
    table : tuple of Equation
        The best equations of each size, preferred one first.
    path : tuple of (float, tuple of str)
        Chosen terms against the threshold in explained variance.
    threshold : float
        Share of the variance that a term must explain, at the size chosen.
    noise_ratio : float
        Variance of what is left over that of the instrument's noise, at the frequencies of the motion.
    rows, at_rest, smoothers, stretches, resamples
        How the regression was made.
    status : str
        The result as a sentence.
    """

    equation: Equation
    rivals: tuple[Equation, ...]
    inclusion: dict[str, float]
    table: tuple[Equation, ...]
    path: tuple[tuple[float, tuple[str, ...]], ...]
    threshold: float
    noise_ratio: float
    rows: RowKind
    at_rest: bool
    smoothers: tuple[Smoother, ...]
    stretches: int
    resamples: int
    status: str

    def best(self, terms: int) -> Equation:
        """Return the preferred equation of so many terms."""
        return next(equation for equation in self.table if len(equation.terms) == terms)

    def summary(self) -> list[dict[str, float | str | None]]:
        """One row for each term of the equation, for a table of the report."""
        e = self.equation
        return [
            {"term": t, "effect": f, "coefficient": c, "sd": s, "inclusion_probability": self.inclusion[t]}
            for t, f, c, s in zip(e.terms, e.effects, e.coefficients, e.sd, strict=True)
        ]


def _loudness(residual: FloatArray, target: FloatArray) -> float:
    """Spectral density of unit-noise residuals at the frequencies of the target; one for the instrument's noise alone.

    What a wrong model leaves is correlated: its variance as a regression sees it is its spectrum where the target is.
    """
    power = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
    width = max(5, round(np.sqrt(residual.size) / 4.0))
    smoothed = np.convolve(np.pad(power, width, mode="reflect"), np.ones(width) / width, mode="same")[width:-width]
    weight = np.abs(np.fft.rfft(target)) ** 2
    return max(1.0, float(np.sum(smoothed * weight) / np.sum(weight)))


@dataclass(frozen=True)
class _Choice:
    """The rule by which one equation is preferred, on the full data and on every resample alike."""

    sets: tuple[np.ndarray, ...]  # for each size, (m, k)
    complexity: tuple[FloatArray, ...]
    noise: FloatArray  # noise ratio at each size, index zero for no term
    stretches: int
    price: float  # chi squared that a term must gain

    def preferred(self, rss: Sequence[FloatArray], size: int) -> int:
        """Index of the simplest equation among those that cannot be told from the best."""
        return int(min(self.near(rss, size), key=lambda i: (self.complexity[size - 1][i], rss[size - 1][i])))

    def near(self, rss: Sequence[FloatArray], size: int) -> np.ndarray:
        """Return the indices of the equations of one size that fit as well as the best."""
        return np.flatnonzero(self.evidence(rss, size) <= np.log(CANNOT_TELL))

    def evidence(self, rss: Sequence[FloatArray], size: int) -> FloatArray:
        return _evidence(rss[size - 1], float(rss[size - 1].min()), float(self.noise[size]), self.stretches)

    def size(self, energy: float, rss: Sequence[FloatArray]) -> int:
        return _size(np.array([energy, *(values.min() for values in rss)]), self.price * self.noise)


def _signs(library: Library, bounds: Mapping[str, tuple[float, float]]) -> np.ndarray:
    signs = np.zeros(len(library.terms), int)
    known = {key for term in library.terms for key in (term.name, term.effect) if key}
    for key, (low, high) in bounds.items():
        if key not in known and key not in PHYSICAL_BOUNDS:
            raise InputError(
                f"There is no term or effect {key!r} to bound; the library has {', '.join(sorted(known))}."
            )
        sign = {(0.0, np.inf): 1, (-np.inf, 0.0): -1, (-np.inf, np.inf): 0}.get((float(low), float(high)))
        if sign is None:
            raise InputError(
                f"SINDy honours the sign of {key!r} but not the bounds {low:g} to {high:g}; bound it by zero here "
                "and leave the rest to the fit on trajectories."
            )
        for j, term in enumerate(library.terms):
            if key in (term.name, term.effect):
                signs[j] = sign
    return signs


def _evidence(rss: FloatArray, best: float, noise: float, stretches: int) -> FloatArray:
    """Log likelihood ratio of the best equation over others of its size.

    Against the instrument's noise if that is all that is left. Else all of them are wrong, what they leave is
    systematic, and each stretch counts for two independent numbers only, an amplitude and a phase.
    """
    white = (rss - best) / (2.0 * noise)
    return white if noise <= MISFIT else np.minimum(white, stretches * np.log(np.maximum(rss / best, 1.0)))


def _block_grams(library: Library) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gram matrix, moment and energy of every stretch."""
    data = np.column_stack([library.columns, library.target])
    grams = np.stack([data[library.blocks == b].T @ data[library.blocks == b] for b in np.unique(library.blocks)])
    return grams[:, :-1, :-1], grams[:, :-1, -1], grams[:, -1, -1]


def discover(
    motions: Sequence[Motion],
    *,
    rng: np.random.Generator,
    rows: RowKind = "response",
    degree: int = 5,
    trigonometric: bool | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    max_terms: int | None = None,
    resamples: int = 200,
    at_rest: bool | None = None,
) -> Discovery:
    """Discover the terms of the equation of motion.

    Parameters
    ----------
    motions : sequence of Motion
        One or more smoothed recordings of one system.
    rng : numpy.random.Generator
        Source of the resamples.
    rows : str
        "response", "force" or "power", see `discovery.library`.
    degree, trigonometric, at_rest
        See `discovery.library.build_library`.
    bounds : mapping of str to (float, float), optional
        Signs by name of a term or id of an effect, as bounds from or to zero; added to `PHYSICAL_BOUNDS`.
    max_terms : int, optional
        Largest equation looked at; by default five terms, and the input where there is one.
    resamples : int
        Number of resamples of whole stretches, with replacement.

    Returns
    -------
    Discovery
        Equation, probabilities, rivals and the table of the best equations of each size.

    Raises
    ------
    InputError
        For bounds that name nothing or cannot be honoured, and for unknown rows.
    """
    library = build_library(motions, rows=rows, degree=degree, trigonometric=trigonometric, at_rest=at_rest)
    signs = _signs(library, {**PHYSICAL_BOUNDS, **(bounds or {})})
    names, p = library.names, len(library.terms)
    max_terms = max_terms or 5 + any(term.family == "input" for term in library.terms)
    scale = np.sqrt(np.mean(library.columns**2, axis=0))
    table = np.column_stack([library.columns / scale, library.target])
    triangle: FloatArray = np.asarray(np.linalg.qr(table, mode="r"))  # the same least squares in p + 1 rows
    optimizer = BestSubset(max_terms=max_terms, signs=signs)
    optimizer.fit(triangle[:, :-1], triangle[:, -1:])
    sets, rss = tuple(s for s, _ in optimizer.table_), tuple(r for _, r in optimizer.table_)
    energy = float(library.target @ library.target)

    def solve(terms: np.ndarray) -> tuple[FloatArray, FloatArray, FloatArray]:
        x = library.columns[:, terms]
        c: FloatArray = np.asarray(np.linalg.lstsq(x, library.target, rcond=None)[0])
        return c, np.sqrt(np.diag(np.linalg.pinv(x.T @ x))), library.target - x @ c

    noise = np.array([_loudness(r, library.target) for r in (library.target, *(solve(s[0])[2] for s in sets))])
    grams, moments, energies = _block_grams(library)
    count = energies.size
    choice = _Choice(
        sets,
        complexity=tuple(np.array([[library.terms[j].complexity for j in s] for s in k]).sum(axis=1) for k in sets),
        noise=noise,
        stretches=count,
        price=float(chi2.isf(FALSE_ALARM / p, 1)),
    )
    size = choice.size(energy, rss)

    preferred = [np.zeros(len(s)) for s in sets]
    included = np.zeros(p)
    for draw in rng.multinomial(count, np.full(count, 1.0 / count), size=resamples).astype(float):
        gram, moment, e = np.tensordot(draw, grams, 1), draw @ moments, float(draw @ energies)
        again = [_residuals(gram, moment, e, s, signs) for s in sets]
        for k in range(1, len(sets) + 1):
            preferred[k - 1][choice.preferred(again, k)] += 1.0
        if k := choice.size(e, again):
            included[sets[k - 1][choice.preferred(again, k)]] += 1.0

    def equation(k: int, i: int) -> Equation:
        terms = sets[k - 1][i]
        c, sd, _ = solve(terms)
        return Equation(
            terms=tuple(names[j] for j in terms),
            effects=tuple(library.terms[j].effect for j in terms),
            coefficients=tuple(float(v) for v in c),
            sd=tuple(float(v * np.sqrt(noise[k])) for v in sd),
            unexplained=float(rss[k - 1][i] / energy),
            likelihood_ratio=float(np.exp(min(choice.evidence(rss, k)[i], 700.0))),
            probability=float(preferred[k - 1][i] / resamples),
        )

    ranking: list[Equation] = []
    for k in range(1, len(sets) + 1):
        first = choice.preferred(rss, k)
        ranking += [equation(k, i) for i in [first, *(i for i in range(min(6, len(sets[k - 1]))) if i != first)][:5]]
    nothing = Equation((), (), (), (), 1.0, 1.0, 1.0)
    chosen = equation(size, choice.preferred(rss, size)) if size else nothing
    equal = choice.near(rss, size) if size else np.array([], int)
    rivals = tuple(equation(size, i) for i in equal if i != choice.preferred(rss, size))
    best = np.array([energy, *(values.min() for values in rss)])
    path = []
    for threshold in np.geomspace(choice.price / energy, 0.5, 40):
        if k := _size(best, np.full(best.size, threshold * energy)):
            path.append((float(threshold), tuple(names[j] for j in sets[k - 1][choice.preferred(rss, k)])))
    return Discovery(
        equation=chosen,
        rivals=rivals,
        inclusion={name: float(n / resamples) for name, n in zip(names, included, strict=True)},
        table=tuple(ranking),
        path=tuple(path),
        threshold=float(choice.price * noise[size] / energy),
        noise_ratio=float(noise[size]),
        rows=rows,
        at_rest=library.at_rest,
        smoothers=tuple(motion.coordinate.smoother for motion in motions),
        stretches=count,
        resamples=resamples,
        status=_status(chosen, rivals, size == max_terms, float(noise[size])),
    )


def _status(equation: Equation, rivals: Sequence[Equation], full: bool, noise: float) -> str:
    share = 1.0 - equation.unexplained
    text = f"{len(equation.terms)} terms ({', '.join(equation.terms)}) explain {share:.6%} of the variance."
    if full:
        text += " More terms than were allowed would explain more."
    if noise > MISFIT:
        text += f" What is left is {noise:.0f} times the instrument's noise: something is missing."
    if rivals:
        others = "; ".join(", ".join(rival.terms) for rival in rivals[:5])
        text += (
            f" Cannot tell it from {len(rivals)} of the same size that fit equally ({others}); the simplest is kept."
        )
    return text


@dataclass(frozen=True)
class RadiusRival:
    """One candidate for rho_t / l as a function of the motion, least squares on all samples."""

    law: str
    parameters: dict[str, float]
    unexplained: float
    likelihood_ratio: float


@dataclass(frozen=True)
class RadiusLaw:
    """The radius law rho_t = l cos(gamma delta), equation (16), against its rivals.

    Attributes
    ----------
    gamma : float
        Of the law (16) alone [-].
    sd : float
        From resamples of whole stretches.
    drift : float
        Half the difference between gamma of the larger and of the smaller deflections: no beam follows (16) exactly.
    dynamic : float
        Change of gamma once the pull of the swinging mass is allowed for: the share of the motion in the static law.
    interval : tuple of float
        95 % interval from all three, added in squares.
    preferred : RadiusRival
        The simplest of the laws that fit equally.
    rivals : tuple of RadiusRival
        All of them, best first.
    noise_ratio : float
        Variance of what is left over that of the instrument's noise, at the frequencies of the motion.
    status : str
        The result as a sentence.
    """

    gamma: float
    sd: float
    drift: float
    dynamic: float
    interval: tuple[float, float]
    preferred: RadiusRival
    rivals: tuple[RadiusRival, ...]
    noise_ratio: float
    status: str

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


def _is_cosine(parameters: Mapping[str, float], dynamic: bool) -> bool:
    return "gamma" in parameters and ("kappa" in parameters) == dynamic


def discover_radius(motions: Sequence[Motion], *, rng: np.random.Generator, resamples: int = 200) -> RadiusLaw:
    """Discover how the radius of an arm's tip depends on its motion.

    cos(gamma delta) and 1 - a delta^2 - b delta^4 compete, each alone and with kappa delta^2 theta_t'^2: the pull of
    the swinging mass straightens the rod, which a static law cannot describe.

    Parameters
    ----------
    motions : sequence of Motion
        Recordings of an arm with tip x and y.
    rng : numpy.random.Generator
        Source of the resamples.
    resamples : int
        Number of resamples of whole stretches.

    Returns
    -------
    RadiusLaw
        gamma with its interval, and the rivals.

    Raises
    ------
    InputError
        If no recording has a radius.
    """
    tracks = [(motion.radius, motion.state(motion.radius.time)) for motion in motions if motion.radius is not None]
    if not tracks:
        raise InputError("The radius law needs recordings of the tip's x and y.")
    delta, rate = (np.concatenate([getattr(state, name) for _, state in tracks]) for name in ("delta", "q_dot"))
    ratio, sd = (np.concatenate([getattr(track, name) for track, _ in tracks]) for name in ("observed", "noise"))
    longest = max(float(track.time[-1] - track.time[0]) for track, _ in tracks)
    blocks = stretches([track.time for track, _ in tracks], longest / 12.0)
    count = int(blocks.max()) + 1
    pull = (delta**2 * rate**2 / sd)[:, None]
    energy = float(np.sum(((1.0 - ratio) / sd) ** 2))

    fits: list[tuple[int, str, dict[str, float], float, FloatArray]] = []
    for pulled in (False, True):
        extra = pull if pulled else pull[:, :0]
        tail = " + kappa delta^2 theta_t'^2" if pulled else ""
        gamma, c, rss = _best_gamma(delta, ratio, sd, extra)
        left = (ratio - np.cos(gamma * delta)) / sd - extra @ c
        labels = ["kappa"][: c.size]
        found = {"gamma": gamma, **dict(zip(labels, map(float, c), strict=True))}
        fits.append((2 + pulled, "cos(gamma delta)" + tail, found, rss, left))
        for degree, law in ((1, "1 - a delta^2"), (2, "1 - a delta^2 - b delta^4")):
            powers = -(delta[:, None] ** (2 * np.arange(1, degree + 1))) / sd[:, None]
            c, rss = _project(1.0 / sd, ratio / sd, columns := np.column_stack([powers, extra]))
            left = (ratio - 1.0) / sd - columns @ c
            found = dict(zip(["a", "b"][:degree] + labels, map(float, c), strict=True))
            fits.append((2 * degree - 1 + pulled, law + tail, found, rss, left))
    fits.sort(key=lambda fit: fit[3])
    noise = _loudness(fits[0][4], (1.0 - ratio) / sd)
    evidence = _evidence(np.array([fit[3] for fit in fits]), fits[0][3], noise, count)
    rivals = tuple(
        RadiusRival(law, found, rss / energy, float(np.exp(min(e, 700.0))))
        for (_, law, found, rss, _), e in zip(fits, evidence, strict=True)
    )
    equal = [i for i, e in enumerate(evidence) if e <= np.log(CANNOT_TELL)]
    preferred = rivals[min(equal, key=lambda i: (fits[i][0], i))]

    gamma, moved = (fit[2]["gamma"] for kappa in (False, True) for fit in fits if _is_cosine(fit[2], kappa))
    size = np.sort(np.abs(delta))
    weight = np.cumsum(size**4)
    half = size[int(np.searchsorted(weight, weight[-1] / 2.0))]  # equal information on either side
    sides = (np.abs(delta) <= half, np.abs(delta) > half)
    low, high = (_best_gamma(delta[k], ratio[k], sd[k], pull[k][:, :0])[0] for k in sides)
    # One Gauss-Newton step from the full estimate for every resample, from sums over stretches.
    slope, rest = -delta * np.sin(gamma * delta) / sd, (ratio - np.cos(gamma * delta)) / sd
    upper, lower = (np.bincount(blocks, slope * other, minlength=count) for other in (rest, slope))
    draws = rng.multinomial(count, np.full(count, 1.0 / count), size=resamples)
    spread, drift, dynamic = float(np.std((draws @ upper) / (draws @ lower))), abs(high - low) / 2.0, abs(moved - gamma)
    width = 1.96 * float(np.linalg.norm([spread, drift, dynamic]))
    status = f"{preferred.law} is the simplest law that fits; in (16) alone gamma = {gamma:.4f} +- {width:.4f}."
    if len(equal) > 1:
        status += f" Cannot tell it from {'; '.join(rivals[i].law for i in equal if rivals[i] is not preferred)}."
    interval = (gamma - width, gamma + width)
    return RadiusLaw(gamma, spread, drift, dynamic, interval, preferred, rivals, noise, status)


def default_pysindy(motions: Sequence[Motion]) -> tuple[tuple[str, ...], ...]:
    """Terms that pysindy finds at its defaults, for comparison: STLSQ with threshold 0.1 and finite differences.

    Returns
    -------
    tuple of tuple of str
        Terms of theta_t'' (of q'') on each recording, with a cubic library in the deflection and the rate.
    """
    found = []
    for motion in motions:
        track = motion.coordinate
        names = ["delta", "theta_t'"] if motion.kind == "flexible_arm" else ["q", "q'"]
        difference = pysindy.FiniteDifference()
        rate = difference(track.observed[:, None], track.time)
        base = track.q - motion.state(track.time).delta
        x = np.column_stack([track.observed - base, rate])
        x_dot = np.column_stack([rate, difference(np.asarray(rate), track.time)])
        model = pysindy.SINDy(feature_library=pysindy.PolynomialLibrary(degree=3))
        model.fit(x, t=track.time, x_dot=x_dot, feature_names=names)
        terms = zip(model.get_feature_names(), model.coefficients()[1], strict=True)
        found.append(tuple(name for name, coefficient in terms if coefficient != 0.0))
    return tuple(found)
