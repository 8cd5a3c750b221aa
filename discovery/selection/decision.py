"""What the search decided, as records: codes and numbers. Sentences are made from them in `report.sentences`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Candidacy:
    """One set that was compared with another."""

    effects: tuple[str, ...]  # what it has more, or in the place of another
    train: float  # log evidence of the training recordings against that of the other [nats]
    held: float  # log predictive score of the held-out ones against that of the other [nats]
    size: float  # how far it moves the residual over the model error that is left, rms over rms
    model_error: float  # size of the model error that it leaves [noise sds]
    chi2: float  # what it leaves in training [noise variances]
    parameters: int  # number of parameters that were fitted


@dataclass(frozen=True)
class Decision:
    """One decision of the search.

    Parameters
    ----------
    action : str
        "declare", "mechanics", "add", "remove", "exchange", "integrate" or "stop".
    effects : tuple of str
        What it is about.
    accepted : bool
        Whether it was done.
    code : str
        Why: "accepted", "training", "held_out", "predicts_worse" (than the declared model), "chance", "size", "finite"
        (a motion that blows up), "complete" (what is left is noise), "exhausted" (nothing is accepted), "budget",
        "impossible" (a recording refutes the rig file), "unknown" (a force of no law), "sampled" or "laplace" (how the
        parameters were integrated), "astray" (the declared model leaves most of the motion), "contained" (a declared
        law in an added one); why there is no fit, see `discovery.runs`.
    numbers : mapping of str to float
        What the code is about, see `Candidacy`, of "budget" `Neighbours.work`; "odds" is the smallest of the log odds.
    candidates : tuple of Candidacy
        What was compared, the most likely first.
    """

    action: str
    effects: tuple[str, ...]
    accepted: bool
    code: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    candidates: tuple[Candidacy, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        rows = [{**asdict(c), "effects": list(c.effects)} for c in self.candidates]
        return {**asdict(self), "effects": list(self.effects), "candidates": rows}
