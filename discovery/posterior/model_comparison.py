"""Models by their evidence: which noise the readings have, which set of effects, and whether held-out ones agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.estimation.covariance import covariance_of
from discovery.estimation.fit import Fit
from discovery.foundation.arguments import as_words, check_number, check_seed, check_whole, expect
from discovery.foundation.errors import InputError
from discovery.foundation.progress import Tell, counted, teller
from discovery.posterior.likelihood import log_posterior
from discovery.posterior.marginal_likelihood import FEWEST_DRAWS, Evidence, log_evidence
from discovery.posterior.noise import GAUSSIAN, applicable
from discovery.posterior.noise.model import instruments

if TYPE_CHECKING:
    from discovery.screening.refits import Refit

_DOING = "weighing noise models by their evidence"
#: Heads of the columns of a table whose keys do not say what is in them.
_HEADS = {
    "noise": "noise model",
    "name": "model",
    "behind": "behind [nats]",
    "error": "error [nats]",
    "free": "free parameters",
    "held_out": "held-out error",
}


def _table(rows: Sequence[Mapping[str, Any]], keys: list[str]) -> str:
    """Return rows by decreasing evidence as a notebook shows them."""
    import pandas as pd

    return pd.DataFrame(rows)[keys].rename(columns=_HEADS).to_html(float_format="{:.4g}".format, index=False)


@dataclass(frozen=True, repr=False)
class NoiseChoice:
    """Evidence of every noise model on one fit, the Gaussian first."""

    evidences: tuple[Evidence, ...]

    def __repr__(self) -> str:
        """Return the choice, and by how much each of the others is behind."""
        rows = ", ".join(f"{row['noise']} {row['behind']:.4g}" for row in self.summary()["models"])
        return f"<NoiseChoice {self.noise}: behind by [nats] {rows}>"

    def _repr_html_(self) -> str:
        return _table(self.summary()["models"], ["noise", "behind", "error", "reliable"])

    @property
    def chosen(self) -> Evidence:
        """Largest evidence among those that can be trusted; among all where none can."""
        able = [e for e in self.evidences if e.reliable] or list(self.evidences)
        return max(able, key=lambda e: e.log_evidence)

    @property
    def noise(self) -> str:
        """Name of the noise model of largest evidence."""
        return self.chosen.target.noise

    def widening(self) -> dict[str, float]:
        """Return the width of every free number's interval under the chosen noise over that under white noise."""
        white, honest = self.evidences[0].intervals(), self.chosen.intervals()
        names = self.chosen.target.problem.names
        return {name: (honest[name][2] - honest[name][0]) / (white[name][2] - white[name][0]) for name in names}

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready table: `models` by decreasing evidence, each with its intervals, and the choice."""
        rows = sorted(self.evidences, key=lambda e: -e.log_evidence)
        best = self.chosen.log_evidence
        return {
            "chosen": self.noise,
            "reliable": self.chosen.reliable,
            "widening": self.widening(),
            "models": [{**row.summary(), "behind": best - row.log_evidence} for row in rows],
        }


def choose_noise(
    fit: Fit, *, seed: int = 1, models: Sequence[str] | None = None, draws: int = 4000, progress: Tell | None = None
) -> NoiseChoice:
    """Weigh noise models by their evidence on the recordings of a fit.

    Parameters
    ----------
    fit : Fit
        The fit.
    seed : int
        Seed; every model has a random stream of its own.
    models : sequence of str, optional
        Noise models; by default the Gaussian and all others that apply: rounding where readings come in steps, a noisy
        input where there is an input.
    draws : int
        Draws for each evidence.
    progress : callable, optional
        Receives one sentence before each model.

    Raises
    ------
    NotIdentifiable
        If the data leave a combination of parameters undetermined.
    InputError
        For a noise model that is not known, or does not apply.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> part = [data.train[0].first(100)]  # its first second
    >>> fit = fit_model(declared_model(data), part)
    >>> choose_noise(fit, models=["student_t"], draws=500).noise
    'gaussian'
    """
    expect(fit, Fit, "fit", "Make one with fit_model(model, dataset); a loop has two, `before` and `after`.")
    check_seed(seed)
    check_whole(draws, "draws", FEWEST_DRAWS)
    if models is not None:
        models = as_words(models, "models", "Name noise models, or leave it out for all that apply.")
    tell = teller(progress)
    parts = instruments(fit.problem.bench.experiments)
    names = applicable(fit.problem, parts) if models is None else (GAUSSIAN, *(m for m in models if m != GAUSSIAN))
    streams = np.random.default_rng(seed).spawn(len(names))
    weighed = counted(list(zip(names, streams, strict=True)), tell, _DOING, "models")
    return NoiseChoice(tuple(log_evidence(log_posterior(fit, name), rng, draws) for name, rng in weighed))


@dataclass(frozen=True, repr=False)
class Comparison:
    """Evidence of candidate models on the same recordings, by name of the candidate.

    `held_out` is the error of each on recordings that were held out, smaller is better; empty where there are none.
    """

    evidences: Mapping[str, Evidence]
    held_out: Mapping[str, float]

    def __repr__(self) -> str:
        """Return the candidates by decreasing evidence, and by how much each is behind."""
        rows = ", ".join(f"{row['name']} {row['behind']:.4g}" for row in self.summary()["models"])
        return f"<Comparison of {len(self.evidences)} models: behind by [nats] {rows}>"

    def _repr_html_(self) -> str:
        return _table(self.summary()["models"], ["name", "behind", "error", "free", "held_out", "reliable"])

    @property
    def ranking(self) -> tuple[str, ...]:
        """Names by decreasing evidence."""
        return tuple(sorted(self.evidences, key=lambda name: -self.evidences[name].log_evidence))

    @property
    def agreement(self) -> float | None:
        """Kendall's tau between evidence and held-out error, one for the same order; None without held-out errors."""
        from scipy.stats import kendalltau

        if not self.held_out:
            return None
        names = self.ranking
        return float(
            kendalltau([-self.evidences[n].log_evidence for n in names], [self.held_out[n] for n in names]).statistic
        )

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready table by decreasing evidence, and whether the held-out recordings prefer the same one."""
        names = self.ranking
        best = self.evidences[names[0]].log_evidence
        rows = [
            {
                "name": name,
                "effects": list(self.evidences[name].target.problem.model.effects),
                "free": len(self.evidences[name].target.problem.free),
                "behind": best - self.evidences[name].log_evidence,
                "held_out": self.held_out.get(name),
                **self.evidences[name].summary(),
            }
            for name in names
        ]
        return {
            "preferred": names[0],
            "reliable": all(evidence.reliable for evidence in self.evidences.values()),
            "held_out_prefers": min(self.held_out, key=lambda n: self.held_out[n]) if self.held_out else None,
            "same_order": self.agreement,
            "models": rows,
        }


def compare_models(
    fits: Mapping[str, Fit | Refit],
    *,
    seed: int = 1,
    noise: str = GAUSSIAN,
    held_out: Mapping[str, float] | None = None,
    draws: int = 4000,
    progress: Tell | None = None,
) -> Comparison:
    """Compare fitted candidates by evidence, all under one noise model.

    Parameters
    ----------
    fits : mapping of str to Fit or Refit
        By name; on the same recordings. Refits are the candidates of the search.
    seed : int
        Seed; every candidate has a random stream of its own.
    noise : str
        Noise model. White noise is only right where nothing is missing any more: what a model lacks is correlated.
    held_out : mapping of str to float, optional
        Error or chi-square of each candidate on recordings that were held out.
    draws : int
        Draws for each evidence.
    progress : callable, optional
        Receives one sentence before each candidate.

    Raises
    ------
    InputError
        If the candidates were fitted on different readings, or a held-out error is missing.
    NotIdentifiable
        If the data leave a combination of parameters of a candidate undetermined.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> part = [data.train[0].first(100)]  # its first second
    >>> declared = declared_model(data)
    >>> models = {"declared": declared, "friction": declared.with_effect("coulomb_friction")}
    >>> fits = {name: fit_model(model, part) for name, model in models.items()}
    >>> list(compare_models(fits, draws=500).ranking)
    ['declared', 'friction']
    """
    expect(fits, Mapping, "fits", 'Name the candidates: {"declared": fit, "with drag": other}.')
    for name, candidate in fits.items():
        if not hasattr(candidate, "problem"):
            expect(candidate, Fit, f"fits[{name!r}]", "Make one with fit_model(model, dataset).")
    check_seed(seed)
    check_whole(draws, "draws", FEWEST_DRAWS)
    if held_out is not None:
        expect(held_out, Mapping, "held_out", 'Give the error of each by name, as in {"declared": 0.1}.')
    tell = teller(progress)
    data = {tuple((e.recording.sha256, e.fitted_samples) for e in f.problem.bench.experiments) for f in fits.values()}
    if len(data) != 1:
        raise InputError("Evidences compare only on the same readings: fit all candidates on the same recordings.")
    if held_out is not None and (missing := fits.keys() - held_out.keys()):
        raise InputError(f"There is no held-out error of {', '.join(sorted(missing))}.")
    for name, error in (held_out or {}).items():
        check_number(error, f"held_out[{name!r}]")
    streams = np.random.default_rng(seed).spawn(len(fits))
    weighed = counted(
        list(zip(fits.items(), streams, strict=True)), tell, "weighing models by their evidence", "models"
    )
    evidences = {name: log_evidence(log_posterior(_fit_of(fit), noise), rng, draws) for (name, fit), rng in weighed}
    return Comparison(evidences, {name: held_out[name] for name in fits} if held_out is not None else {})


def _fit_of(candidate: Fit | Refit) -> Fit:
    """Return a candidate as a fit on a kernel of its own effects, which is faster."""
    if isinstance(candidate, Fit):
        return candidate.specialised()
    found = covariance_of(candidate.problem, candidate.minimum)
    return Fit(candidate.problem, candidate.minimum, *found, float("nan")).specialised()
