"""The paper's claims under test: error ratios, and friction that is linear in the velocity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.paper.figures.look import DASHED
from discovery.report.numbers import significant
from discovery.report.references import paper_numbers
from discovery.report.style import BLUE, GREEN, ORANGE, RED, Picture, new_figure, plain_log
from discovery.report.words import listed

_CLAIM = 0.2
_QUANTITIES = {"position": "tip position", "angle": "tip angle", "radius": "radius"}
_SIZES = {"mean": "mean", "peak": "largest"}
#: Cases of the study of friction: words, and whether the simulated arm has dry friction.
_CASES = {
    "paper_model": ("paper’s model", False),
    "exact_arm": ("exact arm", False),
    "exact_arm_dry": ("exact arm, with\ndry friction", True),
}
_LAWS = {
    "coulomb_friction": ("dry friction", BLUE, "o"),
    "quadratic_drag": ("quadratic drag", GREEN, "s"),
    "amplitude_dependent_damping": ("damping by amplitude", RED, "^"),
}


def _printed(quantity: str, size: str) -> float | None:
    errors = paper_numbers()["errors"]
    key = f"{quantity}_{size}"
    return errors["declared"][key] / errors["linear"][key] if key in errors["declared"] else None


def draw_ratios(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return the nonlinear model's error over the linear one's, with the paper's own and its claim."""
    found = numbers["error_ratios"]
    kinds = [(q, s) for q in _QUANTITIES for s in _SIZES if f"{q}_{s}" in found]
    ours = [100 * found[f"{q}_{s}"] for q, s in kinds]
    printed = {i: 100 * p for i, kind in enumerate(kinds) if (p := _printed(*kind)) is not None}
    figure = new_figure(0.34 * len(kinds) + 1.1)
    axes = figure.subplots()
    colours = [BLUE if r < 100 * _CLAIM else ORANGE for r in ours]
    axes.barh(range(len(kinds)), ours, height=0.55, color=colours, zorder=2)
    axes.plot(list(printed.values()), list(printed), "D", color="black", markersize=5, label="paper’s own numbers")
    axes.axvline(100 * _CLAIM, **DASHED, label="claim: less than 20 %")
    for i, ratio in enumerate(ours):
        ink = "white" if colours[i] == BLUE else "black"
        axes.annotate(significant(ratio, 2), (0, i), (4, 0), textcoords="offset points", va="center", color=ink)
    axes.set_yticks(range(len(kinds)), [f"{_QUANTITIES[q]}, {_SIZES[s]}" for q, s in kinds])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.15 * max(*ours, *printed.values()))
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("error over the linear model’s [%]")
    figure.legend(loc="outside upper left", ncols=2)
    above = listed(f"{_SIZES[s]} {_QUANTITIES[q]}" for (q, s), r in zip(kinds, ours, strict=True) if r >= 100 * _CLAIM)
    words = f"Above the claimed 20 % (orange): {above or 'none'}"
    return [
        Picture(
            "error_ratios",
            figure,
            f"Error of the paper’s nonlinear model over the linear model’s; diamonds: from the numbers that the paper "
            f"prints. {words}.",
            f"Bars of {len(kinds)} error ratios in per cent with a line at 20. {words}.",
        )
    ]


def draw_friction(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return what each other law of friction finds and removes, on three pairs of model and simulated arm."""
    found, truth = numbers["friction"], numbers["friction"]["dry_truth"]
    figure = new_figure(4.6)
    top, bottom = figure.subplots(2, 1)
    estimates = {}
    for row, (case, (_, dry)) in enumerate(_CASES.items()):
        for shift, law in zip((-0.22, 0.0, 0.22), found[case], strict=False):
            words, colour, marker = _LAWS[law["law"]]
            name = words if row == 0 else None
            bottom.plot(law["misfit_after"], row + shift, marker, color=colour, markersize=6, zorder=3, label=name)
            if law["law"] == "coulomb_friction":
                estimates[case] = 100 * law["value"] / truth
                top.errorbar(estimates[case], row, xerr=100 * law["sd"] / truth, fmt=marker, color=colour, capsize=3)
        before = found[case][0]["misfit_before"]
        bottom.plot(
            [before] * 2,
            [row - 0.36, row + 0.36],
            color="black",
            linewidth=2,
            label=None if row else "linear friction alone",
        )
        top.plot(100.0 * dry, row, "|", color="black", markersize=18, markeredgewidth=2, zorder=2.5)
    bottom.axvline(1.0, **DASHED, label="noise")
    bottom.set_xscale("log")
    plain_log(bottom.xaxis)
    top.set_xlabel("dry friction found, over that of the third arm [%]\n(bar: the truth)")
    bottom.set_xlabel("misfit with one more law of friction [noise sds]")
    for axes in (top, bottom):
        axes.set_yticks(range(len(_CASES)), [words for words, _ in _CASES.values()])
        axes.set_ylim(len(_CASES) - 0.5, -0.5)
        axes.grid(axis="y", visible=False)
    figure.legend(*bottom.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    best = min(found["exact_arm_dry"], key=lambda law: law["misfit_after"])
    left = f"{_LAWS[best['law']][0]} leaves least, {significant(best['misfit_after'])} noise sds"
    shares = {case: f"{significant(share)} %" for case, share in estimates.items()}
    words = (
        f"the paper’s model finds {shares['paper_model']} where there is none, the exact arm {shares['exact_arm']}, "
        f"and {shares['exact_arm_dry']} where it is there"
    )
    return [
        Picture(
            "friction",
            figure,
            f"Dry friction, over that of the third simulated arm ({significant(1e3 * found['dry_force'], 2)} mN): "
            f"{words}. Below: the misfit that each of three laws of friction leaves. On the third arm {left}.",
            f"Two panels of dots. Dry friction: {words}. Misfit by law of friction in three cases.",
        )
    ]
