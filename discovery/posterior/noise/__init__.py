"""What the errors of readings are like beside Gaussian and white: outliers, correlation, a noisy input, rounding.

One file a model; a new one is added to `NOISE_MODELS`. Every model has its parameters for each instrument: a size, and
what is particular to it.
"""

from __future__ import annotations

from collections.abc import Sequence

from discovery.estimation.problem import Problem
from discovery.foundation.arguments import expect
from discovery.foundation.errors import InputError, suggestion
from discovery.posterior.noise.correlated import Correlated
from discovery.posterior.noise.input_noise import InputNoise
from discovery.posterior.noise.model import GaussianErrors, Instrument
from discovery.posterior.noise.model import Noise as Noise
from discovery.posterior.noise.model import NoiseParameter as NoiseParameter
from discovery.posterior.noise.quantised import Quantised
from discovery.posterior.noise.student_t import StudentT

#: Independent Gaussian errors, whose likelihood needs chi-square alone.
GAUSSIAN = "gaussian"
NOISE_MODELS: dict[str, type[Noise]] = {model.name: model for model in (StudentT, Correlated, InputNoise, Quantised)}


def words_of(name: str) -> str:
    """Return what the noise model of a name takes errors as."""
    return "independent and Gaussian" if name == GAUSSIAN else _model(name).words


def errors_of(name: str) -> type[Noise] | type[GaussianErrors]:
    """Return what draws and weighs the error of one reading under the noise model of a name."""
    return GaussianErrors if name == GAUSSIAN else _model(name)


def is_independent(name: str) -> bool:
    """Return whether errors of different readings are independent under the noise model of a name."""
    return name == GAUSSIAN or _model(name).independent


def _model(name: str) -> type[Noise]:
    expect(name, str, "noise", f"Give one of {', '.join([GAUSSIAN, *NOISE_MODELS])}.")
    if name not in NOISE_MODELS:
        known = [GAUSSIAN, *NOISE_MODELS]
        raise InputError(f"There is no noise model {name!r}; there are {', '.join(known)}.{suggestion(name, known)}")
    return NOISE_MODELS[name]


def noise_of(name: str, problem: Problem, parts: Sequence[Instrument]) -> tuple[Noise, ...]:
    """Return the noise of every instrument; nothing for the Gaussian.

    A name that is not known, or does not apply to these recordings, is refused.
    """
    if name == GAUSSIAN:
        return ()
    found = [_model(name).of(problem, part) for part in parts]
    models = tuple(model for model in found if model is not None)
    if len(models) < len(found):
        raise InputError(
            f"Noise model {name!r} does not apply to these recordings: it needs {_model(name).needs}; these apply: "
            f"{', '.join(applicable(problem, parts))}."
        )
    return models


def applicable(problem: Problem, parts: Sequence[Instrument]) -> tuple[str, ...]:
    """Return the names of the noise models that apply to every instrument, the Gaussian first."""
    fitting = [n for n, model in NOISE_MODELS.items() if all(model.of(problem, part) is not None for part in parts)]
    return GAUSSIAN, *fitting
