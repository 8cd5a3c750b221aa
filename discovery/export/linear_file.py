"""A linear model to take along: in discrete time, as Python with its system in python-control, and as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import expm

from discovery.export.fitted import FittedModel
from discovery.export.linear import LinearModel
from discovery.export.source_text import composition, docstring, origin
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError


def _held(a: FloatArray, b: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
    """Return what a state and a held input become after some time."""
    n, m = b.shape
    whole = expm(time * np.block([[a, b], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]


def discretise(model: LinearModel, sample_time: float) -> LinearModel:
    """Return a linear model in discrete time, the input held between samples, exact for a late instrument too.

    Of a delay of several samples and a part of one, the reading a part of a sample ago follows from the last state and
    input; whole samples are states that hand it on. Standard deviations are left to the continuous model.

    InputError if the model is in discrete time already, or the sample time [s] is not positive.
    """
    if model.sample_time is not None or not (sample_time > 0 and np.isfinite(sample_time)):
        raise InputError("A model in continuous time becomes one in discrete time with a positive sample time.")
    a, b = _held(model.a, model.b, sample_time)
    found = replace(model, a=a, b=b, sd={}, sample_time=sample_time)
    whole = int(np.ceil(model.delay / sample_time - 1e-9))
    if whole == 0:
        return found
    # The reading that was due in the course of the last step, then shifted whole steps.
    part, pushed = _held(model.a, model.b, whole * sample_time - model.delay)
    n, m, r = a.shape[0], b.shape[1], model.c.shape[0]
    size = n + r * whole
    late_a, late_b = np.zeros((size, size)), np.zeros((size, m))
    late_a[:n, :n], late_b[:n] = a, b
    late_a[n : n + r, :n], late_b[n : n + r] = model.c @ part, model.c @ pushed + model.d
    late_a[n + r :, n:-r] = np.eye(r * (whole - 1))
    late_c = np.zeros((r, size))
    late_c[:, -r:] = np.eye(r)
    held = tuple(f"{y}_{k + 1}_late" for k in range(whole) for y in model.outputs)
    drift = (*model.drift, *[0.0] * len(held))
    return replace(
        found, states=(*model.states, *held), a=late_a, b=late_b, c=late_c, d=np.zeros_like(model.d), drift=drift
    )


def linear_to_json(linear: LinearModel) -> str:
    """Return a linear model as JSON: matrices as lists of rows, and what they are of."""
    content: dict[str, Any] = {
        **{key: list(getattr(linear, key)) for key in ("states", "inputs", "outputs")},
        **{key: getattr(linear, key.lower()).tolist() for key in "ABCD"},
        "sd": {key.upper(): value.tolist() for key, value in linear.sd.items()},
        "operating_point": dict(linear.point),
        **{key: list(getattr(linear, key)) for key in ("reading", "drift")},
        "delay_s": linear.delay,
        "sample_time_s": linear.sample_time,
        "warnings": list(linear.warnings),
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _matrices(found: Mapping[str, FloatArray], suffix: str = "") -> list[str]:
    return [f"{key}{suffix} = np.array({value.tolist()!r})" for key, value in found.items()]


def linear_to_python(linear: LinearModel, source: FittedModel) -> str:
    """Return a linear model and where it comes from as Python that needs numpy, and python-control for its `system`."""
    point = "\n".join(f"{n}: {v:.9g}" for n, v in linear.point.items())
    time = "continuous time" if linear.sample_time is None else f"samples of {linear.sample_time:g} s, input held"
    late = f"The reading is {linear.delay:g} s old" if linear.delay else ""
    late += (", which no matrix knows." if linear.sample_time is None else ", which the matrices hold.") if late else ""
    text = docstring(
        f"Base {composition(source)}, linearised, in {time}.",
        f"Operating point:\n{point}",
        f"States: {', '.join(linear.states)}; input: {', '.join(linear.inputs)}; outputs: {', '.join(linear.outputs)}.",
        late,
        "\n".join(f"Warning: {w}" for w in linear.warnings),
        "\n".join(origin(source)),
    )
    body = [
        *_matrices({k: getattr(linear, k.lower()) for k in "ABCD"}),
        "#: Standard deviations of the entries.",
        *_matrices({k.upper(): v for k, v in linear.sd.items()}, "_SD"),
        "#: Age of the reading [s], and time between samples [s].",
        f"DELAY, SAMPLE_TIME = {linear.delay!r}, {linear.sample_time!r}",
        "",
        "",
        "def system():",
        '    """Return the system of python-control."""',
        "    import control",
        "",
        f"    names = dict(states={list(linear.states)!r}, inputs={list(linear.inputs)!r}, "
        f"outputs={list(linear.outputs)!r})",
        "    return control.ss(A, B, C, D, *([] if SAMPLE_TIME is None else [SAMPLE_TIME]), **names)",
    ]
    return f'"""{text}\n"""\n\nimport numpy as np\n\n' + "\n".join(body) + "\n"
