"""From a model and experiments to residuals: what is fitted, in which units, between which bounds, from which start."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from discovery.declarations.priors import Normal, Prior
from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.model_error import ModelError, whiten
from discovery.estimation.natural_units import NaturalUnits, natural_units
from discovery.estimation.start_values import StartValue, start_values
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.mechanics import get_base
from discovery.recordings.experiment import Experiment

#: Part of its range within which a value lies at an edge.
_EDGE = 1e-3
#: Standard deviations by which a rig file may err, and a fit leave what it states.
STATED = 3.0
#: Rod mass over tip mass where the rig does not state it, with as large a standard deviation.
LIGHT_ROD = 0.15


def known_values(experiment: Experiment) -> dict[str, float]:
    """Return the parameters that the rig file fixes.

    Length and mass ratio of an arm, gravity of a falling body, the controller of a drive; no input gain without input.
    The reference inertia of a recorded force is the power of ten nearest to that force over the natural acceleration.
    """
    rig = experiment.rig
    if rig.system is not None:
        return {n: c.value for n, c in rig.system.constants.items() if not c.free and c.sd is None}
    if not experiment.system.has_rod:
        known: dict[str, float] = {} if experiment.recording.input is not None else {"g": 0.0}
        if rig.gravity is not None:
            known["g_0"] = rig.gravity.value
        if rig.controller is not None:
            known |= {"k_p": rig.controller.kp, "k_v": rig.controller.kv}
            known |= {} if rig.controller.limit is None else {"c_max": rig.controller.limit}
        if rig.view is not None:
            units = natural_units([experiment])
            known["m_0"] = 10.0 ** round(np.log10(units.drive * units.time**2 / units.coordinate))
        return known
    # A rod of unknown mass counts as light; the exact arm needs some mass to be solvable.
    known = {"length": rig.length.value if rig.length else 1.0, "mu": LIGHT_ROD}
    if rig.beam_mass is not None and rig.tip_mass is not None:
        known["mu"] = rig.beam_mass.value / rig.tip_mass.value
    return known


def conventions(effects: Iterable[str], units: NaturalUnits) -> dict[str, tuple[float, float]]:
    """Return what the laws of effects hold at a conventional value, by parameter: (that value, its uncertainty).

    Such as the speed within which dry friction changes its sign: it decides how a body creeps that should stick.
    """
    held = [p for e in effects for p in get_effect(e).parameters() if p.fixed and p.shape]
    return {p.name: (p.default * units.scale(p), p.prior.width * units.scale(p)) for p in held}


def values_of(
    names: Sequence[str], base: str, effects: Sequence[str], units: NaturalUnits, known: Mapping[str, float]
) -> FloatArray:
    """Return the values of parameters in this order; those that are not known are at their defaults."""
    values = _defaults(tuple(names), base, tuple(effects), units).copy()
    values[[i for i, n in enumerate(names) if n in known]] = [known[n] for n in names if n in known]
    return values


@lru_cache(maxsize=256)
def _defaults(names: tuple[str, ...], base: str, effects: tuple[str, ...], units: NaturalUnits) -> FloatArray:
    """Return the defaults of parameters in this order, read only."""
    declared = {p.name: p for p in get_base(base).parameters()}
    declared.update({p.name: p for e in effects for p in get_effect(e).parameters()})
    found = np.array([declared[n].default * units.scale(declared[n]) for n in names])
    found.flags.writeable = False
    return found


@dataclass(frozen=True)
class Problem:
    """One model to be fitted on a bench: which numbers are free, and what the others are."""

    model: Model  # its effects must be among those of the bench
    bench: Bench
    units: NaturalUnits
    #: Free parameters known from the rig or by convention within an uncertainty; bounded at three standard deviations.
    gaussian: Mapping[str, tuple[float, float]]
    error: ModelError | None = None  # the model's own error beside the noise: residuals are made white under both
    #: Recording from which others count what each has of its own, as a phase: the first one; "" for none of these.
    reference: str | None = None

    def __post_init__(self) -> None:
        if self.reference is None:
            object.__setattr__(self, "reference", self.bench.experiments[0].recording.name)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Free physical parameters, then what is free of every experiment."""
        return (*self.free, *(state.name for state in self.states))

    @cached_property
    def states(self) -> tuple[StartValue, ...]:
        """What is free of every experiment: its initial state, and what is its own."""
        return start_values(self.model, self.units, self.bench.experiments, self.bench.own, self.reference or "")

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Free physical parameters: the model's own and those known only within an uncertainty."""
        extra = tuple(n for n in self.gaussian if n in self.model.parameters and n not in self.model.free)
        return (*self.model.free, *extra)

    @cached_property
    def priors(self) -> tuple[Prior, ...]:
        """Prior, in the problem's units, of every free number; a state may be up to the whole motion."""
        declared = {n: self.model.parameters[n] for n in self.free if n not in self.gaussian}
        known: dict[str, Prior] = {n: p.prior.scaled(self.units.scale(p)) for n, p in declared.items()}
        known |= {n: Normal(*given) for n, given in self.gaussian.items()}
        return (*(known[n] for n in self.free), *(Normal(0.0, state.width) for state in self.states))

    @cached_property
    def _usual(self) -> list[tuple[int, Prior]]:
        """Free parameters, by place, of which the catalogue has a Gaussian prior."""
        ours = ((i, self.priors[i]) for i, n in enumerate(self.free) if n not in self.gaussian)
        return [(i, prior) for i, prior in ours if np.isfinite(prior.centre)]

    @cached_property
    def scale(self) -> FloatArray:
        """Typical size of every free number."""
        sizes = [prior.width for prior in self.priors[: len(self.free)]]
        return np.array([*sizes, *(state.scale for state in self.states)])

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of every free number."""
        lower, upper = [], []
        for name in self.free:
            parameter = self.model.parameters[name]
            least, most = (bound * self.units.scale(parameter) for bound in parameter.bounds)
            if name in self.gaussian:
                mean, sd = self.gaussian[name]
                least, most = max(least, mean - STATED * sd), min(most, mean + STATED * sd)
            lower.append(least)
            upper.append(most)
        unbounded = np.full(len(self.states), np.inf)
        return np.array([*lower, *-unbounded]), np.array([*upper, *unbounded])

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
        return np.array([*x, *(values.get(state.name, state.guess) for state in self.states)])

    @cached_property
    def _template(self) -> tuple[FloatArray, IntArray]:
        values = values_of(self.bench.names, self.model.base, self.bench.effects, self.units, self.model.known)
        return values, np.array([self.bench.names.index(n) for n in self.free], dtype=np.int64)

    def expand(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return kernel parameters (p, k) and starts (experiments, 2 + own, k), see `Bench`, of free vectors (m, k)."""
        template, where = self._template
        parameters = np.repeat(template[:, None], x.shape[1], axis=1)
        parameters[where] = x[: len(self.free)]
        starts = np.zeros((len(self.bench.experiments), 2 + len(self.bench.own), x.shape[1]))
        for state, values in zip(self.states, x[len(self.free) :], strict=True):
            starts[state.experiment, state.row] = values
        return parameters, starts

    def whitened(self, residuals: FloatArray) -> FloatArray:
        """Return residuals (n, k) of the bench made white under the model error; the same ones without it."""
        if self.error is None:
            return residuals
        found = np.empty_like(residuals)
        self.whiten(residuals, found)
        return found

    def whiten(self, residuals: FloatArray, out: FloatArray) -> None:
        """Write what `whitened` returns into `out` (n, k)."""
        if self.error is None:
            out[:] = residuals
            return
        for experiment, (rows, present) in zip(self.bench.experiments, self.bench.blocks(), strict=True):
            time, channels = experiment.fitted_part.recording.time, present.shape[1]
            for c in range(channels):
                own = slice(rows.start + c, rows.stop, channels)
                whiten(time, present[:, c], residuals[own], self.error, out[own])

    def named(self, x: FloatArray) -> dict[str, float]:
        """Return a free vector (m,) by name."""
        return dict(zip(self.names, x.tolist(), strict=True))

    def edges(self, x: FloatArray) -> list[str]:
        """Return the free parameters at an end of their range that is no zero: there the range ends, not physics.

        What the rig states or guesses, or a law holds by convention, is left out.
        """
        found = []
        for name, value, low, high in zip(self.free, x, *self.bounds, strict=False):
            parameter, near = self.model.parameters[name], _EDGE * (high - low)
            if name in self.gaussian or parameter.physical or not np.isfinite(near):
                continue
            # Of a range on one side of zero the end that is nearer to it is where the quantity is absent. A shape, as a
            # width, is not absent at an end that is no zero, and its range spans decades.
            lowest = low + (min(near, _EDGE * abs(low)) if parameter.shape else near)
            ends = low < 0 or (parameter.shape and low > 0)
            if (high > 0 and value >= high - near) or (ends and value <= lowest):
                found.append(name)
        return found

    def predict(self, x: FloatArray) -> list[FloatArray]:
        """Return the channels of every recording, each (n, c), of a free vector (m,)."""
        return [c[:, :, 0] for c in self.bench.predict(*self.expand(x[:, None]))]

    def prior_residuals(self, x: FloatArray) -> FloatArray:
        """Return (value - mean)/sd of what is known within an uncertainty, shape (g, k).

        Under a model error what the catalogue believes of sizes follows: the estimate is where the evidence is taken.
        """
        rows = [(x[self.free.index(n)] - m) / sd for n, (m, sd) in self.gaussian.items() if n in self.free]
        rows += [x[i] / state.width for i, state in enumerate(self.states, len(self.free)) if state.believed]
        if self.error is not None:
            rows += [(x[i] - p.centre) / p.width for i, p in self._usual]
        return np.array(rows).reshape(len(rows), x.shape[1])

    def prior_jacobian(self) -> FloatArray:
        """Return the derivative of `prior_residuals`, which is the same everywhere, shape (g, m)."""
        m = len(self.names)
        return self.prior_residuals(np.eye(m)) - self.prior_residuals(np.zeros((m, 1)))


def side_by_side(problems: Sequence[Problem], vectors: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return kernel parameters and starts of free vectors (m, k) of several problems on benches of the same names."""
    sets = [problem.expand(x) for problem, x in zip(problems, vectors, strict=True)]
    parameters, starts = (np.concatenate(each, axis=-1) for each in zip(*sets, strict=True))
    return parameters, starts
