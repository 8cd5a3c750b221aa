"""A linear model as files: Python with the matrices and their system in python-control, and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from discovery.export.fitted import FittedModel
from discovery.export.linear import LinearModel
from discovery.export.source_text import composition, docstring, origin
from discovery.foundation.arrays import FloatArray


def linear_to_json(linear: LinearModel) -> str:
    """Return a linear model as JSON: matrices as lists of rows, and what they are of."""
    content: dict[str, Any] = {
        "states": list(linear.states),
        "inputs": list(linear.inputs),
        "outputs": list(linear.outputs),
        **{key: getattr(linear, key.lower()).tolist() for key in "ABCD"},
        "sd": {key.upper(): value.tolist() for key, value in linear.sd.items()},
        "operating_point": dict(linear.point),
        "reading": list(linear.reading),
        "drift": list(linear.drift),
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
