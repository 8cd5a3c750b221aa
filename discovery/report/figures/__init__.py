"""The figures of the report, one file each: functions of a run's result files."""

from __future__ import annotations

from collections.abc import Callable

from discovery.report import latent
from discovery.report.figures import (
    amplitude,
    bands,
    bode,
    chains,
    comparison,
    corner_plot,
    correlation,
    correlogram,
    distortion,
    errors,
    inclusion,
    laws,
    manoeuvre,
    marginals,
    model_error,
    motion,
    odds,
    phase,
    ranking,
    residual,
    time_history,
)
from discovery.report.results import Run
from discovery.report.style import Picture, styled

Draw = Callable[[Run], Picture | list[Picture] | None]
#: Which figures a section of the page shows.
SECTIONS: dict[str, tuple[Draw, ...]] = {
    "first": (comparison.draw,),
    "answer": (errors.draw,),
    "data": (motion.draw, motion.draw_deflections, phase.draw, distortion.draw),
    "equation": (inclusion.draw,),
    "parameters": (corner_plot.draw,),
    "marginals": (marginals.draw,),
    "correlations": (correlation.draw,),
    "chains": (chains.draw,),
    "coverage": (bands.draw,),
    "elastica": (laws.draw,),
    "residual": (residual.draw, correlogram.draw, residual.draw_spectrum, amplitude.draw, bode.draw),
    "steps": (model_error.draw,),
    "odds": (odds.draw,),
    "story": (ranking.draw,),
    "undecided": (manoeuvre.draw,),
    "unexplained": (latent.draw_time, latent.draw_states, latent.draw_map),
    "predictions": (time_history.draw,),
}


def draw_all(run: Run) -> dict[str, list[Picture]]:
    """Return the pictures of every section; those for which the run has no data are left out."""
    found: dict[str, list[Picture]] = {}
    with styled():
        for section, functions in SECTIONS.items():
            pictures: list[Picture] = []
            for function in functions:
                drawn = function(run)
                pictures += drawn if isinstance(drawn, list) else [] if drawn is None else [drawn]
            found[section] = pictures
    return found
