"""Bode plot: gain and phase from the recorded input to the output, measured and by each model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from discovery.foundation.arrays import FloatArray
from discovery.report.numbers import unit_text
from discovery.report.results import Run, Trajectory
from discovery.report.style import LINES, Picture, label, new_figure, plain_log

#: Segments that a recording is cut into, overlapping by half, and their fewest samples.
_SEGMENTS, _FEWEST = 6, 128
#: Part of the strongest line of the input below which it moves too little to tell a response, in power.
_WEAK = 1e-4
#: Least coherence of input and output, of one that noise does not disturb.
_COHERENT = 0.5
#: Frequencies that are drawn at least.
_LINES = 8


def response(time: FloatArray, given: FloatArray, read: FloatArray) -> tuple[FloatArray, NDArray[np.complex128]]:
    """Return frequencies [Hz] and the response at them, by Welch's averaged cross-spectra (the H1 estimate).

    Of instants [s], input and output (n,), gaps are bridged and uneven steps made even by straight lines. Only
    frequencies at which the input has power are returned; the response is NaN where the output does not follow it.
    """
    from scipy.signal import csd, welch

    even = np.linspace(time[0], time[-1], time.size)
    good = np.isfinite(read)
    x, y = np.interp(even, time, given), np.interp(even, time[good], read[good])
    long = max(_FEWEST, 2 * time.size // (_SEGMENTS + 1))
    how = {"fs": (time.size - 1) / (time[-1] - time[0]), "nperseg": min(long, time.size), "detrend": "linear"}
    frequency, across = csd(x, y, **how)
    of_input, of_output = welch(x, **how)[1], welch(y, **how)[1]
    strong = (of_input > _WEAK * of_input.max(initial=0.0)) & (frequency > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.abs(across) ** 2 / (of_input * of_output)
        found = np.where(coherence > _COHERENT, across / of_input, np.nan)
    return frequency[strong], found[strong]


def _shown(run: Run) -> Trajectory | None:
    """Return the first recording with an input that moves, the held-out ones first."""
    driven = (t for t in (*run.held_out, *run.trajectories) if t.input is not None and np.nanstd(t.input) > 0.0)
    return next((t for t in driven if np.isfinite(t.measured[:, 0]).any() and t.time.size > _FEWEST), None)


def draw(run: Run) -> Picture | None:
    """Return gain and phase of one recording; None where nothing drives the system, or too few lines are seen."""
    shown = None if run.system.has_rod or not run.reads_coordinate else _shown(run)
    if shown is None or shown.input is None:
        return None
    read = {"measured": shown.measured[:, 0], **{m: shown.models[m][:, 0] for m in shown.models}}
    found = {
        name: response(shown.time, shown.input, values) for name, values in read.items() if np.isfinite(values).any()
    }
    if np.isfinite(found["measured"][1]).sum() < _LINES:
        return None
    figure = new_figure(4.2)
    above, below = figure.subplots(2, 1, sharex=True)
    for name, (frequency, ratio) in found.items():
        good = np.isfinite(ratio)
        look = {**LINES[name], "markersize": 4} if name == "measured" else LINES[name]
        above.loglog(frequency[good], np.abs(ratio[good]), **look)
        below.semilogx(frequency[good], np.degrees(np.unwrap(np.angle(ratio[good]))), **look)
    gain = f"{unit_text(shown.units[0], run.coordinate_unit)}/{unit_text(run.input_unit)}" if run.input_unit else ""
    above.set_ylabel(label("gain", gain))
    below.set_ylabel(label("phase", "deg"))
    below.set_xlabel("frequency [Hz]")
    plain_log(below.xaxis)
    figure.align_ylabels()
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return Picture(
        "bode",
        figure,
        f"Bode plot from the {run.input_name} to the {run.output_name} on {shown.name}: where the {run.input_name} has "
        "power and the output follows it. Models are treated as the measurement is.",
        "Two panels against frequency: gain and phase, measured points and a line for each model.",
    )
