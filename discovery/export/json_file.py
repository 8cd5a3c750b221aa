"""A model with its numbers as JSON, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

from discovery.export.fitted import FittedModel, fitted_model
from discovery.export.latex import latex_lines
from discovery.export.symbolic import equation_text
from discovery.foundation.errors import InputError

if TYPE_CHECKING:
    from discovery.equations.model import Model
    from discovery.estimation.fit import Fit

#: Version of the layout in docs/EXPORT.md; it grows when a field changes its meaning or goes.
SCHEMA_VERSION = 1
_SCHEMA = "discovery-model"


def to_json(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> str:
    """Return a model as JSON text, laid out as docs/EXPORT.md says; `from_json` reads it.

    Parameters
    ----------
    source : FittedModel, Fit or Model
        What to export.
    values : mapping of str to float, optional
        Numbers that replace those of `source`.

    Raises
    ------
    InputError
        If a parameter has no value.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    >>> values = {"xi": 0.16, "alpha": 400.0, "g": 0.0}  # s^-1, s^-2
    >>> from_json(to_json(model, values)).model == model
    True
    """
    found = fitted_model(source, values)
    content = {
        "schema": _SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "system": found.model.mechanics.system,
        **found.to_dict(),
        "equation": {
            "text": list(equation_text(found.model)),
            "latex": [line.latex for line in latex_lines(found.model)],
        },
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def from_json(text: str) -> FittedModel:
    """Return the model that `to_json` wrote.

    Parameters
    ----------
    text : str
        The JSON itself, not the path of its file.

    Raises
    ------
    InputError
        If the text is not such JSON, such as a path, or of a newer layout.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    >>> values = {"xi": 0.16, "alpha": 400.0, "g": 0.0}  # s^-1, s^-2
    >>> from_json(to_json(model, values)).values["alpha"]
    400.0
    """
    if not str(text).lstrip().startswith(("{", "[")):
        raise InputError(
            "`from_json` reads text, not a path, and this is no model.json; pass `Path(path).read_text()`."
        )
    try:
        content = json.loads(text)
        if content["schema"] != _SCHEMA:
            raise InputError(
                f"The JSON is a {content['schema']!r}, not a {_SCHEMA!r}. Write it with `discovery export`."
            )
        if content["schema_version"] > SCHEMA_VERSION:
            raise InputError(
                f"The model has layout {content['schema_version']}, newer than {SCHEMA_VERSION}. Update discovery."
            )
        return FittedModel.from_dict(content)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"The text is not a model as `discovery export` writes it ({error!r}). Export it again."
        ) from None
