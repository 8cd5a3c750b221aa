"""A linear model in discrete time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from discovery.export.linear import LinearModel
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
