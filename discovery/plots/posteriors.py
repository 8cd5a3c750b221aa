"""Posteriors as pictures and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from discovery.foundation.html_table import html_table
from discovery.foundation.start_names import is_start
from discovery.plots.axes import axes_below
from discovery.plots.fits import starts_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

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
        rows = [(row["name"], *(row[key] for key in _COLUMNS)) for row in self.summary() if not is_start(row["name"])]
        return html_table(repr(self).strip("<>"), ("quantity", *_COLUMNS), rows, below=self.status)

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
