"""The exceptions of the package: one small family, each carrying the numbers that explain it.

The command line turns an :class:`InputError` into exit status 2 and a :class:`ComputationError` into exit status 3.
Everything else that escapes is a defect of the program. :func:`suggestion` ends the message on an unknown name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


class DiscoveryError(Exception):
    """Base of every error that this package raises on purpose."""


class InputError(DiscoveryError):
    """A file or an argument cannot be used.

    The message is one paragraph that names the file, the column and the row where they are known, and the remedy.

    Examples
    --------
    >>> try:
    ...     read_rig("nowhere.toml")
    ... except InputError as error:
    ...     print(str(error).partition(":")[0])
    The rig file nowhere.toml cannot be read
    """


class ComputationError(DiscoveryError):
    """The input is fine, but the computation could not be completed."""


class SimulationFailure(ComputationError):
    """A trajectory left the range of finite numbers.

    Parameters
    ----------
    parameters : mapping of str to float
        The parameter set that was simulated, by name, in SI units.
    time : float
        Time of the first state that is not finite [s].
    reason : str
        What happened, as a sentence.
    """

    def __init__(self, parameters: Mapping[str, float], time: float, reason: str) -> None:
        self.parameters = dict(parameters)
        self.time = float(time)
        self.reason = reason
        # What is zero is mostly an effect that the model lacks.
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.parameters.items() if value != 0.0)
        super().__init__(f"The simulation failed at t = {self.time:.6g} s: {reason} Parameters: {values or 'none'}.")

    def __reduce__(self) -> tuple[type[SimulationFailure], tuple[dict[str, float], float, str]]:
        return type(self), (self.parameters, self.time, self.reason)


class NotConverged(ComputationError):
    """A sampler or an iteration stopped before its result can be trusted.

    Parameters
    ----------
    message : str
        What did not converge, and what to do about it.
    tau : mapping of str to float, optional
        Integrated autocorrelation time of each parameter, in steps.
    ess : mapping of str to float, optional
        Effective number of samples of each parameter.
    r_hat : mapping of str to float, optional
        Root of the pooled variance over that within independent ensembles, of each parameter: 1 where they agree.
    """

    def __init__(
        self,
        message: str,
        *,
        tau: Mapping[str, float] | None = None,
        ess: Mapping[str, float] | None = None,
        r_hat: Mapping[str, float] | None = None,
    ) -> None:
        self.message = message
        self.tau = dict(tau or {})
        self.ess = dict(ess or {})
        self.r_hat = dict(r_hat or {})
        diagnostics = (("autocorrelation time", self.tau), ("effective samples", self.ess), ("R-hat", self.r_hat))
        numbers = [
            f"{label} " + ", ".join(f"{name} {value:.4g}" for name, value in values.items())
            for label, values in diagnostics
            if values
        ]
        super().__init__(" ".join([message, *(f"[{text}]" for text in numbers)]))


class NotIdentifiable(ComputationError):
    """The data leave some combination of parameters undetermined.

    Parameters
    ----------
    directions : sequence of mapping of str to float
        Null directions: the unit vector of each, by parameter name.
    message : str, optional
        What was attempted.
    """

    def __init__(
        self, directions: Sequence[Mapping[str, float]], message: str = "The data do not determine all parameters."
    ) -> None:
        self.directions = tuple(dict(direction) for direction in directions)
        self.message = message
        texts = [
            " ".join(f"{weight:+.3g} {name}" for name, weight in direction.items() if abs(weight) > 1e-3)
            for direction in self.directions
        ]
        super().__init__(" ".join([message, *(f"[undetermined: {text}]" for text in texts)]))


def suggestion(word: str, known: Iterable[str]) -> str:
    """Say "Did you mean ...?" where a known word is close to the one that was given, else nothing."""
    import difflib

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else ""
