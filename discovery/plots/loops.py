"""The answer of a loop as pictures and tables."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.plots.axes import axes_below, one_axes, with_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

#: What is held out, told apart by the motion that was trained, and by whether it moves at all.
_PARTS = {
    "holdout_inside": "held out, inside the trained range",
    "holdout_outside": "held out, beyond it",
    "holdout_moving": "held out, while it moves",
}
_WORDS = {"train": "training", "holdout": "held out", **_PARTS}
_COLOURS = {"before": "tab:orange", "after": "tab:green"}


class LoopViews:
    """What the answer of a loop offers to a notebook."""

    def _repr_html_(self: Any) -> str:
        table = self.to_pandas()
        errors = [self.errors[when]["holdout"]["rms"] for when in ("before", "after")]
        told = f"{self.verdict}. Held out: {errors[0]:.4g} → {errors[1]:.4g} {escape(self.errors['unit'])} rms."
        return table[table["effect"] != ""].to_html(float_format="{:.4g}".format) + f"<p>{told}</p>"

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
        from matplotlib.ticker import LogLocator, NullFormatter

        ax, unit = one_axes(ax), self.errors["unit"]
        sizes = {when: {role: told["rms"] for role, told in self.errors[when].items()} for when in _COLOURS}
        # Where all that is held out lies inside the trained range, or outside, its part says the same once more.
        roles = [
            role
            for role in sizes["before"]
            if role not in _PARTS or sizes["before"]["holdout"] != sizes["before"][role]
        ]
        rows = range(len(roles))
        first, last = ([sizes[when][role] for role in roles] for when in _COLOURS)
        ax.hlines(rows, first, last, color="0.8", zorder=1)
        for when, colour in _COLOURS.items():
            ax.scatter([sizes[when][role] for role in roles], list(rows), s=60, color=colour, label=when, zorder=2)
        if self.errors.get("noise_floor") is not None:
            ax.axvline(self.errors["noise_floor"], color="0.3", linestyle="--", label="noise floor, held out")
        ax.set(xscale="log", title=f"{self.verdict}: {', '.join(self.added) or 'nothing'}")
        ax.set_yticks(rows, [_WORDS.get(role, role) for role in roles])
        ax.set_ylim(len(roles) - 0.5, -0.5)
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_minor_formatter(NullFormatter())
        with_unit(ax.xaxis, "rms error", unit)
        ax.legend(fontsize="small")
        return ax

    def plot_residuals(self: Any, axes: Axes | Sequence[Axes] | None = None) -> list[Axes]:
        """Draw what both models leave of the output of every recording, in standard deviations of its noise.

        Parameters
        ----------
        axes : Axes or sequence of Axes, optional
            One for each recording, training first; new ones otherwise.
        """
        drawn = axes_below(len(self.recordings), axes)
        for i, (ax, r) in enumerate(zip(drawn, self.recordings, strict=True)):
            for when, colour in _COLOURS.items():
                left = ((r.output - self.predictions[when][i]) / r.noise)[:, r.judged]
                error = left[:, 0] if left.shape[1] == 1 else np.linalg.norm(left, axis=1)
                ax.plot(r.time, error, color=colour, linewidth=0.8, label=when)
            ax.set(title=r.name, xlabel="time [s]", ylabel="residual over noise")
        drawn[0].legend(loc="upper right", fontsize="small")
        return drawn
