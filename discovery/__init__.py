"""Discover equations of motion, say how sure they are, and find the effect that a model lacks.

The public names below load what they need when they are first used, so ``import discovery`` stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from discovery.dataset import Dataset as Dataset
    from discovery.dataset import load_dataset as load_dataset
    from discovery.draws import Posterior as Posterior
    from discovery.effect import Effect as Effect
    from discovery.errors import ComputationError as ComputationError
    from discovery.errors import DiscoveryError as DiscoveryError
    from discovery.errors import InputError as InputError
    from discovery.errors import NotConverged as NotConverged
    from discovery.errors import NotIdentifiable as NotIdentifiable
    from discovery.errors import SimulationFailure as SimulationFailure
    from discovery.export import FittedModel as FittedModel
    from discovery.export import from_json as from_json
    from discovery.export import to_json as to_json
    from discovery.export import to_latex as to_latex
    from discovery.export import to_numpy as to_numpy
    from discovery.export import to_sympy as to_sympy
    from discovery.fit import Fit as Fit
    from discovery.fit import declared_model as declared_model
    from discovery.fit import fit as fit_model
    from discovery.loop import LoopResult as LoopResult
    from discovery.loop import close_loop as close_loop
    from discovery.model import Model as Model
    from discovery.parameters import Parameter as Parameter
    from discovery.pipeline import run as run
    from discovery.posterior import sample as sample
    from discovery.predict import predict as predict_motion
    from discovery.prediction import predict as predict_elastica
    from discovery.recording import Recording as Recording
    from discovery.recording import read_recording as read_recording
    from discovery.registry import catalogue as catalogue
    from discovery.registry import get_effect as get_effect
    from discovery.report import build_report as build_report
    from discovery.rig import Rig as Rig
    from discovery.rig_file import read_rig as read_rig
    from discovery.selection.settings import LoopSettings as LoopSettings
    from discovery.stages import discover as discover

# A public name never equals a module's, which would hide it once that module is imported: hence fit_model.
_HOMES = {
    "ComputationError": "discovery.errors:ComputationError",
    "Dataset": "discovery.dataset:Dataset",
    "DiscoveryError": "discovery.errors:DiscoveryError",
    "Effect": "discovery.effect:Effect",
    "Fit": "discovery.fit:Fit",
    "FittedModel": "discovery.export:FittedModel",
    "InputError": "discovery.errors:InputError",
    "LoopResult": "discovery.loop:LoopResult",
    "LoopSettings": "discovery.selection.settings:LoopSettings",
    "Model": "discovery.model:Model",
    "NotConverged": "discovery.errors:NotConverged",
    "NotIdentifiable": "discovery.errors:NotIdentifiable",
    "Parameter": "discovery.parameters:Parameter",
    "Posterior": "discovery.draws:Posterior",
    "Recording": "discovery.recording:Recording",
    "Rig": "discovery.rig:Rig",
    "SimulationFailure": "discovery.errors:SimulationFailure",
    "build_report": "discovery.report:build_report",
    "catalogue": "discovery.registry:catalogue",
    "close_loop": "discovery.loop:close_loop",
    "declared_model": "discovery.fit:declared_model",
    "discover": "discovery.stages:discover",
    "fit_model": "discovery.fit:fit",
    "from_json": "discovery.export:from_json",
    "get_effect": "discovery.registry:get_effect",
    "load_dataset": "discovery.dataset:load_dataset",
    "predict_elastica": "discovery.prediction:predict",
    "predict_motion": "discovery.predict:predict",
    "read_recording": "discovery.recording:read_recording",
    "read_rig": "discovery.rig_file:read_rig",
    "run": "discovery.pipeline:run",
    "sample": "discovery.posterior:sample",
    "to_json": "discovery.export:to_json",
    "to_latex": "discovery.export:to_latex",
    "to_numpy": "discovery.export:to_numpy",
    "to_sympy": "discovery.export:to_sympy",
}

__all__ = [
    "ComputationError",
    "Dataset",
    "DiscoveryError",
    "Effect",
    "Fit",
    "FittedModel",
    "InputError",
    "LoopResult",
    "LoopSettings",
    "Model",
    "NotConverged",
    "NotIdentifiable",
    "Parameter",
    "Posterior",
    "Recording",
    "Rig",
    "SimulationFailure",
    "build_report",
    "catalogue",
    "close_loop",
    "declared_model",
    "discover",
    "fit_model",
    "from_json",
    "get_effect",
    "load_dataset",
    "predict_elastica",
    "predict_motion",
    "read_recording",
    "read_rig",
    "run",
    "sample",
    "to_json",
    "to_latex",
    "to_numpy",
    "to_sympy",
]


def __getattr__(name: str) -> Any:
    try:
        home, _, attribute = _HOMES[name].partition(":")
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
    value = globals()[name] = getattr(import_module(home), attribute)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
