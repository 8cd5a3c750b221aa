"""What a posterior is looked at for: priors, profiles, correlations, chains, and how well it predicts readings."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator

from discovery.estimation.fit import Fit
from discovery.foundation.errors import SimulationFailure
from discovery.posterior.correlations import Autocorrelation, Correlations, autocorrelation, correlations
from discovery.posterior.draws import Posterior
from discovery.posterior.likelihood import log_posterior
from discovery.posterior.predictive import Band, fitted_starts, predictive
from discovery.posterior.priors import MarginalPrior, PriorEffect, marginal_priors, prior_effects
from discovery.posterior.profile_likelihood import CUT, Profile, profiles
from discovery.recordings.experiment import Experiment

if TYPE_CHECKING:
    import xarray as xr

#: Recordings of more samples get no predictive band.
LONGEST_BAND = 20_000
#: Points of a prior's density over the range of the profile.
_PRIOR_POINTS = 41
_NEARLY_ALL = (0.001, 0.999)


@dataclass(frozen=True)
class Coverage:
    """Share of the readings of one channel within the 90 % predictive band, noise included.

    `part` is "fitted" or "held out", `readings` how many there are, and `width` the mean width of the band. The share
    is 0.9 where noise and model are right.
    """

    recording: str
    part: str
    channel: str
    unit: str
    readings: int
    share: float
    width: float


@dataclass(frozen=True)
class PosteriorStudy:
    """Everything that a reader of a posterior asks for beside its summary.

    Bands are left out of recordings that are too long, and of those held out in which a motion blows up. `ranges` say
    where nearly all draws of every physical parameter lie.
    """

    priors: dict[str, MarginalPrior]
    prior_effects: tuple[PriorEffect, ...]
    profiles: tuple[Profile, ...]
    correlations: Correlations
    autocorrelation: Autocorrelation
    bands: tuple[Band, ...]
    coverage: tuple[Coverage, ...]
    ranges: dict[str, tuple[float, float]]

    def summary(self) -> dict[str, Any]:
        """Return what results.json holds of the study."""
        return {
            "priors": [self._prior_row(row) for row in self.prior_effects],
            "profiles": [
                {
                    "name": p.name,
                    "values": p.values.tolist(),
                    "statistic": [float(x) if np.isfinite(x) else None for x in p.statistic],
                    "best": p.best,
                    "interval": list(p.interval),
                    "cut": CUT,
                    **self._prior_beside(p.name),
                }
                for p in self.profiles
            ],
            "correlations": self.correlations.summary(),
            "autocorrelation": self.autocorrelation.summary(),
            "coverage": [asdict(row) for row in self.coverage],
        }

    def _prior_row(self, row: PriorEffect) -> dict[str, Any]:
        return {
            "name": row.name,
            **self.priors[row.name].prior.summary(),
            "prior_sd": row.prior_sd if np.isfinite(row.prior_sd) else None,
            "contraction": row.contraction,
            "widths": [
                {"factor": k, "shift": row.shift[k], "sd_ratio": row.sd_ratio[k], "effective": row.effective[k]}
                for k in row.shift
            ],
            "sensitive": row.sensitive,
        }

    def _prior_beside(self, name: str) -> dict[str, Any]:
        """Return the prior's density over the range of the draws, relative to its largest value there."""
        x = np.linspace(*self.ranges[name], _PRIOR_POINTS)
        log_density = self.priors[name].log_density(x)
        return {"prior_values": x.tolist(), "prior_density": np.exp(log_density - log_density.max()).tolist()}

    def curves(self) -> dict[str, xr.Dataset]:
        """Return the predictive bands as groups of a netCDF file, by recording."""
        import xarray as xr

        groups = {}
        for band in self.bands:
            variables = {
                f"{kind}_{q}": (("time", "channel"), values)
                for kind, quantiles in (("motion", band.motion), ("reading", band.reading))
                for q, values in zip(("q05", "q50", "q95"), quantiles, strict=True)
            }
            groups[band.name] = xr.Dataset(
                variables, {"time": band.time, "channel": list(band.channels)}, {"units": list(band.units)}
            )
        return groups


def study_posterior(
    posterior: Posterior, fit: Fit, holdout: Sequence[Experiment] = (), *, rng: Generator, draws: int = 200
) -> PosteriorStudy:
    """Study a posterior of a fit; of held-out recordings, which it did not see, only the initial states are fitted.

    The predictive bands have so many draws each.
    """
    target = log_posterior(fit)
    priors, flat = marginal_priors(target), posterior.flat()
    train = _short(fit.problem.bench.experiments)
    held = _short(holdout)
    starts = fitted_starts(posterior, held)

    def banded(experiments: Sequence[Experiment]) -> list[Band]:
        own = {e.recording.name: starts[e.recording.name] for e in experiments if e.recording.name in starts}
        return predictive(posterior, experiments, draws, seed=rng, initial=own) if experiments else []

    try:
        bands = banded([*train, *held])
    except SimulationFailure:
        # What was fitted may blow up in a motion that it has not seen: there is no band of that.
        bands, every, held = banded(train), held, []
        for experiment in every:
            with suppress(SimulationFailure):
                bands += banded([experiment])
                held.append(experiment)
    shown = [*train, *held]
    seen = [*(e.fitted for e in train), *[slice(0, 0)] * len(held)]
    covered = (row for found in zip(shown, bands, seen, strict=True) for row in _covered(*found))
    return PosteriorStudy(
        priors,
        tuple(prior_effects(flat, priors)),
        profiles=tuple(profiles(target)),
        correlations=correlations(posterior),
        autocorrelation=autocorrelation(posterior),
        bands=tuple(bands),
        coverage=tuple(covered),
        ranges={name: tuple(np.quantile(flat[name], _NEARLY_ALL).tolist()) for name in priors},
    )


def _short(experiments: Sequence[Experiment]) -> list[Experiment]:
    return [e for e in experiments if e.recording.time.size <= LONGEST_BAND]


def _covered(experiment: Experiment, band: Band, seen: slice) -> list[Coverage]:
    """Return the coverage of the fitted and of the held-out samples of a recording."""
    fitted = np.zeros(band.time.size, bool)
    fitted[seen] = True
    rows = []
    for part, samples in (("fitted", fitted), ("held out", ~fitted)):
        measured = np.where(samples[:, None], experiment.recording.output, np.nan)
        count = np.isfinite(measured).sum(axis=0)
        shares, widths = band.coverage(measured), (band.reading[2] - band.reading[0])[samples]
        for c, (channel, unit) in enumerate(zip(band.channels, band.units, strict=True)):
            if count[c]:
                share, width = float(shares[c]), float(widths[:, c].mean())
                rows.append(Coverage(band.name, part, channel, unit, int(count[c]), share=share, width=width))
    return rows
