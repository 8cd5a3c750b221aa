"""The answer of a loop as pictures and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.foundation.html_table import html_table
from discovery.plots.axes import axes_below, one_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

__all__ = ["LoopViews"]

_COLOURS = {"before": "tab:orange", "after": "tab:green"}


class LoopViews:
    """What the answer of a loop offers to a notebook."""

    def _repr_html_(self: Any) -> str:
        table = self.to_pandas()
        added = table[table["effect"] != ""]
        rows = [
            (row.effect, row.Index, row.value, None if np.isnan(row.sd) else row.sd, row.unit)
            for row in added.itertuples()
        ]
        errors = [self.errors[when]["holdout"]["rms"] for when in ("before", "after")]
        told = f"Held out: {errors[0]:.4g} → {errors[1]:.4g} {self.errors['unit']} rms."
        return html_table(
            f"{self.verdict}: {', '.join(self.added) or 'nothing added'}",
            ("effect", "parameter", "value", "sd", "unit"),
            rows,
            below=told,
        )

    def to_pandas(self: Any) -> pd.DataFrame:
        """Return a row for every parameter of the final model: value, standard deviation, unit and added effect."""
        content = self.summary()
        of = {name: effect["id"] for effect in content["effects"] for name in effect["parameters"]}
        table = self.after.to_pandas()
        return table.assign(effect=[of.get(name, "") for name in table.index])

    def plot_errors(self: Any, ax: Axes | None = None) -> Axes:
        """Draw the errors of the declared and of the final model, in training and held out, above the noise floor.

        Parameters
        ----------
        ax : Axes, optional
            New ones otherwise.
        """
        ax, unit = one_axes(ax), self.errors["unit"]
        roles = list(self.errors["before"])
        for shift, (when, colour) in zip((-0.2, 0.2), _COLOURS.items(), strict=True):
            sizes = [self.errors[when][role]["rms"] for role in roles]
            ax.bar(np.arange(len(roles)) + shift, sizes, 0.38, color=colour, label=when)
        if self.errors.get("noise_floor") is not None:
            ax.axhline(self.errors["noise_floor"], color="0.3", linestyle="--", label="noise floor")
        ax.set(
            yscale="log", ylabel=f"rms error [{unit}]", title=f"{self.verdict}: {', '.join(self.added) or 'nothing'}"
        )
        ax.set_xticks(range(len(roles)), [role.replace("_", " ") for role in roles])
        ax.legend(fontsize="small")
        return ax

    def plot_residuals(self: Any, axes: Sequence[Axes] | None = None) -> list[Axes]:
        """Draw what the declared and the final model leave of every recording, in standard deviations of its noise.

        Parameters
        ----------
        axes : sequence of Axes, optional
            One for each recording, training first; new ones otherwise.

        Returns
        -------
        list of Axes
        """
        drawn = axes_below(len(self.recordings), axes)
        for i, (ax, r) in enumerate(zip(drawn, self.recordings, strict=True)):
            for when, colour in _COLOURS.items():
                error = np.linalg.norm((r.output - self.predictions[when][i]) / r.noise, axis=1)
                single = ((r.output - self.predictions[when][i]) / r.noise)[:, 0]
                ax.plot(r.time, single if len(r.channels) == 1 else error, color=colour, linewidth=0.8, label=when)
            ax.set(title=r.name, xlabel="time [s]", ylabel="residual over noise")
        drawn[0].legend(loc="upper right", fontsize="small")
        return drawn
