"""What a rig file declares to be fitted: its model, and what may move within its uncertainty."""

from __future__ import annotations

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.problem import LIGHT_ROD, known_values
from discovery.foundation.errors import InputError
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment

#: Retardation time of an ordinary rod's material, with its standard deviation [s]: fibre composites lose 0.5 to 1 % of
#: their elastic energy per radian of a vibration at some 50 rad/s, where such a rod rings.
RETARDATION, RETARDATION_SD = 1.5e-4, 1e-4


def rig_uncertainty(experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Return what may move within its uncertainty: stated constants, or the mass and slight damping of an exact arm.

    Returns
    -------
    dict of str to (mean, sd)
        Fitted with this prior and bounded at three standard deviations, so that it cannot swallow an effect.
    """
    rig = experiment.rig
    if rig.system is not None:
        return {n: (c.value, c.sd) for n, c in rig.system.constants.items() if c.sd is not None}
    if not experiment.system.has_rod:
        return {}
    known = {"tau_r": (RETARDATION, RETARDATION_SD), "mu": (LIGHT_ROD, LIGHT_ROD)}
    if rig.beam_mass is not None and rig.tip_mass is not None and rig.beam_mass.value:
        mu = rig.beam_mass.value / rig.tip_mass.value
        spread = np.hypot(rig.beam_mass.sd / rig.beam_mass.value, rig.tip_mass.sd / rig.tip_mass.value)
        known["mu"] = (mu, mu * float(spread))
    return known


def declared_model(experiment: Experiment | Dataset) -> Model:
    """Return the model that the rig file declares, on the base of its kind.

    Parameters
    ----------
    experiment : Experiment or Dataset
        A recording of the rig, or a data set.

    Raises
    ------
    InputError
        For anything else than an experiment, such as the rig alone: a recording says whether there is an input. If a
        law of an angle is declared for an output in another unit.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> declared_model(data).effects
    ('viscous_damping', 'linear_stiffness')
    """
    if isinstance(experiment, Dataset):
        experiment = experiment.train[0]
    if not isinstance(experiment, Experiment):
        raise InputError(
            f"The declared model is that of an Experiment, not of a {type(experiment).__name__}; make one with "
            "`make_experiment(recording, rig)`, or take one of `load_dataset(rig_path, recordings).train`."
        )
    unit = experiment.coordinate_unit
    for effect in experiment.rig.declared:
        if get_effect(effect).angular and not experiment.system.has_rod and unit != "rad":
            raise InputError(f"Effect {effect} needs an angle in rad, but the coordinate is in {unit}.")
    return Model(experiment.rig.base, tuple(experiment.rig.declared), known_values(experiment))
