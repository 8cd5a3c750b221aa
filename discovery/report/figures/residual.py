"""What the models leave of a recording: in time, its spectrum, its correlations; and the Bode plot beside theirs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.report.figures.motion import channel_name, main_period
from discovery.report.numbers import fixed, scale_for, unit_text
from discovery.report.results import Run, Trajectory
from discovery.report.style import BLUE, GREY, LINES, MARK, RED, Picture, decimate, label, new_figure, plain_log

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_residual(run: Run) -> Picture | None:
    """Return the residual of the first held-out recording (the first one otherwise), every channel before and after."""
    shown = run.judged
    if shown is None:
        return None
    count = len(shown.channels)
    figure = new_figure(2 * 1.15 * count + 0.8)
    axes = np.atleast_1d(figure.subplots(2 * count, 1, sharex=True))
    for c, (channel, unit) in enumerate(zip(shown.channels, shown.units, strict=True)):
        for i, (model, colour) in enumerate((("before", RED), ("after", BLUE))):
            left = shown.models[model][:, c] - shown.measured[:, c]
            scale = scale_for(unit, float(np.nanmax(np.abs(left))))
            axis = axes[2 * c + i]
            axis.plot(*decimate(shown.time, left * scale.factor), color=colour, linewidth=0.6)
            axis.set_title(f"{channel_name(run, channel)}, {LINES[model]['label']}", fontsize=8.5, color=GREY)
            axis.set_ylabel(label("", scale.symbol).strip())
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    caption = f"Model minus measurement on {shown.name}, before and after; the vertical scales differ."
    alt = f"Residual against time of {shown.name}, every channel before and after the loop."
    return Picture("residual", figure, caption, alt, raster=True)


def draw_spectrum(run: Run) -> Picture | None:
    """Return the spectrum of the normalised residual on the first training recording."""
    residual = run.loop.get("residual", {})
    if not all(residual.get(m, {}).get("frequency") for m in ("before", "after")):
        return None
    figure = new_figure(3.0)
    axes = figure.subplots()
    for model in ("before", "after"):
        frequency, density = (np.array(residual[model][k], dtype=float) for k in ("frequency", "spectrum"))
        axes.loglog(frequency[1:], density[1:], **LINES[model])
    # The spectrum reaches half the sampling rate; white noise of unit variance has this one-sided density.
    axes.axhline(1.0 / frequency[-1], **MARK, label="noise alone")
    axes.set(xlabel="frequency [Hz]", ylabel="residual density [noise sds² / Hz]")
    figure.legend(loc="outside upper left", ncols=2)
    name = next(r["name"] for r in run.results["recordings"] if r["role"] == "train")
    caption = (
        f"Spectrum of the residual on {name}, in units of the noise. On the dashed line the residual is white noise."
    )
    alt = "Power spectral density of the residual before and after, with the level of the noise alone."
    return Picture("spectrum", figure, caption, alt)


#: Periods of the motion and samples that the lags span at least; the part of the recording that they may not exceed.
_PERIODS, _FEWEST, _PART = 2.0, 60, 4
#: Standard normal quantile of a two-sided 99 % band (Ljung, System Identification, 2nd ed., section 16.6).
_BAND = 2.576


def correlation(a: FloatArray, b: FloatArray, most: int) -> FloatArray:
    """Return the correlation (most + 1,) of a (n,) with b up to `most` samples earlier; gaps count as the mean."""
    x, y = (np.nan_to_num(v - np.nanmean(v)) for v in (a, b))
    size = np.sqrt(np.sum(x**2) * np.sum(y**2))
    if not size:
        return np.zeros(most + 1)
    return np.array([np.sum(x[lag:] * y[: y.size - lag]) for lag in range(most + 1)]) / size


def fit_per_cent(measured: FloatArray, left: FloatArray) -> float:
    """Return the fit [%]: 100 where nothing is left, 0 where the mean of the measurement would do as well."""
    both = np.isfinite(measured) & np.isfinite(left)
    spread = np.linalg.norm(measured[both] - measured[both].mean())
    return float(100 * (1 - np.linalg.norm(left[both]) / spread)) if spread else float("nan")


def draw_correlogram(run: Run) -> Picture | None:
    """Return both correlations of the first held-out recording, of the first one otherwise, on its first channel."""
    shown = run.judged
    if shown is None or not np.isfinite(shown.measured[:, 0]).any():
        return None
    left = {m: shown.models[m][:, 0] - shown.measured[:, 0] for m in ("before", "after")}
    left = {m: values for m, values in left.items() if np.isfinite(values).any()}
    if not left:
        return None
    driven = shown.input is not None and float(np.nanstd(shown.input)) > 0
    figure = new_figure(4.2 if driven else 2.5)
    axes = np.atleast_1d(figure.subplots(1 + driven, 1, sharex=True))
    _panel(axes[0], shown, {m: (values, values) for m, values in left.items()}, "with itself")
    if shown.input is not None and driven:
        _panel(axes[1], shown, {m: (values, shown.input) for m, values in left.items()}, f"with the {run.input_name}")
    axes[-1].set_xlabel("lag [s]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    fits = " → ".join(f"{fixed(fit_per_cent(shown.measured[:, 0], values), 2)} %" for values in left.values())
    also = ", and its correlation with earlier input" if driven else ""
    caption = (
        f"Autocorrelation of the residual on {shown.name}{also}; in the grey band, 99 % of a white residual that does "
        f"not depend on the input. Fit, before → after: {fits}."
    )
    alt = f"Correlation of the residual of {shown.name} against the lag, before and after. Fit: {fits}."
    return Picture("correlogram", figure, caption, alt)


def _panel(axes: Axes, shown: Trajectory, pairs: dict[str, tuple[FloatArray, FloatArray]], what: str) -> None:
    """Draw one kind of correlation against the lag."""
    step = median_step(shown.time)
    reference = shown.measured[:, 0] if shown.deflection is None else shown.deflection
    most = int(min(max(_FEWEST, _PERIODS * main_period(shown.time, reference) / step), shown.time.size // _PART))
    lags = step * np.arange(most + 1)
    wide = _BAND / np.sqrt(np.isfinite(shown.measured[:, 0]).sum())
    axes.axhspan(-wide, wide, color=GREY, alpha=0.25, linewidth=0)
    for model, (a, b) in pairs.items():
        axes.plot(lags, correlation(a, b, most), **LINES[model])
    axes.set(ylabel=f"correlation\n{what}", xlim=(0, lags[-1]))


#: Segments that a recording is cut into, overlapping by half, and their fewest samples.
_SEGMENTS, _SAMPLES = 6, 128
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
    long = max(_SAMPLES, 2 * time.size // (_SEGMENTS + 1))
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
    return next((t for t in driven if np.isfinite(t.measured[:, 0]).any() and t.time.size > _SAMPLES), None)


def draw_bode(run: Run) -> Picture | None:
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
    below.set(ylabel=label("phase", "deg"), xlabel="frequency [Hz]")
    plain_log(below.xaxis)
    figure.align_ylabels()
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    caption = (
        f"Bode plot from the {run.input_name} to the {run.output_name} on {shown.name}: where the {run.input_name} has "
        "power and the output follows it. Models are treated as the measurement is."
    )
    alt = "Two panels against frequency: gain and phase, measured points and a line for each model."
    return Picture("bode", figure, caption, alt)
