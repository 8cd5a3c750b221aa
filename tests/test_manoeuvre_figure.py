"""The picture of a release that tells rivals apart."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from discovery.report.ambiguity import draw_manoeuvres
from discovery.report.style import render, styled

LONG = ["viscoelastic_relaxation_at_pivot", "amplitude_dependent_damping_at_pivot", "friction_through_play_at_pivot"]


@pytest.mark.parametrize("rivals", [LONG, LONG[:2], ["quadratic_drag", "cubic_stiffness"]])
def test_the_names_of_rivals_leave_room_for_their_curves(rivals: list[str]) -> None:
    """A legend wider than the figure left none, which matplotlib warns of."""
    time = np.linspace(0.0, 1.0, 50)
    predicted = np.column_stack([time, *(np.cos((6 + i) * time) for i in range(len(rivals)))]).tolist()
    told = {"decides": True, "rivals": rivals, "clusters": [[name] for name in rivals]}
    design = {**told, "moves": [], "predicted": predicted, "release": 0.3, "unit": "rad/s"}
    with styled():
        (picture,) = draw_manoeuvres(SimpleNamespace(loop={"separation": [design]}))
        render(picture)
    above = picture.figure.axes[0]
    legend = above.get_legend().get_window_extent()
    assert above.get_window_extent().width > 0.6 * picture.figure.bbox.width
    assert picture.figure.bbox.x0 <= legend.x0 < legend.x1 <= picture.figure.bbox.x1
