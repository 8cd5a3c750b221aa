"""What a run left behind: its result files, read once and never computed again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.declarations.system import System
from discovery.declarations.units import is_force
from discovery.foundation.arrays import BoolArray, FloatArray, within_half_a_turn
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import stride
from discovery.foundation.start_names import is_start
from discovery.mechanics import get_base
from discovery.mechanics.base import Base
from discovery.mechanics.systems import know_system
from discovery.posterior.inference_data import attributes, by_name
from discovery.recordings.file_signals import judged_channels
from discovery.results.manifest import check_whole
from discovery.results.provenance import read_json
from discovery.rigs.kinds import KINDS

if TYPE_CHECKING:
    import xarray as xr

#: Models whose predictions are stored beside the measurement.
MODELS = ("linear", "before", "after")
#: Predictions are drawn up to so many times the largest reading.
_FARTHEST = 10.0


@dataclass(frozen=True)
class Trajectory:
    """One recording with what each model says about it: n samples of c channels.

    `role` is "train" or "holdout", `time` [s]; `measured` (n, c) is NaN in gaps, and `models` has predictions (n, c) by
    name, of those in `MODELS` that are there. `input` (n,) is the motor angle [rad] or an oscillator's input,
    `deflection` (n,) in rad or the output, `fitted` (n,) says which samples were fitted, and `band` (3, n, c) are 5, 50
    and 95 % of the declared model's predictive distribution.
    """

    name: str
    role: str
    time: FloatArray
    channels: tuple[str, ...]
    units: tuple[str, ...]
    measured: FloatArray
    models: Mapping[str, FloatArray]
    input: FloatArray | None
    deflection: FloatArray | None
    fitted: BoolArray
    band: FloatArray | None

    def deflection_of(self, model: str) -> FloatArray | None:
        """Return the deflection that a model predicts, shape (n,); None where the channels do not give it."""
        reading = self.models[model]
        if self.channels == ("tip_x", "tip_y") and self.input is not None:
            return within_half_a_turn(np.arctan2(reading[:, 1], reading[:, 0]) - self.input)
        if self.channels == ("tip_angle",) and self.input is not None:
            return reading[:, 0] - self.input
        return reading[:, 0] if self.channels[0] == "output" else None

    def distance(self, model: str) -> FloatArray:
        """Return the distance between the outputs of a model and measured at every sample, shape (n,)."""
        own = judged_channels(self.channels)
        return np.sqrt(np.sum((self.models[model] - self.measured)[:, own] ** 2, axis=1))

    def thinned(self) -> Trajectory:
        """Return it at the readings that are compared, where those are every so many as of a force; else as it is."""
        rows = np.flatnonzero(np.isfinite(self.measured).any(axis=1))
        if stride(rows) < 2:
            return self
        return replace(
            self,
            time=self.time[rows],
            measured=self.measured[rows],
            models={model: read[rows] for model, read in self.models.items()},
            input=None if self.input is None else self.input[rows],
            deflection=None if self.deflection is None else self.deflection[rows],
            fitted=self.fitted[rows],
            band=None if self.band is None else self.band[:, rows],
        )


@dataclass(frozen=True)
class Run:
    """The result files of a run directory, with the content of its ``results.json``."""

    folder: Path
    results: Mapping[str, Any]

    @property
    def system(self) -> System:
        """Kind of system."""
        return System.of(self.results["rig"]["kind"])

    @property
    def is_whole(self) -> bool:
        """Whether the whole pipeline was run, not the loop alone."""
        return self.results.get("scope") != "loop"

    @cached_property
    def loop(self) -> Mapping[str, Any]:
        """The loop's result, as in ``loop.json``; the systems that its models declare are known from here on."""
        for found in self.results["loop"]["model"].values():
            know_system(found["model"])
        return self.results["loop"]

    @property
    def coordinate_unit(self) -> str:
        """Unit of the coordinate: rad for an arm, else as the run states it, or that of the output."""
        return self.system.coordinate_unit(str(self.results["rig"].get("coordinate_unit", self.loop["errors"]["unit"])))

    @property
    def reads_coordinate(self) -> bool:
        """Whether the instrument reads where the system is, not the force on it or its acceleration."""
        return self._base is None or self._base.reads_state

    @property
    def reads_force(self) -> bool:
        """Whether the motion is given, and the force on the system is read."""
        return self._base is not None and self._base.prescribed

    @property
    def output_name(self) -> str:
        """What is read, in the words of a reader; of an arm the channels have names of their own."""
        return (self._base and self._base.reads) or KINDS[self.results["rig"]["kind"]].words[1]

    @property
    def told(self) -> Mapping[str, Any]:
        """The content of loop.json, in which states are named in the words of a reader."""
        error = self.loop["model_error"]
        return {**self.loop, "model_error": {**error, "depends_on": [*map(self.state_name, error["depends_on"])]}}

    def state_name(self, name: str) -> str:
        """Return a state in the words of a reader: without a rod, what is read; results of old call it deflection."""
        return name if self.system.has_rod or name not in ("output", "deflection") else self.output_name

    @property
    def input_name(self) -> str:
        """What drives the system, in the words of a reader."""
        kind, base = KINDS[self.results["rig"]["kind"]], self._base
        given = base and (kind.output if base.prescribed else base.input_word)
        # A voltage pushes as a force does, and is none.
        pushed = base is not None and base.is_pushed and self.input_unit and not is_force(self.input_unit)
        return given or ("input" if pushed else kind.words[0])

    @property
    def input_unit(self) -> str:
        """SI unit of the input; empty where the run does not state it."""
        return "rad" if self.system.has_rod else str(self.results["rig"].get("input_unit") or "")

    @property
    def _base(self) -> Base | None:
        name = self.results["rig"].get("base")
        return get_base(name) if name else None

    def open(self, file: str, group: str | None = None) -> xr.Dataset | None:
        """Return one group of a netCDF file of the run, loaded; None where the file or the group is not there."""
        import h5py
        import xarray as xr

        path = self.folder / file
        if not path.is_file():
            return None
        try:
            with h5py.File(path) as contents:
                if group is not None and group not in contents:
                    return None
            with xr.open_dataset(path, group=group, engine="h5netcdf") as dataset:
                return dataset.load()
        except OSError as error:
            raise InputError(f"{path} cannot be read as netCDF: {error}. Run the pipeline again.") from error

    @property
    def posterior(self) -> Mapping[str, Any]:
        """What the run says of its posterior; empty where there is none."""
        return self.results.get("posterior") or {}

    @cached_property
    def _sampled(self) -> xr.Dataset | None:
        return self.open("posterior.nc", "posterior")

    @cached_property
    def sampling(self) -> Mapping[str, Any]:
        """How the posterior was sampled: its provenance, with `acceptance` by move and `tau` by quantity [steps]."""
        dataset = self._sampled
        if dataset is None or "provenance" not in dataset.attrs:
            return {}
        return {
            **json.loads(dataset.attrs["provenance"]),
            "acceptance": json.loads(dataset.attrs["acceptance"]),
            "tau": {name: float(said["tau"]) for name, said in attributes(dataset).items()},
        }

    @property
    def noise_sampled(self) -> str:
        """Name of the noise model of the posterior."""
        stated = self.posterior.get("noise")
        return str(stated or self.sampling.get("noise", "gaussian"))

    @cached_property
    def draws(self) -> Mapping[str, FloatArray]:
        """Posterior draws by quantity, each (ensembles, draws, walkers); empty where no posterior was sampled."""
        return {} if self._sampled is None else by_name(self._sampled)

    @cached_property
    def quantities_sampled(self) -> tuple[Mapping[str, Any], ...]:
        """Rows of the posterior's summary but for the initial states."""
        return tuple(r for r in self.posterior.get("rows", ()) if not is_start(r["name"]))

    @cached_property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """Recordings in the order of ``results.json``; those without a stored trajectory are left out."""
        found = []
        for recording in self.results["recordings"]:
            dataset = self.open("trajectories.nc", recording["name"])
            if dataset is not None:
                found.append(_trajectory(recording, dataset))
        return tuple(found)

    @property
    def judged(self) -> Trajectory | None:
        """The first held-out recording of which both models are known, else the first such one, at what is compared."""
        known = (t for t in (*self.held_out, *self.trajectories) if {"before", "after"} <= t.models.keys())
        return next((t.thinned() for t in known), None)

    @cached_property
    def held_out(self) -> tuple[Trajectory, ...]:
        """Recordings with samples that no fit saw: separate hold-outs, else recordings whose last part was held out."""
        separate = tuple(t for t in self.trajectories if t.role == "holdout")
        return separate or tuple(t for t in self.trajectories if not t.fitted.all())


def _shown(values: FloatArray, measured: FloatArray) -> FloatArray:
    """Return a prediction without what lies so far beyond all readings that it would hide the rest: it blew up."""
    largest = np.abs(measured[np.isfinite(measured)]).max(initial=0.0)
    return np.where(np.abs(values) <= _FARTHEST * largest, values, np.nan) if largest else values


def _trajectory(recording: Mapping[str, Any], dataset: xr.Dataset) -> Trajectory:
    def array(name: str) -> FloatArray | None:
        return np.asarray(dataset[name].to_numpy(), dtype=np.float64) if name in dataset else None

    measured = array("measured")
    if measured is None:
        raise InputError(
            f"trajectories.nc has no variable 'measured' for {recording['name']!r}. Run the pipeline again."
        )
    models = {name: _shown(values, measured) for name in MODELS if (values := array(name)) is not None}
    quantiles = [array(f"posterior_{q}") for q in ("q05", "q50", "q95")]
    band = np.stack([q for q in quantiles if q is not None]) if all(q is not None for q in quantiles) else None
    fitted = array("fitted")
    everything = np.full(len(measured), recording["role"] == "train")
    return Trajectory(
        name=recording["name"],
        role=recording["role"],
        time=np.asarray(dataset["time"].to_numpy(), dtype=np.float64),
        channels=tuple(recording["channels"]),
        units=tuple(recording["units"]),
        measured=measured,
        models=models,
        input=array("input"),
        deflection=array("deflection"),
        fitted=everything if fitted is None else fitted.astype(bool),
        band=band,
    )


def read_run(folder: Path) -> Run:
    """Read the result files of a run; InputError if ``results.json`` is none, or files are another run's."""
    path = Path(folder) / "results.json"
    try:
        results = read_json(path)
    except FileNotFoundError:
        raise InputError(
            f"{path} does not exist: {folder} is not the folder of a finished run. Run the pipeline first."
        ) from None
    wanted = ("rig", "recordings", "loop", "provenance")
    missing = [key for key in wanted if not isinstance(results, dict) or key not in results]
    if missing:
        raise InputError(
            f"{path} lacks {', '.join(missing)}: it is not the result of a whole run. Run the pipeline again."
        )
    check_whole(Path(folder), results)
    return Run(Path(folder), results)
