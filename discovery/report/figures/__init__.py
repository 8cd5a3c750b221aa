"""The figures of the report by what they show: functions of a run's result files."""

from __future__ import annotations

from collections.abc import Callable

from discovery.report.ambiguity import draw_manoeuvres
from discovery.report.figures import laws, motion, posterior, predictions, search
from discovery.report.figures.residual import draw_bode, draw_correlogram, draw_residual, draw_spectrum
from discovery.report.latent import draw_force, draw_map, draw_states
from discovery.report.results import Run
from discovery.report.style import Picture, styled

Draw = Callable[[Run], Picture | list[Picture] | None]
#: Which figures a section of the page shows.
SECTIONS: dict[str, tuple[Draw, ...]] = {
    "first": (predictions.draw_comparison,),
    "answer": (predictions.draw_errors,),
    "data": (motion.draw_motion, motion.draw_deflections, motion.draw_phase),
    "equation": (search.draw_inclusion,),
    "parameters": (posterior.draw_corner,),
    "marginals": (posterior.draw_marginals,),
    "correlations": (posterior.draw_correlations,),
    "chains": (posterior.draw_chains,),
    "coverage": (predictions.draw_bands,),
    "elastica": (laws.draw,),
    "residual": (draw_residual, draw_correlogram, draw_spectrum, motion.draw_amplitude, draw_bode),
    "steps": (search.draw_model_error,),
    "odds": (search.draw_odds,),
    "story": (search.draw_ranking,),
    "undecided": (draw_manoeuvres,),
    "unexplained": (draw_force, draw_states, draw_map),
    "predictions": (predictions.draw_histories,),
}


def draw_all(run: Run) -> dict[str, list[Picture]]:
    """Return the pictures of every section; those for which the run has no data are left out."""
    with styled():
        drawn = {section: [draw(run) for draw in functions] for section, functions in SECTIONS.items()}
    return {
        section: [p for each in found for p in (each if isinstance(each, list) else [each]) if p is not None]
        for section, found in drawn.items()
    }
