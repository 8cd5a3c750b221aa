"""The stage of sparse regression: the terms that recordings show, and the radius law."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from html import escape
from typing import Any

import numpy as np

from discovery.foundation.arguments import check_seed, expect
from discovery.foundation.errors import InputError
from discovery.foundation.progress import Tell, teller
from discovery.mechanics import get_base
from discovery.recordings.dataset import Dataset
from discovery.rigs.rig import Rig
from discovery.runs.stages import stage_seed

#: Samples of one recording that the sparse regression uses: enough for hundreds of periods.
DISCOVERY_SAMPLES = 16_384


@dataclass(frozen=True, repr=False)
class Discovered:
    """Equations found in the motion."""

    equation: Any
    radius: Any = None

    def __repr__(self) -> str:
        """Return the terms of the equation, and how many others fit equally."""
        found = self.equation
        terms = f"{len(found.equation.terms)} terms: {found.equation}"
        return f"<Discovered {terms}; {len(found.rivals)} others fit equally>"

    def _repr_html_(self) -> str:
        import pandas as pd

        table = pd.DataFrame(self.equation.summary()).to_html(float_format="{:.4g}".format, index=False)
        return f"{table}<p>{escape(self.equation.status)}</p>"

    def summary(self) -> dict[str, Any]:
        """Return what results.json holds of the discovery."""
        e = self.equation

        def described(equation) -> dict[str, Any]:
            keys = ("terms", "effects", "coefficients", "sd", "unexplained", "likelihood_ratio", "probability")
            return {k: getattr(equation, k) for k in keys}

        found = {
            "terms": e.summary(),
            **{k: getattr(e, k) for k in ("status", "at_rest", "threshold", "noise_ratio", "stretches", "resamples")},
            "smoothers": [asdict(x) for x in e.smoothers],
            "inclusion": e.inclusion,
            "equation": described(e.equation),
            "rivals": [described(r) for r in e.rivals],
            "table": [described(r) for r in e.table],
            "best_three": described(e.best(3)),
        }
        law = self.radius
        radius = None
        if law is not None:
            keys = ("gamma", "sd", "drift", "dynamic", "interval", "noise_ratio", "status")
            radius = {k: getattr(law, k) for k in keys}
            radius |= {"preferred": asdict(law.preferred), "rivals": law.summary()}
        return {"discovery": found, "radius": radius}


def can_discover(rig: Rig) -> bool:
    """Return whether the library of the sparse regression describes a system: a coordinate read under a force."""
    return not rig.traits.has_own_equations and get_base(rig.base).in_library


def discover(dataset: Dataset, *, seed: int = 1, progress: Tell | None = None) -> Discovered:
    """Find the equation of motion, and an arm's radius law, by sparse regression.

    Parameters
    ----------
    dataset : Dataset
        Its training recordings are used.
    seed : int
        Seed of everything random.
    progress : callable, optional
        Receives one sentence before every longer piece of work.

    Raises
    ------
    InputError
        For recordings without the channels that this needs, and for a system that the library does not describe.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> "sign(q')" in discover(data).equation.equation.terms
    True
    """
    expect(dataset, Dataset, "dataset", "Read one with load_dataset(rig, train, holdout).")
    check_seed(seed)
    tell = teller(progress)
    if not can_discover(dataset.rig):
        raise InputError(
            f"{dataset.rig.name}: sparse regression needs readings of the coordinate and of the force on it. Use "
            "`discovery loop`, which compares free-run predictions."
        )
    from discovery.signals.motion import motion_of
    from discovery.sindy.radius import discover_radius
    from discovery.sindy.sindy import discover as sparse

    tell("smoothing the recordings")
    motions = []
    for e in dataset.train:
        part = e.first(min(DISCOVERY_SAMPLES, len(e.recording.time[e.fitted])))
        motions.append(motion_of(part.recording, dataset.rig, e.drive))
    rng = np.random.default_rng(stage_seed(seed, "discover"))
    tell("searching the library for the equation of motion")
    equation = sparse(motions, rng=rng)
    radius = None
    if all(m.radius is not None for m in motions):
        tell("searching for the radius law")
        radius = discover_radius(motions, rng=rng)
    return Discovered(equation, radius)
