"""Spring law and radius law over the elastica's."""

from __future__ import annotations

from discovery.report.results import Run
from discovery.report.style import BLUE, GREEN, ORANGE, Picture, new_figure

__all__ = ["draw"]


def draw(run: Run) -> list[Picture]:
    """Return both laws, each with what it departs from taken off so that small differences show."""
    laws = run.open("laws.nc", "laws")
    if laws is None:
        return []
    delta = laws["delta"].to_numpy()
    reach = float(laws.attrs.get("delta_max", delta[-1]))

    def band(name: str, kind: str):
        return [laws[f"{name}_{kind}_{q}"].to_numpy() for q in ("q05", "q50", "q95")]

    pictures = []
    if "posterior_spring_q50" in laws:
        figure = new_figure(4.2)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        low, middle, high = band("posterior", "spring")
        for axis, base in ((top, 0.0), (bottom, delta)):
            axis.fill_between(delta, low - base, high - base, color=BLUE, alpha=0.35, linewidth=0)
            axis.plot(delta, middle - base, color=BLUE, linewidth=1.2, label="posterior, 90 % band")
            axis.plot(
                delta, laws["elastica_spring"] - base, color=ORANGE, linestyle=(0, (4, 1.6)), label="elastica, force"
            )
            if "elastica_torque" in laws:
                axis.plot(
                    delta,
                    laws["elastica_torque"] - base,
                    color=GREEN,
                    linestyle=(0, (1, 1.2)),
                    label="elastica, torque",
                )
            axis.axvspan(reach, delta[-1], color="#EEEEEE", zorder=0)
        top.set_ylabel("spring law [rad]")
        bottom.set_ylabel("minus δ [rad]")
        bottom.set_xlabel("deflection δ [rad]")
        handles, names = top.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper left", ncols=2)
        pictures.append(
            Picture(
                "spring_law",
                figure,
                "Spring law over its linear stiffness, δ + (β/α) δ³, with the elastica’s. "
                f"Grey: beyond the trained {reach:.2f} rad.",
                "Restoring force against deflection: posterior band of the discovered law and the elastica’s; "
                "below, without the linear part.",
            )
        )
    if "posterior_radius_q50" in laws:
        figure = new_figure(4.2)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        low, middle, high = band("posterior", "radius")
        elastica = laws["elastica_radius"].to_numpy()
        measured = run.open("laws.nc", "measured")
        if measured is not None:
            size = abs(measured["delta"].to_numpy())
            top.plot(
                size,
                measured["rho"].to_numpy(),
                ".",
                color="black",
                markersize=2,
                alpha=0.4,
                label="measured",
                rasterized=True,
            )
        for axis, base in ((top, 0.0), (bottom, elastica)):
            axis.fill_between(delta, low - base, high - base, color=BLUE, alpha=0.35, linewidth=0)
            axis.plot(delta, middle - base, color=BLUE, linewidth=1.2, label="posterior, 90 % band")
            axis.plot(delta, elastica - base, color=ORANGE, linestyle=(0, (4, 1.6)), label="elastica")
            axis.axvspan(reach, delta[-1], color="#EEEEEE", zorder=0)
        top.set_ylabel("radius ρ/l [–]")
        bottom.set_ylabel("minus elastica [–]")
        bottom.set_xlabel("deflection δ [rad]")
        handles, names = top.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper left", ncols=2, markerscale=3)
        pictures.append(
            Picture(
                "radius_law",
                figure,
                "Radius law cos(γδ) with the elastica’s and the measured radius. "
                f"Grey: beyond the trained {reach:.2f} rad.",
                "Radius of the tip over the arm’s length against deflection: measured points, posterior band and "
                "elastica; below, differences.",
            )
        )
    return pictures
