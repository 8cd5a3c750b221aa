"""Tables of ranks and coverages, with the binomial scatter that so many replications have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta, binom, chisquare

FloatArray = NDArray[np.float64]
LEVELS = (0.5, 0.8, 0.9, 0.95)
BINS = 20
GOAL = (0.88, 0.92)


def proportion(hits: int, n: int, level: float = 0.95) -> tuple[float, float, float]:
    """Return a share and its Clopper-Pearson interval."""
    tail = (1 - level) / 2
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, n - hits + 1))
    high = 1.0 if hits == n else float(beta.ppf(1 - tail, hits + 1, n - hits))
    return hits / n, low, high


def covered(pit: ArrayLike, level: float) -> NDArray[np.bool_]:
    """Tell where the equal-tailed interval of a level holds the truth, from the posterior probability below it."""
    return np.abs(np.asarray(pit, float) - 0.5) <= level / 2


def coverage(pit: ArrayLike, levels: Sequence[float] = LEVELS) -> dict[str, Any]:
    """Return the share of truths inside the interval of every level, with 95 % intervals."""
    pit = np.asarray(pit, float)
    rows = {f"{level:g}": proportion(int(covered(pit, level).sum()), pit.size) for level in levels}
    return {level: {"share": share, "low": low, "high": high} for level, (share, low, high) in rows.items()}


def curve(pit: ArrayLike, count: int = 99) -> dict[str, list[float]]:
    """Return the coverage at many levels, and the 95 % band of an exact posterior at each."""
    pit = np.asarray(pit, float)
    levels = np.linspace(0.0, 1.0, count + 2)[1:-1]
    share = [float(covered(pit, level).mean()) for level in levels]
    low, high = (binom.ppf(q, pit.size, levels) / pit.size for q in (0.025, 0.975))
    return {"level": levels.tolist(), "share": share, "low": low.tolist(), "high": high.tolist()}


def histogram(rank: ArrayLike, ranked: int) -> dict[str, Any]:
    """Return how many ranks (0 to `ranked`) fall in each bin, the 95 % band of a bin, and the p-value of uniformity."""
    rank = np.asarray(rank, int)
    counts = np.bincount(rank * BINS // (ranked + 1), minlength=BINS)
    low, high = binom.ppf((0.025, 0.975), rank.size, 1 / BINS)
    return {
        "counts": counts.tolist(),
        "low": float(low),
        "high": float(high),
        "outside": int(((counts < low) | (counts > high)).sum()),
        "p": float(chisquare(counts).pvalue),
    }


def plain_name(name: str) -> str:
    """Return a quantity's name without that of its recording."""
    return name.partition("[")[0]


def summary(rows: Sequence[dict[str, Any]], ranked: int) -> dict[str, Any]:
    """Return what replications of one study say of every quantity."""
    found = {}
    for name in rows[0]["pit"]:
        pit = np.array([row["pit"][name] for row in rows])
        found[plain_name(name)] = {
            "coverage": coverage(pit),
            "curve": curve(pit),
            "histogram": histogram([row["rank"][name] for row in rows], ranked),
        }
    return {
        "replications": len(rows),
        "unreliable": sum(not row["reliable"] for row in rows),
        "effective": float(np.median([row["effective"] for row in rows])),
        "quantities": found,
    }
