"""What the intervals of many manoeuvres are worth: coverage of both targets, widths, and scatter over the naive sd."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.calibration.manoeuvres import DISTRIBUTION, GROUP, LEVEL, MODELS, SHOWN, first_principles
from benchmarks.calibration.ranks import proportion

#: What the intervals are made from, in the order of the tables.
METHODS = {
    "independent": "one manoeuvre, residuals taken as independent (naive)",
    "spectrum": "one manoeuvre, from the residual's spectrum",
    "correlated noise": "one manoeuvre, noise taken as correlated",
    "together, independent": f"{GROUP} manoeuvres, residuals taken as independent (naive)",
    "together, by manoeuvre": f"{GROUP} manoeuvres, from how they differ",
    "together, wider": f"{GROUP} manoeuvres, the wider of both (honest)",
}
TARGETS = {"pooled": "noise-free fit of all manoeuvres together", "first principles": "elastica and rig"}
MEANING = (
    "Under the paper's model alpha and beta are no properties of the arm: the model has a constant radius, so what "
    "least squares gives them, the pseudo-true values, also stands in for the inertia of the moving radius, and "
    "depends on how far the manoeuvres deflect the arm. One manoeuvre has one deflection: it leaves alpha and beta to "
    "trade against each other, and no interval from it alone can know the values that other deflections would give. "
    "Noise taken as correlated weighs the record differently, and so has pseudo-true values of its own."
)


def _half(interval: Sequence[float]) -> float:
    return 0.5 * (interval[1] - interval[0])


def table(model: str, groups: Sequence[Mapping[str, Any]], pooled_target: Mapping[str, float]) -> dict[str, Any]:
    """Return the coverages of one model.

    Parameters
    ----------
    model : str
    groups : sequence of mapping
        From `discovery.runs.campaign.rows`, results of `benchmarks.calibration.manoeuvres.group`.
    pooled_target : mapping of str to float
        From `benchmarks.calibration.manoeuvres.noise_free`.
    """
    targets = {"pooled": pooled_target, "first principles": first_principles(model)}
    alone = [intervals for row in groups for intervals in row["alone"]]
    rows = []
    for method in METHODS:
        source = alone if method in alone[0] else [row["together"] for row in groups]
        for name in SHOWN[model]:
            found = [intervals[method][name] for intervals in source]
            row = {
                "method": method,
                "parameter": name,
                "n": len(found),
                "width": float(np.median(np.ptp(found, axis=1))),
            }
            for target, values in targets.items():
                inside = sum(low <= values[name] <= high for low, high in found)
                share, low, high = proportion(inside, len(found))
                row[target] = {"share": share, "low": low, "high": high}
            rows.append(row)
    scatter = {}
    for name in SHOWN[model]:
        estimates = [estimate[name] for row in groups for estimate in row["estimates"]]
        # 1.645 standard deviations are half of a 90 % interval.
        naive = float(np.median([_half(intervals["independent"][name]) for intervals in alone])) / 1.645
        middles = [np.mean(row["together"]["together, independent"][name]) for row in groups]
        together = float(np.median([_half(row["together"]["together, independent"][name]) for row in groups])) / 1.645
        scatter[name] = {
            "sd": float(np.std(estimates, ddof=1)),
            "over_naive": float(np.std(estimates, ddof=1)) / naive,
            "together_over_naive": float(np.std(middles, ddof=1)) / together,
        }
    return {
        "model": MODELS[model][2],
        "manoeuvres": len(alone),
        "groups": len(groups),
        "distribution": DISTRIBUTION,
        "level": LEVEL,
        "deflections": np.quantile([d for row in groups for d in row["deflections"]], [0, 0.5, 1]).tolist(),
        "reduced_chi2": float(np.median([c for row in groups for c in row["reduced_chi2"]])),
        "targets": {t: {n: values[n] for n in SHOWN[model]} for t, values in targets.items()},
        "rows": rows,
        "scatter": scatter,
        "meaning": MEANING if model == "paper" else "",
    }


def text(found: Mapping[str, Any]) -> str:
    """Return a table for the terminal."""

    def share(row: Mapping[str, float]) -> str:
        return f"{100 * row['share']:5.1f} ({100 * row['low']:.0f} to {100 * row['high']:.0f})"

    low, middle, high = found["deflections"]
    lines = [
        f"{found['model']}: {found['manoeuvres']} manoeuvres, {found['groups']} groups of {GROUP}; "
        f"{found['distribution']}; largest deflections {low:.2f} to {high:.2f} rad, median {middle:.2f}; chi2/n "
        f"{found['reduced_chi2']:.3g}",
        f"{'90 % interval':24} {'':6} {'covers pooled, %':>22} {'first principles, %':>22} {'median width':>13}",
    ]
    for row in found["rows"]:
        shares = f"{share(row['pooled']):>22} {share(row['first principles']):>22}"
        lines.append(f"{row['method']:24} {row['parameter']:6} {shares} {row['width']:13.3g}")
    for name, row in found["scatter"].items():
        both = " and ".join(f"{found['targets'][target][name]:.5g} ({target})" for target in TARGETS)
        lines.append(
            f"{name}: {both}; scatter of one manoeuvre {row['sd']:.3g}, {row['over_naive']:.1f} times the naive sd; of "
            f"{GROUP} together {row['together_over_naive']:.1f} times"
        )
    return "\n".join([*lines, found["meaning"]]).rstrip()
