"""From a model and experiments to residuals: what is fitted, in which units, between which bounds, from which start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discovery.effect import ARM
from discovery.experiment import Experiment, largest_deflection
from discovery.model import Model
from discovery.parameters import Parameter, natural_scale
from discovery.registry import get_effect
from discovery.simulate import Simulator

__all__ = ["LIGHT_ROD", "Bench", "NaturalUnits", "Problem", "known_values", "natural_units"]

FloatArray = NDArray[np.float64]
#: Rod mass over tip mass where the rig does not state it, with as large a standard deviation.
LIGHT_ROD = 0.15
#: Rows of residuals that are reduced side by side.
_FOLD = 16
#: Residuals are simulated in pieces of about this many numbers, so that memory stays bounded.
_PIECE = 4e7
# Residuals at once that stay in the cache, in whole blocks of the kernel's lanes.
_CACHED, _LANES = 400_000, 32


@dataclass(frozen=True)
class NaturalUnits:
    """Natural time [s], coordinate [q] and length [m] of a problem; declarations are numbers in these."""

    time: float
    coordinate: float
    length: float
    #: Size of the input of an oscillator, in its unit.
    drive: float = 1.0

    def scale(self, parameter: Parameter) -> float:
        """Return the size of one natural unit of a parameter, in the problem's units."""
        unit = natural_scale(parameter.unit, time=self.time, coordinate=self.coordinate, length=self.length)
        # What links a force to an acceleration scales with the size of the recorded force.
        return unit / self.drive if parameter.name == "g" else unit * self.drive if parameter.name == "m" else unit


def natural_units(experiments: Sequence[Experiment]) -> NaturalUnits:
    """Return the natural units of recordings: the inverse dominant angular frequency, amplitude and length.

    The frequency is that of the largest peak of the pooled periodogram of the deflection; an arm's natural angle is
    one radian, because its geometry is nonlinear on that scale.
    """
    from scipy.signal import lombscargle

    frequencies: list[float] = []
    for experiment in experiments:
        t, d = experiment.recording.time[experiment.fitted], experiment.deflection[experiment.fitted]
        good = np.isfinite(d)
        t, d = t[good], d[good] - d[good].mean()
        keep = slice(None, None, max(1, t.size // 20_000))
        span, gap = t[-1] - t[0], float(np.median(np.diff(t[keep])))
        if np.allclose(np.diff(t), np.diff(t).mean(), rtol=1e-3):
            power = np.abs(np.fft.rfft(d * np.hanning(d.size), 4 * d.size)) ** 2
            grid = 2 * np.pi * np.fft.rfftfreq(4 * d.size, float(np.diff(t).mean()))
            first = int(np.searchsorted(grid, 4 * np.pi / span))
            frequencies.append(float(grid[first + np.argmax(power[first:])]))
        else:
            grid = np.linspace(4 * np.pi / span, 0.5 * np.pi / gap, 4000)
            frequencies.append(float(grid[np.argmax(lombscargle(t[keep], d[keep], grid))]))
    arm = experiments[0].is_arm
    length = experiments[0].rig.length
    forces = [e.force for e in experiments if e.force is not None]
    time = 1.0 / float(np.median(frequencies))
    return NaturalUnits(
        time=time,
        coordinate=1.0 if arm else largest_deflection(experiments) * time ** (2 * experiments[0].reads_acceleration),
        length=length.value if length is not None else 1.0,
        drive=1.0 if arm or not forces else float(max(np.nanmax(np.abs(u)) for u in forces)),
    )


def known_values(experiment: Experiment) -> dict[str, float]:
    """Return the parameters that the rig file fixes.

    Length and mass ratio of an arm, gravity of a falling body, the controller of a drive; no input gain without input.
    """
    rig = experiment.rig
    if rig.kind != ARM:
        known: dict[str, float] = {} if experiment.recording.input is not None else {"g": 0.0}
        if rig.gravity is not None:
            known["g_0"] = rig.gravity.value
        if rig.controller is not None:
            known |= {"k_p": rig.controller.kp, "k_v": rig.controller.kv}
            known |= {} if rig.controller.limit is None else {"c_max": rig.controller.limit}
        return known
    # A rod of unknown mass counts as light; the exact arm needs some mass to be solvable.
    known = {"length": rig.length.value if rig.length else 1.0, "mu": LIGHT_ROD}
    if rig.beam_mass is not None and rig.tip_mass is not None:
        known["mu"] = rig.beam_mass.value / rig.tip_mass.value
    return known


class Bench:
    """Simulators of one base with a common set of effects on all experiments: many problems share them.

    Parameters
    ----------
    base : str
        Name of the base.
    effects : sequence of str
        Every effect that any problem on this bench may use.
    experiments : sequence of Experiment
        Recordings.
    step : float
        Longest integration step [s].
    """

    def __init__(self, base: str, effects: Sequence[str], experiments: Sequence[Experiment], step: float) -> None:
        self.base, self.effects, self.experiments, self.step = base, tuple(effects), tuple(experiments), step
        self.simulators = [Simulator(base, self.effects, e.recording.time, e.drive, step=step) for e in experiments]
        self.names = self.simulators[0].names
        self._weights = [e.weights() for e in experiments]
        self._targets = [
            np.where(w > 0, e.recording.output, 0.0) for e, w in zip(experiments, self._weights, strict=True)
        ]

    @classmethod
    def like(cls, other: Bench, step: float) -> Bench:
        """Return the same bench with another step."""
        return cls(other.base, other.effects, other.experiments, step)

    def predict(self, parameters: FloatArray, initial: FloatArray) -> list[FloatArray]:
        """Return simulated channels of every experiment, each (n, c, k).

        Parameters
        ----------
        parameters : ndarray, shape (p, k)
            In the order of `names`.
        initial : ndarray, shape (experiments, 2, k)
            Initial deflection and rate in every experiment.
        """
        return [
            e.channels(simulate(parameters, initial[i, 0], initial[i, 1]))
            for i, (e, simulate) in enumerate(zip(self.experiments, self.simulators, strict=True))
        ]

    def residuals(self, parameters: FloatArray, initial: FloatArray) -> FloatArray:
        """Return (prediction - measurement) / noise of every fitted sample, zero in gaps, shape (n, k).

        A trial that blows up is infinite throughout.
        """
        pieces = [
            self._residuals(parameters[:, part], initial[:, :, part]) for part in self.pieces(parameters.shape[1])
        ]
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=1)

    def reduced(
        self, parameters: FloatArray, initial: FloatArray, reduce: Callable[[int, FloatArray], FloatArray]
    ) -> list[FloatArray]:
        """Return what is made of the residuals of every experiment, without ever holding all of them.

        Parameters
        ----------
        parameters : ndarray, shape (p, k)
            In the order of `names`.
        initial : ndarray, shape (experiments, 2, k)
            Initial deflection and rate in every experiment.
        reduce : callable
            Gets the number of an experiment and its residuals (n, c, j) of a few sets, zero where nothing is fitted
            and infinite where a trial blew up; returns (s, j).

        Returns
        -------
        list of ndarray, shape (s, k)
            One an experiment.
        """
        width = max(1, _CACHED // (self.n_rows * _LANES)) * _LANES
        found: list[list[FloatArray]] = [[] for _ in self.experiments]
        for first in range(0, parameters.shape[1], width):
            part = slice(first, first + width)
            rows = self._residuals(parameters[:, part], initial[:, :, part])
            for i, (block, fitted) in enumerate(self.blocks()):
                found[i].append(reduce(i, rows[block].reshape(*fitted.shape, -1)))
        return [np.concatenate(parts, axis=1) for parts in found]

    def _residuals(self, parameters: FloatArray, initial: FloatArray) -> FloatArray:
        predicted = self.predict(parameters, initial)
        with np.errstate(over="ignore", invalid="ignore"):
            for channels, target, weight in zip(predicted, self._targets, self._weights, strict=True):
                channels -= target[:, :, None]
                channels *= weight[:, :, None]
            parts = [channels.reshape(-1, parameters.shape[1]) for channels in predicted]
            residuals = parts[0] if len(parts) == 1 else np.concatenate(parts)
            # A trial that blows up is refused by its infinite cost, even where it stays finite to the end.
            residuals[:, ~(_largest(residuals) < self._absurd)] = np.inf
        return residuals

    def pieces(self, columns: int) -> Iterator[slice]:
        """Yield parts of so many columns whose residuals together need a bounded memory only."""
        width = max(64, int(_PIECE / max(1, self.n_rows)))
        for first in range(0, columns, width):
            yield slice(first, first + width)

    def blocks(self) -> Iterator[tuple[slice, NDArray[np.bool_]]]:
        """Yield the rows of every recording in a residual, and where its samples (n, c) are fitted and finite."""
        first = 0
        for weight in self._weights:
            yield slice(first, first + weight.size), weight > 0
            first += weight.size

    @cached_property
    def _absurd(self) -> float:
        """A hundred times the largest measured value, in noise sds."""
        largest = [float((np.abs(t) * w).max()) for t, w in zip(self._targets, self._weights, strict=True) if w.size]
        return 100 * max([1.0, *largest])

    @cached_property
    def n_rows(self) -> int:
        """Length of the residual vector, gaps included."""
        return int(sum(w.size for w in self._weights))

    @cached_property
    def n_data(self) -> int:
        """Number of finite fitted samples over all channels."""
        return int(sum((w > 0).sum() for w in self._weights))


def _largest(values: FloatArray) -> FloatArray:
    """Return the largest magnitude in each column (n, k); long rows first, for short ones are slow."""
    k, tail = values.shape[1], len(values) % _FOLD
    folded = values[: len(values) - tail].reshape(-1, _FOLD * k)
    top, bottom = (f(folded, axis=0, initial=0.0).reshape(_FOLD, k) for f in (np.max, np.min))
    rest = np.abs(values[len(values) - tail :])
    return np.concatenate([top, -bottom, rest]).max(axis=0)


@dataclass(frozen=True)
class Problem:
    """One model to be fitted on a bench: which numbers are free, and what the others are.

    Parameters
    ----------
    model : Model
        Its effects must be among those of the bench.
    bench : Bench
        The simulators.
    units : NaturalUnits
        Natural units.
    gaussian : mapping of str to (mean, sd)
        Free parameters known from the rig within an uncertainty; bounded at three standard deviations.
    """

    model: Model
    bench: Bench
    units: NaturalUnits
    gaussian: Mapping[str, tuple[float, float]]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Free physical parameters, then initial deflection and rate of every experiment."""
        initial = [f"{n}[{e.recording.name}]" for e in self._released for n in ("delta_0_init", "rate_0_init")]
        return (*self.free, *initial)

    @property
    def _released(self) -> tuple[Experiment, ...]:
        """Experiments with an initial state: all, or none where the motion is prescribed."""
        return () if self.model.mechanics.prescribed else self.bench.experiments

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Free physical parameters: the model's own and those known only within an uncertainty."""
        extra = tuple(n for n in self.gaussian if n in self.model.parameters and n not in self.model.free)
        return (*self.model.free, *extra)

    @cached_property
    def scale(self) -> FloatArray:
        """Typical size of every free number."""
        sizes = [
            self.gaussian[n][1] if n in self.gaussian else self._declared_width(self.model.parameters[n])
            for n in self.free
        ]
        # Initial values are known from the data to a small part of the amplitude.
        q, rate = 0.01 * self.units.coordinate, 0.01 * self.units.coordinate / self.units.time
        return np.array([*sizes, *([q, rate] * len(self._released))])

    def _declared_width(self, parameter: Parameter) -> float:
        return parameter.prior.width * self.units.scale(parameter)

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of every free number."""
        lower, upper = [], []
        for name in self.free:
            if name in self.gaussian:
                mean, sd = self.gaussian[name]
                lower.append(max(mean - 3 * sd, self.model.parameters[name].bounds[0]))
                upper.append(min(mean + 3 * sd, self.model.parameters[name].bounds[1]))
            else:
                parameter = self.model.parameters[name]
                unit = self.units.scale(parameter)
                lower.append(parameter.bounds[0] * unit)
                upper.append(parameter.bounds[1] * unit)
        free_start = [np.inf] * (2 * len(self._released))
        return np.array([*lower, *(-np.array(free_start))]), np.array([*upper, *free_start])

    def start(self, values: Mapping[str, float]) -> FloatArray:
        """Return a start: `values` where given, else rig values or declared starts, and measured initial states."""
        x = []
        for name in self.free:
            if name in values:
                x.append(values[name])
            elif name in self.gaussian:
                x.append(self.gaussian[name][0])
            else:
                parameter = self.model.parameters[name]
                first = parameter.starts[0] if parameter.starts else parameter.default
                x.append(first * self.units.scale(parameter))
        for e in self._released:
            names = (f"delta_0_init[{e.recording.name}]", f"rate_0_init[{e.recording.name}]")
            guess = (0.0, 0.0) if values.keys() >= set(names) else e.initial_guess
            x += [values.get(n, g) for n, g in zip(names, guess, strict=True)]
        return np.array(x)

    @cached_property
    def _template(self) -> tuple[FloatArray, NDArray[np.int64]]:
        declared = {p.name: p for p in self.model.mechanics.parameters()}
        for effect in self.bench.effects:
            declared.update({p.name: p for p in get_effect(effect).parameters()})
        values = [
            self.model.known[n] if n in self.model.known else declared[n].default * self.units.scale(declared[n])
            for n in self.bench.names
        ]
        return np.array(values), np.array([self.bench.names.index(n) for n in self.free], dtype=np.int64)

    def expand(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return kernel parameters (p, k) and initial states (experiments, 2, k) of free vectors (m, k)."""
        template, where = self._template
        parameters = np.repeat(template[:, None], x.shape[1], axis=1)
        parameters[where] = x[: len(self.free)]
        if not self._released:
            return parameters, np.zeros((len(self.bench.experiments), 2, x.shape[1]))
        return parameters, x[len(self.free) :].reshape(len(self._released), 2, -1)

    def named(self, x: FloatArray) -> dict[str, float]:
        """Return a free vector (m,) by name."""
        return dict(zip(self.names, x.tolist(), strict=True))

    def predict(self, x: FloatArray) -> list[FloatArray]:
        """Return the channels of every recording, each (n, c), of a free vector (m,)."""
        return [c[:, :, 0] for c in self.bench.predict(*self.expand(x[:, None]))]

    def prior_residuals(self, x: FloatArray) -> FloatArray:
        """Return (value - mean)/sd of the parameters known from the rig, shape (g, k)."""
        rows = [(x[self.free.index(n)] - m) / sd for n, (m, sd) in self.gaussian.items() if n in self.free]
        return np.array(rows).reshape(len(rows), x.shape[1])
