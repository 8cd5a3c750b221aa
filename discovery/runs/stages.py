"""The stages of a run: each a function of its inputs and a seed, whose result is saved to files of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import SeedSequence

from discovery.declarations.system import System
from discovery.diagnosis.missing_force import MissingForce, missing_force
from discovery.equations.model import Model
from discovery.estimation.declared import declared_model, first_fit
from discovery.estimation.fit import Fit, fit
from discovery.estimation.holdout import HoldOut
from discovery.estimation.natural_units import natural_units
from discovery.estimation.residual import errors
from discovery.estimation.step import TOLERANCE
from discovery.foundation.arrays import FloatArray, within_half_a_turn
from discovery.foundation.errors import ComputationError
from discovery.foundation.progress import Tell, silent
from discovery.foundation.sampling import gaps
from discovery.posterior.noise import GAUSSIAN, words_of
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import largest_deflection, make_experiment
from discovery.rigs.kinds import KINDS, LINEAR_MODEL
from discovery.runs.failed_loop import LoopFailure, failed_loop
from discovery.runs.loop import close_loop
from discovery.runs.loop_result import LoopResult
from discovery.selection.settings import LoopSettings

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior
    from discovery.posterior.model_comparison import NoiseChoice
    from discovery.posterior.study import PosteriorStudy

_ORDER = ("discover", "posterior", "predictive", "elastica", "loop", "evidence")


@dataclass(frozen=True)
class Fits:
    """Output-error fits of the linear and of the declared model, each with its predictions of the training recordings.

    Labels are "linear" (where the system has a rest position), "constant_radius" (an arm's declared model without the
    radius law) and "declared". Errors on the training recordings are those of the "position" and, for an arm, of the
    "angle" and the "radius".
    """

    models: Mapping[str, Fit]
    predictions: Mapping[str, list[FloatArray]]
    errors: Mapping[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return what results.json holds of the fits."""
        return {"fits": {k: f.summary() for k, f in self.models.items()}, "fit_errors": dict(self.errors)}


def estimate(dataset: Dataset, *, progress: Tell = silent) -> Fits:
    """Fit the declared model to the training recordings, and simpler ones: those that blow up are left out."""
    train = dataset.train
    units = natural_units(train)
    declared = declared_model(train[0])
    plans: dict[str, tuple[str, ...]] = {}
    if not KINDS[train[0].rig.kind].may_be_bare:
        plans["linear"] = LINEAR_MODEL
    if train[0].system.has_rod and "radius_law" in declared.effects:
        plans["constant_radius"] = tuple(e for e in declared.effects if e != "radius_law")
    plans["declared"] = declared.effects
    models, predictions, found = {}, {}, {}
    start: dict[str, float] = {}
    for label, effects in plans.items():
        progress(f"fitting the {label.replace('_', ' ')} model")
        try:
            model = Model(declared.base, effects, declared.known)
            own = {n: v for n, v in start.items() if n in model.parameters}
            models[label] = fit(model, train, units=units, start=own)
        except ComputationError:
            if label != "declared":
                continue
            models[label] = first_fit(train, units)
        start = models[label].own_values
        predictions[label] = models[label].predict()
        found[label] = _fit_errors(train, predictions[label])
    return Fits(models, predictions, found)


def _fit_errors(train, predictions) -> dict[str, Any]:
    measured = np.concatenate([e.recording.judged_output[e.fitted] for e in train])
    predicted = np.concatenate([p[e.fitted] for e, p in zip(train, predictions, strict=True)])
    found: dict[str, Any] = {"position": errors(predicted, measured)}
    if train[0].recording.channels == ("tip_x", "tip_y"):
        angle = np.arctan2(predicted[:, 1], predicted[:, 0]) - np.arctan2(measured[:, 1], measured[:, 0])
        found["angle"] = errors(within_half_a_turn(angle)[:, None], np.zeros((angle.size, 1)))
        radius = np.hypot(*predicted.T) - np.hypot(*measured.T)
        found["radius"] = errors(radius[:, None], np.zeros((radius.size, 1)))
    return found


def weighed(fitted: Fit, *, seed: int = 1, progress: Tell = silent) -> NoiseChoice:
    """Weigh the noise models that apply to the recordings of a fit by their evidence."""
    from discovery.posterior.model_comparison import choose_noise

    return choose_noise(fitted, seed=stage_seed(seed, "evidence"), progress=progress)


def sampled(fitted: Fit, *, seed: int = 1, progress: Tell = silent, backend=None, noise: str = GAUSSIAN) -> Posterior:
    """Sample the posterior of a fitted model under a noise model."""
    from discovery.posterior.sampling import sample

    progress(f"sampling the posterior, errors {words_of(noise)}")
    return sample(fitted, seed=stage_seed(seed, "posterior"), noise=noise, progress=progress, backend_path=backend)


def studied(
    posterior: Posterior, fitted: Fit, dataset: Dataset, *, seed: int = 1, progress: Tell = silent
) -> PosteriorStudy:
    """Study a posterior: priors, profiles, correlations, chains, and predictive bands of every recording."""
    from discovery.posterior.study import LONGEST_BAND, study_posterior

    progress("profile likelihoods and predictive bands")
    rng = np.random.default_rng(stage_seed(seed, "predictive"))
    study = study_posterior(posterior, fitted, dataset.holdout, rng=rng)
    banded = {band.name for band in study.bands}
    for e in dataset.holdout:
        if e.recording.name not in banded and e.recording.time.size <= LONGEST_BAND:
            progress(f"no predictive band of {e.recording.name}: the fitted motion blows up there")
    return study


def compared(fitted: Fit, loop: LoopResult, *, seed: int = 1, progress: Tell = silent) -> dict[str, Any]:
    """Weigh noise models of a fit, and the models before and after the loop, by their evidence."""
    from discovery.posterior.likelihood import undetermined_parameters
    from discovery.posterior.model_comparison import compare_models

    noise = weighed(fitted, seed=seed, progress=progress).summary()
    models = {"before": loop.before, "after": loop.after}
    if loop.before.model == loop.after.model or any(map(undetermined_parameters, models.values())):
        return {"noise": noise, "evidence": None}
    progress("weighing the models before and after by their evidence")
    held = {label: loop.errors[label]["holdout"]["rms"] for label in models}
    # What the smaller model lacks is correlated: white noise would count every sample of it.
    compared = compare_models(models, seed=stage_seed(seed, "evidence"), noise="correlated", held_out=held)
    return {"noise": noise, "evidence": compared.summary()}


def predicted(dataset: Dataset, posterior, *, seed: int = 1, progress: Tell = silent) -> dict[str, Any] | None:
    """Compare a posterior with the elastica's prediction from the rig file; None where the rig does not allow it."""
    from discovery.theory.prediction import predict

    rig = dataset.rig
    if not System.of(rig.kind).has_rod or None in (rig.flexural_rigidity, rig.tip_mass, rig.length, rig.beam_mass):
        return None
    progress("checking against the elastica")
    rng = np.random.default_rng(stage_seed(seed, "elastica"))
    if dataset.train:
        deflection = np.concatenate([e.deflection[e.fitted] for e in dataset.train])
        prediction = predict(rig, rng, delta_max=largest_deflection(dataset.train), deflection=deflection)
    else:
        prediction = predict(rig, rng)
    return {
        "prediction": [asdict(row) for row in prediction.summary()],
        "comparison": [asdict(row) for row in prediction.compare(posterior.flat())] if posterior is not None else [],
        "delta_max": prediction.delta_max,
    }


def loop(dataset: Dataset, *, seed: int = 1, follow_up: bool = True, progress: Tell = silent) -> LoopResult:
    """Close the loop on a data set; raise LoopFailure, with what can be told, where the declared model has no fit."""
    settings = LoopSettings(seed=stage_seed(seed, "loop"), follow_up=follow_up)
    try:
        return close_loop(dataset.train, dataset.holdout, settings=settings, progress=progress)
    except ComputationError as failure:
        progress("looking for why the declared model cannot be fitted")
        raise LoopFailure(failed_loop(dataset, failure)) from failure


def scored(result: LoopResult, dataset: Dataset, *, progress: Tell = silent) -> dict[str, Any]:
    """Return the errors before and after on every test recording by its name, nothing fitted but initial states."""
    found: dict[str, Any] = {}
    for e in dataset.test:
        progress(f"scoring {e.recording.name}")
        found[e.recording.name] = {"samples": int(np.isfinite(e.recording.output).all(axis=1).sum())}
        for label, fitted in (("before", result.before), ("after", result.after)):
            judge = HoldOut(dataset.train, [e], fitted.problem.units, TOLERANCE)
            ((prediction,),) = judge.predictions(fitted.problem.bench, [(fitted.model, fitted.values, [])])
            found[e.recording.name][label] = errors(prediction, e.recording.judged_output)
    return found


def continued(result: LoopResult, dataset: Dataset, *, progress: Tell = silent) -> dict[str, Any] | None:
    """Return the held-out errors before and after where the run goes on from the training part, nothing fitted anew.

    None where the hold-out is not what follows the only training recording in its file. An initial state fitted to the
    held-out part takes away the phase that a model has lost by then: this error holds it.
    """
    if len(dataset.train) != 1 or len(dataset.holdout) != 1 or result.after.model.mechanics.prescribed:
        return None
    first, second = dataset.train[0].recording, dataset.holdout[0].recording
    onward = np.append(first.time, second.time[0])
    if first.sha256 != second.sha256 or not onward[-1] > onward[-2] or gaps(onward)[-1]:
        return None
    progress("continuing into the held-out part")
    joined = replace(
        first,
        time=np.concatenate([first.time, second.time]),
        output=np.concatenate([first.output, second.output]),
        input=None if first.input is None or second.input is None else np.concatenate([first.input, second.input]),
    )
    whole = make_experiment(joined, dataset.rig)
    found = {}
    for label, fitted in (("before", result.before), ("after", result.after)):
        start = [fitted.values.get(name, 0.0) for name in whole.initial_names]
        (prediction,) = fitted.predict([whole], np.array([start]))
        found[label] = errors(prediction[first.time.size :], second.judged_output)
    return found


def unexplained(result: LoopResult, dataset: Dataset, *, progress: Tell = silent) -> MissingForce | None:
    """Return the force that the final model lacks; None where it is complete, or the file is in doubt."""
    if result.complete or result.impossible:
        return None
    if not result.after.model.mechanics.reads_pushed:
        progress(
            "no missing force: it is reconstructed where the output is itself the coordinate that a force moves, and "
            "the only one"
        )
        return None
    progress("reconstructing the missing force")
    try:
        return missing_force(result.after, dataset.holdout)
    except ComputationError as failure:
        progress(str(failure))
        return None


def stage_seed(seed: int, stage: str) -> int:
    """Return the seed of one stage, independent of the others."""
    return int(SeedSequence(seed).spawn(len(_ORDER))[_ORDER.index(stage)].generate_state(1)[0])
