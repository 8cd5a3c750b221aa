"""What a fit cannot be believed for, as records: values at an edge, hold-outs missed, and what is left.

Sentences are made from them in one place, `discovery.report.doubt_sentences`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from discovery.declarations.effect import Sensor
from discovery.estimation.fit import Fit
from discovery.estimation.holdout import SEPARATE
from discovery.estimation.residual import ResidualReport, memory
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.experiment import Experiment
from discovery.recordings.parts import MOVES, motion_over_noise
from discovery.recordings.recording import Recording
from discovery.results.judging import judged_rms
from discovery.selection.decision import Decision

#: Times the noise, readings that lie farther off than a model that leaves noise would let them.
SCATTERED = 1.5
#: Times the training error, a hold-out that is missed by a model which leaves an error there, too.
_ELSEWHERE = 5.0
#: Standard deviations by which an output moves before its input, and that of a delay without an interval, in readings.
_AHEAD, _UNTOLD = 2.0, 0.1
#: Such a part of what is left of a recording is a burst where it lies within such a share of it.
_SHORT = {0.9: 0.1, 0.5: 0.1, 0.25: 0.01}
_FIRST = 4  # readings: where a recording begins
#: What is left may be noise with a memory up to so many noise sds, and is told apart in time from so many on.
_LITTLE, _LARGE = 3.0, 2.0
#: Errors are white where the variance of their mean is less than so many times that of independent ones.
_WHITE = 2.0
#: Noise is as large held out as in training, within this factor.
_ALIKE = 1.5
#: An error that falls in training falls as well held out, by this share of its logarithm at least; chance, as that of
#: the fitted starts, moves a held-out one by this factor.
_CARRIED, _CHANCE = 0.25, 1.05


@dataclass(frozen=True)
class Caution:
    """One reason not to believe an answer."""

    #: "declared_edge", "effect_edge" (a value at the edge of its range), "strayed" (a constant far from its guess),
    #: "stated_edge" (a `stated` value with `sd` that ends as many `sds` away as it may: `value`, `unit`),
    #: "combined" (a constant that the recordings tell together with `others` only),
    #: "held_sign" (a constant of the declared model that ends at zero and would go beyond), "far_start" (`value`, `sd`
    #: and `unit` of a start that nothing reads, and how many `times` as far as believed),
    #: "lost_gain" (of the input, not told from zero any more: `value`, `sd`, `unit`, `before` and `before_sd`),
    #: "no_gain" (never told from zero: `value`, `sd` and `unit`),
    #: "unfinished" (a fit that stopped after so many `iterations` before it met its rule), "stopped" (a search that its
    #: budget ended, with the numbers of that decision), "motionless" (training readings that move by so many `times`
    #: their noise at most),
    #: "seen_aside" (a spring that gives way in metres, as the sine of an angle does),
    #: "untold" (an added effect of no size 3 sds from zero: `value`, `sd` and `unit` of the first of them),
    #: "acausal" (by how much an output is `ahead` of its input [s], and `sd`), "missed" (the hold-out), and of what is
    #: left "stamps" (that err, see `diagnosis.stamps`), "burst" (where it lies in time), "like_noise" (of the
    #: instrument), "not_carried", "scattered", "quiet".
    code: str
    #: The parameter, or the recording of a burst; of a miss the parameter that training leaves undetermined and that it
    #: hangs on, if there is one; empty where it is about the whole answer.
    about: str = ""
    effect: str = ""  # the effect that was added with the parameter; empty otherwise
    #: Of an edge `value`, `unit`, and `others` of the same effect that are at one; of a strayed constant its `guess`,
    #: too, and `others` that stray; of a miss `rms`, `unit`, `ratio` (over the noise), the rms of training
    #: (`trained`), whether that counts as none (`explains`), the `scatter` about the mean, and `beyond`, whether all
    #: of it moves farther than training, and where it is about a parameter `undetermined`, see
    #: `diagnosis.undetermined`: its `value`, `sd` and `unit`, whether it is a `constant` that a rig file may state, by
    #: how many `sds` it would move, which part of the error is `left` then; of a burst `start`, `stop` [s], `share` of
    #: what is left, whether the input jumps there (`input_jumps`), and whether the recording `begins` there and is
    #: said to rest then (`at_rest`); of stamps their rms `deviation` from a clock of a `step` [s], and the `share`
    #: that this explains of what is left; of what is like noise `ratio` and `autocorrelation`; of what is not carried
    #: by how many times the error falls in training (`train`) and held out (`held`); of scattered readings `rms`,
    #: `unit`, `noise`, their `ratio`, whether that noise is `estimated`, the `memory` of the errors (see
    #: `estimation.residual.memory`), whether it counts as none (`white`), and whether they are those of training
    #: (`trained`); of quiet ones `rms`, `unit`, `noise`, its `ratio` to it, and `trained`.
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return asdict(self)


def acausal(fitted: Fit) -> Caution | None:
    """Return that the output of a driven system moves before its input does; None where it does not."""
    driven = [e for e in fitted.problem.bench.experiments if e.drive is not None]
    least = min((median_step(e.recording.time) for e in driven), default=0.0)
    for effect in fitted.model.terms if driven else ():
        late = str(effect.lateness()) if isinstance(effect, Sensor) else ""  # a parameter that is a delay itself
        sd = fitted.told(late)["sd"] if late in fitted.values else None
        if (ahead := -fitted.values.get(late, 0.0)) > _AHEAD * (_UNTOLD * least if sd is None else sd):
            return Caution("acausal", late, effect.id(), {"ahead": ahead, "sd": sd})
    return None


def unfinished(fitted: Fit) -> Caution | None:
    """Return that the fit stopped on its way to a minimum; None where it is there."""
    minimum = fitted.minimum
    return None if minimum.converged else Caution("unfinished", numbers={"iterations": minimum.iterations})


def stopped(steps: Sequence[Decision]) -> Caution | None:
    """Return that a limit of work ended the search; None where nothing more was accepted."""
    last = next((d for d in reversed(steps) if d.action == "stop"), None)
    return Caution("stopped", numbers=last.numbers) if last is not None and last.code == "budget" else None


def motionless(recordings: Sequence[Recording]) -> Caution | None:
    """Return that what was fitted moves by no more than its noise; None where it does."""
    times = max(motion_over_noise(r, 0) for r in recordings)
    return Caution("motionless", numbers={"times": times}) if times < MOVES else None


def missed(errors: Mapping[str, Any], *, left: float, held: float, least: float) -> Caution | None:
    """Return that a model misses what is held out far more than training; None where it does not.

    Model errors in training and held out, and that which counts as none, are in the unit of the output.
    """
    after, floor, rms = errors["after"], errors["noise_floor"], judged_rms(errors)
    beyond, explains = "holdout_outside" in after and "holdout_inside" not in after, left <= least
    usual = max(floor, after["train"]["rms"])
    if not (rms > (SCATTERED if explains else _ELSEWHERE) * usual and (beyond or held > least)):
        return None
    numbers = {"rms": rms, "unit": errors["unit"], "ratio": rms / (floor if explains else usual), "beyond": beyond}
    numbers["continued"] = errors["holdout_kind"] != SEPARATE
    numbers |= {"explains": explains, "trained": after["train"]["rms"], "scatter": errors["holdout_scatter"]}
    return Caution("missed", numbers=numbers)


def burst(fitted: Fit) -> Caution | None:
    """Return the short stretch that holds nine tenths, half or a quarter of what is left of a recording; else None."""
    bench = fitted.problem.bench
    left = np.square(fitted.minimum.residual[: bench.n_rows])
    found = []
    for e, (rows, used) in zip(bench.experiments, bench.blocks(), strict=True):
        part = np.where(used, left[rows].reshape(used.shape), 0.0).sum(axis=1)
        if _LARGE**2 * used.sum() < (whole := float(part.sum())) < math.inf:
            time = e.recording.time[: part.size]
            for share, short in _SHORT.items():
                begin, end = _shortest(time, part, share * whole)
                if end - begin <= short * float(time[-1] - time[0]):
                    numbers = {"share": share, "start": begin, "stop": end, "input_jumps": _input_jumps(e, begin, end)}
                    numbers |= {"begins": bool(begin <= time[:_FIRST][-1]), "at_rest": e.recording.at_rest}
                    found.append((share, whole, e.recording.name, numbers))
    if not found:
        return None
    *_, name, numbers = max(found, key=lambda f: f[:2])
    return Caution("burst", name, numbers=numbers)


def _input_jumps(experiment: Experiment, begin: float, end: float) -> bool:
    """Return whether the input jumps by a tenth of its range in a stretch of time, or within a reading before it."""
    drive = experiment.drive
    if drive is None:
        return False
    kinks = drive.kinks[(drive.kinks >= begin - median_step(experiment.recording.time)) & (drive.kinks <= end)]
    jumps = np.abs(drive.evaluate(kinks)[0] - drive.evaluate(kinks, "left")[0])
    return bool(jumps.max(initial=0.0) > 0.1 * float(np.ptp(drive.evaluate(experiment.recording.time)[0])))


def _shortest(time: FloatArray, part: FloatArray, sought: float) -> tuple[float, float]:
    """Return the shortest stretch of time that holds so much."""
    so_far = np.concatenate([[0.0], np.cumsum(part)])
    # From each sample on to the one that completes it.
    last = np.searchsorted(so_far, so_far[:-1] + sought) - 1
    first = np.flatnonzero(last < time.size)
    best = first[np.argmin(time[last[first]] - time[first])]
    return float(time[best]), float(time[last[best]])


def like_noise(
    report: ResidualReport,
    depends_on: Sequence[str],
    errors: Mapping[str, Any],
    *,
    left: float,
    held: float,
    noise: float,
) -> Caution | None:
    """Return that what is left may be noise of the instrument; None where it is large or depends on the motion.

    Model errors in training and held out, zero without any, and the smallest noise are in the unit of the output. A
    prediction that misses by more than what training leaves is no noise.
    """
    alike = held == 0.0 or left / _ALIKE <= held <= _ALIKE * left
    predicted = judged_rms(errors) <= _ALIKE * max(errors["noise_floor"], errors["after"]["train"]["rms"])
    if report.rms > _LITTLE or depends_on or not (alike and predicted):
        return None
    return Caution("like_noise", numbers={"ratio": left / noise, "autocorrelation": report.autocorrelation})


def not_carried(errors: Mapping[str, Any]) -> Caution | None:
    """Return that an error falls in training and hardly held out, or grows there; None where it falls as well."""
    pairs = [(errors[when]["train"]["rms"], judged_rms(errors, when)) for when in ("before", "after")]
    if not all(0 < value < math.inf for pair in pairs for value in pair):
        return None
    train, held = (before / after for before, after in zip(*pairs, strict=True))
    if math.log(_CHANCE * held) >= _CARRIED * math.log(max(train, 1.0)):
        return None
    return Caution("not_carried", numbers={"train": train, "held": held})


def scattered(
    errors: Mapping[str, Any], left: Sequence[tuple[Recording, FloatArray]], *, trained: bool = False
) -> Caution | None:
    """Return that held-out readings, or those of training, lie farther off than their noise; None where they do not.

    `left` holds what the final model leaves of each such recording, shape (n, c): NaN where it does not count. Errors
    of time stamps belong to the noise. That the readings scatter by more than the noise that is stated says nothing of
    what a model leaves.
    """
    rms = errors["after"]["train"]["rms"] if trained else judged_rms(errors)
    # The error is a distance over all channels, and recordings may differ in their noise.
    floor = max((recording.noise_floor(np.isfinite(part)) for recording, part in left), default=math.inf)
    if not SCATTERED * floor < rms < math.inf:
        return None
    length = float(np.mean([memory(c[np.isfinite(c)]) for _, part in left for c in part.T]))
    numbers = {"rms": rms, "unit": errors["unit"], "ratio": rms / floor, "noise": floor, "memory": length}
    estimated = any(recording.noise_estimated for recording, _ in left)
    told = {"estimated": estimated, "white": length < _WHITE, "trained": trained}
    return Caution("scattered", numbers={**numbers, **told})


def quiet(
    errors: Mapping[str, Any], left: Sequence[tuple[Recording, FloatArray]], *, trained: bool = False
) -> Caution | None:
    """Return that a model misses readings by far less than a noise that was estimated; None where it does not.

    See `scattered` for the arguments.
    """
    rms = errors["after"]["train"]["rms"] if trained else judged_rms(errors)
    floor = min((recording.noise_floor(np.isfinite(part)) for recording, part in left), default=0.0)
    if not (0.0 < SCATTERED * rms < floor and all(recording.noise_estimated for recording, _ in left)):
        return None
    numbers = {"rms": rms, "unit": errors["unit"], "ratio": floor / rms, "noise": floor, "trained": trained}
    return Caution("quiet", numbers=numbers)
