"""Which parameter that training leaves undetermined the error of a hold-out hangs on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from discovery.diagnosis.caution import Caution
from discovery.estimation.covariance import Probed, simulated
from discovery.estimation.fit import Fit
from discovery.foundation.arrays import FloatArray

#: Training does not tell a parameter within so many standard deviations of zero, and allows it to move by as many.
_UNTOLD = 3.0
#: An error hangs on a parameter that makes it half as large, or less.
_HALVED = 0.5
#: Standard deviations by which numbers are moved for derivatives.
_APART = 0.01


def hung_on(off: Caution, fitted: Fit) -> Caution:
    """Return the miss of a hold-out, about the undetermined parameter that its error hangs on, if there is one.

    A parameter is moved by up to three of its standard deviations, and the others with it as the covariance says, so
    that training is explained as well; its error held out is to become half as large, as derivatives promise and as the
    motion then does. Parameters that hang together all do that: the one that is told worst for its size is named. That
    is asked of training recordings that are continued, whose starts are those of training; a hold-out of its own has
    starts that are fitted to it.
    """
    if all(e.fitted_samples is None for e in fitted.problem.bench.experiments):
        return off
    sds_of = np.sqrt(np.diag(fitted.covariance))
    slopes, left = _continued(fitted, sds_of)
    found: list[tuple[float, str, float, FloatArray]] = []
    for k, (name, sd) in enumerate(zip(fitted.problem.free, sds_of if left.size else (), strict=False)):
        value = float(fitted.minimum.x[k])
        if fitted.model.parameters[name].shape or not (0.0 < sd < np.inf and abs(value) < _UNTOLD * sd):
            continue
        # A number without an interval is not readjusted.
        with_it = np.nan_to_num(fitted.covariance[:, k] / sd)
        moved = slopes @ with_it
        sds = -float(moved @ left) / max(float(moved @ moved), np.finfo(float).tiny)
        share = float(np.linalg.norm(left + sds * moved) / np.linalg.norm(left))
        if abs(sds) <= _UNTOLD and share <= _HALVED:
            found.append((float(sd) / max(abs(value), np.finfo(float).tiny), name, sds, sds * with_it))
    for _, name, sds, moved in sorted(found, key=lambda each: -each[0]):
        share = _share_left(fitted, moved, float(np.linalg.norm(left)))
        if share <= _HALVED:
            return _about(off, fitted, name, {"sds": sds, "left": share})
    return off


def _about(off: Caution, fitted: Fit, name: str, numbers: dict[str, Any]) -> Caution:
    """Return the miss with what is told of the parameter that it hangs on."""
    told = {key: fitted.told(name)[key] for key in ("value", "sd", "unit")}
    told["constant"] = fitted.model.parameters[name].physical
    added = (e for e in fitted.model.terms if e.id() not in fitted.problem.bench.experiments[0].rig.declared)
    owner = next((e.id() for e in added if name in {p.name for p in e.parameters()}), "")
    return replace(off, about=name, effect=owner, numbers={**off.numbers, "undetermined": {**told, **numbers}})


def _share_left(fitted: Fit, moved: FloatArray, whole: float) -> float:
    """Return which share of the error held out is left where parameters are moved (p,) within their bounds."""
    x = np.clip(fitted.minimum.x + moved, *fitted.problem.bounds)
    _, left = _beyond(fitted, Probed.around(fitted.problem, x, np.zeros(x.size)))
    return float(np.linalg.norm(left) / whole) if left.size else np.inf


def _continued(fitted: Fit, sd: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return derivatives (n, p) and residuals (n,) [noise sds] of training recordings beyond what is fitted of them.

    `sd` (p,): standard deviations of what is fitted, a small part of which it is moved by.
    """
    size = _APART * np.where((sd > 0) & np.isfinite(sd), sd, fitted.problem.scale)
    return _beyond(fitted, Probed.around(fitted.problem, fitted.minimum.x, size))


def _beyond(fitted: Fit, probe: Probed) -> tuple[FloatArray, FloatArray]:
    problem, p = fitted.problem, fitted.minimum.x.size
    parts = [e.fitted_samples for e in problem.bench.experiments]
    with np.errstate(over="ignore", invalid="ignore"):
        (columns,) = simulated(problem.bench, [problem], [probe])
    beyond = [c[part:].reshape(-1, p + 1) for c, part in zip(columns, parts, strict=True) if part is not None]
    rows = np.concatenate(beyond)
    # A motion that blows up tells nothing of how far it is off.
    rows = rows[np.isfinite(rows).all(axis=1)]
    return rows[:, :-1], rows[:, -1]
