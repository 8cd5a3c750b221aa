"""Draws from the posterior of a model: what they mean, how well they converged, their table and their file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

from discovery.foundation.arguments import as_path, check_whole
from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.posterior.replication import check_pointwise
from discovery.posterior.sample import Sample
from discovery.posterior.tree import as_tree, fields_of, readings, sampled, some
from discovery.recordings.chosen import Recordings, training_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Posterior"]


#: Draws of which a file keeps what they would read again, and readings that it keeps of them at most.
_REPLICATED, _KEPT = 100, 2_000_000


@dataclass(frozen=True, repr=False)
class Posterior(Sample):
    """The sampled posterior: a `discovery.posterior.sample.Sample`, taken along in files of other packages.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> part = [data.train[0].first(100)]  # its first second
    >>> fit = fit_model(declared_model(data), part)
    >>> posterior = sample(fit, min_effective=500)
    >>> posterior.to_pandas()["mean"].round(1).to_dict()  # s^-1, s^-2, m
    {'xi': 0.4, 'alpha': 400.0, 'sigma': 0.0}
    >>> round(float(posterior.flat()["alpha"].mean()), 1), posterior.summary()[1]["unit"]
    (400.0, 's^-2')
    >>> posterior.to_netcdf("posterior.nc")
    >>> Posterior.from_netcdf("posterior.nc").initial_states().index.tolist()
    ['train_high']
    >>> sorted(posterior.to_tree().children), len(posterior.plot_marginals(["alpha"]))
    (['posterior', 'prior', 'sample_stats'], 1)
    """

    def to_arviz(self, data: Recordings | None = None, *, draws: int = 400, pointwise: bool = True) -> xr.DataTree:
        """Return some of the draws with everything that ArviZ asks for.

        The groups posterior, sample_stats, posterior_predictive and log_likelihood are of the same draws; observed_data
        has the fitted readings. A chain is an independent ensemble. The log likelihood is one variable over all
        recordings, so that `arviz.loo` and `arviz.compare` judge the whole fit. ArviZ below 1.0 takes the tree through
        ``arviz.from_datatree``.

        Parameters
        ----------
        data : Dataset or sequence of Experiment
            The recordings that were fitted, without which there are no readings to predict; see `to_tree` otherwise.
        draws : int
            Draws, evenly from all ensembles.
        pointwise : bool
            With the log likelihood of every reading.

        Returns
        -------
        DataTree

        Raises
        ------
        InputError
            If a recording was not fitted, or `pointwise` is asked for under a noise whose errors depend on each other.

        Examples
        --------
        >>> data = load_dataset("datasets/spring_bench/rig.toml")
        >>> part = [data.train[0].first(100)]  # its first second
        >>> fit = fit_model(declared_model(data), part)
        >>> posterior = sample(fit, min_effective=500)
        >>> tree = posterior.to_arviz(part, draws=100)
        >>> sorted(tree.children)
        ['log_likelihood', 'observed_data', 'posterior', 'posterior_predictive', 'prior', 'sample_stats']
        """
        check_whole(draws, "draws", 1)
        if data is None:
            raise InputError(
                "`data` are the recordings that were fitted. Give the data set, or the list that was fitted."
            )
        if pointwise:
            check_pointwise(self.noise)
        chosen = some(self, draws)
        return as_tree(self, sampled(chosen) | readings(chosen, training_of(data), pointwise=pointwise))

    def to_tree(self, data: Recordings | None = None) -> xr.DataTree:
        """Return all draws as groups of ArviZ's InferenceData.

        Parameters
        ----------
        data : Dataset or sequence of Experiment, optional
            The recordings that were fitted: with them, observed_data has their readings, and posterior_predictive what
            some of the draws make of them.

        Returns
        -------
        DataTree
            The groups posterior, sample_stats (lp, and as log_likelihood the sum over all readings) and prior. A chain
            is an independent ensemble.
        """
        groups = sampled(self)
        if data is not None:
            recordings = training_of(data)
            size = sum(e.recording.output.size for e in recordings)
            kept = max(len(self.draws), min(_REPLICATED, _KEPT // size))
            groups |= readings(some(self, kept), recordings, pointwise=False)
        return as_tree(self, groups)

    def to_netcdf(self, path: str | os.PathLike[str], data: Recordings | None = None) -> None:
        """Write the groups of `to_tree` as netCDF, beside its place first."""
        path = as_path(path, "path", "Give the path of the file to write.")
        # In memory: on a full disk the library of the format ends the process.
        made = BytesIO()
        self.to_tree(data).to_netcdf(made, engine="h5netcdf")
        with atomic_write(path) as temporary:
            temporary.write_bytes(made.getbuffer())

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str]) -> Posterior:
        """Read what `to_netcdf` wrote.

        Raises
        ------
        InputError
            If the file is not such a file.
        """
        import xarray as xr

        path = as_path(path, "path", "Give the path of a file that to_netcdf wrote.")
        try:
            with xr.open_datatree(path, engine="h5netcdf") as tree:
                return cls(**fields_of(tree.load()))
        except (OSError, KeyError, ValueError) as error:
            raise InputError(f"{os.fspath(path)} is not a posterior that this package wrote: {error}") from error
