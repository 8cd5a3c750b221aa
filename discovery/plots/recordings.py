"""Data sets as pictures and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.plots.axes import axes_below, with_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

#: Readings of which each is seen as a point.
_FEW = 200


class RecordingViews:
    """What a recording offers to a notebook."""

    def __repr__(self: Any) -> str:
        """Return name, size and channels."""
        channels = ", ".join(f"{name} [{unit}]" for name, unit in zip(self.channels, self.units, strict=True))
        return f"<Recording {self.name!r}: {self.time.size} readings of {channels}>"

    def to_pandas(self: Any) -> pd.DataFrame:
        """Return times [s] as the index, and a column for the input and every channel, in SI units."""
        import pandas as pd

        given = {} if self.input is None else {"input": self.input}
        columns = {**given, **dict(zip(self.channels, self.output.T, strict=True))}
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time"))

    def to_xarray(self: Any) -> xr.Dataset:
        """Return the channels along ``time`` [s] with their units and noises as attributes."""
        import xarray as xr

        told = zip(self.channels, self.units, self.noise, self.output.T, strict=True)
        found = {name: ("time", values, {"units": u, "noise": float(sd)}) for name, u, sd, values in told}
        given = {} if self.input is None else {"input": ("time", self.input)}
        return xr.Dataset({**given, **found}, {"time": ("time", self.time, {"units": "s"})}, {"name": self.name})


class DatasetViews:
    """What a data set offers to a notebook."""

    def __repr__(self: Any) -> str:
        """Return the rig and how many recordings there are."""
        counts = f"{len(self.train)} to fit, {len(self.holdout)} held out"
        return f"<Dataset {self.rig.name!r} ({self.rig.kind}): {counts}>"

    def _repr_html_(self: Any) -> str:
        import pandas as pd

        rows = [
            (role, r.name, r.time.size, float(r.time[-1] - r.time[0]), ", ".join(r.channels), len(r.notes))
            for role, r in ((role, e.recording) for role, e in self.with_test)
        ]
        header = ["role", "recording", "readings", "duration [s]", "channels", "flags"]
        return pd.DataFrame(rows, columns=header).to_html(float_format="{:.4g}".format, index=False)

    def plot_recordings(self: Any, axes: Axes | Sequence[Axes] | None = None) -> list[Axes]:
        """Draw every recording, one below the other, in SI units, the input in grey.

        Parameters
        ----------
        axes : Axes or sequence of Axes, optional
            One for each recording; new ones otherwise.
        """
        drawn = axes_below(len(self.with_test), axes)
        for ax, (role, experiment) in zip(drawn, self.with_test, strict=True):
            r = experiment.recording
            for name, unit, values in zip(r.channels, r.units, r.output.T, strict=True):
                # Gaps interrupt the line; points beside it where they are few enough to be seen.
                style = ".-" if np.isfinite(values).sum() < _FEW else "-"
                ax.plot(r.time, values, style, markersize=3, linewidth=0.9, label=name)
                with_unit(ax.yaxis, ", ".join(r.channels), unit)
            if role == "train" and experiment.fitted_samples is not None:
                ax.axvspan(r.time[experiment.fitted][-1], r.time[-1], color="0.9", zorder=0, label="held out")
            ax.set(title=f"{role}: {r.name}", xlabel="time [s]")
            if r.input is not None:
                behind = ax.twinx()
                given = experiment.rig.columns.input
                between = "steps-post" if given is not None and given.interpolation == "hold" else "default"
                behind.plot(r.time, r.input, color="0.6", linewidth=0.8, zorder=0, drawstyle=between)
                with_unit(behind.yaxis, "input", experiment.input_unit)
                behind.yaxis.label.set_color("0.4")
            if len(ax.get_legend_handles_labels()[1]) > 1:
                ax.legend(loc="upper right", fontsize="small")
        return drawn
