"""How a parameter of a fit is told to a reader."""

from __future__ import annotations

from typing import Any

from discovery.estimation.fit import Fit
from discovery.estimation.physical import physical_rows


def as_read(fitted: Fit, name: str) -> dict[str, Any]:
    """Return value, sd and unit, JSON-ready: in newtons where a force is read, elsewhere these as `physical` beside."""
    row, physical = fitted.told(name), physical_rows(fitted.physical).get(name)
    if physical is None:
        return row
    return {**row, **(physical if fitted.model.mechanics.prescribed else {"physical": physical})}
