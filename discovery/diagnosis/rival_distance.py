"""Rival models on manoeuvres that are tried, and the search for the one that tells them apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from discovery.diagnosis.manoeuvre_design import NUMBERS, MotorLimits, Move, hub_drive, moves_from_unit
from discovery.diagnosis.rival_pairs import Laws, Pairs
from discovery.estimation.equilibrium import equilibrium
from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray, within_half_a_turn
from discovery.foundation.errors import ComputationError
from discovery.foundation.sampling import median_step
from discovery.simulation.simulate import Simulator

#: Samples at which trial manoeuvres are compared: several in each period of the motion.
_SAMPLES = 400
#: Share of the trials that are drawn at random; the others improve on the best of those.
_RANDOM = 0.6
#: Standard deviation of a random step from the best, in each direction of the unit cube.
_STEP = 0.1


def _room(fit: Fit) -> FloatArray:
    """Return how far down and up every free number of a fit may move within its bounds, shape (2, p)."""
    lower, upper = fit.problem.bounds
    # One that lies on its bound is a hair inside.
    hair = 1e-12 * fit.problem.scale
    return np.stack([lower - fit.minimum.x - hair, upper - fit.minimum.x + hair])


def _rest(fit: Fit, values: Mapping[str, float], angle: float) -> float:
    """Return where a model rests; what no spring holds begins where the given recording did."""
    first = fit.problem.bench.experiments[0]
    try:
        return equilibrium(fit.model, values, fit.problem.units, [angle])
    except ComputationError:
        if first.system.has_rod:
            raise
        return first.initial_guess[0]


class _Rival:
    """One fitted model on trial manoeuvres: which parameter sets to simulate, and what the old recordings know."""

    def __init__(self, fit: Fit, angle: float) -> None:
        problem, m = fit.problem, len(fit.problem.free)
        jacobian = fit.minimum.jacobian
        # Initial states of the old recordings first: the lower corner is then the information without them.
        triangle: Any = np.linalg.qr(np.roll(jacobian, -m, axis=1), mode="r")
        # Two more zero columns: the initial state of a new recording is not known.
        self.root = np.pad(triangle[-m:, -m:], ((0, 0), (0, 2)))
        self.kernel = (problem.bench.base, problem.bench.effects, problem.bench.shortest)
        self.room = np.append(_room(fit)[:, :m], np.array([[-np.inf], [np.inf]]) * np.ones(2), axis=1)
        values = {n: v for n, v in fit.values.items() if n in problem.free}
        self.rest = rest = _rest(fit, values, angle)
        size = np.linalg.norm(jacobian[:, :m], axis=0)
        step = np.clip(0.1 / np.maximum(size, 1e-300), 1e-9 * problem.scale[:m], 1e-3 * problem.scale[:m])
        inward = np.where(fit.minimum.x[:m] + step > problem.bounds[1][:m], -step, step)
        units = problem.units
        self.step = np.concatenate([inward, 1e-7 * units.coordinate * np.array([1.0, 1.0 / units.time])])
        point = np.concatenate([fit.minimum.x[:m], [rest, 0.0]])
        points = np.concatenate([point[:, None], point[:, None] + np.diag(self.step)], axis=1)
        # Old recordings begin anywhere.
        tail = np.zeros((len(problem.states), points.shape[1]))
        self.parameters, _ = problem.expand(np.concatenate([points[:m], tail]))
        self.initial = points[m:]

    def starts(self, place: float | None) -> FloatArray:
        """Return initial states of all its parameter sets (2, m + 3): at a place [q] at no speed, or at its rest."""
        return self.initial if place is None else self.initial + np.array([[place - self.rest], [0.0]])

    def derivatives(self, channels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return prediction (n,) and sensitivities (n, m + 2) from flat channels (n, m + 3)."""
        return channels[:, 0], (channels[:, 1:] - channels[:, :1]) / self.step


class Trial:
    """Rivals, fitted to the same recordings, on trial manoeuvres of some duration [s].

    `angle`: where the input starts, as in the given recording: the hub [rad], or u; zero without one. `gap`, `count`:
    interval of the samples of the recording to be made, that of the given one [s], and their number. `time`: times at
    which rivals are compared [s].
    """

    def __init__(self, fits: Sequence[Fit], duration: float) -> None:
        self.given = fits[0].problem.bench.experiments[0]
        drive = self.given.drive
        self.angle = 0.0 if drive is None else float(drive.evaluate(self.given.recording.time[:1])[0, 0])
        self.rivals = [_Rival(f, self.angle) for f in fits]
        self.gap = median_step(self.given.recording.time)
        self.count = round(duration / self.gap) + 1
        # Fewer samples than will be recorded are enough: each stands for several.
        self.time = np.linspace(0.0, duration, min(self.count, _SAMPLES))

    def compare(self, moves: Sequence[Move], release: float | None = None) -> tuple[Pairs, float]:
        """Return how far the rivals lie apart on a manoeuvre, and the largest deflection predicted [q].

        A system without an input has no moves; it is let go at one place for all rivals, `release` [q].
        """
        found, deflection = self._found(moves, release)
        count = self.count * len(self.given.recording.units)
        if not np.isfinite(deflection):
            return Pairs.none(len(self.rivals), count), np.inf
        weight = np.sqrt(self.count / self.time.size)
        scaled = [(weight * value, weight * slope) for value, slope in found]
        return Pairs.of(scaled, [(rival.root, rival.room) for rival in self.rivals], count), deflection

    def readings(self, moves: Sequence[Move], release: float) -> FloatArray:
        """Return what each rival predicts of the first channel at `time`, shape (n, r) [SI]."""
        found, _ = self._found(moves, release)
        channels = len(self.given.recording.units)
        return np.column_stack([value[::channels] * self.given.recording.noise[0] for value, _ in found])

    def _found(self, moves: Sequence[Move], release: float | None) -> tuple[list[tuple[FloatArray, FloatArray]], float]:
        """Return prediction and sensitivities of every rival, and the largest deflection; infinite where one blows up.

        The noise is the unit of the predictions.
        """
        drive = hub_drive(moves, self.angle) if moves else None
        motor = np.zeros(self.time.size) if drive is None else drive.evaluate(self.time)[0]
        old = self.given.recording
        blank = np.zeros((motor.size, len(old.units)))
        recorded = None if drive is None else motor
        experiment = replace(
            self.given, drive=drive, recording=replace(old, time=self.time, input=recorded, output=blank)
        )
        found: dict[int, tuple[FloatArray, FloatArray]] = {}
        deflection = 0.0
        for kernel in dict.fromkeys(rival.kernel for rival in self.rivals):
            own = [i for i, rival in enumerate(self.rivals) if rival.kernel == kernel]
            simulate = Simulator(kernel[0], kernel[1], self.time, drive, step=kernel[2])
            parameters = np.concatenate([self.rivals[i].parameters for i in own], axis=1)
            initial = np.concatenate([self.rivals[i].starts(release) for i in own], axis=1)
            reading = simulate(parameters, initial[0], initial[1])
            if not np.isfinite(reading).all():
                return [], np.inf
            deflection = max(deflection, float(np.abs(self._deflection(reading, motor)).max()))
            normal = experiment.channels(reading) / old.noise[:, None]
            edges = np.cumsum([0, *(self.rivals[i].parameters.shape[1] for i in own)])
            flat = normal.reshape(-1, edges[-1])
            for j, i in enumerate(own):
                found[i] = self.rivals[i].derivatives(flat[:, edges[j] : edges[j + 1]])
        return [found[i] for i in range(len(self.rivals))], deflection

    def _deflection(self, reading: FloatArray, motor: FloatArray) -> FloatArray:
        """Return the deflection of an arm [rad], or what is read of the coordinate [q]."""
        if not self.given.system.has_rod:
            return reading[:, 0]
        return within_half_a_turn(np.arctan2(reading[:, 1], reading[:, 0]) - motor[:, None])


def pairs_on_given(fits: Sequence[Fit]) -> Pairs:
    """Return how far the rivals lie apart on the recordings that they were fitted to."""
    found = []
    for f in fits:
        rows = f.problem.bench.n_rows
        found.append((f.minimum.residual[:rows], f.minimum.jacobian[:rows]))
    known = [(np.zeros((0, len(f.problem.names))), _room(f)) for f in fits]
    return Pairs.of(found, known, fits[0].problem.bench.n_data)


class MoveSearch:
    """The best of the manoeuvres tried within limits, as a point of the unit cube."""

    def __init__(self, trial: Trial, limits: MotorLimits) -> None:
        self._trial, self._limits = trial, limits
        self._best: FloatArray = np.empty(0)
        self._drawn: list[tuple[FloatArray, Pairs, float]] = []
        self._laws = Laws(np.zeros(1, np.int64))
        self.merit, self.count = -np.inf, 0

    @property
    def moves(self) -> tuple[Move, ...]:
        """The best manoeuvre; where none keeps the deflection, that which exceeds it least."""
        return moves_from_unit(self._best, self._limits)

    @property
    def allowed(self) -> list[Pairs]:
        """How far the rivals lie apart on every manoeuvre drawn that keeps the deflection."""
        return [pairs for _, pairs, deflection in self._drawn if deflection <= self._limits.deflection]

    def explore(self, evaluations: int, rng: np.random.Generator) -> None:
        """Draw the first of so many manoeuvres at random."""
        for i in range(max(1, int(_RANDOM * evaluations))):
            unit = rng.random(NUMBERS * (1 + i % self._limits.moves))
            self._drawn.append((unit, *self._tried(unit)))

    def improve(self, evaluations: int, laws: Laws, rng: np.random.Generator) -> None:
        """Try the others of so many manoeuvres, from the best drawn, so that they tell laws apart."""
        self._laws = laws
        for unit, pairs, deflection in self._drawn:
            self._judge(unit, pairs, deflection)
        left = evaluations - self.count
        # With fewer steps than corners a simplex finds less than single steps do.
        if left >= 2 * (self._best.size + 1):
            self._simplex(left)
        else:
            self._steps(left, rng)

    def _tried(self, unit: FloatArray) -> tuple[Pairs, float]:
        self.count += 1
        moves = moves_from_unit(unit, self._limits)
        return self._trial.compare(moves) if moves else (Pairs.none(0), np.nan)

    def _loss(self, unit: FloatArray) -> float:
        """Try a manoeuvre: return a number that is the smaller, the better it is."""
        return -self._judge(unit, *self._tried(unit))

    def _judge(self, unit: FloatArray, pairs: Pairs, deflection: float) -> float:
        """Return the merit of a manoeuvre, and keep the best; one without a move has no deflection."""
        merit, most = -2.0, self._limits.deflection
        if not np.isnan(deflection):
            # Beyond the allowed deflection, the less the better.
            keeps = deflection <= most
            merit = float(np.log1p(pairs.nearest(self._laws).chi2)) if keeps else most / deflection - 1
        if merit > self.merit:
            self.merit, self._best = merit, unit.copy()
        return merit

    def _simplex(self, count: int) -> None:
        centre = self._best
        corners = np.concatenate([centre[None], np.where(np.eye(centre.size) > 0, (centre + 0.15) % 1.0, centre)])
        minimize(
            self._loss,
            centre,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * centre.size,
            options={"maxfev": count, "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-3},
        )

    def _steps(self, count: int, rng: np.random.Generator) -> None:
        for _ in range(count):
            self._loss(np.clip(self._best + _STEP * rng.standard_normal(self._best.size), 0.0, 1.0))
