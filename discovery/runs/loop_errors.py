"""The errors of the declared and of the final model, in training and held out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.estimation.residual import errors
from discovery.foundation.arrays import FloatArray
from discovery.selection.context import Context


def loop_errors(
    context: Context, on_train: Mapping[str, list[FloatArray]], held: Mapping[str, list[FloatArray]]
) -> dict[str, Any]:
    """Return the errors before and after, with their unit, the noise floor, and what kind of hold-out there is."""
    train, judge = context.train, context.judge
    measured = np.concatenate([e.recording.judged_output[e.fitted] for e in train])
    fitted = {w: np.concatenate([p[e.fitted] for e, p in zip(train, on_train[w], strict=True)]) for w in on_train}
    return {
        "unit": train[0].recording.units[0],
        "noise_floor": judge.noise_floor,
        "holdout_kind": judge.kind,
        "holdout_motion": judge.motion,
        "holdout_scatter": judge.scatter,
        **{w: {"train": errors(fitted[w], measured), **judge.errors(held[w])} for w in on_train},
        **({"also": beside} if (beside := _beside(context, on_train, held)) else {}),
    }


def _beside(
    context: Context, on_train: Mapping[str, list[FloatArray]], held: Mapping[str, list[FloatArray]]
) -> list[dict[str, Any]]:
    """Return the errors of what is read beside the output, before and after, in training and held out."""
    ends = [e.fitted.stop if context.judge.continued else 0 for e in context.judge.experiments]
    groups = {
        "train": (context.train, on_train, [e.fitted for e in context.train]),
        "holdout": (context.judge.experiments, held, [slice(end, None) for end in ends]),
    }

    def left(c: int, group: str, when: str) -> dict[str, float]:
        experiments, predicted, parts = groups[group]
        pairs = zip(predicted[when], (e.recording.output for e in experiments), parts, strict=True)
        two = zip(*((p[part, c : c + 1], read[part, c : c + 1]) for p, read, part in pairs), strict=True)
        return errors(*map(np.concatenate, two))

    first = context.train[0].recording
    return [
        {
            "name": first.channels[c],
            "unit": first.units[c],
            **{when: {group: left(c, group, when) for group in groups} for when in on_train},
        }
        for c in range(first.judged.stop, len(first.channels))
    ]
