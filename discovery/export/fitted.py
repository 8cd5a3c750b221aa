"""A model with its numbers, detached from the recordings on which it was fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.declarations.units import in_coordinate
from discovery.equations.model import Model
from discovery.foundation.arguments import as_words, check_keys, check_names, expect
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.start_names import is_start

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit


@dataclass(frozen=True, repr=False)
class FittedModel:
    """A model with the value of every parameter.

    Parameters
    ----------
    model : Model
        The model.
    values : mapping of str to float
        Every parameter of the model, fitted or not [SI, radians].
    fitted : tuple of str
        What was fitted, in the order of `covariance`; initial states are called ``delta_0_init[RECORDING]`` and
        ``rate_0_init[RECORDING]``.
    covariance : ndarray, shape (p, p)
        Of the estimates; NaN rows where an interval is missing.
    reasons : mapping of str to str
        Why an interval is missing.
    initial : mapping of str to tuple of float
        Deflection [q] and rate [q/s] at the first sample, by recording; of a prescribed motion there are none. Where a
        declared system has coordinates that are not read, displacement and rate of each follow.
    step : float
        Integration step of the fit, the shortest where they differ, in reach of the classical method [s].
    provenance : mapping
        Where the numbers come from: version, rig file and recordings with their hashes.
    physical : mapping of str to (float, float, str)
        What is known in kilograms and newtons: value, standard deviation, unit, see
        `discovery.estimation.physical.physical_parameters`.
    coordinate : str
        SI unit of the coordinate; of an oscillator whose numbers were given without recordings it is not known, and
        written q.
    given, reading : str
        SI unit of the input, written u where it is not known, and of what is read: the coordinate's if empty.

    Raises
    ------
    InputError
        If a parameter has no finite value, a value is not a number, a name is none of the model's, or the covariance is
        not that of what was fitted.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> fit = fit_model(declared_model(data), data)
    >>> fitted = FittedModel.from_fit(fit)
    >>> round(fitted.values["alpha"], 1), fitted.unit_of("alpha")
    (399.9, 's^-2')
    >>> FittedModel.from_dict(fitted.to_dict()).values == fitted.values
    True
    """

    model: Model
    values: Mapping[str, float]
    fitted: tuple[str, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.empty((0, 0)), compare=False)
    reasons: Mapping[str, str] = field(default_factory=dict)
    initial: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    step: float = math.nan
    provenance: Mapping[str, Any] = field(default_factory=dict)
    physical: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    coordinate: str = ""
    given: str = ""
    reading: str = ""

    def __post_init__(self) -> None:
        expect(self.model, Model, "model", "Make a Model(base, effects).")
        expect(self.values, Mapping, "values", 'Name the parameters, as in {"alpha": 400.0}.')
        check_names(self.values, self.model.parameters, "The model", "parameter")
        fitted = as_words(self.fitted, "fitted", "Name the parameters that were fitted.")
        check_names((n for n in fitted if not is_start(n)), self.model.parameters, "The model", "parameter")
        if np.shape(self.covariance) not in {(len(fitted), len(fitted))}:
            raise InputError(
                f"The covariance has the shape {np.shape(self.covariance)}, and {len(fitted)} numbers are fitted; give "
                "a row and a column for each."
            )
        object.__setattr__(self, "fitted", fitted)
        if not self.coordinate:
            object.__setattr__(self, "coordinate", self.model.mechanics.system.coordinate_unit("q"))
        # Plain numbers, whatever kind of float was given: they are written with `repr`.
        object.__setattr__(self, "values", {n: _plain(n, v) for n, v in self.values.items()})
        object.__setattr__(self, "step", float(self.step))
        missing = [n for n in self.model.parameters if not math.isfinite(self.values.get(n, math.nan))]
        if missing:
            raise InputError(f"The model has no value of {', '.join(missing)}; give a number for each.")

    def __repr__(self) -> str:
        """Return the base, the effects and the values of the parameters."""
        values = ", ".join(f"{name} = {self.values[name]:.4g}" for name in self.model.parameters)
        fitted = sum(name in self.model.parameters for name in self.fitted)
        return f"<FittedModel {' + '.join((self.model.base, *self.model.effects))}: {values}; {fitted} fitted>"

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations of what was fitted; NaN where `reasons` says why."""
        with np.errstate(invalid="ignore"):
            return dict(zip(self.fitted, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @classmethod
    def from_fit(cls, fit: Fit) -> FittedModel:
        """Return what a fit found, the parameters that it held included."""
        from discovery.estimation.fit import Fit
        from discovery.results.provenance import surroundings

        expect(fit, Fit, "fit", "Make one with fit_model(model, dataset).")
        bench = fit.problem.bench
        parameters, initial = fit.problem.expand(fit.minimum.x[:, None])
        everything = dict(zip(bench.names, parameters[:, 0].tolist(), strict=True))
        recordings = [e.recording for e in bench.experiments]
        rig = bench.experiments[0].rig
        fitted = fit.problem.names
        rows = [0, 1, *(2 + bench.own.index(name) for name in fit.model.begins)]
        values = {n: everything[n] for n in fit.model.parameters}
        return cls(
            model=fit.model.free_parameter(*fitted),
            values=values,
            fitted=fitted,
            covariance=fit.covariance,
            reasons=dict(fit.reasons),
            initial={}
            if fit.model.mechanics.prescribed
            else {r.name: tuple(start[rows, 0].tolist()) for r, start in zip(recordings, initial, strict=True)},
            step=bench.classical_step(parameters, initial),
            provenance={
                "discovery": version("discovery"),
                "git_revision": surroundings()["git_revision"],
                "rig": {"name": rig.name, "sha256": rig.sha256},
                "data": [{"name": r.name, "source": Path(r.source).name, "sha256": r.sha256} for r in recordings],
            },
            physical=fit.physical,
            coordinate=bench.experiments[0].coordinate_unit,
            given=bench.experiments[0].input_unit,
            reading=bench.experiments[0].reading_unit,
        )

    def unit_of(self, parameter: str) -> str:
        """Return the SI unit of a parameter."""
        check_names([parameter], self.model.parameters, "The model", "parameter")
        declared = self.model.parameters[parameter]
        coordinate = (self.reading or self.coordinate) if declared.read else self.coordinate
        return in_coordinate(declared.value_unit, coordinate, self.given or "u")

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-ready description; numbers that are missing are null."""
        sd = self.sd
        rows: list[dict[str, Any]] = []
        for name, parameter in self.model.parameters.items():
            value = {"value": self.values[name], "sd": _null(sd.get(name, math.nan)), "unit": self.unit_of(name)}
            rows.append({"name": name, **value, "meaning": parameter.meaning, "fitted": name in self.fitted})
        return {
            "model": self.model.to_dict(),
            "parameters": rows,
            "covariance": {
                "names": list(self.fitted),
                "matrix": [[_null(v) for v in row] for row in self.covariance.tolist()],
            },
            "reasons": dict(self.reasons),
            "initial": {n: [float(v) for v in state] for n, state in self.initial.items()},
            "step_s": _null(self.step),
            "provenance": dict(self.provenance),
            "physical": {n: {"value": v, "sd": _null(sd), "unit": u} for n, (v, sd, u) in self.physical.items()},
            "coordinate_unit": self.coordinate,
            "input_unit": self.given,
            "reading_unit": self.reading,
        }

    @classmethod
    def from_dict(cls, description: Mapping[str, Any]) -> FittedModel:
        """Return the model that `to_dict` described."""
        wanted = ("model", "parameters", "covariance", "reasons", "initial", "step_s", "provenance")
        check_keys(description, wanted, "description", "Export it again, or give what `FittedModel.to_dict` returned.")
        names = description["covariance"]["names"]
        matrix = [[_number(v) for v in row] for row in description["covariance"]["matrix"]]
        return cls(
            model=Model.from_dict(description["model"]),
            values={row["name"]: _number(row["value"]) for row in description["parameters"]},
            fitted=tuple(names),
            covariance=np.array(matrix, float).reshape(len(names), len(names)),
            reasons=dict(description["reasons"]),
            initial={n: tuple(map(float, start)) for n, start in description["initial"].items()},
            step=_number(description["step_s"]),
            provenance=dict(description["provenance"]),
            # An earlier version did not write it.
            physical={
                n: (_number(p["value"]), _number(p["sd"]), str(p["unit"]))
                for n, p in description.get("physical", {}).items()
            },
            coordinate=description.get("coordinate_unit", ""),
            given=description.get("input_unit", ""),
            reading=description.get("reading_unit", ""),
        )


def _null(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _plain(name: str, value: float) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"The value of {name} is {value!r}; give a number.") from None


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def given_numbers(model: Model, values: Mapping[str, float] | None) -> dict[str, float]:
    """Return the finite numbers given for parameters of a model, else InputError; initial states are passed over."""
    if values is not None:
        expect(values, Mapping, "values", 'Name the parameters, as in {"alpha": 400.0}.')
    given = {n: _plain(n, v) for n, v in (values or {}).items() if not is_start(str(n))}
    check_names(given, model.parameters, "The model", "parameter")
    bad = [n for n, v in given.items() if not math.isfinite(v)]
    if bad:
        raise InputError(f"The value of {', '.join(bad)} is not finite; give a number.")
    return given


def model_of(source: object) -> Model:
    """Return the model of what a caller has; InputError for anything that has none, or two, as the answer of a loop."""
    if isinstance(source, Model):
        return source
    if isinstance(model := getattr(source, "model", None), Model):
        return model
    raise InputError(
        f"A Model, a Fit or a FittedModel is exported, but {source!r:.60} is a {type(source).__name__}. Of a loop give "
        "its `after`, of a folder of results use `discovery export`."
    )


def fitted_model(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> FittedModel:
    """Return a model with its numbers from whatever a caller has; `values` [SI, radians] replace those of the source.

    A bare model also knows some itself. InputError for a name that is no parameter of it, or one without a number.
    """
    model = model_of(source)
    given = given_numbers(model, values)
    if isinstance(source, Model):
        known = {n: v for n, v in model.known.items() if n in model.parameters}
        return FittedModel(model, {**known, **given})
    found = source if isinstance(source, FittedModel) else FittedModel.from_fit(source)
    # What is known in kilograms is of the numbers that are replaced.
    return replace(found, values={**found.values, **given}, physical={}) if given else found


def deviations(
    found: FittedModel, law: Callable[[Mapping[str, float]], tuple[FloatArray, ...]]
) -> tuple[FloatArray, ...]:
    """Return the sds of what a law makes of the values, by differences over a tenth of each sd; empty without any."""
    places = [k for k, n in enumerate(found.fitted) if n in found.values and np.isfinite(found.covariance[k, k])]
    slopes = []
    for k in places:
        name, step = found.fitted[k], 0.1 * float(np.sqrt(found.covariance[k, k]))
        ends = [law({**found.values, name: found.values[name] + s * step}) for s in (1, -1)]
        slopes.append([(up - down) / (2.0 * step) if step else 0.0 * up for up, down in zip(*ends, strict=True)])
    own = found.covariance[np.ix_(places, places)]
    each = (np.array(s) for s in zip(*slopes, strict=True))
    return tuple(np.sqrt(np.maximum(np.einsum("i...,ij,j...->...", s, own, s), 0.0)) for s in each)
