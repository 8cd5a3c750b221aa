"""The figures of the reproduction page, one file each: functions of a study's numbers and curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from benchmarks.paper.figures import (
    claims,
    dynamics,
    errors,
    ladder,
    motor,
    normalisation,
    recording,
    responses,
    sensitivity,
    statics,
)
from benchmarks.paper.figures.look import FloatArray
from discovery.report.style import Picture, styled

__all__ = ["SECTIONS", "draw_all"]

Draw = Callable[[Mapping[str, Any], Mapping[str, Any]], list[Picture]]
#: Which figures a section of the page shows, and the study that they need.
SECTIONS: dict[str, tuple[str | None, tuple[Draw, ...]]] = {
    "figures": (
        "comparison",
        (
            recording.draw_cartesian,
            recording.draw_polar,
            errors.draw_angle,
            errors.draw_radius,
            errors.draw_position,
            responses.draw,
        ),
    ),
    "steps": ("steps", (ladder.draw_ladder, ladder.draw_freed)),
    "sensitivity": ("sensitivity", (sensitivity.draw,)),
    "claims": ("claims", (claims.draw_ratios, claims.draw_friction)),
    "normalisation": ("normalisation", (normalisation.draw,)),
    "statics": (None, (statics.draw_shapes, statics.draw_laws)),
    "dynamics": ("dynamics", (dynamics.draw_limit, dynamics.draw_motion)),
    "motor": ("motor", (motor.draw_torque, motor.draw_driven, motor.draw_gear)),
}
#: Studies with curves.
_DRAW_CURVES = ("comparison", "dynamics", "motor")
#: What a caption of Figures 5 to 13 says of the twin.
_CALIBRATIONS = {
    "printed": "Twin with the stiffness of the paper’s tables.",
    "calibrated": "Twin with its stiffness adjusted to the paper’s α.",
}


def draw_all(
    results: Mapping[str, Any],
    curves: Callable[[str], Mapping[str, Mapping[str, FloatArray]]],
    *,
    calibration: str = "printed",
) -> dict[str, list[Picture]]:
    """Draw the figures of every section; those whose study is missing are left out.

    Parameters
    ----------
    results : mapping
        Numbers by study, as ``studies.json`` has them.
    curves : callable
        Returns the arrays of a study by group and name; called only for studies whose figures draw curves.
    calibration : {"printed", "calibrated"}
        The twin of Figures 5 to 13: its stiffness as the paper prints it, or adjusted to the paper's alpha.

    Returns
    -------
    dict of str to list of Picture
        Pictures by section of the page.
    """
    found: dict[str, list[Picture]] = {}
    with styled():
        for section, (study, functions) in SECTIONS.items():
            found[section] = []
            if study is not None and study not in results:
                continue
            numbers: Mapping[str, Any] = results[study] if study else {}
            groups: Mapping[str, Any] = curves(study) if study in _DRAW_CURVES else {}
            if study == "comparison":
                numbers, groups = numbers[calibration], groups[calibration]
            for draw in functions:
                found[section] += draw(numbers, groups)
    twin = _CALIBRATIONS[calibration]
    found["figures"] = [replace(p, caption=f"{p.caption} {twin}") for p in found["figures"]]
    return found
