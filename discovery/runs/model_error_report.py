"""The error that a model keeps beside the noise, as loop.json tells it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

__all__ = ["ModelErrorReport"]


@dataclass(frozen=True)
class ModelErrorReport:
    """The error that a model keeps beside the noise.

    Parameters
    ----------
    before, after : float
        Size for the declared and for the final model [unit of the output].
    unit : str
        That unit.
    share : float
        After over before.
    least : float
        Size up to which it counts as none [unit of the output].
    held : float
        Size for the final model on the held-out recordings [unit of the output]; zero without any.
    depends_on : tuple of str
        States that explain a part of what the final model leaves, the strongest first.
    """

    before: float
    after: float
    unit: str
    share: float
    least: float
    held: float
    depends_on: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {**asdict(self), "depends_on": list(self.depends_on)}
