"""What is known of measured recordings beforehand: ``known.toml`` beside their rig files, one table a rig file."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from discovery.foundation.errors import InputError

#: How an error is stated: its rms, its rms over that of the signal, or over the signal's standard deviation.
Measure = Literal["rms", "relative", "normalised"]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Figure(_Table):
    """Errors that others reached, in the unit of the rig's table.

    Attributes
    ----------
    model, source : str
        What was fitted, and where the figure is from.
    errors : mapping of str to float
        By group: "train", "holdout", "continued" (held out, run on from the training part without a new initial state),
        "both", or the name of a recording that is only scored.
    comparable : bool
        Whether they were reached on the same samples, through the same filter and from the same input; others are shown
        and never counted.
    """

    model: str
    source: str
    errors: Mapping[str, float]
    comparable: bool = True


class Goal(_Table):
    """What a good result is, stated before the loop is run.

    Attributes
    ----------
    errors : mapping of str to float
        Largest error by group, in the unit of the rig's table.
    named : tuple of tuple of str
        Effects that must be added; of each inner tuple, one.
    not_named : tuple of str
        Effects that must not be.
    verdict : tuple of str
        Verdicts of which the loop must say one; any where there are none.
    fewer_parameters_than : int or None
        Free physical parameters of the final model.
    gravity_over_length : float or None
        Largest relative distance of a pendulum's fitted g/L from that of its geometry.
    seconds : float or None
        That the loop may take.
    """

    errors: Mapping[str, float] = {}
    named: tuple[tuple[str, ...], ...] = ()
    not_named: tuple[str, ...] = ()
    verdict: tuple[str, ...] = ()
    fewer_parameters_than: int | None = None
    gravity_over_length: float | None = None
    seconds: float | None = None


class Reference(_Table):
    r"""A reference model of a drive, F = M q'' + F_v q' + F_c sign(q') + F_0.

    Attributes
    ----------
    source : str
    mass, viscous, coulomb, offset : float
        M [kg], F_v [N s/m], F_c [N], F_0 [N].
    """

    source: str
    mass: float
    viscous: float
    coulomb: float
    offset: float


class Known(_Table):
    """What is known of one rig's recordings.

    Attributes
    ----------
    measure : Measure
        How errors are stated.
    unit : str
        Unit of an rms in this table and on the page; empty for that of the output. Relative errors are in per cent.
    figures : tuple of Figure
    goal : Goal
    regression : Goal
        What a run must still reach where the goal is not reached yet: stands in the place of the same keys of the goal,
        of `errors` group by group. An infinite limit is none.
    reference : Reference or None
    remarks : tuple of str
        Sentences that a reader needs.
    """

    measure: Measure = "rms"
    unit: str = ""
    figures: tuple[Figure, ...] = ()
    goal: Goal = Goal()
    regression: Goal = Goal()
    reference: Reference | None = None
    remarks: tuple[str, ...] = ()

    @property
    def bounds(self) -> Goal:
        """What a run that falls short of it makes worse: the goal, or what stands in its place."""
        stated = {name: getattr(self.regression, name) for name in self.regression.model_fields_set}
        errors = {**self.goal.errors, **self.regression.errors}
        stated["errors"] = {group: limit for group, limit in errors.items() if math.isfinite(limit)}
        return self.goal.model_copy(update=stated)


def read_known(rig: Path) -> Known:
    """Return what is known of the recordings of a rig file; nothing where no ``known.toml`` speaks of it.

    Raises
    ------
    InputError
        If ``known.toml`` cannot be read.
    """
    path = rig.with_name("known.toml")
    if not path.exists():
        return Known()
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        return Known.model_validate(table.get(rig.stem, {}))
    except (tomllib.TOMLDecodeError, ValidationError) as error:
        raise InputError(f"{path}, table of {rig.name}: {error}") from None
