"""Functions of fitted parameters beside independent values: g/L of a pendulum, the forces of a drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.measured.known import Reference
from discovery.report.results import Run


@dataclass(frozen=True)
class Check:
    """A fitted quantity beside an independent value.

    Attributes
    ----------
    symbol, meaning, unit : str
    fitted, expected : float
        NaN where the model of either has no such quantity.
    sd : float or None
        Of the fitted one; None where a parameter in it has none.
    expected_sd : float or None
    """

    symbol: str
    meaning: str
    unit: str
    fitted: float
    sd: float | None
    expected: float
    expected_sd: float | None = None


def _propagated(
    model: Mapping[str, Any], names: Sequence[str], function: Callable[..., float]
) -> tuple[float, float | None]:
    """Return a function of fitted parameters and its standard deviation, to first order in their covariance."""
    values = {p["name"]: p["value"] for p in model["parameters"]}
    if not set(names) <= values.keys():
        return math.nan, None
    x = np.array([values[n] for n in names])
    slope = np.empty(x.size)
    for i, step in enumerate(1e-6 * np.maximum(np.abs(x), 1e-12)):
        shift = step * np.eye(x.size)[i]
        slope[i] = (function(*(x + shift)) - function(*(x - shift))) / (2 * step)
    order = model["covariance"]["names"]
    if not set(names) <= set(order):
        return float(function(*x)), None
    rows = [order.index(n) for n in names]
    covariance = np.array([[model["covariance"]["matrix"][i][j] for j in rows] for i in rows], dtype=np.float64)
    variance = float(slope @ covariance @ slope)
    return float(function(*x)), math.sqrt(variance) if math.isfinite(variance) else None


def gravity_over_length(run: Run) -> Check | None:
    """Return a pendulum's fitted g/L beside gravity over its stated length; None where there is no such thing."""
    stated = run.results["rig"]["quantities"]
    if run.results["rig"]["kind"] != "pendulum" or not {"gravity", "length"} <= stated.keys():
        return None
    fitted, sd = _propagated(run.results["models"]["after"], ("g_c", "g_s"), math.hypot)
    if math.isnan(fitted):
        return None
    g, length = stated["gravity"], stated["length"]
    expected = g["value"] / length["value"]
    spread = expected * math.hypot(g["sd"] / g["value"], length["sd"] / length["value"])
    return Check("g/L", "gravity over length", "1/s²", fitted, sd, expected, spread)


def drive_checks(run: Run, reference: Reference) -> tuple[Check, ...]:
    """Return mass and friction of a drive's inverse model beside those of a reference model.

    Times the reference inertia m₀ the parameters of the effects are forces.
    """
    model = run.results["models"]["after"]

    reference_inertia = float(model["model"]["known"]["m_0"])

    def force(*names: str) -> tuple[float, float | None]:
        return _propagated(model, names, lambda *x: reference_inertia * math.prod(x))

    dry = "f_c" if any(p["name"] == "f_c" for p in model["parameters"]) else "f_k"
    found = (
        Check("m", "mass", "kg", *_propagated(model, ["m"], float), reference.mass),
        Check("m₀ ξ", "viscous friction, mean of both directions", "N s/m", *force("xi"), reference.viscous),
        Check("m₀ a_v ξ", "half the difference between the directions", "N s/m", *force("a_v", "xi"), math.nan),
        Check(f"m₀ {dry}", "dry friction", "N", *force(dry), reference.coulomb),
        Check("m₀ f_b", "more of it at creep (Stribeck)", "N", *force("f_b"), math.nan),
        Check("m₀ f₀", "constant force", "N", *force("f_0"), reference.offset),
    )
    return tuple(c for c in found if not (math.isnan(c.fitted) and math.isnan(c.expected)))
