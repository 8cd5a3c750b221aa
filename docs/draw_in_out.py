"""Draw what goes in and what comes out, on the spring bench: ``python docs/draw_in_out.py OUT.png``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

import discovery
from discovery.report.numbers import uncertain

FOLDER = Path(__file__).parents[1] / "datasets" / "spring_bench"
#: Colours of Okabe and Ito, which the colour-blind can tell apart.
BEFORE, AFTER = "#d55e00", "#009e73"


def heading(ax: Axes, words: str) -> None:
    """Write the heading of a panel."""
    ax.set_title(words, loc="left", fontsize=11, fontweight="bold")


def draw_recording(ax: Axes, data: discovery.Dataset) -> None:
    """Draw the first recording."""
    recording = data.train[0].recording
    ax.plot(recording.time, 1e3 * recording.output[:, 0], color="0.15", lw=0.9)
    ax.set(xlabel="time [s]", ylabel="position [mm]", xlim=(0, 4))
    heading(ax, "recordings (CSV)")


def draw_declared(ax: Axes) -> None:
    """Write the declared model as the rig file states it."""
    ax.axis("off")
    heading(ax, "rig file with the declared model")
    lines = ('kind = "oscillator"', "output: position_mm, noise 0.05 mm", "effects: viscous_damping, linear_stiffness")
    ax.text(0.0, 0.93, "\n".join(lines), va="top", fontsize=9.5, family="monospace", linespacing=1.5)
    ax.text(0.5, 0.14, r"$\ddot q + \xi\,\dot q + \alpha\,q = 0$", ha="center", fontsize=15)


def draw_answer(ax: Axes, found: discovery.LoopResult) -> None:
    """Write verdict and final equation."""
    ax.axis("off")
    heading(ax, "answer")
    values, sd = found.after.values, found.after.sd
    lines = (
        f"verdict: {found.verdict}",
        f"missing: {', '.join(found.added)}",
        f"f_c = {uncertain(values['f_c'], sd['f_c'])} m/s²   (simulated: 0.12)",
    )
    ax.text(0.0, 0.93, "\n".join(lines), va="top", fontsize=9.5, family="monospace", linespacing=1.5)
    equation = rf"$\ddot q + {values['xi']:.3f}\,\dot q + {values['alpha']:.1f}\,q + {values['f_c']:.3f}\,"
    ax.text(0.5, 0.14, equation + r"\mathrm{sgn}\,\dot q = 0$", ha="center", fontsize=15, color=AFTER)


def draw_residuals(ax: Axes, data: discovery.Dataset, found: discovery.LoopResult) -> None:
    """Draw what both models leave of the recording that was held out."""
    recording = data.holdout[0].recording
    for name, colour, words in (("before", BEFORE, "declared model"), ("after", AFTER, "with dry friction")):
        left = 1e3 * (recording.output[:, 0] - found.predictions[name][-1][:, 0])
        rms = float(np.sqrt(np.mean(left**2)))
        ax.plot(recording.time, left, color=colour, lw=0.9, label=f"{words}: {rms:.2g} mm rms")
    ax.set(xlabel="time [s]", ylabel="error [mm]", xlim=(0, 4), ylim=(-3.0, 5.0))
    ax.legend(frameon=False, fontsize=9, loc="upper left")
    heading(ax, "error on a recording that no fit saw")


def draw() -> Figure:
    """Return the picture."""
    data = discovery.load_dataset(FOLDER / "rig.toml")
    found = discovery.close_loop(data)
    figure = Figure(figsize=(10.5, 4.6), dpi=110)
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.5), hspace=0.3, wspace=0.26, left=0.07, right=0.98)
    grid.update(top=0.86, bottom=0.11)
    panels = [[figure.add_subplot(grid[row, column]) for column in (0, 1)] for row in (0, 1)]
    draw_declared(panels[0][0])
    draw_recording(panels[1][0], data)
    draw_answer(panels[0][1], found)
    draw_residuals(panels[1][1], data, found)
    figure.text(0.07, 0.94, "what goes in", fontsize=14, color="#0072b2", fontweight="bold")
    left = panels[0][1].get_position().x0
    figure.text(left, 0.94, "what comes out", fontsize=14, color="#0072b2", fontweight="bold")
    figure.add_artist(
        FancyArrowPatch((0.235, 0.952), (left - 0.01, 0.952), arrowstyle="-|>", mutation_scale=18, color="#0072b2")
    )
    for row in panels:
        for ax in row:
            ax.spines[["top", "right"]].set_visible(False)
    return figure


def main() -> None:
    """Draw and write the picture."""
    draw().savefig(sys.argv[1], metadata={"Software": None}, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
