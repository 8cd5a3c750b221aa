"""Fits and posteriors as pictures and tables."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from discovery.foundation.start_names import is_start, start_of, start_word
from discovery.plots.axes import axes_below

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes


class FitViews:
    """What a fit offers to a notebook."""

    def __repr__(self: Any) -> str:
        """Return the effects, the free parameters and how well they fit."""
        free = ", ".join(f"{name} = {self.values[name]:.4g}" for name in self.problem.free)
        return f"<Fit of {' + '.join(self.model.effects)}: {free}; reduced chi-square {self.reduced_chi2:.4g}>"

    def _repr_html_(self: Any) -> str:
        told = f"{self.status} Reduced chi-square {self.reduced_chi2:.4g}."
        return self.to_pandas().to_html(float_format="{:.4g}".format) + f"<p>{escape(told)}</p>"

    def to_pandas(self: Any) -> pd.DataFrame:
        """Return a row for every parameter: value, standard deviation (NaN where there is none) and unit, SI.

        Where parameters are also told as forces or torques, three columns more hold them: `physical`, `physical_sd`
        and `physical_unit`. Initial states are no parameters of the physics: see `initial_states`.
        """
        import pandas as pd

        content = self.summary()
        found = {name: entry for name, entry in content["parameters"].items() if not is_start(name)}
        table = pd.DataFrame.from_dict(found, orient="index", columns=["value", "sd", "unit"])
        table = table.astype({"value": float, "sd": float}).rename_axis("parameter")
        if "physical" not in content:
            return table
        forces = pd.DataFrame.from_dict(content["physical"], orient="index", columns=["value", "sd", "unit"])
        forces.columns = pd.Index(["physical", "physical_sd", "physical_unit"])
        return table.join(forces.astype({"physical": float, "physical_sd": float}))

    def initial_states(self: Any) -> pd.DataFrame:
        """Return a row for every recording: deflection and rate at its first time, standard deviations, units, SI."""
        return starts_table(self.summary()["parameters"].items(), "value")

    def plot_residuals(self: Any, axes: Axes | Sequence[Axes] | None = None) -> list[Axes]:
        """Draw what the fit leaves of every fitted recording, in standard deviations of its noise.

        Parameters
        ----------
        axes : Axes or sequence of Axes, optional
            One for each recording; new ones otherwise.
        """
        experiments = self.problem.bench.experiments
        drawn = axes_below(len(experiments), axes)
        for ax, experiment, computed in zip(drawn, experiments, self.predict(), strict=True):
            r = experiment.recording
            for name, error, noise in zip(r.channels, (r.output - computed).T, r.noise, strict=True):
                ax.plot(r.time, error / noise, ".", markersize=2, label=name)
            ax.axhspan(-2.0, 2.0, color="0.9", zorder=0)
            ax.set(title=r.name, xlabel="time [s]", ylabel="residual over noise")
            if len(r.channels) > 1:
                ax.legend(loc="upper right", fontsize="small")
        return drawn


def starts_table(told: Iterable[tuple[str, Mapping[str, Any]]], value: str) -> pd.DataFrame:
    """Return a row for every recording: deflection and rate at its first time (the key `value`), sds and units."""
    import pandas as pd

    rows: dict[str, dict[str, Any]] = {}
    for name, entry in told:
        if found := start_of(name):
            what = start_word(found[0])
            rows.setdefault(found[1], {}).update(
                {what: entry[value], f"{what}_sd": entry["sd"], f"{what}_unit": entry["unit"]}
            )
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")


_COLUMNS = ("mean", "sd", "q05", "q50", "q95", "unit", "r_hat", "ess")


class PosteriorViews:
    """What a posterior offers to a notebook."""

    def __repr__(self: Any) -> str:
        """Return how many draws there are of what, and how well they converged."""
        ensembles, steps, walkers, d = self.draws.shape
        worst = f"R-hat at most {max(self.r_hat.values()):.3f}, at least {min(self.ess.values()):.0f} effective"
        made = f"{ensembles} {'chains' if walkers == 1 else 'ensembles'}"
        return f"<Posterior of {d} quantities: {made}, {ensembles * steps * walkers} draws; {worst}>"

    def _repr_html_(self: Any) -> str:
        return self.to_pandas().to_html(float_format="{:.4g}".format) + f"<p>{escape(self.status)}</p>"

    def to_pandas(self: Any) -> pd.DataFrame:
        """Return a row for every parameter and size of noise: mean, sd, quantiles, unit, R-hat, effective draws.

        Initial states are no parameters of the physics: see `initial_states`.
        """
        import pandas as pd

        rows = [row for row in self.summary() if not is_start(row["name"])]
        return pd.DataFrame(rows).set_index("name")[list(_COLUMNS)]

    def initial_states(self: Any) -> pd.DataFrame:
        """Return a row for every recording: mean deflection and rate at its first time, sds, units, SI."""
        return starts_table(((row["name"], row) for row in self.summary()), "mean")

    def plot_marginals(
        self: Any, names: str | Sequence[str] | None = None, axes: Axes | Sequence[Axes] | None = None
    ) -> list[Axes]:
        """Draw the marginal posterior of quantities, with their 90 % intervals; for pairs see `to_arviz`.

        Parameters
        ----------
        names : str or sequence of str, optional
            Which; all but the initial states otherwise.
        axes : Axes or sequence of Axes, optional
            One for each; new ones otherwise.

        Raises
        ------
        InputError
            For a name that was not sampled.
        """
        from discovery.foundation.arguments import as_words
        from discovery.foundation.errors import InputError, suggestion

        rows = {row["name"]: row for row in self.summary()}
        wanted = [n for n in self.names if not is_start(n)] if names is None else names
        chosen = as_words(wanted, "names", f"Sampled are {', '.join(rows)}.")
        if not chosen:
            raise InputError(f"`names` is empty. Sampled are {', '.join(rows)}.")
        for name in chosen:
            if name not in rows:
                raise InputError(f"{name!r} was not sampled.{suggestion(name, rows)} Sampled are {', '.join(rows)}.")
        drawn, values = axes_below(len(chosen), axes), self.flat()
        for ax, name in zip(drawn, chosen, strict=True):
            row = rows[name]
            ax.hist(values[name], bins=80, density=True, histtype="step", color="tab:blue")
            ax.axvspan(row["q05"], row["q95"], color="tab:blue", alpha=0.15)
            ax.set(xlabel=f"{name} [{row['unit']}]", yticks=[])
        return drawn
