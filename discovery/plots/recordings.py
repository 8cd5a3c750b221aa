"""Recordings as they were understood: output over time, its input behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discovery.plots.axes import axes_below

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from discovery.recordings.dataset import Dataset

__all__ = ["plot_recordings"]


def plot_recordings(dataset: Dataset, axes: Sequence[Axes] | None = None) -> list[Axes]:
    """Draw every recording of a data set, one below the other, in SI units.

    Parameters
    ----------
    dataset : Dataset
    axes : sequence of Axes, optional
        One for each recording; new ones otherwise.

    Returns
    -------
    list of Axes
    """
    every = (*dataset.everything, *(("test", e) for e in dataset.test))
    drawn = axes_below(len(every), axes)
    for ax, (role, experiment) in zip(drawn, every, strict=True):
        r = experiment.recording
        for name, unit, values in zip(r.channels, r.units, r.output.T, strict=True):
            seen = np.isfinite(values)
            ax.plot(r.time[seen], values[seen], ".", markersize=2, label=f"{name} [{unit}]")
        if role == "train" and experiment.fitted_samples is not None:
            ax.axvspan(r.time[experiment.fitted][-1], r.time[-1], color="0.9", zorder=0, label="held out")
        ax.set(title=f"{role}: {r.name}", xlabel="time [s]", ylabel=f"{r.channels[0]} [{r.units[0]}]")
        if r.input is not None:
            behind = ax.twinx()
            behind.plot(r.time, r.input, color="0.6", linewidth=0.8, zorder=0)
            behind.set_ylabel("input", color="0.4")
        if len(ax.get_legend_handles_labels()[1]) > 1:
            ax.legend(loc="upper right", fontsize="small")
    return drawn
