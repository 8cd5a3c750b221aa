"""One rig of the comparison: its errors in the measure of its table, beside known ones, and whether goals are met."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.measured.derived import gravity_over_length
from benchmarks.measured.known import Goal, Known, read_known
from discovery.declarations.units import si_factor
from discovery.foundation.errors import InputError
from discovery.report.numbers import scale_for, significant, unit_text
from discovery.report.results import Run, read_run
from discovery.report.sentences import verdict_sentence
from discovery.report.words import effect_name, listed
from discovery.results.provenance import read_json

#: Verdicts under which effects are named.
_NAMED = ("explained", "partly_explained")
_GROUPS = {
    "train": "training",
    "holdout": "held out",
    "continued": "held out, run on from training",
    "both": "both drops",
}


@dataclass(frozen=True)
class Outcome:
    """A goal with what was found: whether it is reached, as a sentence."""

    reached: bool
    sentence: str


@dataclass(frozen=True)
class Entry:
    """One rig's run beside what is known of its recordings.

    Parameters
    ----------
    name : str
        Of the rig, such as ``emps/rig``.
    run : Run
        Its result files.
    known : Known
        What is known.
    reference : mapping or None
        Errors of a reference model by group, in the unit of the output.
    """

    name: str
    run: Run
    known: Known
    reference: Mapping[str, Mapping[str, float]] | None = None

    @property
    def errors(self) -> Mapping[str, Any]:
        """Errors of the loop, as in ``loop.json``."""
        return self.run.loop["errors"]

    @property
    def unit(self) -> str:
        """Unit of an error on the page."""
        if self.known.measure == "relative":
            return "%"
        return "" if self.known.measure == "normalised" else unit_text(self._shown[1])

    @property
    def _shown(self) -> tuple[float, str]:
        """What an rms in SI units is multiplied by, and the unit that it then has."""
        if self.known.unit:
            return 1.0 / si_factor(self.known.unit), self.known.unit
        scale = scale_for(self.errors["unit"], self.errors["after"]["train"]["rms"])
        return scale.factor, scale.symbol

    @property
    def tests(self) -> tuple[str, ...]:
        """Recordings that are only scored."""
        return tuple(self.run.results.get("test") or ())

    def group_name(self, group: str) -> str:
        """Return a group of recordings in the words of a reader."""
        return _GROUPS.get(group, f"{effect_name(group)}, only scored")

    def _signal(self, group: str, which: str) -> float:
        """Return the rms of the signal of a group, or its standard deviation."""
        roles = {"both": ("train", "holdout"), "continued": ("holdout",)}.get(group, (group,))
        members = [r for r in self.run.results["recordings"] if r["role"] in roles or r["name"] == group]
        total = sum(r["samples"] for r in members)
        return math.sqrt(sum(r["samples"] * r["signal"][which] ** 2 for r in members) / total)

    def scaled(self, rms: float, group: str = "holdout") -> float:
        """Return an rms error in SI units in the measure of the rig's table."""
        if self.known.measure == "relative":
            return 100.0 * rms / self._signal(group, "rms")
        if self.known.measure == "normalised":
            return rms / self._signal(group, "sd")
        return rms * self._shown[0]

    def error(self, when: str, group: str) -> float | None:
        """Return the free-run error "before" or "after" on a group of recordings; None where there is none."""
        if group == "continued":
            on = self.run.results.get("continued")
            return self.scaled(on[when]["rms"]) if on else None
        if group in self.tests:
            return self.scaled(self.run.results["test"][group][when]["rms"], group)
        if group == "both":
            count = {r["role"]: r["samples"] for r in self.run.results["recordings"]}
            mean = sum(count[g] * self.errors[when][g]["rms"] ** 2 for g in ("train", "holdout"))
            return self.scaled(math.sqrt(mean / (count["train"] + count["holdout"])), group)
        found = (self.errors[when].get(group) or {}).get("rms")
        return None if found is None else self.scaled(found, group)

    @property
    def judged(self) -> str:
        """The held-out group by which a rig is compared: run on from training, unless others state the other one."""
        stated = {g for f in self.known.figures for g in f.errors} | self.known.goal.errors.keys()
        on = self.run.results.get("continued") and ("continued" in stated or "holdout" not in stated)
        return "continued" if on else "holdout"

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of recordings whose errors are shown: training, held out, and every one that is only scored."""
        named = {g for f in self.known.figures for g in f.errors}
        on = ("continued",) if self.run.results.get("continued") else ()
        return ("train", "holdout", *on, *(("both",) if "both" in named else ()), *self.tests)

    def best_known(self, group: str) -> tuple[float, str] | None:
        """Return the smallest error known on a group, a reference model scored here included, and of which model."""
        found = [
            (f.errors[group], f"{f.model} ({f.source})")
            for f in self.known.figures
            if group in f.errors and f.comparable
        ]
        if self.reference and group in self.reference:
            found.append((self.scaled(self.reference[group]["rms"], group), "reference model, through the same filter"))
        return min(found, default=None)

    def floor(self, group: str = "holdout") -> tuple[float, str]:
        """Return the error of a perfect model on a group, and where that figure is from."""
        first = next(r for r in self.run.results["recordings"] if r["role"] == "train")
        step = max(first.get("step") or [0.0])
        kind = "estimated noise" if first.get("noise_estimated") else "stated noise"
        rounding = step / math.sqrt(12.0)
        if rounding >= 0.9 * self.errors["noise_floor"]:
            kind = "rounding of the readings"
        return self.scaled(self.errors["noise_floor"], group), kind

    def shown(self, value: float | None) -> str:
        """Return an error as printed, with its unit."""
        return f"{significant(value)} {self.unit}".strip()

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Every goal with what was found."""
        return self._against(self.known.goal)

    @property
    def bounds(self) -> tuple[Outcome, ...]:
        """What stands in the place of goals that are not reached yet, with what was found."""
        return tuple(o for o in self._against(self.known.bounds) if o not in self.outcomes)

    @property
    def regressions(self) -> tuple[str, ...]:
        """Goals and bounds that must be reached and are not."""
        return tuple(o.sentence for o in self._against(self.known.bounds) if not o.reached)

    def _against(self, goal: Goal) -> tuple[Outcome, ...]:
        """Return every item of a goal with what was found."""
        found = []
        for group, limit in goal.errors.items():
            value = self.error("after", group)
            reached = value is not None and value <= limit
            what = f"{self.group_name(group)} at most {self.shown(limit)}: {self.shown(value)}"
            found.append(Outcome(reached, what + ("" if reached else self._why(group, limit))))
        for names in goal.named:
            found.append(self._named(names))
        added = {e["id"] for e in self.named}
        for name in goal.not_named:
            found.append(Outcome(name not in added, f"{effect_name(name)} is {'not ' * (name not in added)}added"))
        if goal.verdict:
            verdict = self.run.loop["verdict"]
            wanted = " or ".join(f"“{effect_name(v)}”" for v in goal.verdict)
            found.append(Outcome(verdict in goal.verdict, f"verdict {wanted}: it is “{effect_name(verdict)}”"))
        if goal.fewer_parameters_than is not None:
            count = self.parameters
            reached = count < goal.fewer_parameters_than
            found.append(Outcome(reached, f"fewer than {goal.fewer_parameters_than} parameters: {count} are fitted"))
        if goal.gravity_over_length is not None:
            check = gravity_over_length(self.run)
            away = abs(check.fitted / check.expected - 1) if check else math.inf
            limit = goal.gravity_over_length
            sentence = (
                f"g/L within {significant(100 * limit, 2)} % of the geometry: {significant(100 * away, 2)} % away"
            )
            found.append(Outcome(away <= limit, sentence))
        if goal.seconds is not None:
            took = self.run.results["provenance"].get("loop_seconds", math.inf)
            sentence = f"the loop takes at most {significant(goal.seconds)} s: {significant(took)} s"
            found.append(Outcome(took <= goal.seconds, sentence))
        return tuple(found)

    def _named(self, names: tuple[str, ...]) -> Outcome:
        """Return whether one of several effects was added, or explains the recordings as well as one that was."""
        what = " or ".join(effect_name(n) for n in names)
        if any(e["id"] in names for e in self.named):
            return Outcome(True, f"{what} is named")
        for e in self.named:
            if set(names) & set(e["ambiguous_with"]):
                return Outcome(False, f"{what} is not named first, but explains as much as {effect_name(e['id'])}")
        return Outcome(False, f"{what} is not named; what was added: {listed(self.added) or 'nothing'}")

    def _why(self, group: str, limit: float) -> str:
        """Return what the numbers say of a limit that is not met."""
        parts = []
        floor, kind = self.floor(group)
        if floor > limit:
            parts.append(f"the limit is below the {kind} of {self.shown(floor)}")
        train, held = self.error("after", "train"), self.error("after", group)
        if train is not None and held is not None:
            if train > limit:
                parts.append(f"the final model leaves {self.shown(train)} already where it was fitted")
            else:
                parts.append(f"where it was fitted the final model leaves {self.shown(train)}")
        best = self.best_known(group)
        if best is not None:
            parts.append(f"the best known figure is {self.shown(best[0])}, {best[1]}")
        if self.run.loop["verdict"] in ("partly_explained", "unexplained"):
            parts.append(f"the verdict says: {verdict_sentence(self.run.loop)}")
        return f" ({'; '.join(parts)})" if parts else ""

    @property
    def parameters(self) -> int:
        """Number of fitted physical parameters of the final model, the initial states not counted."""
        return sum("[" not in name for name in self.run.loop["model"]["after"]["parameters"])

    @property
    def named(self) -> Sequence[Mapping[str, Any]]:
        """Effects that the loop names, in full or beside a model error; better mechanics under no such verdict."""
        return self.run.loop["effects"] if self.run.loop["verdict"] in _NAMED else ()

    @property
    def added(self) -> tuple[str, ...]:
        """What the loop added, each with what explains the recordings as well, in words."""
        effects = self.run.loop["effects"]
        return tuple(" or ".join(effect_name(n) for n in (e["id"], *e["ambiguous_with"])) for e in effects)


def read_entry(name: str, folder: Path, known: Known) -> Entry:
    """Return one rig's entry from its run's folder.

    Raises
    ------
    InputError
        If the folder does not hold the results of a run.
    """
    scored = folder / "reference.json"
    reference = read_json(scored) if scored.exists() else None
    return Entry(name, read_run(folder), known, reference)


def read_entries(rigs: Mapping[str, Path], folder: Path) -> list[Entry]:
    """Return the entries of the rigs that have a run, in their order.

    Parameters
    ----------
    rigs : mapping of str to Path
        Rig files by name.
    folder : Path
        The folder of the runs; that of a rig lies in the folder of its name.

    Raises
    ------
    InputError
        If no rig has a run.
    """
    entries = [
        read_entry(name, folder / name, read_known(rig))
        for name, rig in rigs.items()
        if (folder / name / "results.json").exists()
    ]
    if not entries:
        raise InputError(f"{folder} holds no run of a measured set; make one with `make measured`.")
    return entries
