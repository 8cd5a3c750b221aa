"""What a posterior costs: this package beside its peers, on one data set in one run.

Usage: ``python benchmarks/posterior.py OUT.json [--seconds 60] [--effective 200000]``. Writes the numbers as JSON, and
beside it a table (``.md``) and a picture (``.svg``). The figure is bulk effective samples of the worst parameter per
second, burn-in included, compilation not. Peers of the group ``bench`` that are not installed are left out.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from samplers.gradients import numpyro_diffrax, nutpie_compiled
from samplers.job import NAMES, Job, Result, make_job
from samplers.vectorised import as_users_write_it, importance, ours

from discovery.report.style import BLUE, GREY, Picture, new_figure, render, styled

PACKAGES = ("numpy", "numba", "scipy", "emcee", "numpyro", "diffrax", "jax", "nutpie")


def measured(job: Job, seconds: float, effective: float, runs: int) -> tuple[list[Result], dict[str, str]]:
    """Run all samplers; return what they achieved, and why the others are left out."""
    results = [ours(job, effective, runs), importance(job)]
    left_out: dict[str, str] = {}
    peers: dict[str, Callable[[], Result]] = {
        "nutpie, compiled gradient": lambda: nutpie_compiled(job),
        "NumPyro NUTS + diffrax": lambda: numpyro_diffrax(job, seconds),
    }
    for name, run in peers.items():
        try:
            results.append(run())
        except ImportError as error:
            left_out[name] = f"{error.name} is not installed"
    return [*results, *as_users_write_it(job, seconds)], left_out


def agreement(result: Result, reference: Result) -> dict[str, float]:
    """Return the largest difference of means and of standard deviations, in Monte Carlo standard errors."""
    mean, sd = (np.array([f(r.kept, axis=(0, 1)) for r in (result, reference)]) for f in (np.mean, np.std))
    share = np.sqrt(1 / result.effective + 1 / reference.effective)
    return {
        "z_mean": float(np.abs((mean[0] - mean[1]) / (sd[1] * share)).max()),
        "z_sd": float(np.abs((sd[0] / sd[1] - 1) / (share / np.sqrt(2))).max()),
    }


def rows(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row a sampler, the fastest first."""
    found = []
    for result in results:
        worst = float(result.effective.min())
        found.append(
            {
                "sampler": result.name,
                "effective_per_second": worst / result.seconds,
                "effective": worst,
                "seconds": result.seconds,
                "evaluations": result.evaluations,
                "effective_per_evaluation": worst / result.evaluations,
                **(agreement(result, results[0]) if result is not results[0] else {"z_mean": 0.0, "z_sd": 0.0}),
                "mean": dict(zip(NAMES, result.kept.mean(axis=(0, 1)).tolist(), strict=True)),
                "sd": dict(zip(NAMES, result.kept.std(axis=(0, 1)).tolist(), strict=True)),
                "note": result.note,
                **result.figures,
            }
        )
    return sorted(found, key=lambda row: -row["effective_per_second"])


def table(found: Sequence[dict[str, Any]], left_out: dict[str, str]) -> str:
    """Return the table in Markdown."""
    lines = [
        "| sampler | effective samples per second | of evaluations | mean differs by [se] | sd differs by [se] | |",
        "|---|--:|--:|--:|--:|---|",
    ]
    for r in found:
        numbers = (f"{r['effective_per_second']:.3g}", f"{r['effective_per_evaluation']:.2g}")
        lines.append(f"| {r['sampler']} | {' | '.join(numbers)} | {r['z_mean']:.1f} | {r['z_sd']:.1f} | {r['note']} |")
    return "\n".join([*lines, *(f"| {name} | left out | | | | {why} |" for name, why in left_out.items())]) + "\n"


def picture(found: Sequence[dict[str, Any]]) -> Picture:
    """Return a bar a sampler."""
    figure = new_figure(0.42 * len(found) + 0.9)
    axis = figure.subplots()
    places = np.arange(len(found))[::-1]
    rates = [r["effective_per_second"] for r in found]
    colours = [BLUE if "this package" in r["sampler"] else GREY for r in found]
    axis.barh(places, rates, color=colours, height=0.62)
    for place, rate in zip(places, rates, strict=True):
        text = f"{rate:,.2g}" if rate < 100 else f"{rate:,.0f}"
        axis.annotate(text, (rate, place), (4, 0), textcoords="offset points", va="center")
    axis.set_yticks(places, [r["sampler"] for r in found])
    axis.set(xscale="log", xlim=(0.01, 12 * max(rates)), xlabel="effective samples per second")
    axis.grid(visible=False, axis="y")
    return Picture(
        "posterior", figure, "Effective samples per second of every sampler.", "Bars on a logarithmic scale."
    )


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0, help="bound for each slow peer")
    parser.add_argument("--effective", type=float, default=200_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    job = make_job()
    results, left_out = measured(job, options.seconds, options.effective, options.runs)
    found = rows(results)
    text = table(found, left_out)
    print(text)
    machine = {"cpus": os.cpu_count(), "load": os.getloadavg()[0], "python": platform.python_version(), **_versions()}
    solver = {"step_s": job.fitted.problem.bench.step, "shift_sd": job.fitted.solver_shift}
    numbers = {"machine": machine, "solver": solver, "samplers": found, "left_out": left_out}
    options.out.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    options.out.with_suffix(".md").write_text(text, encoding="utf-8")
    with styled():
        suffix, content = render(picture(found))
    options.out.with_suffix(suffix).write_bytes(content)


if __name__ == "__main__":
    main()
