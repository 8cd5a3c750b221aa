"""The answer of a run, and what follows it, as far as they are there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discovery.diagnosis.missing_force import MissingForce
from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.posterior.draws import Posterior
from discovery.recordings.dataset import Dataset
from discovery.results.manifest import check_whole
from discovery.results.provenance import plain, read_json, restored
from discovery.runs import stages
from discovery.runs.loop_result import LoopResult

if TYPE_CHECKING:
    from discovery.foundation.progress import Progress
    from discovery.posterior.study import PosteriorStudy

#: What follows the answer, in words; and under which names it is in results.json.
_PARTS = ("the posterior and what it predicts", "the noise models and the evidence of the models")
_AFTERWARDS = ("posterior", "pending", "noise", "evidence", "elastica")


@dataclass(frozen=True)
class Answer:
    """What a run knows when its loop is done, which is in its folder then.

    `content` is that of results.json, with nothing of the posterior; `missing` the force that the final model lacks;
    and `predictions` hold every recording by "linear", "before" and "after".
    """

    dataset: Dataset
    out: Path
    seed: int
    content: Mapping[str, Any]
    fits: stages.Fits
    loop: LoopResult
    missing: MissingForce | None
    predictions: Mapping[str, list[FloatArray]]

    @property
    def subject(self) -> Fit:
        """The fit that is sampled: an arm's is the paper's model, which the elastica predicts, else the final one."""
        rod = self.dataset.train[0].system.has_rod
        return (self.fits.models["declared"] if rod else self.loop.after).specialised()

    @cached_property
    def kept(self) -> Mapping[str, Any]:
        """Content of results.json of an earlier run that came to the same answer; empty where there is none."""
        try:
            found = read_json(self.out / "results.json")
            check_whole(self.out, found)
        except (FileNotFoundError, InputError):
            return {}
        same = isinstance(found, Mapping) and _answer_in(found) == restored(plain(_answer_in(self.content)))
        return found if same else {}


def _answer_in(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of results.json is the answer, and what it was made from."""
    origin = content.get("provenance") or {}
    made_from = {k: origin.get(k) for k in ("seed", "rig_sha256", "data", "versions", "git_revision")}
    return {**{k: v for k, v in content.items() if k not in (*_AFTERWARDS, "provenance")}, "made_from": made_from}


@dataclass
class Sampled:
    """What follows the answer, as far as it is there.

    `weighed` holds "noise" and "evidence", `reached` how far the sampler was when it was last asked. What is not there
    is in `left_out`, in words, and why it is not in `because`: "asked" (not to be sampled), "running", "time", or what
    failed.
    """

    posterior: Posterior | None = None
    study: PosteriorStudy | None = None
    weighed: Mapping[str, Any] = field(default_factory=lambda: {"noise": None, "evidence": None})
    reached: Progress | None = None
    left_out: tuple[str, ...] = _PARTS
    because: str = "running"

    def summary(self, answer: Answer) -> dict[str, Any]:
        """Return what results.json holds of it."""
        posterior, study = self.posterior, self.study
        found = None
        if posterior is not None and study is not None:
            subject = "declared" if answer.dataset.train[0].system.has_rod else "after"
            found = {
                "subject": subject,
                "rows": posterior.summary(),
                "status": posterior.status,
                "method": posterior.provenance["method"],
                **study.summary(),
            }
        pending: dict[str, Any] | None = None
        if self.left_out:
            pending = {"left_out": list(self.left_out), "because": self.because}
            if self.reached is not None and posterior is None:
                pending |= {"effective": self.reached.done, "wanted": self.reached.total}
        return {"posterior": found, "pending": pending, **self.weighed}
