"""The elastica (P1 to P3): published table, both directions of the force map, independent solver, limits and series."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from benchmarks.paper.theory.elastica.beam import tip_under_load
from benchmarks.paper.theory.elastica.force_map import load_at_tip
from benchmarks.paper.theory.elastica.series import elastica_series
from benchmarks.paper.theory.elastica.small_deflection import small_deflection_tip
from discovery.theory.elastica.static_law import fitted_law, perpendicular_law, usable_deflections

FloatArray = NDArray[np.float64]

MATTIASSON = ((1.0, 0.30172, 0.05643), (2.0, 0.49346, 0.16064), (5.0, 0.71379, 0.38763), (10.0, 0.81061, 0.55500))
"""P l^2/EI, w/l and u/l of a cantilever under a vertical load at its tip (Mattiasson, IJNME 17 (1981) 145)."""
_LOADS = ((0.5, 1.57), (3.0, 1.9), (8.0, 2.4), (20.0, 1.0), (2.0, 3.0))
_POINTS = 20_000


def boundary_value(force: float, direction: float) -> tuple[float, float]:
    """Return the tip of the elastica, in lengths, by collocation of eq. (5): no elliptic integral is used."""

    def slope(_: FloatArray, y: FloatArray) -> FloatArray:
        return np.vstack([y[1], force * np.sin(y[0] - direction), np.cos(y[0]), np.sin(y[0])])

    def ends(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0.0, 1.0, 101)
    turn = min(0.8 * direction, 0.3 * force)
    start = np.vstack([turn * s * (2 - s), turn * (2 - 2 * s), s, 0.3 * s**2])
    found = solve_bvp(slope, ends, s, start, tol=1e-9, max_nodes=20_000)
    return float(found.y[2, -1]), float(found.y[3, -1])


def statics() -> dict[str, Any]:
    """Return the numbers that the page shows of the elastica."""
    rng = np.random.default_rng(108)
    force, direction = rng.uniform(0.05, 15.0, _POINTS), rng.uniform(0.3, 2.8, _POINTS)
    tip = tip_under_load(force, direction)
    found, phi = load_at_tip(tip.radius, tip.angle)
    again = tip_under_load(found, phi)
    collocated = np.array([boundary_value(*load) for load in _LOADS])
    integrals = tip_under_load(*np.array(_LOADS).T)
    small = np.array([0.01, 0.02])
    off = np.abs(tip_under_load(small, np.pi / 2).y - small_deflection_tip(small))
    loads = np.array([row[0] for row in MATTIASSON])
    cantilever = tip_under_load(loads, np.pi / 2)
    law = fitted_law(usable_deflections(0.85))
    series = elastica_series()
    delta = np.array([0.2, 0.4, 0.85])
    exact_force, exact_radius = perpendicular_law(delta)
    return {
        "mattiasson": [
            {"load": p, "w_published": w, "w": float(y), "u_published": u, "u": float(1 - x)}
            for (p, w, u), x, y in zip(MATTIASSON, cantilever.x, cantilever.y, strict=True)
        ],
        "round_trip": float(np.hypot(again.x - tip.x, again.y - tip.y).max()),
        "collocation": float(np.hypot(collocated[:, 0] - integrals.x, collocated[:, 1] - integrals.y).max()),
        "small_deflection_order": float(np.log2(off[1] / off[0])),
        "least_squares": {"delta_max": 0.85, "ratio": law.cubic / law.stiffness, "gamma": law.gamma},
        "series": {"tangential": str(series.tangential), "radius": str(series.radius)},
        "at": [
            {"delta": float(d), "force": float(f), "rho": float(r)}
            for d, f, r in zip(delta, exact_force, exact_radius, strict=True)
        ],
    }
