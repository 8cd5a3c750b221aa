"""What the loop found: the models before and after, every decision, and what is told of the effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.declarations.units import quoted
from discovery.diagnosis import caution, edges
from discovery.diagnosis.caution import Caution
from discovery.diagnosis.contradiction import ContradictionReport
from discovery.diagnosis.separation import Separation
from discovery.diagnosis.stamps import erring_stamps
from discovery.diagnosis.stand_in import StandIn, seen_aside, stand_in
from discovery.diagnosis.undetermined import hung_on
from discovery.equations.losses import without_losses
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit
from discovery.estimation.generalised import fitted_to_all
from discovery.estimation.residual import ResidualReport
from discovery.estimation.told import as_read
from discovery.foundation.arrays import FloatArray
from discovery.foundation.estimate_text import figures
from discovery.foundation.start_names import start_of
from discovery.mechanics.upgrades import UPGRADES
from discovery.plots.loops import LoopViews
from discovery.recordings.flags import impossible
from discovery.recordings.recording import Recording
from discovery.runs.description import flagged
from discovery.selection.contender import Contender
from discovery.selection.context import Context
from discovery.selection.decision import Decision
from discovery.selection.verdict import Named, least_error

#: A state on which the residual depends explains so much of its variance.
_DEPENDS = 0.1


def noise_of(recordings: Sequence[Recording]) -> float:
    """Return the noise in which a model error of recordings counts [unit of the output].

    The quieter of them tell the more of it.
    """
    weights = [float(r.noise[r.judged].min()) ** -2 for r in recordings]
    return float(np.average(weights, weights=[r.time.size for r in recordings]) ** -0.5)


@dataclass(frozen=True)
class ModelErrorReport:
    """The error that a model keeps beside the noise."""

    #: before, after: size for the declared and for the final model [unit of the output].
    before: float
    after: float
    unit: str  # that unit
    share: float  # after over before
    least: float  # size up to which it counts as none [unit of the output]
    held: float  # size for the final model on the held-out recordings [unit of the output]; zero without any
    depends_on: tuple[str, ...]  # states that explain a part of what the final model leaves, the strongest first

    @classmethod
    def of(
        cls, context: Context, root: Contender, before: Contender, after: Contender, left: ResidualReport
    ) -> ModelErrorReport:
        """Return the model error of the final model, and of the declared one, in the unit of the output."""
        least, e = least_error(after, root, context), after.evidence
        # What is held out may be noisier, or less so.
        judged = [own.recording for own, _ in context.judge.parts] if context.judge.holds else []
        noise = noise_of([own.recording for own in context.train])

        def size(error: float, chi2: float, readings: int) -> float:
            # Errors that come and go faster than it would take a size beyond all that is left.
            return min(error, max(float(np.sqrt(chi2 / max(readings, 1))), least))

        first, last = (
            size(float(np.hypot(c.evidence.error, c.evidence.beyond)), c.chi2, c.refit.problem.bench.n_data) * noise
            for c in (before, after)
        )
        held = size(e.off, e.chi2_ahead, e.count_held) * noise_of(judged) if judged else 0.0
        depends = tuple(d.variable for d in left.dependence if d.share > _DEPENDS and d.p_value < 1e-3)
        share = last / first if first > 0 and np.isfinite(first) else 1.0
        unit = context.train[0].recording.units[0]
        return cls(first, last, unit, share, least * noise, held=held, depends_on=depends)

    @property
    def expected(self) -> tuple[float, float]:
        """What the declared and the final model err by in another recording; nothing where that counts as none."""
        sizes = self.before, max(self.after, self.held)
        before, after = (size if size > self.least else 0.0 for size in sizes)
        return before, after

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {**asdict(self), "depends_on": list(self.depends_on)}


@dataclass(frozen=True, repr=False)
class LoopResult(LoopViews):
    """What the loop found.

    Parameters
    ----------
    verdict : str
        "explained", "partly_explained", "nothing_missing" or "unexplained".
    declared : tuple of str
        The declared model.
    added : tuple of str
        Effects in the order in which they were added, base upgrades first.
    named : mapping of str to Named
        How sure each added effect is, base upgrades left out.
    before, after : Fit
        The declared model refitted, and the final one.
    steps : tuple of Decision
        What was decided, in order.
    errors : mapping
        As in loop.json.
    model_error : ModelErrorReport
        The error that the model keeps beside the noise.
    lead, lead_law : Decision or None
        The strongest candidate that is not named, where something is left; of a force of no law, the best law too.
    residual_before, residual_after : ResidualReport
        On the training recordings.
    predictions : mapping
        "before" and "after": prediction of every recording, training first.
    complete : bool
        Whether the model error cannot be told from none.
    contradiction : ContradictionReport
        Fitted values against what the rig predicts.
    separations : tuple of Separation
        The manoeuvres that would tell apart what these recordings cannot.
    recordings : tuple of Recording
        Training first.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> found = close_loop(data)
    >>> found.verdict, found.added
    ('explained', ('coulomb_friction',))
    >>> found.to_pandas().loc["f_c", ["unit", "effect"]].tolist()
    ['m s^-2', 'coulomb_friction']
    >>> found.summary()["errors"]["unit"], round(found.foresight().values["f_c"], 3)  # m s^-2
    ('m', 0.12)
    >>> found.plot_errors().get_title(), len(found.plot_residuals())
    ('explained: coulomb_friction', 3)
    """

    verdict: str
    declared: tuple[str, ...]
    added: tuple[str, ...]
    named: Mapping[str, Named]
    before: Fit
    after: Fit
    steps: tuple[Decision, ...]
    errors: Mapping[str, Any]
    model_error: ModelErrorReport
    lead: Decision | None
    residual_before: ResidualReport
    residual_after: ResidualReport
    predictions: Mapping[str, list[FloatArray]]
    complete: bool
    contradiction: ContradictionReport = field(default_factory=ContradictionReport)
    separations: tuple[Separation, ...] = ()
    recordings: tuple[Recording, ...] = ()
    lead_law: Decision | None = None

    def __repr__(self) -> str:
        """Return the answer; all that led to it would fill pages."""
        before, after = (self.errors[k]["holdout"]["rms"] for k in ("before", "after"))
        change = f"holdout rms {figures(before, 4)} -> {quoted(after, self.errors['unit'], 4)}"
        return f"<LoopResult {self.verdict}, added {', '.join(self.added) or 'nothing'}, {change}>"

    @property
    def ambiguous(self) -> dict[str, tuple[str, ...]]:
        """What else would serve, by added effect."""
        return {effect: found.group for effect, found in self.named.items()}

    @property
    def given_up(self) -> list[str]:
        """Declared laws, or constants that are losses, in whose place an added effect stands."""
        final = {*without_losses(self.after.model), *self.after.model.effects}
        contained = {law for e in self.named for law in get_effect(e).reduces_to}.intersection(self.declared)
        return [law for law in (*without_losses(self.before.model), *contained) if law not in final]

    @property
    def impossible(self) -> bool:
        """Whether a recording refutes what the rig file declares; nothing was searched then."""
        return impossible(flag for recording in self.recordings for flag in recording.flags)

    @property
    def stand_ins(self) -> dict[str, StandIn]:
        """What added effects may stand for, by effect: an error of the rig file would do the same."""
        found = {effect: stand_in(self.after, effect) for effect in self.added}
        return {effect: other for effect, other in found.items() if other is not None}

    @cached_property
    def cautions(self) -> list[Caution]:
        """Why the answer may not be believed, as the fit itself shows."""
        error = self.model_error
        off = caution.missed(self.errors, left=error.after, held=error.held, least=error.least)
        off = hung_on(off, self.after) if off else off
        found = [None if self.impossible else off, edges.strayed_constant(self.after), caution.acausal(self.after)]
        found.append(None if self.impossible else caution.unfinished(self.after))
        found += [*edges.combined(self.after), edges.held_sign(self.before, self.after), edges.far_start(self.after)]
        found.append(edges.gain_untold(self.before, self.after))
        if not self.impossible and not self.contradiction.contradictions:
            found += edges.stated_edges(self.after)
        if self.added:
            found += [caution.not_carried(self.errors), seen_aside(self.after, self.added)]
        elif self.complete:
            found.append(caution.motionless([e.recording for e in self.after.problem.bench.experiments]))
        if not self.complete and not self.impossible:
            found.append(caution.stopped(self.steps))
            noise = float(min(r.noise[r.judged].min() for r in self.recordings))
            sizes = {"left": error.after, "held": error.held, "noise": noise}
            alike = caution.like_noise(self.residual_after, error.depends_on, self.errors, **sizes)
            found.append(erring_stamps(self._left(trained=True)) or caution.burst(self.after) or alike)
        # A model error is said, and so is a hold-out that is missed.
        if self.complete and found[0] is None:
            for judge in (caution.scattered, caution.quiet):
                told = (judge(self.errors, self._left(trained=t), trained=t) for t in (False, True))
                found.append(next((c for c in told if c is not None), None))
        ends = (*edges.at_edges(self.after, self.added), *edges.untold(self.after, self.added))
        return [*ends, *(c for c in found if c is not None)]

    def _left(self, *, trained: bool) -> list[tuple[Recording, FloatArray]]:
        """Return the recordings that judge, or were fitted, and what the final model leaves: NaN in the other part."""
        pairs = [(r, p - r.output) for r, p in zip(self.recordings, self.predictions["after"], strict=True)]
        fitted = self.after.problem.bench.experiments
        if (separate := pairs[len(fitted) :]) and not trained:
            return separate
        for e, (_, left) in zip(fitted, pairs, strict=False):
            if e.fitted_samples is not None:
                left[slice(e.fitted_samples, None) if trained else slice(e.fitted_samples)] = np.nan
        return pairs[: len(fitted)]

    def foresight(self) -> Fit:
        """Return the final model fitted to the training recordings to their end: once judged, it predicts others."""
        bench = self.after.problem.bench
        experiments = bench.experiments
        if all(e.fitted_samples is None for e in experiments):
            return self.after
        noise = noise_of([e.recording for e in experiments])
        whole = [replace(e, fitted_samples=None) for e in experiments]
        # Their motions, and so the steps that these ask for, are known.
        return fitted_to_all(
            self.after, self.model_error.after / noise, Bench(bench.base, bench.effects, whole, bench.step)
        )

    def summary(self) -> dict[str, Any]:
        """Return the content of loop.json."""
        lead, law = (
            d and {"effects": list(d.effects), "code": d.code, "numbers": dict(d.numbers)}
            for d in (self.lead, self.lead_law)
        )
        return {
            "verdict": self.verdict,
            "declared": list(self.declared),
            "recordings": [flagged(r) for r in self.recordings],
            "effects": [self._described(effect) for effect in self.added],
            **({"given_up": lost} if (lost := self.given_up) else {}),
            "errors": dict(self.errors),
            "model_error": self.model_error.summary(),
            "complete": self.complete,
            "cautions": [c.summary() for c in self.cautions],
            **({"lead": {**lead, **({"law": law} if law else {})}} if lead else {}),
            "contradiction": self.contradiction.summary(),
            **({"separation": [s.summary() for s in self.separations]} if self.separations else {}),
            "model": {"before": self.before.summary(), "after": self.after.summary()},
            "residual": {"before": self.residual_before.summary(), "after": self.residual_after.summary()},
            "steps": [s.summary() for s in self.steps],
        }

    def _described(self, effect: str) -> dict[str, Any]:
        """Return what loop.json holds of an added effect."""
        other = self.stand_ins.get(effect)
        declared = () if effect in UPGRADES else get_effect(effect).parameters()
        names, own = [p.name for p in declared], [p.name for p in declared if p.own]
        of_recordings = [n for n in self.after.values if (start := start_of(n)) and start[0] in own]
        parameters = {n: as_read(self.after, n) for n in (*names, *of_recordings) if n in self.after.values}
        if other and other.parameter in parameters and parameters[other.parameter]["sd"] is not None:
            # No reading is surer than the ruler.
            row = parameters[other.parameter]
            row["sd"] = float(np.hypot(row["sd"], other.relative_sd))
        found = self.named.get(effect)
        return {
            "id": effect,
            "parameters": parameters,
            "evidence": {**found.odds.numbers, **found.force} if found else {},
            "probability": found.probability if found else None,
            "group_probability": found.group_probability if found else None,
            "ambiguous_with": list(found.group if found else ()),
            "may_stand_for_unknown": found is not None and found.doubtful,
            **({"stands_for": other.summary()} if other else {}),
        }
