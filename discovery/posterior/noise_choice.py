"""Which noise the readings have: every model that applies, by its evidence, and what each means for the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discovery.estimation.fit import Fit
from discovery.foundation.arguments import as_words, check_seed, check_whole, expect
from discovery.foundation.html_table import html_table
from discovery.foundation.progress import Tell, counted, teller
from discovery.posterior.instrument import instruments
from discovery.posterior.likelihood import log_posterior
from discovery.posterior.marginal_likelihood import FEWEST_DRAWS, Evidence, log_evidence
from discovery.posterior.noise import GAUSSIAN, applicable

_DOING = "weighing noise models by their evidence"


@dataclass(frozen=True, repr=False)
class NoiseChoice:
    """Evidence of every noise model on one fit, the Gaussian first."""

    evidences: tuple[Evidence, ...]

    def __repr__(self) -> str:
        """Return the choice, and by how much each of the others is behind."""
        rows = ", ".join(f"{row['noise']} {row['behind']:.4g}" for row in self.summary()["models"])
        return f"<NoiseChoice {self.noise}: behind by [nats] {rows}>"

    def _repr_html_(self) -> str:
        rows = ((row["noise"], row["behind"], row["error"], row["reliable"]) for row in self.summary()["models"])
        header = ("noise model", "behind [nats]", "error [nats]", "reliable")
        return html_table(f"{self.noise} has the largest evidence", header, rows)

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
