"""The general model (7): its distance from arms with a rod, and the two components of its force."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.paper.figures.look import DASHED, FloatArray, marks
from benchmarks.paper.stand import POSITION_NOISE
from discovery.report.numbers import significant
from discovery.report.style import BLUE, GREY, RED, Picture, new_figure, plain_log

#: How the rod's mass is treated: words, colour and marker.
_ROD = {"massless": ("rod massless", RED, "^"), "rod counted": ("33/140 of the rod at the tip", BLUE, "o")}


def draw_limit(numbers: Mapping[str, Any], curves: Mapping[str, Mapping[str, FloatArray]]) -> list[Picture]:
    """Return the distance of the general model from the twin and from the exact arm as the rod gets lighter."""
    moves = list(dict.fromkeys(r["move"] for r in numbers["exact"]))
    figure = new_figure(2.1 * len(moves) + 1.1)
    panels = np.atleast_1d(figure.subplots(len(moves), 1, sharex=True, sharey=True))
    for axes, move in zip(panels, moves, strict=True):
        for key, (_, colour, marker) in _ROD.items():
            for reference, line, face in (("exact", "-", "white"), ("twin", "none", colour)):
                rows = [r for r in numbers[reference] if r["move"] == move]
                axes.loglog(
                    [r["mass_ratio"] for r in rows],
                    [1e3 * r[key] for r in rows],
                    marker,
                    color=colour,
                    linestyle=line,
                    linewidth=1.0,
                    markersize=5,
                    markerfacecolor=face,
                )
        noise = axes.axhline(1e3 * POSITION_NOISE, **DASHED, label="camera’s noise")
        axes.set_title(f"motor: {move}", fontsize=8.5, color=GREY)
        axes.set_ylabel("mean distance [mm]")
        for axis in (axes.xaxis, axes.yaxis):
            plain_log(axis)
    panels[-1].set_xlabel("mass of the rod over that of the tip [–]")
    treated = [{"marker": m, "color": c, "label": words} for words, c, m in _ROD.values()]
    against = [
        {"marker": "o", "color": GREY, "label": "against the twin"},
        {"marker": "o", "color": GREY, "markerfacecolor": "white", "linestyle": "-", "label": "against the exact arm"},
    ]
    figure.legend(handles=[*marks(panels[0], *treated, *against), noise], loc="outside upper left", ncols=2, fontsize=8)
    light = min(numbers["exact"], key=lambda r: r["mass_ratio"])["mass_ratio"]
    at = [r for r in numbers["exact"] if r["mass_ratio"] == light]
    words = ", ".join(f"{significant(1e3 * r['rod counted'], 2)} mm ({r['move']})" for r in at)
    paper = significant(1e3 * numbers["paper_rig"]["mean"], 2)
    return [
        Picture(
            "massless_limit",
            figure,
            f"Mean distance of the general model (7) from arms with a rod, over 6 s, as the rod gets lighter. Its mass "
            f"counted at the tip, the distance is {paper} mm for the paper’s rod, and for one of {light:g} tip "
            f"masses {words}.",
            f"Distance on logarithmic axes against the rod’s share of the mass, for two motions of the motor: it falls "
            f"as the rod gets lighter, with the rod counted to {words}.",
        )
    ]


def draw_motion(numbers: Mapping[str, Any], curves: Mapping[str, Mapping[str, FloatArray]]) -> list[Picture]:
    """Return the force components and the coupling torque of one motion, and its distance from the twin."""
    motion = curves["motion"]
    time = motion["time"]
    figure = new_figure(4.8)
    force, torque, distance = figure.subplots(3, 1, sharex=True)
    force.plot(time, motion["tangential"], color=BLUE, linewidth=1.7, label="force across the radius")
    force.plot(time, motion["radial"], color=RED, linewidth=0.8, label="force along it")
    torque.plot(time, motion["coupling_torque"], color="black", linewidth=1.0)
    distance.plot(time, 1e3 * np.hypot(*(motion["tip"] - motion["truth"]).T), color="black", linewidth=1.0)
    force.set_ylabel("force [N]")
    torque.set_ylabel("torque [N m]")
    distance.set_ylabel("distance [mm]")
    distance.set_xlabel("time [s]")
    distance.set_xlim(time[0], time[-1])
    distance.set_ylim(bottom=0.0)
    figure.legend(*force.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    figure.align_ylabels()
    rig = numbers["paper_rig"]
    words = (
        f"largest force across the radius {significant(numbers['largest_tangential'], 2)} N; distance from the twin "
        f"{significant(1e3 * rig['mean'], 2)} mm on average and {significant(1e3 * rig['peak'], 2)} mm at most"
    )
    return [
        Picture(
            "general_motion",
            figure,
            f"The general model on the paper’s manoeuvre: both components of the force on the tip, coupling torque "
            f"(11), and distance from the twin, the rod counted. {words[:1].upper()}{words[1:]}. The bursts of the "
            f"force along the radius while the motor moves are ringing, whose size depends on the internal damping.",
            f"Three panels against time: force components, coupling torque, distance from the twin; {words}.",
        )
    ]
