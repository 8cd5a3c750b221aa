"""What nothing in the catalogue explains: the missing force in time and against states, and the patch for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.report.numbers import chance, scale_for, significant, unit_text
from discovery.report.results import Run
from discovery.report.style import BLUE, GREY, ORANGE, SKY, Picture, label, new_figure, verbatim
from discovery.report.tables import Table
from discovery.report.words import listed

if TYPE_CHECKING:
    import xarray as xr

#: Variables in words where these are not their names.
_WORDS = {
    "deflection": "deflection δ",
    "angle": "angle θₜ of the tip",
    "rate": "rate θ̇ₜ",
    "motor_angle": "motor angle θₘ",
}
_SHORT = {"angle": "angle θₜ"}
#: What the force is drawn against.
_SHOWN = ("deflection", "angle", "rate", "motor_angle", "output", "input")
#: Recordings of which the force is drawn in time.
_MOST = 3


def _word(run: Run, variable: str) -> str:
    """Return one variable in words."""
    own = {} if run.system.has_rod else {"rate": "rate q̇", "output": run.output_name, "input": run.input_name}
    return own.get(variable, _WORDS.get(variable, variable))


def _names(run: Run, variables: Sequence[str]) -> str:
    if tuple(variables) == ("x", "y"):
        return "absolute position (x, y)"
    return listed(_word(run, v) for v in variables)


def _unit(run: Run) -> str:
    return unit_text("q s^-2", run.coordinate_unit)


def _forces(run: Run) -> dict[str, xr.Dataset]:
    """Return the reconstructed forces by recording; none where nothing was left unexplained."""
    missing = run.results.get("missing_force")
    found = {r["recording"]: run.open("force.nc", r["recording"]) for r in missing["recordings"]} if missing else {}
    return {name: force for name, force in found.items() if force is not None}


def draw_force(run: Run) -> Picture | None:
    """Return the force in time with its 90 % band, for the first recordings."""
    forces = dict(list(_forces(run).items())[:_MOST])
    if not forces:
        return None
    figure = new_figure(0.9 + 1.8 * len(forces))
    rows = np.atleast_1d(figure.subplots(len(forces), 1, sharex=True))
    for axes, (name, force) in zip(rows, forces.items(), strict=True):
        time, mean, sd = (force[k].to_numpy() for k in ("time", "force", "sd"))
        axes.fill_between(time, mean - 1.645 * sd, mean + 1.645 * sd, color=SKY, alpha=0.5, linewidth=0)
        axes.plot(time, mean, color=BLUE, linewidth=1.0)
        axes.axhline(0.0, color=GREY, linewidth=0.7)
        axes.set_title(verbatim(name), fontsize=8.5, color=GREY)
        axes.set_ylabel(label("force", _unit(run)))
    rows[-1].set_xlabel("time [s]")
    caption = "The force per unit inertia that would make the final model follow the recording, with its 90 % band."
    alt = "Reconstructed missing force against time with a band, one panel a recording."
    return Picture("missing_force", figure, caption, alt)


def draw_states(run: Run) -> Picture | None:
    """Return the force against every state, with the law of a patch where it has one variable."""
    forces = _forces(run)
    if not forces:
        return None
    variables = [v for v in _SHOWN if all(v in f and np.ptp(f[v].to_numpy()) > 0 for f in forces.values())]
    unit = run.coordinate_unit
    units = {"rate": f"{unit}/s", "input": run.input_unit}
    rows = -(-len(variables) // 2)
    figure = new_figure(0.4 + 2.1 * rows)
    grid = figure.subplots(rows, 2, sharey=True, squeeze=False)
    laws = [p for p in run.results["missing_force"]["patches"] if p["accepted"] and p["curve"]]
    for axes, variable in zip(grid.flat, variables, strict=False):
        for force in forces.values():
            axes.plot(force[variable], force["force"], ".", color=BLUE, markersize=2.5, alpha=0.6)
        for law in laws[:1]:
            if variable in law["curve"]:
                axes.plot(law["curve"][variable], law["curve"]["force"], color=ORANGE, linewidth=1.6)
        axes.set_xlabel(label(_SHORT.get(variable, _word(run, variable)), units.get(variable, unit)))
    for axes in grid.flat[len(variables) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel(label("force", _unit(run)))
    line = " Orange: the law of the patch, whose parameters differ a little from the model's." if laws else ""
    caption = f"The missing force against what it may depend on: a line where it depends on it alone.{line}"
    alt = "Missing force against each state, one panel each."
    return Picture("missing_force_states", figure, caption, alt, raster=True)


def draw_map(run: Run) -> Picture | None:
    """Return the force where the tip was, in the plane; None for a system without one."""
    forces = [f for f in _forces(run).values() if "x" in f]
    if not forces:
        return None
    x, y, force = (np.concatenate([f[k].to_numpy() for f in forces]) for k in ("x", "y", "force"))
    most = float(np.quantile(np.abs(force), 0.98)) or 1.0
    figure = new_figure(3.4)
    axes = figure.subplots()
    # Purple to orange through pale: told apart by every reader; dots grow with the force.
    dots = axes.scatter(
        x, y, c=force, s=4 + 30 * np.minimum(np.abs(force) / most, 1), cmap="PuOr_r", vmin=-most, vmax=most,
        edgecolors=GREY, linewidths=0.2,
    )  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [arm lengths]", ylabel="y [arm lengths]")
    figure.colorbar(dots, ax=axes, label=label("force", _unit(run)), shrink=0.85)
    caption = "The missing force where the tip was: a place that always pushes alike shows as one colour."
    alt = "Positions of the tip in the plane, coloured by the missing force."
    return Picture("missing_force_map", figure, caption, alt)


def dependence_table(run: Run) -> Table | None:
    """Return how far each set of variables predicts the force."""
    missing = run.results.get("missing_force")
    if not missing or not missing["dependence"]:
        return None
    chosen = [tuple(v) for v in missing["depends_on"]]
    cells, raw = [], []
    for d in missing["dependence"]:
        mark = "chosen" if tuple(d["variables"]) in chosen else ""
        share = "none" if d["share"] <= 0 else f"{100 * d['share']:.0f} %"
        cells.append([_names(run, d["variables"]), share, chance(d["p_value"]), mark])
        raw.append(["; ".join(d["variables"]), d["share"], d["p_value"], bool(mark)])
    caption = (
        "What the missing force depends on: share of its power that a smooth law of these predicts in periods that it "
        "did not see, and the probability of such a share by chance (circular shifts in time). Chosen: the fewest "
        "variables that predict nearly as much as the best."
    )
    head, keys = ("depends on", "predicted share", "p value", ""), ("variables", "share", "p_value", "chosen")
    return Table("force_dependence", caption, head, cells, keys, raw, text=(0, 3))


def patches_table(run: Run) -> Table | None:
    """Return the patches that were tried."""
    missing = run.results.get("missing_force")
    if not missing or not missing["patches"]:
        return None
    unit = run.loop["errors"]["unit"]
    cells = []
    for p in missing["patches"]:
        scale = scale_for(unit, p["before"] or 0.0)
        errors = [scale.text(p[k]) for k in ("before", "after")]
        accepted = "accepted" if p["accepted"] else "refused"
        cells.append([p["kind"], _names(run, p["variables"]), *errors, scale.symbol, accepted])
    head = ("patch", "in", "held-out rms without", "with", "unit", "")
    keys = ("kind", "formula", "before", "after", "accepted", "reason")
    caption = (
        "Laws of the missing force, run freely on the held-out recordings. A patch describes; it explains nothing."
    )
    return Table("patches", caption, head, cells, keys, missing["patches"], text=(0, 1, 4, 5))


def sentences(run: Run) -> list[str]:
    """Return in plain words what the missing force is, what it depends on and whether a patch is offered."""
    missing: Mapping[str, Any] | None = run.results.get("missing_force")
    if not missing:
        return []
    unit = _unit(run)
    size, sd = (float(np.sqrt(np.mean([r[k] ** 2 for r in missing["recordings"]]))) for k in ("force_rms", "force_sd"))
    found = [
        f"A force of {significant(size, 2)} {unit} rms (known to {significant(sd, 2)} {unit}) would make the final "
        "model follow the recordings. The fitted parameters are held: what they absorbed is not in it."
    ]
    if missing["depends_on"]:
        best = next(d for d in missing["dependence"] if d["variables"] in missing["depends_on"])
        sets = [_names(run, v) for v in missing["depends_on"]]
        doubt = "" if len(sets) == 1 else " These recordings cannot tell which."
        found.append(
            f"It depends on the {' or the '.join(sets)}: that predicts {100 * best['share']:.0f} % of its power in "
            f"periods that the law did not see.{doubt}"
        )
    else:
        found.append("It depends on nothing that was tested.")
    patch = next((p for p in missing["patches"] if p["accepted"]), None)
    if patch is None:
        found.append("No law of it predicts the held-out recordings well enough; no correction is applied.")
    else:
        scale = scale_for(run.loop["errors"]["unit"], patch["before"])
        before, after = (scale.text(patch[k]) for k in ("before", "after"))
        law = f"a {patch['kind']} in the {_names(run, patch['variables'])}"
        found.append(
            f"A patch, not an explanation: with {law} the held-out rms error falls from {before} to "
            f"{after} {scale.symbol}. It holds within the range that was seen."
        )
    return found
