"""Parameters in kilograms and newtons: those of a model are per unit inertia, which the rig or the input tells."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from discovery.declarations.effect import Dissipation, Effect, Load, Memory, Potential
from discovery.declarations.symbols import alpha
from discovery.declarations.unit_words import named_unit
from discovery.declarations.units import dimension, known_dimension, si_symbol
from discovery.equations.model import Model
from discovery.recordings.experiment import Experiment

__all__ = ["physical_parameters", "physical_rows"]

Dimension = dict[str, Fraction]
#: What a drive gives whose input is a force or a torque.
_FORCES = tuple(dimension(unit) for unit in ("N", "N m"))


def _product(*factors: tuple[Dimension, int]) -> Dimension:
    total: Dimension = {}
    for unit, power in factors:
        for base, exponent in unit.items():
            total[base] = total.get(base, Fraction(0)) + power * exponent
    return {base: exponent for base, exponent in total.items() if exponent}


def _amplitudes(effect: Effect) -> list[str]:
    """Return the parameters to which the force of an effect is proportional, where no other parameter scales it."""
    if not isinstance(effect, Potential | Dissipation | Load | Memory):
        return []
    law = sp.sympify(effect.expression())
    symbols = {p.name: sp.Symbol(p.name, real=True) for p in effect.parameters()}
    relative = alpha in law.free_symbols and "alpha" not in symbols
    return [
        name
        for name, symbol in symbols.items()
        if not relative and symbol in law.free_symbols and sp.expand(law / symbol).diff(symbol) == 0
    ]


def _inertia(model: Model, experiment: Experiment) -> tuple[str | float, float, Dimension] | None:
    """Return the inertia, or the parameter that tells it, its relative standard deviation, and its dimension."""
    rig, base = experiment.rig, model.mechanics
    if base.system.has_rod:
        if rig.length is None or rig.tip_mass is None:
            return None
        rod = rig.beam_mass
        mass = rig.tip_mass.value + (33 / 140 * rod.value if rod else 0.0)
        spread = math.hypot(rig.tip_mass.sd, 33 / 140 * rod.sd if rod else 0.0) / mass
        relative = math.hypot(spread, 2 * rig.length.sd / rig.length.value)
        return mass * rig.length.value**2, relative, dimension("kg m^2")
    q = known_dimension(experiment.coordinate_unit)
    if q is None:
        return None
    acceleration = _product((q, 1), (dimension("s^-2"), 1))
    if base.prescribed:
        force = known_dimension(experiment.recording.units[0])
        return ("m_0", 0.0, _product((force, 1), (acceleration, -1))) if force and force in _FORCES else None
    stated, unit = (rig.inertia, "kg m^2") if rig.inertia else (rig.mass, "kg")
    told = rig.columns.input
    force = None if told is None else known_dimension(si_symbol(told.unit))
    if base.gain and force and force in _FORCES:
        return base.gain, 0.0, _product((force, 1), (acceleration, -1))
    return None if stated is None else (stated.value, stated.sd / stated.value, dimension(unit))


def physical_parameters(
    model: Model,
    values: Mapping[str, float],
    fitted: tuple[str, ...],
    covariance: NDArray[np.float64],
    experiment: Experiment,
) -> dict[str, tuple[float, float, str]]:
    """Return parameters that are forces, in newtons and kilograms; none where nothing tells the inertia.

    The parameters of a declared system are in these units by themselves.

    Parameters
    ----------
    model : Model
        The model.
    values : mapping of str to float
        Of its parameters.
    fitted : tuple of str
        What was fitted, in the order of `covariance`.
    covariance : ndarray, shape (p, p)
        Of what was fitted.
    experiment : Experiment
        A recording of its system: units, rig.

    Returns
    -------
    dict of str to (float, float, str)
        Value, standard deviation (that of the rig included, 0 where nothing of it is uncertain, NaN where an interval
        is missing) and unit; "inertia" is the moving one.
    """
    found = _inertia(model, experiment)
    if found is None:
        return {}
    known, relative, unit = found
    source = known if isinstance(known, str) else None
    power = {"g": -1, "m_0": 1}.get(source or "", 0)
    scale = values[source] ** power if source else float(known)
    places = {name: k for k, name in enumerate(fitted)}
    q = {} if model.mechanics.system.has_rod else dimension(experiment.coordinate_unit)

    def spread(value: float, *powers: tuple[str | None, int]) -> float:
        """Return the standard deviation of a product of powers of parameters, and of the rig's inertia."""
        own = [(places[n], p / values[n]) for n, p in powers if n in places and values[n]]
        variance = sum(a * b * covariance[i, j] for i, a in own for j, b in own)
        return float(abs(value) * math.sqrt(max(variance + relative**2, 0.0)))

    rows: dict[str, tuple[float, float, str]] = {}
    if "m" in model.parameters and model.mechanics.prescribed:
        rows["inertia"] = (values["m"], spread(values["m"], ("m", 1)), named_unit(unit))
    else:
        rows["inertia"] = (scale, spread(scale, (source, power)), named_unit(unit))
    for effect in model.terms:
        for name in _amplitudes(effect):
            value = scale * values[name]
            declared = model.parameters[name].unit
            exponents = _product((dimension(declared.replace("q", "rad")), 1), (unit, 1), (q, _power_of_q(declared)))
            rows[name] = (value, spread(value, (name, 1), (source, power)), named_unit(exponents))
    return rows


def _power_of_q(unit: str) -> int:
    """Return the power of the coordinate in a declared unit."""
    powers = [factor.partition("^")[2] or "1" for factor in unit.split() if factor.partition("^")[0] == "q"]
    return sum(int(p) for p in powers)


def physical_rows(found: Mapping[str, tuple[float, float, str]]) -> dict[str, dict[str, Any]]:
    """Return what `physical_parameters` found, JSON-ready: an interval that is missing is null."""
    return {
        n: {"value": v, "sd": sd if math.isfinite(sd) else None, "unit": unit} for n, (v, sd, unit) in found.items()
    }
