"""Discover equations of motion, say how sure they are, and find the effect that a model lacks.

The public names below load what they need when they are first used, so ``import discovery`` stays light.
"""

from __future__ import annotations

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from discovery.declarations.effect import Effect as Effect
    from discovery.declarations.parameters import Parameter as Parameter
    from discovery.declarations.registry import catalogue as catalogue
    from discovery.declarations.registry import get_effect as get_effect
    from discovery.drafting.overview import overview as overview
    from discovery.drafting.rig_text import draft as draft_rig
    from discovery.equations.model import Model as Model
    from discovery.estimation.declared import declared_model as declared_model
    from discovery.estimation.fit import Fit as Fit
    from discovery.estimation.fit import fit as fit_model
    from discovery.estimation.predict import predict as predict_motion
    from discovery.export import FittedModel as FittedModel
    from discovery.export import from_json as from_json
    from discovery.export import to_json as to_json
    from discovery.export import to_latex as to_latex
    from discovery.export import to_numpy as to_numpy
    from discovery.export import to_sympy as to_sympy
    from discovery.foundation.errors import ComputationError as ComputationError
    from discovery.foundation.errors import DiscoveryError as DiscoveryError
    from discovery.foundation.errors import InputError as InputError
    from discovery.foundation.errors import NotConverged as NotConverged
    from discovery.foundation.errors import NotIdentifiable as NotIdentifiable
    from discovery.foundation.errors import SimulationFailure as SimulationFailure
    from discovery.posterior.draws import Posterior as Posterior
    from discovery.posterior.model_comparison import choose_noise as choose_noise
    from discovery.posterior.model_comparison import compare_models as compare_models
    from discovery.posterior.predictive import predictive as predict_bands
    from discovery.posterior.sampling import sample as sample
    from discovery.recordings.dataset import Dataset as Dataset
    from discovery.recordings.dataset import load_dataset as load_dataset
    from discovery.recordings.recording import Recording as Recording
    from discovery.recordings.recording import read_recording as read_recording
    from discovery.report import build_report as build_report
    from discovery.rigs.rig import Rig as Rig
    from discovery.rigs.rig_file import read_rig as load_rig
    from discovery.rigs.rig_file import read_rig as read_rig
    from discovery.runs.loop import close_loop as close_loop
    from discovery.runs.loop_result import LoopResult as LoopResult
    from discovery.runs.pipeline import run as run
    from discovery.runs.regression_stage import discover as discover
    from discovery.selection.settings import LoopSettings as LoopSettings
    from discovery.theory.prediction import predict as predict_elastica

# A public name never equals a module's, which would hide it once that module is imported: hence fit_model.
_HOMES = {
    "ComputationError": "discovery.foundation.errors:ComputationError",
    "Dataset": "discovery.recordings.dataset:Dataset",
    "DiscoveryError": "discovery.foundation.errors:DiscoveryError",
    "Effect": "discovery.declarations.effect:Effect",
    "Fit": "discovery.estimation.fit:Fit",
    "FittedModel": "discovery.export:FittedModel",
    "InputError": "discovery.foundation.errors:InputError",
    "LoopResult": "discovery.runs.loop_result:LoopResult",
    "LoopSettings": "discovery.selection.settings:LoopSettings",
    "Model": "discovery.equations.model:Model",
    "NotConverged": "discovery.foundation.errors:NotConverged",
    "NotIdentifiable": "discovery.foundation.errors:NotIdentifiable",
    "Parameter": "discovery.declarations.parameters:Parameter",
    "Posterior": "discovery.posterior.draws:Posterior",
    "Recording": "discovery.recordings.recording:Recording",
    "Rig": "discovery.rigs.rig:Rig",
    "SimulationFailure": "discovery.foundation.errors:SimulationFailure",
    "build_report": "discovery.report:build_report",
    "catalogue": "discovery.declarations.registry:catalogue",
    "choose_noise": "discovery.posterior.model_comparison:choose_noise",
    "close_loop": "discovery.runs.loop:close_loop",
    "compare_models": "discovery.posterior.model_comparison:compare_models",
    "declared_model": "discovery.estimation.declared:declared_model",
    "discover": "discovery.runs.regression_stage:discover",
    "draft_rig": "discovery.drafting.rig_text:draft",
    "fit_model": "discovery.estimation.fit:fit",
    "from_json": "discovery.export:from_json",
    "get_effect": "discovery.declarations.registry:get_effect",
    "load_dataset": "discovery.recordings.dataset:load_dataset",
    "load_rig": "discovery.rigs.rig_file:read_rig",
    "overview": "discovery.drafting.overview:overview",
    "predict_bands": "discovery.posterior.predictive:predictive",
    "predict_elastica": "discovery.theory.prediction:predict",
    "predict_motion": "discovery.estimation.predict:predict",
    "read_recording": "discovery.recordings.recording:read_recording",
    "read_rig": "discovery.rigs.rig_file:read_rig",
    "run": "discovery.runs.pipeline:run",
    "sample": "discovery.posterior.sampling:sample",
    "to_json": "discovery.export:to_json",
    "to_latex": "discovery.export:to_latex",
    "to_numpy": "discovery.export:to_numpy",
    "to_sympy": "discovery.export:to_sympy",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        from discovery.foundation.errors import suggestion

        raise AttributeError(f"module {__name__!r} has no attribute {name!r}.{suggestion(name, _HOMES)}", name=name)
    home, _, attribute = _HOMES[name].partition(":")
    value = globals()[name] = getattr(_import_module(home), attribute)
    return value


def __dir__() -> list[str]:
    return sorted({*(n for n in globals() if n.startswith("__")), *_HOMES})
