"""What a reconstructed force depends on: smooth regression on states, judged period by period out of the fit.

For every set of variables a penalised spline (Eilers and Marx, Statistical Science 11 (1996) 89) predicts the force in
each period from all others. What counts is its share of the power that the fitted parameters cannot imitate: what they
absorbed is held neither against a variable nor for it. Chance is measured on the same force shifted circularly in time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from discovery.diagnosis.latent_force import FINE, LatentForce, cubic_splines
from discovery.foundation.arrays import FloatArray, IntArray

#: What the force of an arm, or of an oscillator, may depend on.
ARM_SETS = (
    ("deflection",), ("angle",), ("rate",), ("motor_angle",), ("time",),
    ("x", "y"), ("deflection", "rate"), ("angle", "rate"), ("angle", "motor_angle"),
)  # fmt: skip
OSCILLATOR_SETS = (("output",), ("rate",), ("input",), ("time",), ("output", "rate"))
#: Segments of a spline in one variable, and in each of two.
_SEGMENTS = {1: 16, 2: 9}
#: Weights of the penalty, relative to the data, among which the best prediction chooses.
_PENALTIES = tuple(10.0**k for k in range(-4, 3))
#: Circular shifts that measure chance.
_SHIFTS = 199
#: A dependence counts from this share of the power and up to this probability of chance.
LEAST_SHARE, MOST_CHANCE = 0.25, 0.1
#: A simpler set is taken where it explains this part of the best one's share.
_NEARLY = 0.9


@dataclass(frozen=True)
class Smooth:
    """A spline in one variable, or a tensor product of two, constant beyond the range seen."""

    names: tuple[str, ...]  # variables
    #: low, high: range of each.
    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def over(cls, names: tuple[str, ...], variables: Mapping[str, FloatArray]) -> Smooth:
        """Return the spline over the range of variables."""
        ranges = [(float(variables[n].min()), float(variables[n].max())) for n in names]
        return cls(names, tuple(a for a, _ in ranges), tuple(max(b, a + 1e-9) for a, b in ranges))

    def clipped(self, variables: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return the variables, none outside the range."""
        return {n: np.clip(variables[n], a, b) for n, a, b in zip(self.names, self.low, self.high, strict=True)}

    def evaluate(self, variables: Mapping[str, FloatArray]) -> FloatArray:
        """Return the basis functions (n, k)."""
        found: FloatArray = np.ones((np.size(variables[self.names[0]]), 1))
        for values, a, b in zip(self.clipped(variables).values(), self.low, self.high, strict=True):
            step = (b - a) / _SEGMENTS[len(self.names)]
            knots = np.asarray(a + step * np.arange(-3, _SEGMENTS[len(self.names)] + 4), np.float64)
            found = (found[:, :, None] * cubic_splines(values, knots)[:, None, :]).reshape(len(found), -1)
        return found

    @cached_property
    def penalty(self) -> FloatArray:
        """Penalty (k, k) on the second differences along every variable, and a little on the size."""
        size = _SEGMENTS[len(self.names)] + 3
        rough = np.diff(np.eye(size), 2, axis=0)
        one, unit = rough.T @ rough, np.eye(size)
        total = one if len(self.names) == 1 else np.kron(one, unit) + np.kron(unit, one)
        return total + 1e-4 * np.eye(len(total))


@dataclass(frozen=True)
class Sites:
    """Reconstructed forces of all recordings, once in every spacing of their knots, one below the other."""

    force: FloatArray  # (n,), [s^-2 q]
    variables: Mapping[str, FloatArray]  # each (n,), along the motions
    #: (n, 1 + p): a constant, and the forces that imitate changes of the fitted parameters, each of unit size.
    imitated: FloatArray
    #: (1 + p,): by which a coefficient of `imitated` is to be multiplied: a change of the parameter, in its unit.
    scale: FloatArray
    blocks: IntArray  # (n,), period to which each belongs
    lengths: tuple[int, ...]  # number of times in each recording

    @classmethod
    def of(cls, forces: Sequence[LatentForce], period: float) -> Sites:
        """Collect forces; `period` is that of the motion [s]."""
        labels, first = [], 0
        times = [f.time[::FINE] for f in forces]
        for time in times:
            label = ((time - time[0]) / period).astype(np.int64)
            labels.append(first + label)
            first += int(label[-1]) + 1
        imitated = [np.column_stack([np.ones(f.time.size), *f.equivalent.values()])[::FINE] for f in forces]
        together = np.concatenate(imitated)
        size = np.sqrt(np.mean(together**2, axis=0))
        scale = 1 / np.where(size > 0, size, 1.0)
        return cls(
            np.concatenate([f.mean[::FINE] for f in forces]),
            {n: np.concatenate([f.variables[n][::FINE] for f in forces]) for n in forces[0].variables},
            together * scale,
            scale,
            np.concatenate(labels),
            tuple(t.size for t in times),
        )

    def shifted(self, values: FloatArray) -> FloatArray:
        """Return values (n,) shifted circularly within every recording, shape (n, shifts)."""
        parts, start = [], 0
        shares = np.arange(1, _SHIFTS + 1) / (_SHIFTS + 1)
        for length in self.lengths:
            index = (np.arange(length)[:, None] + np.round(shares * length).astype(int)) % length
            parts.append(values[start : start + length][index])
            start += length
        return np.concatenate(parts)

    def misses(self, columns: FloatArray, penalty: FloatArray, targets: FloatArray) -> FloatArray:
        """Return the squared errors (t,) of predictions of each block of the targets (n, t) from the other blocks."""
        gram = columns.T @ columns + penalty
        gram += 1e-10 * np.trace(gram) / len(gram) * np.eye(len(gram))
        hat = columns @ np.linalg.solve(gram, columns.T)
        left = targets - hat @ targets
        total = np.zeros(targets.shape[1])
        for block in np.unique(self.blocks):
            own = np.flatnonzero(self.blocks == block)
            outside = np.linalg.solve(np.eye(own.size) - hat[np.ix_(own, own)] + 1e-9 * np.eye(own.size), left[own])
            total += np.sum(outside**2, axis=0)
        return total


@dataclass(frozen=True)
class ForceDependence:
    """How far a set of variables predicts the force."""

    variables: tuple[str, ...]  # the set
    #: Share of the power, beside what parameters imitate, that is predicted out of the fit; negative where that harms.
    share: float
    p_value: float  # probability of such a share by chance
    penalty: float  # weight of the penalty that predicts best


def dependences(sites: Sites) -> tuple[ForceDependence, ...]:
    """Return how far every set of variables predicts the force, the best first.

    A set of which one variable does not change is left out.
    """
    away = np.linalg.qr(sites.imitated)[0]
    left = sites.force - away @ (away.T @ sites.force)
    targets = np.column_stack([left, sites.shifted(left)])
    power = np.sum((targets - away @ (away.T @ targets)) ** 2, axis=0)
    found = []
    for names in ARM_SETS if "angle" in sites.variables else OSCILLATOR_SETS:
        if any(np.ptp(sites.variables[n]) == 0 for n in names):
            continue
        smooth = Smooth.over(names, sites.variables)
        columns, penalty = with_imitated(sites, smooth.evaluate(sites.variables), smooth.penalty)
        errors = np.array([sites.misses(columns, weight * penalty, targets) for weight in _PENALTIES])
        shares = 1 - errors / power
        best = shares.max(axis=0)
        chance = (1 + np.sum(best[1:] >= best[0])) / len(best)
        found.append(ForceDependence(names, float(best[0]), float(chance), _PENALTIES[int(np.argmax(shares[:, 0]))]))
    return tuple(sorted(found, key=lambda d: -d.share))


def with_imitated(sites: Sites, features: FloatArray, penalty: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the imitated forces and features side by side, and the penalty on the features, relative to the data."""
    k = sites.imitated.shape[1]
    total = np.zeros((k + len(penalty), k + len(penalty)))
    total[k:, k:] = penalty * (np.sum(features**2) / np.trace(penalty))
    return np.column_stack([sites.imitated, features]), total


def depends_on(found: Sequence[ForceDependence]) -> tuple[ForceDependence, ...]:
    """Return the simplest sets that predict nearly as much as the best one; none where none does beyond chance.

    Several, where these recordings cannot tell what the force depends on: the deflection and the angle are one while
    the motor rests.
    """
    real = [d for d in found if d.share >= LEAST_SHARE and d.p_value <= MOST_CHANCE]
    near = [d for d in real if d.share >= _NEARLY * real[0].share]
    fewest = min((len(d.variables) for d in near), default=0)
    return tuple(d for d in near if len(d.variables) == fewest)
