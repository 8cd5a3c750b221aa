"""One set of effects in the search: fitted, linearised, and weighed by its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.generalised import generalised
from discovery.estimation.log_evidence import NOISIER, Evidence, evidence_of
from discovery.estimation.model_error import ModelError
from discovery.estimation.sampled_evidence import Sampled, sampled
from discovery.foundation.arrays import FloatArray
from discovery.foundation.workers import at_once
from discovery.screening.refits import Refit
from discovery.selection.context import Context
from discovery.selection.linearise import linearised
from discovery.simulation.simulate import THREADS

#: A first-order step that gains more nats than this is made on the trajectories, unless even as much again held out
#: leaves the set further behind the most likely one than twice so many times the nats of an accepted effect.
_WORTH, _BEHIND = 1.0, 5.0
#: Sets are linearised together as long as they take no more than so many numbers, of so many a parameter and reading.
_NUMBERS, _EACH = 4e7, 5
#: Model error [noise sds] above which effects may be of a size at which linear starts fail.
_FAR = 3.0
#: Steps of a generalised least squares fit.
_ITERATIONS = 8


@dataclass(frozen=True, eq=False)
class Contender:
    """A set of effects beside the declared ones.

    Parameters
    ----------
    added : tuple of str
        Effects in the order in which they were added.
    refit : Refit
        The model with them, at its generalised least squares estimate; residual and Jacobian in noise sds.
    evidence : Evidence
        How well it explains the recordings.
    sampled : Sampled or None
        What importance sampling corrected in the evidence; None where that is Laplace's.
    """

    added: tuple[str, ...]
    refit: Refit
    evidence: Evidence
    sampled: Sampled | None = None

    @property
    def model(self) -> Model:
        """The model."""
        return self.refit.problem.model

    @property
    def key(self) -> tuple[frozenset[str], str]:
        """The effects added, whatever their order, and the mechanics."""
        return frozenset(self.added), self.model.base

    @property
    def chi2(self) -> float:
        """Sum of squared residuals of the training recordings [noise variances], the rig's part included."""
        return self.refit.chi2

    @property
    def error_size(self) -> float:
        """Size of its model error over the noise."""
        return self.evidence.error / self.evidence.white

    def white(self, columns: FloatArray, least: float) -> FloatArray:
        """Return columns (rows, k) of its bench made white under its model error; up to `least` it counts as none."""
        error = ModelError.of(self.error_size, self.refit.problem.units.time) if self.evidence.error > least else None
        return replace(self.refit.problem, error=error).whitened(columns)

    def imitation(self, effect: str) -> float:
        """Return whether one of its effects does what others do, see `Effect.imitates`, or what it cannot be."""
        law, problem, units = get_effect(effect), self.refit.problem, self.refit.problem.units
        sizes = {p.name for p in law.parameters() if not (p.shape or p.natural)}
        own = law.imitates(self.refit.values, units.time, *problem.bench.seen, units.reach(law.place), units.passes)
        return max(own, not sizes.isdisjoint(problem.edges(self.refit.minimum.x)))

    def leaves_noise(self, context: Context) -> bool:
        """Return whether its model error cannot be told from none."""
        return self.evidence.left <= context.least_error(self.model)

    def is_enough(self, context: Context) -> bool:
        """Return whether what it leaves counts as none, or looks like noise that is not far more than is stated."""
        own = self.evidence
        noise = own.nil < context.settings.nats and own.alone < NOISIER and own.off <= own.error_held
        return self.leaves_noise(context) or noise

    def strays(self, found: Contender) -> bool:
        """Return whether an effect that it shares with a set imitates others here, and not there."""
        return any(self.imitation(e) > found.imitation(e) for e in {*self.added}.intersection(found.added))

    @property
    def is_far(self) -> bool:
        """Whether its model error is so large that linear starts may fail, and mechanics err."""
        return self.evidence.error > _FAR

    @property
    def joint(self) -> float:
        """Log evidence of all recordings [nats]."""
        return self.evidence.joint


def contenders(context: Context, sets: Sequence[tuple[tuple[str, ...], Refit]]) -> list[Contender]:
    """Return sets with their evidence, the most likely first; what blows up comes last.

    Parameters
    ----------
    context : Context
        Recordings and settings.
    sets : sequence of (added effects, Refit)
        Refitted by least squares.
    """
    sets, nats = _freed(context, sets), context.settings.nats
    benches = dict.fromkeys(r.problem.bench for _, r in sets)
    weighed = {b: _weighed(context, b, [(added, r) for added, r in sets if r.problem.bench is b]) for b in benches}
    best = max((c.joint for own in weighed.values() for c in own), default=-np.inf)
    for bench, own in weighed.items():
        again = [c for c in own if c.evidence.gained > max(_WORTH, 0.5 * (best - c.joint) - _BEHIND * nats)]
        refitted = _weighed(context, bench, [(c.added, r) for c, r in zip(again, _generalised(again), strict=True)])
        # What is held out does not choose between two estimates of one set.
        better = {c: max(c, b, key=lambda x: x.evidence.train) for c, b in zip(again, refitted, strict=True)}
        weighed[bench] = [better.get(c, c) for c in own]
    return sorted((c for own in weighed.values() for c in own), key=lambda c: -c.joint)


def _freed(context: Context, sets: Sequence[tuple[tuple[str, ...], Refit]]) -> list[tuple[tuple[str, ...], Refit]]:
    """Return sets with what their laws hold by convention free: held, one law would seem better than another."""
    own = [r.problem for _, r in sets]
    problems = [context.freed(p) for p in own]
    new = [i for i, p in enumerate(problems) if len(p.gaussian) > len(own[i].gaussian)]
    starts = [problems[i].start(sets[i][1].values) for i in new]
    minima = fit_problems([problems[i] for i in new], starts, iterations=_ITERATIONS, tolerance=1e-4, rough=True)
    found = list(sets)
    for i, minimum in zip(new, minima, strict=True):
        added, refit = sets[i]
        found[i] = added, replace(refit, problem=problems[i], minimum=minimum)
    return found


def _generalised(sets: Sequence[Contender]) -> list[Refit]:
    """Return sets refitted by generalised least squares, each under its model error."""
    problems = [c.refit.problem for c in sets]
    starts = [c.refit.minimum.x + c.evidence.step for c in sets]
    minima = generalised(problems, starts, [c.error_size for c in sets], iterations=_ITERATIONS, tolerance=1e-4)
    return [replace(c.refit, minimum=m) if np.isfinite(m.cost) else c.refit for c, m in zip(sets, minima, strict=True)]


def integrated(context: Context, contender: Contender) -> Contender:
    """Return a set whose parameters are integrated by importance sampling where Laplace's method was used."""
    refit, evidence = contender.refit, contender.evidence
    if contender.sampled is not None or not np.isfinite(contender.joint):
        return contender
    (slopes,) = linearised(context, refit.problem.bench, [refit])
    if slopes is None:
        return contender
    size = contender.error_size if evidence.nil > 0 else 0.0
    rng = np.random.default_rng([context.settings.seed, refit.minimum.x.size])
    found = sampled(refit.problem, refit.minimum.x, slopes.problem, size, rng)
    better = replace(evidence, train=evidence.train + found.correction)
    return replace(contender, evidence=better, sampled=found)


def _weighed(context: Context, bench: Bench, sets: Sequence[tuple[tuple[str, ...], Refit]]) -> list[Contender]:
    """Return sets of one bench with their evidence, in groups that need a bounded memory."""
    most = max((len(r.problem.names) for _, r in sets), default=1)
    count = max(1, int(_NUMBERS / (_EACH * most * max(1, bench.n_rows))))
    return [c for i in range(0, len(sets), count) for c in _weighed_together(context, bench, sets[i : i + count])]


def _weighed_together(context: Context, bench: Bench, sets: Sequence[tuple[tuple[str, ...], Refit]]) -> list[Contender]:
    """Return sets of one bench with their evidence, linearised in one simulation."""
    good = [r for _, r in sets if np.isfinite(r.chi2)]
    slopes = dict(zip(good, linearised(context, bench, good), strict=True))
    known = [slopes.get(r) for _, r in sets]
    each = at_once([partial(evidence_of, k.problem) if k else Evidence.none for k in known], threads=THREADS)
    found = []
    for (added, r), slope, own in zip(sets, known, each, strict=True):
        if slope is not None:
            jacobian = np.concatenate([slope.jacobian, r.minimum.jacobian[bench.n_rows :]])
            r = replace(r, minimum=replace(r.minimum, jacobian=jacobian))
        found.append(Contender(added, r, own))
    return found
