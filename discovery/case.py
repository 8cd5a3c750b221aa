"""What every part of one loop shares: its recordings, its thresholds, and the decisions that make its story."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.attribution import candidates
from discovery.bench import Bench
from discovery.errors import ComputationError, SimulationFailure
from discovery.experiment import Experiment
from discovery.fit import MOST_STEPS, SHIFT, Fit, fit, fit_near, refined
from discovery.holdout import HoldOut
from discovery.model import Model
from discovery.problem import NaturalUnits, Problem, conventions
from discovery.refits import Refit, distances, resettled
from discovery.registry import catalogue
from discovery.residual import roughness
from discovery.shaking import shaken
from discovery.simplicity import imitates
from discovery.solver_error import Probe
from discovery.step import choose_step
from discovery.unequal_steps import unequal_bench

__all__ = ["Case", "LoopSettings", "Step", "Tell"]

FloatArray = NDArray[np.float64]
Tell = Callable[[str], None]
#: More coordinates have found the same answer unless they leave more than so many times as much.
_SAME_ANSWER = 1.05
#: Finer mechanics may take so many times the steps of quick ones: the tip does not feel what rings faster still.
_MORE = 8
#: A normal number is farther from its mean than so many standard deviations once in a hundred times.
_FAR_OFF = 2.576


@dataclass(frozen=True)
class LoopSettings:
    """Thresholds of the loop, each a plain number with a reason.

    Parameters
    ----------
    tolerance : float
        Trajectory error of the search [rad or natural coordinate], or what noise hides where that is more; the solver's
        shift of the answer is reported.
    floor : float
        Systematic residual, in noise sds, below which a residual counts as noise. The exact arm itself leaves 0.05 to
        0.3 when the encoder's profile is rough.
    relative_floor : float
        Or below this share of what was there before any effect was added,
    ceiling : float
        but never above this: then the systematic part is as large as the noise.
    least_gain : float
        Chi-square that an effect must remove: far beyond the largest of 20 chance gains.
    least_share : float
        Share of the excess chi-square that an effect must remove on the training recordings.
    price : float
        Chi-square that one free parameter more must gain for a candidate to count as better.
    tie : float
        Candidates whose excess chi-square is within this share of the best one count as equally good: the one with
        fewer parameters is taken and the others are reported as ambiguous.
    form : float
        So are those within this share of what the best one removes: every law idealises. Where what is left counts
        as noise, a further effect must remove more than this share of what the others have.
    form_lumped : float
        That share beside a law at the tip that stands for one spread along the rod.
    tie_pliable : float
        The same share where the best one is pliable (a periodic force imitates any slow change of a decay).
    pair_share : float
        Share of the excess chi-square that two effects must remove together where neither passes alone, and that every
        one of several effects must remove from what the others leave.
    kept_share : float
        The latter where the residual stays unexplained, and no law in the set imitates others.
    least_known, least_foreseen : float
        Where the residual stays unexplained, effects are named only if at most these shares of the excess are left on
        the training and on the held-out recordings.
    most_effects : int
        Largest number of effects added.
    seed : int
        Of everything random.
    follow_up : bool
        Test the answer against the rig, and design manoeuvres for what the recordings cannot tell apart.
    """

    tolerance: float = 2e-5
    floor: float = 0.35
    relative_floor: float = 0.1
    ceiling: float = 1.0
    least_gain: float = 40.0
    least_share: float = 0.2
    price: float = 10.0
    tie: float = 0.05
    form: float = 5e-4
    form_lumped: float = 2e-3
    tie_pliable: float = 0.25
    pair_share: float = 0.7
    kept_share: float = 0.4
    least_known: float = 0.03
    least_foreseen: float = 0.5
    most_effects: int = 4
    seed: int = 1
    follow_up: bool = True

    def limit(self, first_rough: float) -> float:
        """Return the systematic residual [noise sds] up to which a held-out residual counts as noise.

        `first_rough` is what was there before any effect was added.
        """
        return max(self.floor, min(self.relative_floor * first_rough, self.ceiling))


@dataclass(frozen=True)
class Step:
    """One decision of the loop, for its story.

    Parameters
    ----------
    action : str
        "upgrade", "add", "refine", "remove", "renew", "exchange", "withdraw" or "stop".
    effect : str
        What was added or tried.
    accepted : bool
        Whether it stayed.
    reason : str
        A sentence.
    numbers : mapping of str to float
        Chi-square before and after, on training and hold-out.
    ranking : tuple of mapping
        For "add": every candidate with its linear score and its refitted chi-square.
    """

    action: str
    effect: str
    accepted: bool
    reason: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    ranking: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True)
class Case:
    """What every part of one loop shares.

    Parameters
    ----------
    train : sequence of Experiment
        Recordings to fit.
    judge : HoldOut
        Recordings, or parts of them, that decide.
    settings : LoopSettings
        Thresholds.
    units : NaturalUnits
        Natural units.
    tell : callable
        Receives one sentence before every longer piece of work.
    """

    train: Sequence[Experiment]
    judge: HoldOut
    settings: LoopSettings
    units: NaturalUnits
    tell: Tell
    _benches: dict[tuple[str, float, float], Bench] = field(default_factory=dict, init=False, repr=False)

    def kernel_effects(self, model: Model) -> tuple[str, ...]:
        """Return every effect that may come into question on the base, so that one kernel serves the whole search."""
        return tuple(sorted({*model.effects, *self.candidates(model)}))

    def candidates(self, model: Model) -> tuple[str, ...]:
        """Return the effects that a model of these recordings could lack."""
        return candidates(model, self.train[0].coordinate_unit)

    def fit(self, model: Model, values: Mapping[str, float], gaussian: Mapping[str, tuple[float, float]]) -> Fit:
        """Fit a model with the kernel that holds the whole catalogue of its base."""
        effects, tolerance = self.kernel_effects(model), self.settings.tolerance
        bench = unequal_bench(model, effects, self.train, self.units, values, tolerance)
        return fit(model, self.train, start=values, bench=bench, units=self.units, gaussian=gaussian)

    def finished(self, found: Refit) -> Fit:
        """Return a refit of the search with its intervals, the conventions of the added effects free.

        Held, these would shift the other parameters, and leave their intervals too narrow.
        """
        return fit_near(self._unfixed(found.problem), found.values)

    def _on_finer(self, found: Refit) -> Iterator[Problem]:
        """Yield the problem of a refit on each finer mechanics, the best first."""
        for name in found.problem.model.mechanics.finer:
            model = found.problem.model.on_base(name)
            own = found.problem.bench
            key = name, own.step, own.shortest
            try:
                # The steps that the search needs tell how fine these must be.
                if key not in self._benches:
                    self._benches[key] = self._alike(found, model)
            except ComputationError:
                continue
            yield replace(found.problem, model=model, bench=self._benches[key])

    def _alike(self, found: Refit, model: Model) -> Bench:
        """Return a bench for a model on finer mechanics, at the pace of a refit or on fewer equal steps."""
        effects, tolerance = self.kernel_effects(model), self.settings.tolerance
        own = found.problem.bench
        # What damps the rod's higher shapes strongly may ask for a million steps, and leaves nothing of them to see.
        shortest = own.duration / min(MOST_STEPS, _MORE * own.most_steps)

        def bench(experiments: Sequence[Experiment]) -> Bench:
            step = choose_step(model, experiments, self.units, found.values, tolerance, effects, shortest)
            return Bench(model.base, effects, experiments, step)

        if own.shortest == own.step:
            return bench(self.train)
        benches = []
        for experiments in (self.train, own.experiments):
            with suppress(ComputationError):
                benches.append(bench(experiments))
        if not benches:
            raise ComputationError(f"No step reaches the tolerance on {model.base}.")
        probe = Probe.of(model, effects, self.units, found.values)
        # At the shortest steps the error may be too large.
        return min(benches, key=lambda b: (probe.error(b) > tolerance, b.most_steps))

    def finer(self, found: Refit, least: float) -> Refit:
        """Return a refit of the search on finer mechanics where there are any that fit as well, else the same.

        Where these move its readings by less than `least` [noise sds, squared], they are not tried.
        """
        for problem in self._on_finer(found):
            if self._moved(found, problem) < least:
                return found
            self.tell(f"refitting on finer mechanics: {problem.model.base}")
            again = resettled(found, problem.bench)
            if self._is_as_good(again.chi2, found):
                return again
        return found

    def finest(self, found: Refit) -> Fit:
        """Return a refit of the search, finished on finer mechanics where there are any that fit as well."""
        for problem in self._on_finer(found):
            self.tell(f"refitting on finer mechanics: {problem.model.base}")
            try:
                fitted = fit_near(self._unfixed(problem), found.values)
            except SimulationFailure:
                continue
            if self._is_as_good(fitted.chi2, found):
                return fitted
        return self.finished(found)

    def _unfixed(self, problem: Problem) -> Problem:
        return replace(problem, gaussian={**problem.gaussian, **self.conventions(problem.model)})

    def conventions(self, model: Model) -> dict[str, tuple[float, float]]:
        """Return what the added effects of a model hold by convention, see `discovery.problem.conventions`."""
        return conventions(self._added(model), self.units)

    def _added(self, model: Model) -> list[str]:
        """Return the effects of a model that are not declared."""
        return [e for e in model.effects if e not in self.train[0].rig.declared]

    def _is_as_good(self, chi2: float, found: Refit) -> bool:
        return chi2 < _SAME_ANSWER * found.chi2 + self.settings.price

    def _moved(self, found: Refit, other: Problem) -> float:
        """Return how far another problem with the same values moves the readings of a refit [noise sds, squared]."""
        predictions = (found.predict(), other.predict(other.start(found.values)))
        here, there = ([channels[:, :, None] for channels in each] for each in predictions)
        return float(distances(self.train, here, there)[0])

    def reshaped(self, fitted: Fit, effects: Sequence[str]) -> Fit:
        """Return a fit, or a better one of the same model in which the laws of some effects have another shape."""
        self.tell(f"looking for other shapes of {' and '.join(effects)}")
        found = shaken(Refit(effects[-1], fitted.problem, fitted.minimum), effects)
        better = found.chi2 < 2 * fitted.minimum.cost - self.settings.price
        return self.finished(found) if better else fitted

    def polish(self, fitted: Fit) -> Fit:
        """Return the fit on steps so fine that the solver shifts no estimate; see `discovery.fit.refined`."""
        if fitted.solver_shift > SHIFT:
            self.tell("refitting with a finer step")
        return refined(fitted, rough=True)

    def held(self, fitted: Fit) -> list[FloatArray]:
        """Return a fit's predictions of the held-out recordings."""
        model = (fitted.model, fitted.values, fitted.predict())
        return self.judge.predictions(fitted.problem.bench, [model])[0]

    def roughness(self, predictions: Sequence[FloatArray]) -> float:
        """Return the systematic part of what predictions leave of the training recordings [noise sds]."""
        return roughness(self.train, predictions, 2 * np.pi * self.units.time)

    def limits(self, model: Model, first: tuple[float, float]) -> tuple[float, float]:
        """Return up to where the systematic residuals of the training and the held-out recordings count as noise.

        Parameters
        ----------
        model : Model
            What leaves them.
        first : (float, float)
            What was there before any effect was added [noise sds].
        """
        s = self.settings
        if self._imitating(model):
            # A law that imitates others has no law of its own to idealise.
            return s.floor, s.floor
        return s.limit(first[0]), s.limit(first[1])

    def _imitating(self, model: Model) -> list[str]:
        """Return the added effects of a model that imitate others."""
        return [e for e in self._added(model) if imitates(e)]

    def is_noise(self, fitted: Fit, held: Sequence[FloatArray], first: tuple[float, float]) -> tuple[bool, str]:
        """Return whether what a fit leaves counts as noise, and the test as a sentence.

        Parameters
        ----------
        fitted : Fit
            The fit.
        held : sequence of ndarray
            Its predictions of the held-out recordings.
        first : (float, float)
            See `limits`.
        """
        s, train, rough = self.settings, self.roughness(fitted.predict()), self.judge.score(held)[2]
        limit_train, limit = self.limits(fitted.model, first)
        part, told = "averages over a 24th of a period, noise removed", f"{limit:.3g}"
        if train > limit_train:
            return False, f"systematic part of the residual ({part}): {train:.3g} noise sds, above {limit_train:.3g}"
        if imitating := self._imitating(fitted.model):
            told += f", for {' and '.join(imitating)} may imitate others"
        else:
            told += f" = max({s.floor:.3g}, min({s.relative_floor:g} x {first[1]:.3g}, {s.ceiling:g}))"
        if limit < rough <= s.ceiling and train <= s.floor:
            # What was fitted is noise, so the estimates are as sure as they say, and what they foretell no surer.
            unsure = _FAR_OFF * self.judge.uncertainty(fitted)
            if np.isfinite(unsure):
                limit = min(float(np.hypot(limit, unsure)), s.ceiling)
                told = f"{limit:.3g}, for the estimates leave {unsure:.3g} uncertain, else {told}"
        noise = rough <= limit
        verb = "at most" if noise else "above"
        return noise, f"systematic part of the held-out residual ({part}): {rough:.3g} noise sds, {verb} {told}"

    def form(self, model: Model) -> float:
        """Return the share of what the added effects of a model remove that their laws may leave for others."""
        lumped = self.train[0].is_arm and any(catalogue()[e].lumped for e in self._added(model))
        return self.settings.form_lumped if lumped else self.settings.form

    @cached_property
    def n_data(self) -> int:
        """Number of fitted values."""
        return int(sum((e.weights() > 0).sum() for e in self.train))

    @cached_property
    def n_held(self) -> int:
        """Number of held-out values that decide."""
        outputs = self.judge.outputs()
        return int(sum(np.isfinite(outputs[i]).sum() for i in self.judge.deciding()))

    def excess(self, chi2: float) -> float:
        """Return how much a chi-square on the training recordings exceeds that of noise."""
        return max(chi2 - self.n_data, 0.0)

    def held_excess(self, chi2: float) -> float:
        """Return how much a chi-square on the held-out recordings exceeds that of noise."""
        return max(chi2 - self.n_held, 0.0)

    def margin(self, chi2: float, gain: float = 0.0, *, pliable: bool = False) -> float:
        """Return by how much chi-square may exceed that of a set that is as good.

        Parameters
        ----------
        chi2 : float
            What the better set leaves of the training recordings.
        gain : float
            What it removes.
        pliable : bool
            Whether its effect is.
        """
        s = self.settings
        return max(s.price, (s.tie_pliable if pliable else s.tie) * self.excess(chi2), s.form * gain)
