"""Spring law and radius law over the elastica's."""

from __future__ import annotations

from typing import Any

from discovery.report.results import Run
from discovery.report.style import BLUE, DASHED, DOTTED, GREEN, ORANGE, Picture, new_figure

_FORCE = {"color": ORANGE, "linestyle": DASHED}
_TORQUE = {"color": GREEN, "linestyle": DOTTED}


def draw(run: Run) -> list[Picture]:
    """Return both laws, each with what it departs from taken off so that small differences show."""
    laws = run.open("laws.nc", "laws")
    if laws is None:
        return []
    pictures = []
    if "posterior_spring_q50" in laws:
        pictures.append(_spring(laws))
    if "posterior_radius_q50" in laws:
        pictures.append(_radius(laws, run.open("laws.nc", "measured")))
    return pictures


def _spring(laws: Any) -> Picture:
    curves = [(laws["elastica_spring"], {**_FORCE, "label": "elastica, force"})]
    if "elastica_torque" in laws:
        curves.append((laws["elastica_torque"], {**_TORQUE, "label": "elastica, torque"}))
    figure, (top, bottom), reach = _panels(laws, "spring", laws["delta"].to_numpy(), curves)
    top.set_ylabel("spring law [rad]")
    bottom.set_ylabel("minus δ [rad]")
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return Picture(
        "spring_law",
        figure,
        "Spring law over its linear stiffness, δ + (β/α) δ³, with the elastica’s. "
        f"Grey: beyond the trained {reach:.2f} rad.",
        "Restoring force against deflection: posterior band of the discovered law and the elastica’s; "
        "below, without the linear part.",
    )


def _radius(laws: Any, measured: Any) -> Picture:
    elastica = laws["elastica_radius"].to_numpy()
    figure, (top, bottom), reach = _panels(laws, "radius", elastica, [(elastica, {**_FORCE, "label": "elastica"})])
    if measured is not None:
        points = {"color": "black", "markersize": 2, "alpha": 0.4, "label": "measured", "rasterized": True}
        top.plot(abs(measured["delta"].to_numpy()), measured["rho"].to_numpy(), ".", zorder=1.9, **points)
    top.set_ylabel("radius ρ/l [–]")
    bottom.set_ylabel("minus elastica [–]")
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2, markerscale=3)
    return Picture(
        "radius_law",
        figure,
        f"Radius law cos(γδ) with the elastica’s and the measured radius. Grey: beyond the trained {reach:.2f} rad.",
        "Radius of the tip over the arm’s length against deflection: measured points, posterior band and "
        "elastica; below, differences.",
    )


def _panels(laws: Any, law: str, taken_off: Any, curves: list[tuple[Any, dict[str, Any]]]):
    """Return a figure with the posterior's band and curves, whole above and less a law below, and the trained reach."""
    delta = laws["delta"].to_numpy()
    reach = float(laws.attrs.get("delta_max", delta[-1]))
    low, middle, high = (laws[f"posterior_{law}_{q}"].to_numpy() for q in ("q05", "q50", "q95"))
    figure = new_figure(4.2)
    axes = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for axis, base in zip(axes, (0.0, taken_off), strict=True):
        axis.fill_between(delta, low - base, high - base, color=BLUE, alpha=0.35, linewidth=0)
        axis.plot(delta, middle - base, color=BLUE, linewidth=1.2, label="posterior, 90 % band")
        for values, style in curves:
            axis.plot(delta, values - base, **style)
        axis.axvspan(reach, delta[-1], color="#EEEEEE", zorder=0)
    axes[1].set_xlabel("deflection δ [rad]")
    return figure, axes, reach
