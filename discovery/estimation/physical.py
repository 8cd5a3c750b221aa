"""Parameters in kilograms and newtons: those of a model are per unit inertia, which the rig or the input tells."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from discovery.declarations.place import amplitudes
from discovery.declarations.unit_suffixes import named_unit
from discovery.declarations.units import dimension, is_force, known_dimension, si_symbol
from discovery.equations.model import Model
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.mechanics.rod_shapes import AT_THE_TIP
from discovery.recordings.experiment import Experiment

Dimension = dict[str, Fraction]


def _product(*factors: tuple[Dimension, int]) -> Dimension:
    total: Dimension = {}
    for unit, power in factors:
        for base, exponent in unit.items():
            total[base] = total.get(base, Fraction(0)) + power * exponent
    return {base: exponent for base, exponent in total.items() if exponent}


def _inertia(model: Model, experiment: Experiment) -> tuple[str | float, float, Dimension] | None:
    """Return the inertia, or the parameter that tells it, its relative standard deviation, and its dimension."""
    rig, base = experiment.rig, model.mechanics
    if base.system.has_rod:
        if rig.length is None or rig.tip_mass is None:
            return None
        rod = rig.beam_mass
        mass = rig.tip_mass.value + (AT_THE_TIP * rod.value if rod else 0.0)
        spread = math.hypot(rig.tip_mass.sd, AT_THE_TIP * rod.sd if rod else 0.0) / mass
        relative = math.hypot(spread, 2 * rig.length.sd / rig.length.value)
        return mass * rig.length.value**2, relative, dimension("kg m^2")
    q = known_dimension(experiment.coordinate_unit)
    if q is None:
        return None
    acceleration = _product((q, 1), (dimension("s^-2"), 1))
    if base.prescribed:
        force = experiment.recording.units[0]
        return ("m_0", 0.0, _product((dimension(force), 1), (acceleration, -1))) if is_force(force) else None
    stated, unit = (rig.inertia, "kg m^2") if rig.inertia else (rig.mass, "kg")
    told = rig.columns.input
    given = "" if told is None else si_symbol(told.unit)
    if base.gain and is_force(given):
        return base.gain, 0.0, _product((dimension(given), 1), (acceleration, -1))
    return None if stated is None else (stated.value, stated.sd / stated.value, dimension(unit))


def stated_inertia(experiment: Experiment) -> tuple[str, float, float, str, str] | None:
    """Return what the rig's mass or inertia says of a parameter where a force is recorded, which tells it, too.

    Returned: the input's gain, which is its inverse, or with a force that is read the inertia; mean and standard
    deviation; unit; what the rig file calls it. None where the rig states none, or no force is recorded.
    """
    rig, base = experiment.rig, get_base(experiment.rig.base)
    stated, unit, key = (rig.inertia, "kg m^2", "inertia_kg_m2") if rig.inertia else (rig.mass, "kg", "mass_kg")
    force = experiment.recording.units[0] if base.prescribed else rig.columns.input and rig.columns.input.unit
    q = known_dimension(experiment.coordinate_unit)
    name, power = ("m", 1) if base.prescribed else (base.gain, -1)
    if base.system.has_rod or stated is None or not name or q is None or not is_force(given := si_symbol(force or "")):
        return None
    if _product((dimension(given), 1), (q, -1), (dimension("s^2"), 1)) != dimension(unit):
        return None
    value = stated.value**power
    own = named_unit(_product((dimension(unit), power), ({}, 1)))
    return name, value, value * stated.sd / stated.value, own, key if power > 0 else f"1 / {key}"


def physical_parameters(
    model: Model,
    values: Mapping[str, float],
    fitted: tuple[str, ...],
    covariance: FloatArray,
    experiment: Experiment,
) -> dict[str, tuple[float, float, str]]:
    """Return parameters that are forces, in newtons and kilograms; none where nothing tells the inertia.

    The parameters of a declared system are in these units by themselves.

    `values`: of the model's parameters. `fitted`: what was fitted, in the order of its `covariance` (p, p).
    `experiment`: a recording of its system: units, rig. Returned: value, standard deviation (that of the rig included,
    0 where nothing of it is uncertain, NaN where an interval is missing) and unit; "inertia" is the moving one.
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

    def spread(value: float, **slopes: float) -> float:
        """Return the standard deviation of a value of such derivatives, that of the rig's inertia included."""
        if source:
            slopes.setdefault(source, power * value / values[source])
        own = [(places[n], slope) for n, slope in slopes.items() if n in places]
        variance = sum(a * b * covariance[i, j] for i, a in own for j, b in own)
        return float(math.sqrt(max(variance + (value * relative) ** 2, 0.0)))

    if "m" in model.parameters and model.mechanics.prescribed:
        inertia = values["m"], spread(values["m"], m=1.0), named_unit(unit)
    else:
        inertia = scale, spread(scale), named_unit(unit)
    rows: dict[str, tuple[float, float, str]] = {"inertia": inertia}
    for name in _forces(model):
        value = scale * values[name]
        declared = model.parameters[name].unit
        powers = [factor.partition("^")[2] or "1" for factor in declared.split() if factor.partition("^")[0] == "q"]
        exponents = _product((dimension(declared.replace("q", "rad")), 1), (unit, 1), (q, sum(map(int, powers))))
        rows[name] = (value, spread(value, **{name: scale}), named_unit(exponents))
    return rows


def _forces(model: Model) -> list[str]:
    """Return the parameters of a model that are forces, without the directions that its system does not have."""
    found = [name for effect in model.terms for name in amplitudes(effect)]
    return [name for name in found if model.mechanics.system.has_rod or not model.parameters[name].planar]


def physical_rows(found: Mapping[str, tuple[float, float, str]]) -> dict[str, dict[str, Any]]:
    """Return what `physical_parameters` found, JSON-ready: an interval that is missing is null."""
    return {
        n: {"value": v, "sd": sd if math.isfinite(sd) else None, "unit": unit} for n, (v, sd, unit) in found.items()
    }
