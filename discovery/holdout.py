"""Held-out data: they decide and judge, and nothing of them is fitted but initial states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from discovery.bench import Bench
from discovery.covariance import principal_spread
from discovery.errors import ComputationError
from discovery.experiment import Experiment, largest_deflection
from discovery.fit import Fit
from discovery.model import Model
from discovery.predict import held_out
from discovery.problem import NaturalUnits
from discovery.residual import chance_variance, errors, systematic_share
from discovery.step import choose_step

__all__ = ["SEPARATE", "HoldOut"]

FloatArray = NDArray[np.float64]
#: What held-out recordings are called that were given as such.
SEPARATE = "separate recordings"
#: Standard deviations above its mean that a normal number exceeds once in a hundred times.
_ONCE_IN_A_HUNDRED = 2.326


def _physical(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that belong to the model, not to a recording."""
    return {n: v for n, v in values.items() if "[" not in n}


class HoldOut:
    """Recordings, or parts of them, that decide and judge but are never fitted."""

    def __init__(
        self, train: Sequence[Experiment], separate: Sequence[Experiment], units: NaturalUnits, tolerance: float
    ) -> None:
        self.train, self.separate, self.units, self.tolerance = train, separate, units, tolerance
        self.continued = not separate
        reach = largest_deflection(train)
        self.inside = [largest_deflection([e]) <= 1.05 * reach for e in separate]
        self._benches: dict[tuple[str, tuple[str, ...], float], Bench] = {}
        self._shares: dict[tuple[str, tuple[str, ...], float], float] = {}
        self._wild: set[object] = set()

    @property
    def kind(self) -> str:
        """How the held-out data relate to the fitted ones."""
        return "last third of each training recording, continued" if self.continued else SEPARATE

    def predictions(
        self, bench: Bench, models: Sequence[tuple[Model, Mapping[str, float], list[FloatArray]]]
    ) -> list[list[FloatArray]]:
        """Return the predictions of the held-out recordings by each model (model, values, training predictions)."""
        if self.continued:
            return [on_train for _, _, on_train in models]
        kernel = bench.base, bench.effects
        sets = [(model, values) for model, values, _ in models]
        step = self._share(bench, sets) * bench.shortest
        key = (*kernel, step)
        if key not in self._benches:
            self._benches[key] = Bench(*kernel, self.separate, step)
        return held_out(sets, self.separate, self._benches[key], self.units)

    def _share(self, bench: Bench, models: Sequence[tuple[Model, Mapping[str, float]]]) -> float:
        """Return how much finer steps the held-out recordings need than the fitted ones, over these.

        The first set that moves through them decides: later ones do not ask again.
        """
        # Of two paces the shortest steps differ.
        kernel = bench.base, bench.effects, bench.shortest / bench.step
        for model, values in models:
            asked = kernel, model.effects, frozenset(values.items())
            if kernel in self._shares:
                break
            if asked in self._wild:
                continue
            try:
                step = choose_step(model, self.separate, self.units, _physical(values), self.tolerance, bench.effects)
            except ComputationError:
                # A model that is good for the fitted recordings may blow up beyond them, whatever the step.
                self._wild.add(asked)
            else:
                self._shares[kernel] = min(step / bench.shortest, 1.0)
        return self._shares.get(kernel, 1.0)

    @property
    def experiments(self) -> Sequence[Experiment]:
        """Recordings that `predictions` refers to."""
        return self.train if self.continued else self.separate

    def outputs(self) -> list[FloatArray]:
        """Return measured outputs, NaN where a sample was fitted."""
        found = []
        for e in self.experiments:
            out = e.recording.output.copy()
            if self.continued:
                out[e.fitted] = np.nan
            found.append(out)
        return found

    def deciding(self) -> list[int]:
        """Return which recordings decide: those inside the trained deflection, or all where none is."""
        inside = [i for i, flag in enumerate(self.inside) if flag]
        return inside or list(range(len(self.experiments)))

    # Shortly before a blow-up squares may be too large for a number.
    @np.errstate(over="ignore")
    def score(self, predictions: Sequence[FloatArray]) -> tuple[float, int, float]:
        """Return chi-square, number of samples and systematic residual of the deciding recordings.

        Both measures are infinite where a sample is not predicted: a motion blew up.
        """
        chi2, count = 0.0, 0
        parts: list[float] = []
        outputs = self.outputs()
        for i in self.deciding():
            e = self.experiments[i]
            normal = (predictions[i] - outputs[i]) / e.recording.noise
            measured = np.isfinite(outputs[i])
            count += int(measured.sum())
            if not np.isfinite(normal[measured]).all():
                chi2 = np.inf
                parts.append(np.inf)
                continue
            chi2 += float(np.sum(normal[measured] ** 2))
            parts.append(systematic_share(normal, e.recording.time, 2 * np.pi * self.units.time))
        return chi2, count, float(np.sqrt(np.mean(np.square(parts))))

    def chance(self) -> float:
        """Return the systematic residual [noise sds] that noise alone exceeds once in a hundred."""
        outputs, period = self.outputs(), 2 * np.pi * self.units.time
        each = [
            chance_variance(np.isfinite(outputs[i]), self.experiments[i].recording.time, period)
            for i in self.deciding()
        ]
        return float(np.sqrt(_ONCE_IN_A_HUNDRED * np.sqrt(sum(each)) / len(each)))

    @np.errstate(over="ignore", invalid="ignore")
    def uncertainty(self, fit: Fit) -> float:
        """Return the rms standard deviation of a fit's deciding predictions [noise sds], infinite if one blows up."""
        half = 0.5 * principal_spread(fit.covariance)
        low, high = fit.problem.bounds
        points = np.clip(fit.minimum.x[:, None] + np.hstack([half, -half]), low[:, None], high[:, None])
        on_train = fit.problem.bench.predict(*fit.problem.expand(points))
        models = [
            (fit.model, fit.problem.named(point), [channels[:, :, i] for channels in on_train])
            for i, point in enumerate(points.T)
        ]
        predicted, outputs = self.predictions(fit.problem.bench, models), self.outputs()
        squares = []
        for i in self.deciding():
            noise, held = self.experiments[i].recording.noise, np.isfinite(outputs[i])
            pairs = zip(predicted[: half.shape[1]], predicted[half.shape[1] :], strict=True)
            squares.append(np.sum([np.square((up[i] - down[i]) / noise) for up, down in pairs], axis=0)[held].mean())
        uncertainty = float(np.sqrt(np.mean(squares)))
        return uncertainty if np.isfinite(uncertainty) else np.inf

    def errors(self, predictions: Sequence[FloatArray]) -> dict[str, dict[str, float]]:
        """Return errors over all held-out recordings, and apart inside and outside the trained deflection."""
        outputs = self.outputs()

        def pooled(which: list[int]) -> dict[str, float]:
            return errors(np.concatenate([predictions[i] for i in which]), np.concatenate([outputs[i] for i in which]))

        everything = list(range(len(self.experiments)))
        result = {"holdout": pooled(everything)}
        if not self.continued:
            inside = [i for i in everything if self.inside[i]]
            outside = [i for i in everything if not self.inside[i]]
            if inside:
                result["holdout_inside"] = pooled(inside)
            if outside:
                result["holdout_outside"] = pooled(outside)
        return result
