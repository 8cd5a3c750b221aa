"""The manoeuvre that tells rival effects apart: the predicted readings made as different as the limits allow.

It is a course of the input. What has no input is let go from another place.

Rivals fit the same recordings equally well. Those between which nothing that is tried tells anything are one law here.
The manoeuvre maximises the chi-square by which the right one will win, see `discovery.diagnosis.rival_pairs`, the
smallest over all ordered pairs of different laws: optimal design for discrimination (Hunter and Reiner, Technometrics 7
(1965) 307).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from discovery.declarations.registry import simplicity
from discovery.diagnosis.manoeuvre_design import (
    MotorLimits,
    Move,
    allowed_limits,
    demonstrated_limits,
    hub_drive,
    known_part,
)
from discovery.diagnosis.rival_distance import MoveSearch, Trial, pairs_on_given
from discovery.diagnosis.rival_pairs import NOTHING, Distance, Laws, Pairs
from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.recordings.experiment import Experiment, largest_deflection
from discovery.screening.likeness import similarity

#: Chi-square by which the right rival must be expected to win: less may be chance.
_DECIDES = 10.0
#: Places on either side from which a system without an input is let go.
_PLACES = 12
#: Swings of a designed recording.
_SWINGS = 40.0
#: What is let go swings no further than it was seen to, or hardly.
_OVERSHOOT = 1.1
#: It moves to a side of zero where it was seen at so much of its largest deflection.
_VISITED = 0.2


@dataclass(frozen=True)
class Separation:
    """The manoeuvre that separates rivals."""

    rivals: tuple[str, ...]  # names of the rivals, physically simplest first
    clusters: tuple[tuple[str, ...], ...]  # the same by law: those of one are told apart by nothing that was tried
    #: (r, r): see `similarity_matrix`, in the same order; NaN where a rival has no sensitivity of its own.
    similarities: FloatArray
    limits: MotorLimits  # what the input was allowed, in its unit
    moves: tuple[Move, ...]  # the manoeuvre; empty where the system is let go
    columns: tuple[str, ...]  # of the table, with their units
    #: (n, 2): time [s] and motor angle [rad] or another input, at the rate of the given recordings. Of a release: time
    #: and what each rival predicts.
    table: FloatArray
    #: given, designed: of the nearest pair of different laws, or of all where there is one law. On the given
    #: recordings, where parameters are as free as they can be, and on the manoeuvre; zero there where every manoeuvre
    #: that was tried exceeds the deflection that is allowed.
    given: Distance
    designed: Distance
    left: float  # model error that the best rival leaves of the given recordings [noise sds rms]
    deflection: float  # largest deflection that a rival predicts, as it is read
    evaluations: int  # manoeuvres tried
    release: float = 0.0  # the place where the system is let go, at no speed [q]; zero where its input moves it
    #: unit, deflection_unit: SI units of the coordinate q, and of deflections: those of an accelerometer are
    #: accelerations.
    unit: str = "rad"
    deflection_unit: str = "rad"

    @property
    def decides(self) -> bool:
        """Whether the manoeuvre can be expected to tell the laws apart, and better than the given recordings do.

        Laws that differ by less than the model error that is left are hidden by it.
        """
        better = self.designed.projected > max(self.given.projected, self.left)
        return len(self.clusters) > 1 and self.designed.chi2 >= _DECIDES and better

    def csv(self) -> str:
        """Return the table as a CSV file, an arm's with the columns ``time_s, motor_angle_rad``."""
        rows = (",".join((f"{t:.6f}", *(f"{v:.9g}" for v in values))) for t, *values in self.table.tolist())
        return "\n".join((",".join(self.columns), *rows)) + "\n"

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description; of the table, what rivals predict of a release."""
        return {
            "rivals": list(self.rivals),
            "clusters": [list(names) for names in self.clusters],
            "similarity": [[v if np.isfinite(v) else None for v in row] for row in self.similarities.tolist()],
            "limits": asdict(self.limits),
            "moves": [asdict(m) for m in self.moves],
            "columns": list(self.columns),
            "release": self.release,
            "unit": self.unit,
            "deflection_unit": self.deflection_unit,
            "predicted": [] if self.moves else [[float(f"{v:.6g}") for v in row] for row in self.table.tolist()],
            "given": asdict(self.given),
            "designed": asdict(self.designed),
            "left": self.left,
            "deflection": self.deflection,
            "evaluations": self.evaluations,
            "decides": self.decides,
            "decides_from": _DECIDES,
            "same_below": NOTHING,
        }


def similarity_matrix(fits: Sequence[Fit]) -> FloatArray:
    """Return how alike the rivals' own effects act on the recordings that they were fitted to, shape (r, r).

    It is the largest principal cosine between the sensitivities of what each fit has beyond the parameters common to
    all, with what the common ones, as far as the rig leaves them free, and the initial states absorb projected out; NaN
    for a fit that has nothing more.
    """
    common = set.intersection(*(set(f.problem.names) for f in fits))
    # With the rows of the priors: what the rig knows cannot absorb at will.
    most = max(len(f.minimum.jacobian) for f in fits)
    own = []
    for f in fits:
        rows = np.pad(f.minimum.jacobian, ((0, most - len(f.minimum.jacobian)), (0, 0)))
        shared = np.array([n in common for n in f.problem.names])
        known, _ = np.linalg.qr(rows[:, shared])
        left = rows[:, ~shared] - known @ (known.T @ rows[:, ~shared])
        size = np.linalg.norm(left, axis=0)
        seen = size > 1e-9 * np.linalg.norm(rows[:, ~shared], axis=0)
        own.append(left[:, seen] / size[seen])
    matrix = np.full((len(fits), len(fits)), np.nan)
    for i, first in enumerate(own):
        for j, second in enumerate(own):
            if first.size and second.size:
                matrix[i, j] = 1.0 if i == j else similarity(first, second)
    return matrix


def separate(rivals: Mapping[str, Fit], rng: np.random.Generator, *, evaluations: int = 400) -> Separation:
    """Design the manoeuvre that separates rival effects.

    The input is allowed what the rig file states and the recordings show, see `allowed_limits`.

    `rivals`: two or more fits to the same recordings, by catalogue id. They may be on different bases. `rng`: source of
    the manoeuvres that are tried at random. `evaluations`: manoeuvres to try: the first ones at random, the others from
    the best of those, by the simplex of Nelder and Mead (Computer Journal 7 (1965) 308) or, where its corners would
    take most of them, by random steps. So many within what the recordings show to be safe, and as many more where the
    limits are others. Raises InputError for fewer than two rivals, on different recordings, or some of which have an
    input and others not; ComputationError if a model has no rest position where the hub starts.
    """
    names, fits = _in_order(rivals)
    experiments = fits[0].problem.bench.experiments
    if all(e.drive is None for e in experiments):
        return _let_go(names, fits)
    shown = demonstrated_limits(experiments)
    limits = _short(allowed_limits(experiments), fits[0])
    trial = Trial(fits, limits.duration)
    # Wider limits are no reason to find less than without them.
    searches = [MoveSearch(trial, within) for within in dict.fromkeys((known_part(limits, shown), limits))]
    sources = rng.spawn(len(searches))
    for search, source in zip(searches, sources, strict=True):
        search.explore(evaluations, source)
    laws, given = _laws(fits, [pairs for search in searches for pairs in search.allowed])
    for search, source in zip(searches, sources, strict=True):
        search.improve(evaluations, laws, source)
    best = max(searches, key=lambda s: s.merit)
    pairs, deflection = trial.compare(best.moves)
    time = trial.gap * np.arange(trial.count)
    return Separation(
        **_rivals(names, fits, laws),
        limits=limits,
        moves=best.moves,
        columns=("time_s", _input_column(experiments[0])),
        table=np.column_stack([time, hub_drive(best.moves, trial.angle).evaluate(time)[0]]),
        given=given,
        designed=pairs.nearest(laws) if deflection <= limits.deflection else Distance(0.0, 0.0, 0.0),
        deflection=deflection,
        evaluations=sum(s.count for s in searches),
    )


def _rivals(names: tuple[str, ...], fits: Sequence[Fit], laws: Laws) -> dict[str, Any]:
    """Return what a separation says of its rivals whatever moves the system."""
    first = fits[0].problem.bench.experiments[0]
    units = {"unit": first.coordinate_unit, "deflection_unit": first.deflection_unit}
    left = float(np.sqrt(max(0.0, min(f.reduced_chi2 for f in fits) - 1.0)))
    likeness = similarity_matrix(fits)
    return {"rivals": names, "clusters": laws.groups(names), "similarities": likeness, "left": left, **units}


def _laws(fits: Sequence[Fit], tried: Sequence[Pairs]) -> tuple[Laws, Distance]:
    """Return which rivals are one law, by the given recordings and manoeuvres, and how far laws lie apart on those.

    Without a manoeuvre that is allowed the given recordings alone say it, and of recordings like these.
    """
    given = pairs_on_given(fits)
    laws = Laws.of(len(fits), [given, *tried])
    return laws, given.nearest(laws)


def _in_order(rivals: Mapping[str, Fit]) -> tuple[tuple[str, ...], list[Fit]]:
    """Return rivals by name, the physically simplest first, and their fits."""
    names = tuple(sorted(rivals, key=lambda n: (simplicity(n, rivals[n].model.mechanics.system), n)))
    fits = [rivals[n] for n in names]
    if len(fits) < 2 or len({tuple(e.recording.name for e in f.problem.bench.experiments) for f in fits}) != 1:
        raise InputError("Rivals to be separated are at least two fits to the same recordings.")
    return names, fits


def _short(limits: MotorLimits, fit: Fit) -> MotorLimits:
    """Return limits of a recording as long as some swings of what is no arm: a longer one says hardly more."""
    if fit.problem.bench.experiments[0].system.has_rod:
        return limits
    return replace(limits, duration=min(limits.duration, _SWINGS * 2 * np.pi * fit.problem.units.time))


def _input_column(experiment: Experiment) -> str:
    """Return the name of the input with its SI unit, as recordings of an arm name their motor's angle."""
    told = experiment.rig.columns.input
    if experiment.system.has_rod or told is None:
        return "motor_angle_rad"
    return f"input_{experiment.input_unit}".replace(" ", "_")


def _let_go(names: tuple[str, ...], fits: Sequence[Fit]) -> Separation:
    """Return the place to let the system go from, at rest, within the deflections that it has been seen at."""
    experiments = fits[0].problem.bench.experiments
    seen = largest_deflection(experiments, whole=True)
    most = fits[0].problem.units.coordinate if experiments[0].reads_acceleration else seen
    longest = max(float(np.ptp(e.recording.time)) for e in experiments)
    limits = _short(MotorLimits(most, 1.0, 1.0, longest, _OVERSHOOT * seen), fits[0])
    trial = Trial(fits, limits.duration)
    # What moves to one side of zero may have a wall at the other.
    sides = [s for s in (1.0, -1.0) if max(float(np.nanmax(s * e.deflection)) for e in experiments) > _VISITED * seen]
    rest = trial.rivals[0].rest
    places = [rest + side * most * part for part in np.linspace(0.05, 1.0, _PLACES) for side in sides]
    compared = [(trial.compare((), place), place) for place in places]
    known = [found for found in compared if found[0][1] <= limits.deflection]
    laws, given = _laws(fits, [pairs for (pairs, _), _ in known])
    (pairs, deflection), release = max(known or compared, key=lambda found: found[0][0].nearest(laws).chi2)
    predicted = trial.readings((), release) if np.isfinite(deflection) else np.empty((0, len(names)))
    return Separation(
        **_rivals(names, fits, laws),
        limits=limits,
        moves=(),
        columns=("time_s", *(f"{name}_{experiments[0].recording.units[0]}" for name in names)),
        table=np.column_stack([trial.time[: len(predicted)], predicted]),
        given=given,
        designed=pairs.nearest(laws) if known else Distance(0.0, 0.0, 0.0),
        deflection=deflection,
        evaluations=len(places),
        release=release,
    )
