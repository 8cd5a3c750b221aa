"""What a loop says where the declared model cannot be fitted: why, as far as it can be told, and what would help."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from discovery.diagnosis.contradiction import ContradictionReport
from discovery.equations.model import Model
from discovery.estimation.declared import declared_model, led, rig_uncertainty
from discovery.estimation.natural_units import NaturalUnits, natural_units
from discovery.export import linearise
from discovery.foundation.errors import ComputationError, InputError, SimulationFailure
from discovery.mechanics.systems import system_base
from discovery.recordings.dataset import Dataset
from discovery.results.provenance import provenance, write_json
from discovery.runs.description import describe, flagged
from discovery.runs.loop_files import save_curves
from discovery.selection.decision import Decision

#: A motion that grows by more than this many e-foldings in a recording is a hundred times too large at its end.
_FOLDINGS = float(np.log(100.0))


@dataclass(frozen=True)
class FailedLoop:
    """The answer of a loop that has no fit to begin with."""

    #: dataset, model: rig and recordings, and the declared model.
    dataset: Dataset
    model: Model
    #: "runs_away" (a small motion grows by itself), "unresolved" (no step resolves its motion), "diverges" (none of
    #: these).
    code: str
    #: "time": first time at which the motion is not finite or far too large [s]; "grows_in": time in which a small
    #: motion grows e-fold at the guesses [s]; "followed": length of the longest first part of the recordings over which
    #: a fit follows [s]. Only those that are known.
    numbers: Mapping[str, float]
    message: str  # what the computation said

    verdict = "unexplained"

    def summary(self) -> dict[str, Any]:
        """Return the content of loop.json: errors are infinite, as those of every motion that blows up."""
        recording = self.dataset.train[0].recording
        infinite = {role: dict.fromkeys(("rms", "mean", "peak"), np.inf) for role in ("train", "holdout")}
        error = {"before": np.inf, "after": np.inf, "unit": recording.units[0], "share": 1.0}
        return {
            "verdict": self.verdict,
            "failure": {"code": self.code, "numbers": dict(self.numbers), "message": self.message},
            "declared": list(self.model.effects),
            "recordings": [flagged(e.recording) for _, e in self.dataset.everything],
            "effects": [],
            "errors": {
                "unit": recording.units[0],
                "noise_floor": recording.noise_floor(),
                **dict.fromkeys(("before", "after"), infinite),
            },
            "model_error": {**error, "least": 0.0, "held": error["after"], "depends_on": []},
            "complete": False,
            "cautions": [],
            "contradiction": ContradictionReport().summary(),
            "model": {when: {"model": self.model.to_dict(), "parameters": {}} for when in ("before", "after")},
            "steps": [Decision("stop", (), accepted=False, code=self.code, numbers=self.numbers).summary()],
        }


class LoopFailure(ComputationError):
    """The declared model of a data set cannot be fitted; `loop` is what is said of it."""

    def __init__(self, loop: FailedLoop) -> None:
        self.loop = loop
        super().__init__(loop.message)


def failed_loop(dataset: Dataset, failure: ComputationError) -> FailedLoop:
    """Return what can be told of a fit, or the search after it, that raised this failure."""
    train = dataset.train
    units, model = natural_units(train), declared_model(train[0])
    gaussian = {} if train[0].system.has_rod else rig_uncertainty(train[0])
    duration = max(float(np.ptp(e.recording.time[e.fitted])) for e in train)
    numbers = {"time": failure.time} if isinstance(failure, SimulationFailure) else {}
    growth = _growth(dataset, model, units)
    if growth > 0:
        numbers["grows_in"] = 1.0 / growth
    _, part = led(model, train, units, gaussian)
    if part > 0:
        numbers["followed"] = part * duration
    code = "diverges" if isinstance(failure, SimulationFailure) else "unresolved"
    return FailedLoop(dataset, model, "runs_away" if growth * duration > _FOLDINGS else code, numbers, str(failure))


def _growth(dataset: Dataset, model: Model, units: NaturalUnits) -> float:
    """Return the fastest rate at which a small motion grows, at the guesses of the declaration [1/s].

    About rest, else about the middle of the first recording: a levitated body has no rest without its input.
    """
    system = dataset.rig.system
    own = {} if system is None else {x.name: v for x, v in system_base(system).guess.items()}
    values = {
        n: own.get(n, (p.starts[0] if p.starts else p.default) * units.scale(p)) for n, p in model.parameters.items()
    }
    first = dataset.train[0]
    held = 0.0 if first.recording.input is None else float(np.nanmedian(first.recording.input))
    for point, force in ((None, 0.0), (float(np.nanmedian(first.deflection)), held)):
        try:
            matrix = linearise(model, {**values, **model.known}, deflection=point, held=force).a
        except InputError:
            continue
        if np.isfinite(matrix).all() and (growth := float(np.linalg.eigvals(matrix).real.max())) > 0:
            return growth
    return 0.0


def gather_failed_loop(folder: Path, loop: FailedLoop, seed: int, *, note: str = "") -> None:
    """Gather in an empty folder what the page of a failed loop is made of."""
    save_curves(folder, loop.dataset, {})
    content = {
        "provenance": provenance(loop.dataset, seed=seed),
        **describe(loop.dataset),
        "loop": loop.summary(),
        "data_note": note,
        "scope": "loop",
    }
    write_json(folder / "results.json", content)
