"""Sparse discovery of the equation of motion.

SINDy proposes, trajectories decide: what is found here are names and start values; coefficients are estimated again on
trajectories before anything is reported. Terms are judged by the variance that they explain, never by the size of a
coefficient, so that a friction 200 times smaller than the stiffness counts for what it does to the motion.

References
----------
S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016) 3932 (SINDy); U. Fasel et al., Proc. R. Soc. A 478 (2022)
20210904 (inclusion probabilities).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pysindy
from scipy.stats import chi2

from discovery.foundation.errors import InputError
from discovery.signals.differentiate import FloatArray
from discovery.signals.motion import Motion
from discovery.sindy.evidence import Choice, loudness
from discovery.sindy.library import Library, build_library
from discovery.sindy.rows import RowKind
from discovery.sindy.structure import Discovery, Equation, status_of
from discovery.sindy.subset import BestSubset, residual_sums, stopping_size

__all__ = ["FALSE_ALARM", "PHYSICAL_BOUNDS", "default_pysindy", "discover"]

PHYSICAL_BOUNDS: dict[str, tuple[float, float]] = {
    "viscous_damping": (0.0, np.inf),
    "structural_damping": (0.0, np.inf),
    "coulomb_friction": (0.0, np.inf),
    "quadratic_drag": (0.0, np.inf),
}
"""Passive friction takes energy out of the motion."""

FALSE_ALARM = 1e-3
"""Probability that noise alone adds a term, over the whole library."""


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
        "response", "force" or "power", see `discovery.sindy.rows`.
    degree, trigonometric, at_rest
        See `discovery.sindy.library.build_library`.
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

    noise = np.array([loudness(r, library.target) for r in (library.target, *(solve(s[0])[2] for s in sets))])
    grams, moments, energies = _block_grams(library)
    count = energies.size
    choice = Choice(
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
        again = [residual_sums(gram, moment, e, s, signs) for s in sets]
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
        if k := stopping_size(best, np.full(best.size, threshold * energy)):
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
        status=status_of(chosen, rivals, size == max_terms, float(noise[size])),
    )


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
