"""Draw the picture of the README from the result files of a run: ``python docs/draw_result.py RUN OUT.png``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

#: Colours of Okabe and Ito, which the colour-blind can tell apart, and line styles that differ too.
STYLES = {
    "linear": ("#0072b2", "-.", "linear spring, constant radius"),
    "before": ("#d55e00", "--", "the paper's model, refitted"),
    "after": ("#009e73", "-", "after the loop"),
}


def draw(run: Path, recording: str = "holdout_beyond") -> Figure:
    """Return the tip of a held-out recording and the distance of each model from it."""
    with xr.open_datatree(run / "trajectories.nc", engine="h5netcdf") as groups:
        data = groups[recording].to_dataset().load()
    time, tip = data["time"].values, data["measured"].values
    figure = Figure(figsize=(9, 5.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.3))
    upper.plot(time, tip[:, 1], color="0.1", lw=1.4, label="tip y, as the camera saw it")
    upper.plot(time, np.sin(data["input"].values), color="0.55", lw=1.2, ls=":", label="tip y of a rigid arm")
    upper.set_ylabel("tip y [m]")
    upper.legend(loc="lower right", frameon=False, ncols=2)
    upper.set_title(f"simulated arm, {recording}: a manoeuvre that no fit ever saw", loc="left", fontsize=11)
    for name, (colour, dash, label) in STYLES.items():
        distance = np.linalg.norm(data[name].values - data["clean"].values, axis=1)
        lower.semilogy(time, 1e3 * distance, color=colour, ls=dash, lw=1.1, label=f"{label}: {_mean(distance)}")
    floor = 1e3 * float(np.sqrt(np.sum(np.square(data.attrs["noise"]))))
    lower.axhline(floor, color="0.4", lw=0.9, ls=(0, (1, 2)))
    lower.text(time[0] + 0.6, 0.85 * floor, "camera noise, rms", ha="left", va="top", fontsize=9, color="0.3")
    lower.set(xlabel="time [s]", ylabel="distance to the noise-free tip [mm]", xlim=(time[0], time[-1]))
    lower.set_ylim(1e-3, 6e3)
    lower.legend(loc="upper right", frameon=False, fontsize=9, ncols=3, title="mean over the recording")
    for axes in (upper, lower):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _mean(distance: np.ndarray) -> str:
    mean = 1e3 * float(distance.mean())
    return f"{mean:.1f} mm" if mean >= 1 else f"{mean:.2g} mm"


def main() -> None:
    """Draw and write the picture."""
    draw(Path(sys.argv[1])).savefig(sys.argv[2], metadata={"Software": None}, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
